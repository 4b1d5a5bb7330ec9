"""Where on a table something stands: distances to its border and its centre (Figure 4.8)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fluentboard.model.geometry import FloatArray

_TINY = 1e-12


def border_distance(boundary: FloatArray, points: FloatArray) -> FloatArray:
    """`(n,)`; metres from each point `(n, 2)` to the border, negative beyond the table.

    Args:
        boundary: `(k, 2)`; corners of the outline in order, not closed, not necessarily convex.
        points: `(n, 2)`; in the same frame.
    """
    foot = _nearest_on_border(boundary, points)
    distance = np.linalg.norm(points - foot, axis=1)
    return np.where(inside(boundary, points), distance, -distance)


def inward_direction(boundary: FloatArray, points: FloatArray) -> FloatArray:
    """`(n, 2)`; unit vectors from the nearest piece of the border to each point, into the table."""
    offset = points - _nearest_on_border(boundary, points)
    offset = np.where(inside(boundary, points)[:, None], offset, -offset)
    length = np.linalg.norm(offset, axis=1, keepdims=True)
    return np.where(length > _TINY, offset / np.maximum(length, _TINY), 0.0)


def inside(boundary: FloatArray, points: FloatArray) -> NDArray[np.bool_]:
    """`(n,)`; which of the points `(n, 2)` lie within the outline (rays crossed to the right)."""
    start, end = boundary, np.roll(boundary, -1, axis=0)
    x, y = points[:, 0, None], points[:, 1, None]
    spans = (start[:, 1] > y) != (end[:, 1] > y)
    rise = end[:, 1] - start[:, 1]
    safe = np.where(np.abs(rise) > _TINY, rise, 1.0)
    crossing = start[:, 0] + (y - start[:, 1]) / safe * (end[:, 0] - start[:, 0])
    return np.asarray(np.count_nonzero(spans & (x < crossing), axis=1) % 2 == 1)


def angle_about(centre: FloatArray, first: FloatArray, second: FloatArray) -> FloatArray:
    """`(n,)`; signed angle in radians from first to second `(n, 2)` seen from the centre `(n, 2)`.

    Counter-clockwise is positive; 0 where one of the points is the centre.
    """
    a, b = first - centre, second - centre
    return np.arctan2(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0], np.sum(a * b, axis=1))


def _nearest_on_border(boundary: FloatArray, points: FloatArray) -> FloatArray:
    start = boundary
    along = np.roll(boundary, -1, axis=0) - start
    length2 = np.maximum(np.sum(along**2, axis=1), _TINY)
    share = np.sum((points[:, None] - start) * along, axis=2) / length2
    feet = start + np.clip(share, 0.0, 1.0)[..., None] * along
    nearest = np.argmin(np.sum((points[:, None] - feet) ** 2, axis=2), axis=1)
    return feet[np.arange(len(points)), nearest]
