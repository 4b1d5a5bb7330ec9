"""A model compared with the depth image that it was drawn into: inner loops of `visibility`."""

from __future__ import annotations

import numba as nb
import numpy as np
from numpy.typing import NDArray

from fluentboard.model.geometry import FloatArray
from fluentboard_modules.mapping.draw_kernels import Floats, Indices

_STEEP = 0.15  # a surface that a ray meets at less than this sine has no certain continuation
EXPLAINED, OCCLUDED, VIOLATED, UNKNOWN, OVERRUN, FILLED, EMPTY, CLOSE = range(8)
"""Places of the areas in what `compare` returns."""


@nb.njit(cache=True)
def compare(
    expected: Floats,
    triangle: Indices,
    corners: FloatArray,
    measured: Floats,
    sigma: Floats,
    camera: FloatArray,
    window: NDArray[np.int64],
    step: int,
    T_model_sensor: FloatArray,
    voids: FloatArray,
    tolerance_m: float,
    tolerance_sigma: float,
    beside_m: float,
    reach_m: float,
    floor_clear_m: float,
) -> FloatArray:
    """Areas of a drawn model that a depth image explains, hides, contradicts and so on.

    Args:
        expected: `(h, w)`; depth of the model from `draw`.
        triangle: `(h, w)`; its triangles.
        corners: `(n, 3, 3)`; their corners in the sensor's frame.
        measured: the whole depth image, 0 where unknown.
        sigma: standard deviation of each of its pixels.
        camera: as for `draw`.
        window: as for `draw`.
        step: as for `draw`.
        T_model_sensor: `(4, 4)`; takes points of the sensor's frame to the model's.
        voids: `(m, 2, 3)`; lowest and highest corners, model frame.
        tolerance_m: so far off is explained.
        tolerance_sigma: and so many standard deviations.
        beside_m: what is explained by the pixel beside it counts as so much further off.
        reach_m: a surface that goes on so far beyond the outline does.
        floor_clear_m: above the floor; below, it goes on below everything.

    Returns:
        `(8,)`; square metres across the view, in the order of the constants above.
    """
    h, w = expected.shape
    top, left = window[0], window[2]
    fx, fy = camera[0], camera[1]
    areas = np.zeros(8)
    agrees = np.zeros((h, w), dtype=np.bool_)
    any_agrees = False
    for row in range(h):
        v = top + row * step
        for column in range(w):
            z = expected[row, column]
            if not np.isfinite(z):
                continue
            u = left + column * step
            depth = measured[v, u]
            tolerance = max(tolerance_m, tolerance_sigma * sigma[v, u])
            misfit = np.inf if depth <= 0.0 else abs(depth - z)
            if misfit > beside_m:
                for i in range(4):
                    r = row + (1 if i == 0 else -1 if i == 1 else 0)
                    c = column + (1 if i == 2 else -1 if i == 3 else 0)
                    if r < 0 or c < 0 or r >= h or c >= w:
                        continue
                    beside = measured[top + r * step, left + c * step]
                    if beside > 0.0:
                        misfit = min(misfit, abs(beside - z) + beside_m)
            area = z * z
            if misfit <= tolerance:
                agrees[row, column] = True
                any_agrees = True
                areas[EXPLAINED] += area
                areas[CLOSE] += area * (1.0 - (misfit / tolerance) ** 2)
            elif depth <= 0.0:
                areas[UNKNOWN] += area
            elif depth < z:
                areas[OCCLUDED] += area
            else:
                areas[VIOLATED] += area
    if any_agrees:
        areas[OVERRUN] = _overrun(
            expected, triangle, corners, measured, sigma, agrees, camera, window, step,
            T_model_sensor, tolerance_m, tolerance_sigma, reach_m, floor_clear_m,
        )  # fmt: skip
    for k in range(voids.shape[0]):
        _add_void(areas, voids[k], measured, camera, window, step, h, w, T_model_sensor)
    return areas * (step * step / (fx * fy))


@nb.njit(cache=True)
def _nearest_rows(expected: Floats) -> Indices:
    """`(h, w)`; per pixel the row of the model's nearest pixel in its column, -1 without any."""
    h, w = expected.shape
    nearest = np.full((h, w), -1, dtype=np.int32)
    last = np.full(w, -1, dtype=np.int32)
    for row in range(h):
        for column in range(w):
            if expected[row, column] < np.inf:
                last[column] = row
            nearest[row, column] = last[column]
    last[:] = -1
    for row in range(h - 1, -1, -1):
        for column in range(w):
            if expected[row, column] < np.inf:
                last[column] = row
            before, after = nearest[row, column], last[column]
            if after >= 0 and (before < 0 or after - row < row - before):
                nearest[row, column] = after
    return nearest


