"""Sizes and heights of point sets (compiled): what segmentation asks of every part of a frame."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fluentboard.model.geometry import FloatArray


@njit(cache=True)
def quantile(ordered: FloatArray, share: float) -> float:
    """The value below which a share of the sorted values `(n,)` lies, linearly interpolated."""
    place = share * (ordered.shape[0] - 1)
    below = int(np.floor(place))
    above = min(below + 1, ordered.shape[0] - 1)
    return ordered[below] + (place - below) * (ordered[above] - ordered[below])


@njit(cache=True)
def heights_above(points: FloatArray, centre: FloatArray, coefficients: FloatArray) -> FloatArray:
    """`(n,)`; second-order heights at points `(n, k)`, of which x and y count.

    Args:
        points: `(n, k)`, k at least 2.
        centre: `(2,)`; origin of the coefficients.
        coefficients: `(6,)`; of 1, x, y, x^2, x y, y^2.
    """
    heights = np.zeros(points.shape[0])
    for i in range(points.shape[0]):
        x, y = points[i, 0] - centre[0], points[i, 1] - centre[1]
        heights[i] = (
            coefficients[0]
            + x * (coefficients[1] + coefficients[3] * x + coefficients[4] * y)
            + y * (coefficients[2] + coefficients[5] * y)
        )
    return heights


@njit(cache=True)
def covered_cells(
    points: FloatArray, cell: float, first_x: int, first_y: int, inside: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """`(n,)`; which points `(n, k)` lie in the cells `(nx, ny)` that are inside."""
    covered = np.zeros(points.shape[0], dtype=np.bool_)
    for i in range(points.shape[0]):
        u = int(np.floor(points[i, 0] / cell)) - first_x
        v = int(np.floor(points[i, 1] / cell)) - first_y
        if 0 <= u < inside.shape[0] and 0 <= v < inside.shape[1]:
            covered[i] = inside[u, v]
    return covered


@njit(cache=True)
def _lower_end(values, trim):
    """The value `(n,)` below which the share `trim` lies, as `quantile` of the sorted values."""
    place = trim * (values.shape[0] - 1)
    below = int(np.floor(place))
    kept = min(below + 2, values.shape[0])
    # A short sorted list of the least values: sorting all of them would take ten times as long.
    least = np.full(kept, np.inf)
    for value in values:
        if value >= least[kept - 1]:
            continue
        k = kept - 1
        while k > 0 and least[k - 1] > value:
            least[k] = least[k - 1]
            k -= 1
        least[k] = value
    above = min(below + 1, kept - 1)
    return least[below] + (place - below) * (least[above] - least[below])


@njit(cache=True)
def _spread(flat, step, cos, sin, trim):
    """Trimmed extents along and across a direction, of every `step`-th point."""
    count = (flat.shape[0] + step - 1) // step
    along, across = np.zeros(count), np.zeros(count)
    for k in range(count):
        x, y = flat[k * step, 0], flat[k * step, 1]
        along[k] = x * cos + y * sin
        across[k] = y * cos - x * sin
    return (
        _lower_end(along, trim),
        -_lower_end(-along, trim),
        _lower_end(across, trim),
        -_lower_end(-across, trim),
    )


@njit(cache=True)
def turned_extent(
    flat: FloatArray, trim: float, samples: int
) -> tuple[float, float, float, float, float]:
    """The turn at which the trimmed extents of points span the least area, and the extents.

    Args:
        flat: `(n, 2)`; x and y about their middle.
        trim: share of the points beyond the extent at each of its ends.
        samples: so many points at least decide about the turn.

    Returns:
        Angle in radians, then the lower and the upper end along and across; the long side is along.
    """
    step = max(1, flat.shape[0] // samples)
    best, least, is_long = 0.0, np.inf, True
    for k in range(18):
        angle = np.radians(5.0 * k)
        a, b, c, d = _spread(flat, step, np.cos(angle), np.sin(angle), trim)
        area = (b - a) * (d - c)
        if area < least:
            best, least, is_long = angle, area, b - a >= d - c
    if not is_long:
        best += 0.5 * np.pi
    a, b, c, d = _spread(flat, 1, np.cos(best), np.sin(best), trim)
    return best, a, b, c, d


@njit(cache=True)
def largest_of(labels: NDArray[np.int32], values: FloatArray, count: int) -> FloatArray:
    """`(count,)`; the largest value `(h, w)` of each label `(h, w)` below `count`."""
    largest = np.zeros(count)
    for v in range(labels.shape[0]):
        for u in range(labels.shape[1]):
            label = labels[v, u]
            largest[label] = max(largest[label], values[v, u])
    return largest
