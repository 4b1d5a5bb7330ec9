"""A model drawn into a depth image and compared with it, compiled: inner loops of `visibility`."""

from __future__ import annotations

import numba as nb
import numpy as np
from numpy.typing import NDArray

from fluentboard.model.geometry import FloatArray

Floats = NDArray[np.float32]
Indices = NDArray[np.int32]

_NEAREST_M = 0.05  # what is nearer to the sensor than this is behind it
_IN_FRONT_M = 0.3  # a box that reaches nearer has no bounds in the image
_STEEP = 0.15  # a surface that a ray meets at less than this sine has no certain continuation
EXPLAINED, OCCLUDED, VIOLATED, UNKNOWN, OVERRUN, FILLED, EMPTY, CLOSE = range(8)
"""Places of the areas in what `compare` returns."""


@nb.njit(cache=True)
def image_window(
    box_corners: FloatArray,
    T_sensor_model: FloatArray,
    camera: FloatArray,
    height: int,
    width: int,
    reach_m: float,
) -> NDArray[np.int64]:
    """The part of an image that shows a model and a little around it.

    Args:
        box_corners: `(8, 3)`; of the box around the model, in its frame.
        T_sensor_model: `(4, 4)`; takes points of the model's frame to the sensor's.
        camera: `(4,)`; fx, fy, cx, cy in pixels.
        height: of the image.
        width: of the image.
        reach_m: so much around the model is looked at.

    Returns:
        `(4,)`; first row, row behind the last, first column, column behind the last; all 0 if the
        image does not show it.
    """
    T = T_sensor_model
    u_low = v_low = nearest = np.inf
    u_high = v_high = farthest = -np.inf
    for k in range(8):
        x, y, z = box_corners[k, 0], box_corners[k, 1], box_corners[k, 2]
        a = T[0, 0] * x + T[0, 1] * y + T[0, 2] * z + T[0, 3]
        b = T[1, 0] * x + T[1, 1] * y + T[1, 2] * z + T[1, 3]
        c = T[2, 0] * x + T[2, 1] * y + T[2, 2] * z + T[2, 3]
        nearest, farthest = min(nearest, c), max(farthest, c)
        if c > 0.0:
            u, v = a / c * camera[0] + camera[2], b / c * camera[1] + camera[3]
            u_low, u_high = min(u_low, u), max(u_high, u)
            v_low, v_high = min(v_low, v), max(v_high, v)
    window = np.zeros(4, dtype=np.int64)
    if farthest < _IN_FRONT_M:
        return window
    top, bottom, left, right = 0, height, 0, width
    if nearest >= _IN_FRONT_M:
        margin = reach_m * camera[0] / nearest + 2.0
        left, right = max(int(np.floor(u_low - margin)), 0), int(np.ceil(u_high + margin)) + 1
        top, bottom = max(int(np.floor(v_low - margin)), 0), int(np.ceil(v_high + margin)) + 1
        right, bottom = min(right, width), min(bottom, height)
    if right - left >= 2 and bottom - top >= 2:
        window[:] = (top, bottom, left, right)
    return window


@nb.njit(cache=True)
def in_sensor(vertices: FloatArray, triangles: Indices, T_sensor_model: FloatArray) -> FloatArray:
    """`(n, 3, 3)`; the corners of a model's triangles in the sensor's frame, metres.

    Args:
        vertices: `(m, 3)`; in the model's frame.
        triangles: `(n, 3)`; indices of their vertices.
        T_sensor_model: `(4, 4)`; takes points of the model's frame to the sensor's.
    """
    T = T_sensor_model
    moved = np.zeros(vertices.shape)
    for k in range(vertices.shape[0]):
        x, y, z = vertices[k, 0], vertices[k, 1], vertices[k, 2]
        for i in range(3):
            moved[k, i] = T[i, 0] * x + T[i, 1] * y + T[i, 2] * z + T[i, 3]
    corners = np.zeros((triangles.shape[0], 3, 3))
    for k in range(triangles.shape[0]):
        for i in range(3):
            for j in range(3):
                corners[k, i, j] = moved[triangles[k, i], j]
    return corners


