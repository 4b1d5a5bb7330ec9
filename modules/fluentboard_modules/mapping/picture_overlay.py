"""What mapping believes, drawn over a frame."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Outline
from numpy.typing import NDArray

from fluentboard.model.geometry import BoundingBox, FloatArray, Transform
from fluentboard_modules.frames.sensor_frame import Camera, SensorFrame
from fluentboard_modules.mapping.furniture_item import FurnitureItem
from fluentboard_modules.mapping.picture_style import (
    BACKGROUND,
    INK,
    LABEL_COLOURS,
    PAPER,
    class_colour,
    explaining_planes,
    main_label,
)
from fluentboard_modules.mapping.planar_region import PlanarRegion

_NEAR_M = 0.2  # what is nearer to the camera cannot be projected sensibly
_BOX_EDGES = ((0, 1), (0, 2), (0, 4), (1, 3), (1, 5), (2, 3), (2, 6), (3, 7), (4, 5), (4, 6))
_BOX_EDGES = (*_BOX_EDGES, (5, 7), (6, 7))


def draw_overlay(
    frame: SensorFrame,
    planes: Sequence[PlanarRegion],
    labels: Sequence[frozenset[str]],
    furniture: Sequence[FurnitureItem],
    *,
    title: str = "",
) -> Figure:
    """A frame with the labelled planes and the furniture boxes drawn over it.

    Args:
        frame: the picture below is its colour image, or its depth in shades if it has none.
        planes: of the map, or of this frame alone (then without furniture).
        labels: the classes of each plane; planes without a label of their own are not drawn.
        furniture: pieces to draw as boxes; only the planes that explain them are drawn then.
        title: above the picture.
    """
    picture, camera, T_picture_map = _picture_below(frame)
    height, width = picture.shape[:2]
    figure = Figure(figsize=(width / 100.0, height / 100.0 + 0.3), dpi=150, facecolor=PAPER)
    top = height / (height + 30.0)
    axes = figure.add_axes((0.0, 0.0, 1.0, top))
    axes.imshow(picture, interpolation="bilinear")
    explaining = explaining_planes(furniture)
    for plane, names in zip(planes, labels, strict=True):
        label = main_label(names)
        if label is None or label in BACKGROUND:
            continue
        if furniture and plane.index not in explaining:
            continue
        outline = _projected_outline(plane, T_picture_map, camera)
        if outline is not None:
            colour = LABEL_COLOURS[label]
            axes.add_patch(
                PathPatch(outline, facecolor=to_rgba(colour, 0.4), edgecolor=colour, linewidth=1.3)
            )
    for item in furniture:
        _draw_item_in_picture(axes, item, T_picture_map, camera)
    axes.set_xlim(-0.5, width - 0.5)
    axes.set_ylim(height - 0.5, -0.5)
    axes.axis("off")
    figure.text(0.01, 0.5 * (1.0 + top), title, color=INK, fontsize=9, va="center")
    return figure


def _picture_below(frame: SensorFrame) -> tuple[NDArray[np.uint8], Camera, Transform]:
    """The picture to draw on, its camera, and map to camera coordinates."""
    T_depth_map = frame.T_map_sensor.inverse()
    if frame.colour is not None:
        camera = frame.colour_camera or frame.camera
        T_colour_depth = frame.T_colour_depth or Transform.identity()
        # Towards white, so that the drawing stands out.
        pale = (0.75 * frame.colour + 0.25 * 255.0).astype(np.uint8)
        return pale, camera, T_colour_depth @ T_depth_map
    depth = np.where(frame.valid, frame.depth_m, np.nan)
    near, far = np.nanpercentile(depth, (2, 98)) if frame.valid.any() else (0.0, 1.0)
    shade = np.clip((depth - near) / max(far - near, 1e-6), 0.0, 1.0)
    grey = np.where(frame.valid, 235.0 - 150.0 * np.nan_to_num(shade), 250.0).astype(np.uint8)
    return np.repeat(grey[..., None], 3, axis=2), frame.camera, T_depth_map


def _projected_outline(
    plane: PlanarRegion, T_picture_map: Transform, camera: Camera
) -> Outline | None:
    parts: list[Outline] = []
    for ring in plane.rings_map():
        clipped = _clip_in_front(T_picture_map.apply(ring))
        if len(clipped) >= 3:
            pixels = camera.project(clipped)
            parts.append(Outline(np.concatenate([pixels, pixels[:1]]), closed=True))
    return Outline.make_compound_path(*parts) if parts else None


def _clip_in_front(ring: FloatArray) -> FloatArray:
    """The part of a closed ring in front of the camera (Sutherland-Hodgman, one plane)."""
    kept: list[FloatArray] = []
    for a, b in pairwise(ring):
        if a[2] >= _NEAR_M:
            kept.append(a)
        if (a[2] >= _NEAR_M) != (b[2] >= _NEAR_M):
            kept.append(a + (b - a) * (_NEAR_M - a[2]) / (b[2] - a[2]))
    return np.array(kept).reshape(-1, 3)


def _draw_item_in_picture(
    axes: Axes, item: FurnitureItem, T_picture_map: Transform, camera: Camera
) -> None:
    colour = class_colour(item.class_name)
    corners = T_picture_map.apply(item.box.corners())
    if (corners[:, 2] < _NEAR_M).all():
        return
    for i, j in _BOX_EDGES:
        a, b = corners[i], corners[j]
        if a[2] < _NEAR_M and b[2] < _NEAR_M:
            continue
        if a[2] < _NEAR_M:
            a = a + (b - a) * (_NEAR_M - a[2]) / (b[2] - a[2])
        elif b[2] < _NEAR_M:
            b = b + (a - b) * (_NEAR_M - b[2]) / (a[2] - b[2])
        ends = camera.project(np.stack([a, b]))
        # Odd corners are the upper ones; what leads down is mostly hidden by something.
        is_upper = i % 2 and j % 2
        axes.plot(
            ends[:, 0],
            ends[:, 1],
            color=colour,
            linewidth=1.6 if is_upper else 0.8,
            alpha=0.95 if is_upper else 0.4,
        )
    top = T_picture_map.apply(_top_centre(item.box))
    if top[2] < _NEAR_M:
        return
    u, v = camera.project(top[None])[0]
    if -20 <= u < camera.width + 20 and 0 <= v < camera.height:
        axes.text(
            u,
            v,
            item.identifier,
            color=colour,
            fontsize=9,
            fontweight="bold",
            ha="center",
            va="center",
            clip_on=True,
            path_effects=[patheffects.withStroke(linewidth=2.5, foreground="white")],
        )


def _top_centre(box: BoundingBox) -> FloatArray:
    return box.pose.to_transform().apply(np.array([0.0, 0.0, 0.5 * box.z_size]))
