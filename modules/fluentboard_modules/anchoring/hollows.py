"""The middle of a plate: too low to tell from the top pixel by pixel, yet not the top.

A plate rises a few millimetres in its middle and two centimetres at its rim. From afar only pieces
of the rim stand out of the noise, and each would be an object. The mean over many pixels tells the
middle from the top, so that the pieces around it can be joined.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from fluentboard.model.geometry import FloatArray
from fluentboard_modules.anchoring.config import SegmentationConfig
from fluentboard_modules.anchoring.extents import quantile
from fluentboard_modules.anchoring.organised import OrganisedPoints
from fluentboard_modules.anchoring.pixel_parts import windows

_MEAN_PX = 11  # side of the square over which heights are averaged
_OPEN_PX = 5  # narrower strips are the feet of objects
_CONTACT_PX = 3
_CONTACT_SHARE = 0.06  # of the outline of a hollow that a piece of the rim takes up
_PIXELS_MIN = 60
_TOP = 1  # kind of pixels, as `rises` gives it


def joined_around_hollows(
    parts: NDArray[np.int32],
    count: int,
    kind: NDArray[np.uint8],
    rise: NDArray[np.float32],
    points: OrganisedPoints,
    config: SegmentationConfig,
) -> NDArray[np.int32]:
    """The labels with flat parts made one that lie around one hollow.

    Args:
        parts: `(h, w)` int32; numbers from 1, 0 for nothing.
        count: the highest number.
        kind: `(h, w)`; as `rises` gives it.
        rise: `(h, w)` float32; height of each pixel above the top, NaN where unknown.
        points: of the frame.
        config: how high a hollow is, and how large what surrounds it.
    """
    if count < 2 or config.hollow_m <= 0.0:
        return parts
    found = windows(parts, count)
    flat = [
        int(number)
        for number in np.flatnonzero(found[:, 0] >= _PIXELS_MIN // 4)
        if _height_m(number, found, parts, rise) < config.hollow_rim_m
    ]
    if len(flat) < 2:
        return parts
    # Hollows lie between flat parts, so the window around all of these is enough.
    rows = slice(int(found[flat, 1].min()), int(found[flat, 2].max()) + 1)
    columns = slice(int(found[flat, 3].min()), int(found[flat, 4].max()) + 1)
    on_top = (kind[rows, columns] == _TOP).astype(np.float32)
    heights = np.where(on_top > 0.0, np.nan_to_num(rise[rows, columns]), 0.0).astype(np.float32)
    size = (_MEAN_PX, _MEAN_PX)
    total = cv2.boxFilter(heights, -1, size, normalize=False)
    counted = cv2.boxFilter(on_top, -1, size, normalize=False)
    weak = (on_top > 0.0) & (total > config.hollow_m * np.maximum(counted, 1.0))
    opened = cv2.morphologyEx(
        weak.astype(np.uint8), cv2.MORPH_OPEN, np.ones((_OPEN_PX, _OPEN_PX), np.uint8)
    )
    hollows, labels, stats, _ = cv2.connectedComponentsWithStats(opened, connectivity=4)
    target = np.arange(count + 1, dtype=np.int32)
    here = parts[rows, columns]
    cloud = points.points_map[rows, columns]
    for number in range(1, hollows):
        if stats[number, cv2.CC_STAT_AREA] < _PIXELS_MIN:
            continue
        window = _around(stats[number], labels.shape)
        inside = labels[window] == number
        pieces = _pieces(inside, here[window])
        if len(pieces) < 2 or not set(pieces) <= set(flat):
            continue
        whole = inside | np.isin(here[window], pieces)
        if max(_extent_m(parts, found, pieces, points)) > config.hollow_width_max_m:
            continue
        if max(np.ptp(cloud[window][inside][:, :2], axis=0)) > config.hollow_width_max_m:
            continue
        ring = _ring(whole) & (on_top[window] > 0.0) & ~weak[window]
        level = float(np.median(heights[window][ring])) if ring.any() else 0.0
        if float(np.median(heights[window][inside])) - level < config.hollow_m:
            continue
        roots = {_root(target, piece) for piece in pieces}
        for root in roots:
            target[root] = min(roots)
    for number in range(1, count + 1):
        target[number] = _root(target, number)
    return target[parts]


def _around(stats: NDArray[np.int32], shape: tuple[int, ...]) -> tuple[slice, slice]:
    """The window of a component with a margin."""
    left, top, width, height = (int(value) for value in stats[:4])
    margin = 6 * _CONTACT_PX
    return (
        slice(max(0, top - margin), min(shape[0], top + height + margin)),
        slice(max(0, left - margin), min(shape[1], left + width + margin)),
    )


def _pieces(inside: NDArray[np.bool_], parts: NDArray[np.int32]) -> list[int]:
    """The parts that take up a noticeable share of a hollow's outline."""
    ring = _ring(inside, _CONTACT_PX)
    numbers, counts = np.unique(parts[ring], return_counts=True)
    least = _CONTACT_SHARE * float(ring.sum())
    return [int(n) for n, c in zip(numbers, counts, strict=True) if n > 0 and c >= least]


def _ring(mask: NDArray[np.bool_], reach_px: int = 2 * _CONTACT_PX) -> NDArray[np.bool_]:
    size = 2 * reach_px + 1
    grown = cv2.dilate(mask.astype(np.uint8), np.ones((size, size), np.uint8))
    return (grown > 0) & ~mask


def _height_m(
    number: int,
    found: NDArray[np.int64],
    parts: NDArray[np.int32],
    rise: NDArray[np.float32],
) -> float:
    """How high a part rises, without flying pixels."""
    _, first, last, left, right = found[number].tolist()
    window = (slice(first, last + 1), slice(left, right + 1))
    heights = rise[window][parts[window] == number]
    return float(quantile(np.sort(heights[:: max(1, len(heights) // 400)]), 0.95))


def _extent_m(
    parts: NDArray[np.int32], found: NDArray[np.int64], pieces: list[int], points: OrganisedPoints
) -> FloatArray:
    """`(2,)`; how far the pieces together reach in x and y."""
    clouds: list[FloatArray] = []
    for piece in pieces:
        _, first, last, left, right = found[piece].tolist()
        window = (slice(first, last + 1), slice(left, right + 1))
        clouds.append(points.points_map[window][parts[window] == piece][:, :2].astype(np.float64))
    return np.ptp(np.concatenate(clouds), axis=0)


def _root(target: NDArray[np.int32], number: int) -> int:
    while target[number] != number:
        number = int(target[number])
    return number
