"""Outlines in depth images, compiled: the inner loop of `evidence`."""

from __future__ import annotations

import numba as nb
import numpy as np
from numpy.typing import NDArray

from fluentboard.model.geometry import FloatArray
from fluentboard_modules.mapping.draw_kernels import Floats, Indices

_STEEP = 0.15  # a surface that a ray meets at less than this sine has no certain continuation
_GOES_ON_M = 0.1  # of depth from one pixel of the model to the next: more is another part of it


@nb.njit(cache=True, nogil=True)
def outline_lengths(
    expected: Floats,
    triangle: Indices,
    corners: FloatArray,
    measured: Floats,
    sigma: Floats,
    camera: FloatArray,
    window: NDArray[np.int64],
    T_map_sensor: FloatArray,
    tolerance_m: float,
    tolerance_sigma: float,
    outline_m: float,
    floor_clear_m: float,
) -> tuple[float, float]:
    """How much of a model's outline is seen to be one.

    Beyond the outline of a thing one sees what is behind it. Where the surface that explains the
    model goes on in the same plane instead, the outline is drawn on something larger. What is
    nearer hides the outline and says nothing.

    Args:
        expected: `(h, w)`; depth of the model from `draw` with step 1.
        triangle: `(h, w)`; its triangles.
        corners: `(n, 3, 3)`; their corners in the sensor's frame.
        measured: the whole depth image, 0 where unknown.
        sigma: standard deviation of each of its pixels.
        camera: `(4,)`; fx, fy, cx, cy.
        window: `(4,)`; first row, row behind the last, first column, column behind the last.
        T_map_sensor: `(4, 4)`; takes points of the sensor's frame to the map.
        tolerance_m: so far off is explained.
        tolerance_sigma: and so many standard deviations.
        outline_m: a surface that goes on so near to the model's plane has no end there.
        floor_clear_m: above the floor; lower, it is the floor that goes on.

    Returns:
        Metres of outline beyond which one sees farther, and over which the surface goes on.
    """
    h, w = expected.shape
    top, left = window[0], window[2]
    fx, fy, cx, cy = camera[0], camera[1], camera[2], camera[3]
    shown = missing = 0.0
    T = T_map_sensor
    for row in range(h):
        v = top + row
        y = (v - cy) / fy
        for column in range(w):
            z = expected[row, column]
            if not z < np.inf:
                continue
            u = left + column
            depth = measured[v, u]
            tolerance = max(tolerance_m, tolerance_sigma * sigma[v, u])
            if depth <= 0.0 or abs(depth - z) > tolerance:
                continue
            x = (u - cx) / fx
            nx = ny = nz = along = 0.0
            for side in range(4):
                dr = 1 if side == 0 else -1 if side == 1 else 0
                dc = 1 if side == 2 else -1 if side == 3 else 0
                r2, c2 = row + 2 * dr, column + 2 * dc
                if r2 < 0 or c2 < 0 or r2 >= h or c2 >= w:
                    continue
                if min(expected[row + dr, column + dc], expected[r2, c2]) < z + _GOES_ON_M:
                    continue
                # Beside a true edge a pixel may still show it: look two pixels beyond.
                beyond = measured[top + r2, left + c2]
                if beyond <= 0.0:
                    continue
                length = z / (fx if dc != 0 else fy)
                x2, y2 = (left + c2 - cx) / fx, (top + r2 - cy) / fy
                height = T[2, 3] + beyond * (T[2, 0] * x2 + T[2, 1] * y2 + T[2, 2])
                if height <= floor_clear_m:
                    shown += length
                    continue
                if nx == 0.0 and ny == 0.0 and nz == 0.0:
                    k = triangle[row, column]
                    ax, ay, az = corners[k, 0, 0], corners[k, 0, 1], corners[k, 0, 2]
                    px, py, pz = corners[k, 1, 0] - ax, corners[k, 1, 1] - ay, corners[k, 1, 2] - az
                    qx, qy, qz = corners[k, 2, 0] - ax, corners[k, 2, 1] - ay, corners[k, 2, 2] - az
                    nx, ny, nz = py * qz - pz * qy, pz * qx - px * qz, px * qy - py * qx
                    along = nx * x + ny * y + nz
                size = np.sqrt((nx * nx + ny * ny + nz * nz) * (x * x + y * y + 1.0))
                onward = nx * x2 + ny * y2 + nz
                if abs(along) < _STEEP * size or abs(onward) < 0.5 * abs(along):
                    continue
                continued = along * z / onward
                near = max(outline_m, tolerance_sigma * sigma[top + r2, left + c2])
                if beyond > continued + near:
                    shown += length
                elif beyond >= continued - near:
                    missing += length
    return shown, missing
