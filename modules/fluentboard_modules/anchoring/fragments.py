"""Parts of the image that belong to one object, and fragments torn off from them."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from fluentboard.model.geometry import FloatArray
from fluentboard_modules.anchoring.config import SegmentationConfig
from fluentboard_modules.anchoring.organised import OrganisedPoints
from fluentboard_modules.anchoring.pixel_parts import nearest_distance, windows

_MARGIN_PX, _NEIGHBOUR_PX, _FRAGMENT_PX = 4, 12, 12
_LIP_LEVEL_M = 0.015
_LIP_BORDER_SHARE = 0.3


@dataclass(frozen=True, slots=True, eq=False)
class PartMask:
    """A part within the window of the image that holds it, with a margin."""

    inside: NDArray[np.bool_]
    rows: slice
    columns: slice

    @classmethod
    def of(cls, parts: NDArray[np.int32], number: int, found: NDArray[np.int64]) -> PartMask:
        """The part of a number, whose window is known."""
        _, first, last, left, right = found.tolist()
        rows = slice(max(0, first - _MARGIN_PX), last + 1 + _MARGIN_PX)
        columns = slice(max(0, left - _MARGIN_PX), right + 1 + _MARGIN_PX)
        return cls(parts[rows, columns] == number, rows, columns)

    @property
    def pixels(self) -> NDArray[np.int64]:
        """`(n, 2)`; rows and columns in the whole image."""
        return np.argwhere(self.inside) + np.array([self.rows.start, self.columns.start])

    def ring(self, reach_px: int) -> NDArray[np.bool_]:
        """The pixels of the window that surround the part."""
        size = 2 * reach_px + 1
        grown = cv2.dilate(self.inside.astype(np.uint8), np.ones((size, size), np.uint8))
        return (grown > 0) & ~self.inside

    def top_height(self, points: OrganisedPoints) -> float:
        """Height of its highest points in the map, without flying pixels."""
        heights = points.points_map[self.rows, self.columns, 2][self.inside]
        return float(np.percentile(heights, 97))


def rejoined(
    parts: NDArray[np.int32], count: int, points: OrganisedPoints, config: SegmentationConfig
) -> NDArray[np.int32]:
    """The labels with fragments made one with the larger part that they were torn off.

    A fragment is a small part that nearly touches a larger one, or the near lip of a bowl before
    its inside: a step in depth, but both end at the same height and border on each other.

    Args:
        parts: `(h, w)` int32; numbers from 1, 0 for nothing.
        count: the highest number.
        points: of the frame.
        config: how small and how near a fragment is.
    """
    found = windows(parts, count)
    sizes = found[:, 0]
    order = [int(n) for n in np.argsort(-sizes, kind="stable") if sizes[n] >= _FRAGMENT_PX]
    if len(order) < 2:
        return parts
    clouds: dict[int, FloatArray] = {}

    def cloud(number: int) -> FloatArray:
        if number not in clouds:
            mask = PartMask.of(parts, number, found[number])
            window = points.points_map[mask.rows, mask.columns]
            thin = window[mask.inside][:: max(1, int(sizes[number]) // 300)]
            clouds[number] = thin.astype(np.float64)
        return clouds[number]

    target = np.arange(count + 1, dtype=np.int32)
    for small in reversed(order):
        nearest = config.rejoin_m
        for large in order:
            if (
                sizes[small] > config.rejoin_share * sizes[large]
                or sizes[large] < config.points_min
            ):
                break  # sorted by size
            if not _are_neighbours(found[small], found[large]):
                continue
            if _is_lip(small, large, parts, found, points):
                target[small] = large
                break
            a, b = cloud(small), cloud(large)
            gap = np.maximum(a.min(axis=0) - b.max(axis=0), b.min(axis=0) - a.max(axis=0))
            if gap.max() > nearest:
                continue
            distance = float(nearest_distance(a, b, 0.25 * config.rejoin_m))
            if distance < nearest:
                target[small], nearest = large, distance
    for number in reversed(order):
        while target[number] != target[target[number]]:
            target[number] = target[target[number]]
    return target[parts]


def _are_neighbours(a: NDArray[np.int64], b: NDArray[np.int64]) -> bool:
    """Whether two windows are a few pixels apart at most."""
    gap = max(a[1] - b[2], b[1] - a[2], a[3] - b[4], b[3] - a[4])
    return bool(gap < _NEIGHBOUR_PX)


def _is_lip(
    small: int,
    large: int,
    parts: NDArray[np.int32],
    found: NDArray[np.int64],
    points: OrganisedPoints,
) -> bool:
    """Whether the small part is the near side of a vessel into which the large one looks."""
    near, far = (PartMask.of(parts, number, found[number]) for number in (small, large))
    if near.top_height(points) < far.top_height(points) - _LIP_LEVEL_M:
        return False
    if near.top_height(points) > far.top_height(points) + _LIP_LEVEL_M:
        return False
    window = (near.rows, near.columns)
    if np.median(points.depth_m[window][near.inside]) >= np.median(
        points.depth_m[far.rows, far.columns][far.inside]
    ):
        return False
    ring = near.ring(2)
    return float((parts[window] == large)[ring].mean()) > _LIP_BORDER_SHARE
