"""The loops over pixels behind the depth noise, compiled by numba; `noise` explains the formulas.

Random numbers are drawn beforehand by numpy's generator, so that a seed decides everything.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

STEEPEST_RAD = math.radians(89.0)

Float32Array = NDArray[np.float32]


@njit(cache=True)
def steepness(incidence_rad: float) -> float:
    """The factor a / (pi/2 - a), cut off below 90 deg where it has its pole."""
    angle = min(incidence_rad, STEEPEST_RAD)
    return angle / (0.5 * math.pi - angle)


@njit(cache=True)
def axial_sigma(depth_m: float, steep: float) -> float:
    """Standard deviation of the depth in metres (Nguyen 2012, Eq. 3)."""
    off = depth_m - 0.4
    return 0.0012 + 0.0019 * off * off + 0.0001 / math.sqrt(max(depth_m, 1e-3)) * steep * steep


@njit(cache=True)
def lateral_sigma(steep: float) -> float:
    """Standard deviation of a pixel's position in pixels at 640 px width (Nguyen 2012, Eq. 2)."""
    return 0.8 + 0.035 * steep


@njit(cache=True)
def incidence_of_hits(triangle: Any, normals: Any, directions: Any, lengths: Any, out: Any) -> None:
    """Angle between the lines of sight and the surfaces they meet, in radians.

    Args:
        triangle: `(n,)` int32; -1 picks the last row of the normals.
        normals: `(m, 3)` float32; unit normals in the camera frame.
        directions: `(n, 3)` float32; of the rays.
        lengths: `(n,)` float32; of the directions.
        out: `(n,)` float32; filled.
    """
    count = normals.shape[0]
    for i in range(triangle.size):
        k = triangle[i]
        if k < 0:
            k += count
        along = (
            normals[k, 0] * directions[i, 0]
            + normals[k, 1] * directions[i, 1]
            + normals[k, 2] * directions[i, 2]
        )
        out[i] = math.acos(min(abs(along) / lengths[i], np.float32(1.0)))


@njit(cache=True)
def shadow_of_projector(depth_m: Any, product: float, out: Any) -> None:
    """Which pixels a projector to the right of the camera cannot reach.

    Args:
        depth_m: `(h, w)`; 0 or infinite where there is no surface.
        product: focal length times baseline, in pixels times metres.
        out: `(h, w)` bool; filled.
    """
    height, width = depth_m.shape
    greatest = 0.0
    for row in range(height):
        for column in range(width):
            z = depth_m[row, column]
            if z > 0.0 and z < math.inf:
                greatest = max(greatest, product / z)
    reach = math.ceil(greatest) + 1
    nearest = np.zeros(width + reach + 2)
    disparity = np.zeros(width)
    for row in range(height):
        nearest[:] = 0.0
        for column in range(width):
            z = depth_m[row, column]
            known = z > 0.0 and z < math.inf
            own = product / z if known else 0.0
            disparity[column] = own
            if known:
                # Both neighbouring columns are drawn, so that a slanted surface has no gaps to
                # shine through.
                left = math.floor(column - own + reach)
                nearest[left] = max(nearest[left], own)
                nearest[left + 1] = max(nearest[left + 1], own)
        for column in range(width):
            own = disparity[column]
            out[row, column] = False
            if own > 0.0:
                left = math.floor(column - own + reach)
                out[row, column] = min(nearest[left], nearest[left + 1]) > own + 2.0


@njit(cache=True)
def measured(
    clean_m: Any,
    incidence_rad: Any,
    sideways: Any,
    axial_draw: Any,
    dropped: Any,
    lateral: float,
    axial: float,
    product: float,
    step: float,
    dropout: float,
    depth_out: Any,
    source_out: Any,
) -> None:
    """Wander of pixels, error of the depth, quantisation and dropouts, in this order.

    Args:
        clean_m: `(h, w)` float32; 0 where nothing can be measured.
        incidence_rad: `(h, w)`; angle between line of sight and normal.
        sideways: `(2, h, w)` float32; standard normal, not used if `lateral` is 0.
        axial_draw: `(h, w)` float32; standard normal, not used if `axial` is 0.
        dropped: `(h, w)` float32; uniform, not used if `dropout` is 0.
        lateral: factor on the sideways deviation, in pixels of this image.
        axial: factor on the deviation of the depth.
        product: focal length times baseline, for the disparity.
        step: of the disparity in pixels; 0 does not quantise.
        dropout: share of pixels lost.
        depth_out: `(h, w)` float32; filled.
        source_out: `(h, w)` int64; filled with the pixel that each pixel shows.
    """
    height, width = clean_m.shape
    for row in range(height):
        for column in range(width):
            from_row, from_column = row, column
            if lateral > 0.0:
                sigma = lateral * lateral_sigma(steepness(incidence_rad[row, column]))
                from_row += int(np.rint(sigma * sideways[0, row, column]))
                from_column += int(np.rint(sigma * sideways[1, row, column]))
                from_row = min(max(from_row, 0), height - 1)
                from_column = min(max(from_column, 0), width - 1)
            source_out[row, column] = from_row * width + from_column
            depth = float(clean_m[from_row, from_column])
            if depth > 0.0 and axial > 0.0:
                steep = steepness(incidence_rad[from_row, from_column])
                depth += axial * axial_sigma(depth, steep) * axial_draw[row, column]
            if depth > 0.0 and step > 0.0:
                steps = max(np.rint(product / (depth * step)), 1.0)
                depth = product / (steps * step)
            if dropout > 0.0 and dropped[row, column] < dropout:
                depth = 0.0
            depth_out[row, column] = max(depth, 0.0)
