"""Anchors over the colour image, in the manner of Figure 4.7."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from fluentboard.model.geometry import FloatArray
from fluentboard_modules.anchoring.anchors import Anchor
from fluentboard_modules.anchoring.supports import Top
from fluentboard_modules.frames.sensor_frame import SensorFrame

_FRAMES_KEPT = 16
_TRACKED, _UNTRACKED, _TOP, _HELD = (60, 190, 60), (70, 110, 235), (240, 200, 40), (200, 80, 200)
_EDGES = tuple((i, j) for i in range(8) for j in range(i) if bin(i ^ j).count("1") == 1)
_NEAREST_M = 0.15


@dataclass(frozen=True, slots=True, eq=False)
class _Moment:
    frame: SensorFrame
    anchors: tuple[Anchor, ...]
    tops: tuple[Top, ...]


class Album:
    """Keeps some frames with their anchors, spread evenly over all that were added."""

    def __init__(self) -> None:
        self._moments: list[_Moment] = []
        self._seen = 0
        self._keep_every = 1

    @property
    def moments(self) -> Sequence[_Moment]:
        """What was kept, in order."""
        return self._moments

    def add(self, frame: SensorFrame, anchors: Sequence[Anchor], tops: Sequence[Top]) -> None:
        """Looks at one more frame."""
        if self._seen % self._keep_every == 0:
            self._moments.append(_Moment(frame, tuple(anchors), tuple(tops)))
        self._seen += 1
        if len(self._moments) > _FRAMES_KEPT:
            self._moments = self._moments[::2]
            self._keep_every *= 2


def draw_album(album: Album, directory: Path) -> list[Path]:
    """One picture per kept frame, and all of them on one sheet.

    Args:
        album: frames with anchors.
        directory: must exist.

    Returns:
        The files.
    """
    files: list[Path] = []
    pictures: list[NDArray[np.uint8]] = []
    for moment in album.moments:
        picture = draw_overlay(moment.frame, moment.anchors, moment.tops)
        file = directory / f"anchors-{moment.frame.index:06d}.png"
        cv2.imwrite(str(file), picture[..., ::-1])
        files.append(file)
        pictures.append(picture)
    if pictures:
        sheet = directory / "anchors.png"
        cv2.imwrite(str(sheet), _sheet(pictures)[..., ::-1])
        files.append(sheet)
    return files


def draw_overlay(
    frame: SensorFrame, anchors: Sequence[Anchor], tops: Sequence[Top]
) -> NDArray[np.uint8]:
    """`(h, w, 3)` uint8 RGB; boxes of anchors (green: tracked, blue: not) and outlines of tops."""
    picture = _background(frame)
    for top in tops:
        outline = top.raster.outline()
        pixels = _project(frame, np.column_stack([outline, top.height_at(outline)]))
        if pixels is not None:
            cv2.polylines(picture, [pixels], True, _TOP, 1, cv2.LINE_AA)
    for anchor in anchors:
        pixels = _project(frame, anchor.box.corners())
        if pixels is None:
            continue
        colour = _HELD if anchor.is_held else _TRACKED if anchor.is_tracked else _UNTRACKED
        for i, j in _EDGES:
            _line(picture, pixels[i], pixels[j], colour, 2 if anchor.is_tracked else 1)
        place = pixels[np.argmin(pixels[:, 1])] - (0, 6)
        _label(picture, anchor.name or str(anchor.identifier), place, colour)
    return picture


def _background(frame: SensorFrame) -> NDArray[np.uint8]:
    if frame.colour is not None:
        return np.ascontiguousarray(frame.colour).copy()
    depth = np.where(frame.valid, frame.depth_m, 0.0)
    grey = np.clip(255.0 * (1.0 - depth / 4.0), 0.0, 255.0).astype(np.uint8)
    return np.repeat(np.where(depth > 0.0, grey, 0).astype(np.uint8)[..., None], 3, axis=2)


def _project(frame: SensorFrame, points_map: FloatArray) -> NDArray[np.int32] | None:
    """Pixels of points in the picture; None if a point is behind the camera or far to the side."""
    points = frame.T_map_sensor.inverse().apply(points_map)
    camera = frame.camera
    if frame.colour is not None:
        camera = frame.colour_camera or camera
        if frame.T_colour_depth is not None:
            points = frame.T_colour_depth.apply(points)
    if points[:, 2].min() < _NEAREST_M:
        return None
    pixels = camera.project(points)
    size = np.array([camera.width, camera.height])
    if np.any(pixels.max(axis=0) < 0.0) or np.any(pixels.min(axis=0) > size):
        return None
    return np.rint(np.clip(pixels, -10 * size, 10 * size)).astype(np.int32)


def _line(
    picture: NDArray[np.uint8],
    start: NDArray[np.int32],
    end: NDArray[np.int32],
    colour: tuple[int, int, int],
    width: int,
) -> None:
    a, b = (tuple(int(value) for value in point) for point in (start, end))
    cv2.line(picture, a, b, colour, width, cv2.LINE_AA)


def _label(
    picture: NDArray[np.uint8], text: str, place: NDArray[np.int32], colour: tuple[int, int, int]
) -> None:
    x, y = (int(value) for value in place)
    font, size = cv2.FONT_HERSHEY_SIMPLEX, 0.7
    (width, height), _ = cv2.getTextSize(text, font, size, 2)
    cv2.rectangle(picture, (x - 2, y - height - 4), (x + width + 2, y + 4), (0, 0, 0), cv2.FILLED)
    cv2.putText(picture, text, (x, y), font, size, colour, 2, cv2.LINE_AA)


def _sheet(pictures: Sequence[NDArray[np.uint8]], columns: int = 4) -> NDArray[np.uint8]:
    """Small copies side by side."""
    small = [cv2.resize(picture, (400, 300), interpolation=cv2.INTER_AREA) for picture in pictures]
    while len(small) % columns:
        small.append(np.zeros_like(small[0]))
    rows = [np.hstack(small[i : i + columns]) for i in range(0, len(small), columns)]
    return np.vstack(rows)