@nb.njit(cache=True)
def draw(
    corners: FloatArray, camera: FloatArray, window: NDArray[np.int64], step: int
) -> tuple[Floats, Indices]:
    """The depth at which rays through pixels first meet triangles.

    Edge functions in homogeneous coordinates, so that triangles which reach behind the sensor need
    no clipping: a ray d meets the triangle (a, b, c) if d . (a x b), d . (b x c) and d . (c x a)
    have one sign, at the depth a . (b x c) over their sum.

    Args:
        corners: `(n, 3, 3)`; corners of the triangles in the sensor's frame, metres.
        camera: `(4,)`; fx, fy, cx, cy in pixels.
        window: `(4,)`; first row, row behind the last, first column, column behind the last.
        step: every so many pixels.

    Returns:
        `(h, w)` depth, infinite where there is none; `(h, w)` triangle, -1 where there is none.
    """
    top, bottom, left, right = window[0], window[1], window[2], window[3]
    h, w = (bottom - top + step - 1) // step, (right - left + step - 1) // step
    depth = np.full((h, w), np.inf, dtype=np.float32)
    triangle = np.full((h, w), -1, dtype=np.int32)
    fx, fy, cx, cy = camera[0], camera[1], camera[2], camera[3]
    edges = np.zeros((3, 3))
    for k in range(corners.shape[0]):
        nearest = min(corners[k, 0, 2], corners[k, 1, 2], corners[k, 2, 2])
        if max(corners[k, 0, 2], corners[k, 1, 2], corners[k, 2, 2]) <= _NEAREST_M:
            continue
        first_row, last_row, first_column, last_column = 0, h, 0, w
        if nearest > _NEAREST_M:
            u_low = v_low = np.inf
            u_high = v_high = -np.inf
            for i in range(3):
                u = corners[k, i, 0] / corners[k, i, 2] * fx + cx
                v = corners[k, i, 1] / corners[k, i, 2] * fy + cy
                u_low, u_high = min(u_low, u), max(u_high, u)
                v_low, v_high = min(v_low, v), max(v_high, v)
            if u_high < left or v_high < top or u_low >= right or v_low >= bottom:
                continue
            first_column = max(int(np.ceil((u_low - left) / step - 1e-9)), 0)
            last_column = min(int(np.floor((u_high - left) / step + 1e-9)) + 1, w)
            first_row = max(int(np.ceil((v_low - top) / step - 1e-9)), 0)
            last_row = min(int(np.floor((v_high - top) / step + 1e-9)) + 1, h)
        for i in range(3):
            a, b = corners[k, i], corners[k, (i + 1) % 3]
            edges[i, 0] = a[1] * b[2] - a[2] * b[1]
            edges[i, 1] = a[2] * b[0] - a[0] * b[2]
            edges[i, 2] = a[0] * b[1] - a[1] * b[0]
        c = corners[k, 2]
        volume = c[0] * edges[0, 0] + c[1] * edges[0, 1] + c[2] * edges[0, 2]
        if volume == 0.0:
            continue
        sign = 1.0 if volume > 0.0 else -1.0
        volume = abs(volume)
        for i in range(3):
            for j in range(3):
                edges[i, j] *= sign
        for row in range(first_row, last_row):
            y = (top + row * step - cy) / fy
            # Each edge leaves a half line of this row: their common part is the triangle's.
            begin, end = (left - cx) / fx, (right - cx) / fx
            for i in range(3):
                slope, rest = edges[i, 0], edges[i, 1] * y + edges[i, 2]
                if slope > 0.0:
                    begin = max(begin, -rest / slope)
                elif slope < 0.0:
                    end = min(end, -rest / slope)
                elif rest < 0.0:
                    end = -np.inf
            if begin > end:
                continue
            first = max(int(np.ceil((begin * fx + cx - left) / step - 1e-9)), first_column)
            last = min(int(np.floor((end * fx + cx - left) / step + 1e-9)) + 1, last_column)
            total_slope = edges[0, 0] + edges[1, 0] + edges[2, 0]
            total_rest = (edges[0, 1] + edges[1, 1] + edges[2, 1]) * y
            total_rest += edges[0, 2] + edges[1, 2] + edges[2, 2]
            for column in range(first, last):
                total = total_slope * ((left + column * step - cx) / fx) + total_rest
                if total <= 0.0:
                    continue
                z = volume / total
                if z > _NEAREST_M and z < depth[row, column]:
                    depth[row, column] = z
                    triangle[row, column] = k
    return depth, triangle


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