@nb.njit(cache=True)
def _overrun(
    expected: Floats,
    triangle: Indices,
    corners: FloatArray,
    measured: Floats,
    sigma: Floats,
    agrees: NDArray[np.bool_],
    camera: FloatArray,
    window: NDArray[np.int64],
    step: int,
    T_model_sensor: FloatArray,
    tolerance_m: float,
    tolerance_sigma: float,
    reach_m: float,
    floor_clear_m: float,
) -> float:
    """Depth squared over the pixels whose surface goes on beyond the model's outline."""
    h, w = expected.shape
    top, left = window[0], window[2]
    fx, fy, cx, cy = camera[0], camera[1], camera[2], camera[3]
    closest = np.inf
    for row in range(h):
        for column in range(w):
            closest = min(closest, expected[row, column])
    reach = int(np.ceil(reach_m * max(fx, fy) / (max(closest, 0.1) * step))) + 1
    nearest_rows = _nearest_rows(expected)
    total = 0.0
    for row in range(h):
        v = top + row * step
        y = (v - cy) / fy
        for column in range(w):
            u = left + column * step
            depth = measured[v, u]
            if depth <= 0.0 or expected[row, column] < np.inf:
                continue
            x = (u - cx) / fx
            height = T_model_sensor[2, 3] + depth * (
                T_model_sensor[2, 0] * x + T_model_sensor[2, 1] * y + T_model_sensor[2, 2]
            )
            if height <= floor_clear_m:
                continue
            r = c = -1
            least = reach * reach + 1
            for across in range(reach + 1):
                if across * across >= least:
                    break
                for side in range(-1, 2, 2):
                    beside = column + side * across
                    if beside < 0 or beside >= w or nearest_rows[row, beside] < 0:
                        continue
                    distance = (nearest_rows[row, beside] - row) ** 2 + across * across
                    if distance < least:
                        least, r, c = distance, nearest_rows[row, beside], beside
            # Neighbouring pixels of a true edge may still show it: start a pixel further out.
            if r < 0 or least <= 1 or not agrees[r, c]:
                continue
            z = expected[r, c]
            foot_x, foot_y = (left + c * step - cx) / fx * z, (top + r * step - cy) / fy * z
            gap = (x * depth - foot_x) ** 2 + (y * depth - foot_y) ** 2 + (depth - z) ** 2
            if gap > reach_m * reach_m:
                continue
            k = triangle[r, c]
            ax, ay, az = corners[k, 0, 0], corners[k, 0, 1], corners[k, 0, 2]
            px, py, pz = corners[k, 1, 0] - ax, corners[k, 1, 1] - ay, corners[k, 1, 2] - az
            qx, qy, qz = corners[k, 2, 0] - ax, corners[k, 2, 1] - ay, corners[k, 2, 2] - az
            nx, ny, nz = py * qz - pz * qy, pz * qx - px * qz, px * qy - py * qx
            length = np.sqrt(nx * nx + ny * ny + nz * nz)
            along = nx * x + ny * y + nz
            if abs(along) < _STEEP * length * np.sqrt(x * x + y * y + 1.0):
                continue
            continued = (nx * foot_x + ny * foot_y + nz * z) / along
            if abs(depth - continued) > max(tolerance_m, tolerance_sigma * sigma[v, u]):
                continue
            total += depth * depth
    return total


@nb.njit(cache=True)
def _add_void(
    areas: FloatArray,
    void: FloatArray,
    measured: Floats,
    camera: FloatArray,
    window: NDArray[np.int64],
    step: int,
    h: int,
    w: int,
    T_model_sensor: FloatArray,
) -> None:
    """Adds where a space that must be empty is filled, and where it was seen through."""
    fx, fy, cx, cy = camera[0], camera[1], camera[2], camera[3]
    for row in range(h):
        v = window[0] + row * step
        y = (v - cy) / fy
        for column in range(w):
            u = window[2] + column * step
            depth = measured[v, u]
            if depth <= 0.0:
                continue
            x = (u - cx) / fx
            enter, leave = -np.inf, np.inf
            for axis in range(3):
                along = (
                    T_model_sensor[axis, 0] * x
                    + T_model_sensor[axis, 1] * y
                    + T_model_sensor[axis, 2]
                )
                if abs(along) < 1e-6:
                    along = 1e-6
                a = (void[0, axis] - T_model_sensor[axis, 3]) / along
                b = (void[1, axis] - T_model_sensor[axis, 3]) / along
                enter, leave = max(enter, min(a, b)), min(leave, max(a, b))
            if enter >= leave or enter <= 0.0:
                continue
            if depth >= leave:
                areas[EMPTY] += leave * leave
            elif depth > enter:
                areas[FILLED] += depth * depth
