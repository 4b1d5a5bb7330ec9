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


@nb.njit(cache=True, nogil=True)
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
    # Of the agreeing pixels: first and last row and column; least and greatest depth. And of all
    # pixels, the least.
    around, depths = np.zeros(4, dtype=np.int64), np.zeros(3)
    around[0], around[1], around[2], around[3] = h, -1, w, -1
    depths[0], depths[1], depths[2] = np.inf, 0.0, np.inf
    for row in range(h):
        v = top + row * step
        for column in range(w):
            z = expected[row, column]
            if not np.isfinite(z):
                continue
            depths[2] = min(depths[2], z)
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
                around[0], around[1] = min(around[0], row), max(around[1], row)
                around[2], around[3] = min(around[2], column), max(around[3], column)
                depths[0], depths[1] = min(depths[0], z), max(depths[1], z)
                areas[EXPLAINED] += area
                areas[CLOSE] += area * (1.0 - (misfit / tolerance) ** 2)
            elif depth <= 0.0:
                areas[UNKNOWN] += area
            elif depth < z:
                areas[OCCLUDED] += area
            else:
                areas[VIOLATED] += area
    if around[1] >= 0:
        areas[OVERRUN] = _overrun(
            expected, triangle, corners, measured, sigma, agrees, around, depths, camera, window,
            step, T_model_sensor, tolerance_m, tolerance_sigma, reach_m, floor_clear_m,
        )  # fmt: skip
    for k in range(voids.shape[0]):
        _add_void(areas, voids[k], measured, camera, window, step, h, w, T_model_sensor)
    for i in range(8):
        areas[i] *= step * step / (fx * fy)
    return areas


@nb.njit(cache=True, nogil=True)
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
    for column in range(w):
        last[column] = -1
    for row in range(h - 1, -1, -1):
        for column in range(w):
            if expected[row, column] < np.inf:
                last[column] = row
            before, after = nearest[row, column], last[column]
            if after >= 0 and (before < 0 or after - row < row - before):
                nearest[row, column] = after
    return nearest


@nb.njit(cache=True, nogil=True)
def _overrun(
    expected: Floats,
    triangle: Indices,
    corners: FloatArray,
    measured: Floats,
    sigma: Floats,
    agrees: NDArray[np.bool_],
    around: NDArray[np.int64],
    depths: FloatArray,
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
    reach = int(np.ceil(reach_m * max(fx, fy) / (max(depths[2], 0.1) * step))) + 1
    nearest_rows = _nearest_rows(expected)
    total = 0.0
    # Only what is so near to an agreeing pixel can go on from there.
    for row in range(max(around[0] - reach, 0), min(around[1] + reach + 1, h)):
        v = top + row * step
        y = (v - cy) / fy
        for column in range(max(around[2] - reach, 0), min(around[3] + reach + 1, w)):
            if expected[row, column] < np.inf:
                continue
            u = left + column * step
            depth = measured[v, u]
            if depth <= 0.0 or depth < depths[0] - reach_m or depth > depths[1] + reach_m:
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


@nb.njit(cache=True, nogil=True)
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
    top, bottom, left, right = _void_window(void, camera, window, step, h, w, T_model_sensor)
    for row in range(top, bottom):
        v = window[0] + row * step
        y = (v - cy) / fy
        for column in range(left, right):
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


@nb.njit(cache=True, nogil=True)
def _void_window(
    void: FloatArray,
    camera: FloatArray,
    window: NDArray[np.int64],
    step: int,
    h: int,
    w: int,
    T_model_sensor: FloatArray,
) -> tuple[int, int, int, int]:
    """First row, row behind the last, first column, column behind the last that may show a box."""
    T = T_model_sensor
    u_low = v_low = np.inf
    u_high = v_high = -np.inf
    for k in range(8):
        x = void[k & 1, 0] - T[0, 3]
        y = void[(k >> 1) & 1, 1] - T[1, 3]
        z = void[k >> 2, 2] - T[2, 3]
        depth = T[0, 2] * x + T[1, 2] * y + T[2, 2] * z
        if depth < 0.01:  # it reaches behind the sensor and has no bounds
            return 0, h, 0, w
        u = (T[0, 0] * x + T[1, 0] * y + T[2, 0] * z) / depth * camera[0] + camera[2]
        v = (T[0, 1] * x + T[1, 1] * y + T[2, 1] * z) / depth * camera[1] + camera[3]
        u_low, u_high = min(u_low, u), max(u_high, u)
        v_low, v_high = min(v_low, v), max(v_high, v)
    top = max(int(np.floor((v_low - window[0]) / step)), 0)
    left = max(int(np.floor((u_low - window[2]) / step)), 0)
    bottom = min(int(np.ceil((v_high - window[0]) / step)) + 1, h)
    right = min(int(np.ceil((u_high - window[2]) / step)) + 1, w)
    return top, bottom, left, right


@nb.njit(cache=True, nogil=True)
def explained_pixels(
    expected: Floats,
    measured: Floats,
    sigma: Floats,
    camera: FloatArray,
    window: NDArray[np.int64],
    T_model_sensor: FloatArray,
    box: FloatArray,
    is_filled: bool,
    tolerance_m: float,
    tolerance_sigma: float,
) -> NDArray[np.bool_]:
    """`(h, w)`; which measurements a drawn model accounts for.

    Args:
        expected: `(h, w)`; depth of the model from `draw` with step 1.
        measured: the whole depth image, 0 where unknown.
        sigma: standard deviation of each of its pixels.
        camera: as for `draw`.
        window: as for `draw`.
        T_model_sensor: `(4, 4)`; takes points of the sensor's frame to the model's.
        box: `(2, 3)`; lowest and highest corner, model frame.
        is_filled: whether all that is measured in the box is accounted for as well.
        tolerance_m: as deep as the model, at the pixel or at one beside it, to within this.
        tolerance_sigma: and so many standard deviations.
    """
    h, w = expected.shape
    fx, fy, cx, cy = camera[0], camera[1], camera[2], camera[3]
    T = T_model_sensor
    mask = np.zeros((h, w), dtype=np.bool_)
    for row in range(h):
        y = (window[0] + row - cy) / fy
        for column in range(w):
            depth = measured[window[0] + row, window[2] + column]
            if depth <= 0.0:
                continue
            tolerance = max(
                tolerance_m, tolerance_sigma * sigma[window[0] + row, window[2] + column]
            )
            is_near = abs(depth - expected[row, column]) <= tolerance
            is_near |= row > 0 and abs(depth - expected[row - 1, column]) <= tolerance
            is_near |= row < h - 1 and abs(depth - expected[row + 1, column]) <= tolerance
            is_near |= column > 0 and abs(depth - expected[row, column - 1]) <= tolerance
            is_near |= column < w - 1 and abs(depth - expected[row, column + 1]) <= tolerance
            if is_filled and not is_near:
                x = (window[2] + column - cx) / fx
                is_near = True
                for i in range(3):
                    at = depth * (T[i, 0] * x + T[i, 1] * y + T[i, 2]) + T[i, 3]
                    is_near &= box[0, i] <= at and at <= box[1, i]
            mask[row, column] = is_near
    return mask
