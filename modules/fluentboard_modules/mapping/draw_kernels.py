"""A model drawn into a depth image, compiled: the inner loop of `visibility`."""

from __future__ import annotations

import numba as nb
import numpy as np
from numpy.typing import NDArray

from fluentboard.model.geometry import FloatArray

Floats = NDArray[np.float32]
Indices = NDArray[np.int32]

_NEAREST_M = 0.05  # what is nearer to the sensor than this is behind it
_IN_FRONT_M = 0.3  # a box that reaches nearer has no bounds in the image


@nb.njit(cache=True, nogil=True)
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
        window[0], window[1], window[2], window[3] = top, bottom, left, right
    return window


@nb.njit(cache=True, nogil=True)
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


@nb.njit(cache=True, nogil=True)
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
    nearness = np.zeros((h, w))  # 1 / depth, which is linear in the image
    triangle = np.full((h, w), -1, dtype=np.int32)
    fx, fy, cx, cy = camera[0], camera[1], camera[2], camera[3]
    per_column, per_row = np.zeros(3), np.zeros(3)
    at_origin, crossing, tilt = np.zeros(3), np.zeros(3), np.zeros(3)
    for k in range(corners.shape[0]):
        ax, ay, az = corners[k, 0, 0], corners[k, 0, 1], corners[k, 0, 2]
        bx, by, bz = corners[k, 1, 0], corners[k, 1, 1], corners[k, 1, 2]
        ox, oy, oz = corners[k, 2, 0], corners[k, 2, 1], corners[k, 2, 2]
        if max(az, bz, oz) <= _NEAREST_M:
            continue
        first_row, last_row, first_column, last_column = 0, h, 0, w
        if min(az, bz, oz) > _NEAREST_M:
            ua, ub, uo = ax / az * fx + cx, bx / bz * fx + cx, ox / oz * fx + cx
            va, vb, vo = ay / az * fy + cy, by / bz * fy + cy, oy / oz * fy + cy
            u_low, u_high, v_low, v_high = (
                min(ua, ub, uo), max(ua, ub, uo), min(va, vb, vo), max(va, vb, vo),
            )  # fmt: skip
            first_column = max(int(np.ceil((u_low - left) / step - 1e-9)), 0)
            last_column = min(int(np.floor((u_high - left) / step + 1e-9)) + 1, w)
            first_row = max(int(np.ceil((v_low - top) / step - 1e-9)), 0)
            last_row = min(int(np.floor((v_high - top) / step + 1e-9)) + 1, h)
            if first_row >= last_row or first_column >= last_column:
                continue
        per_column[0], per_row[0], at_origin[0] = (
            ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx,
        )  # fmt: skip
        per_column[1], per_row[1], at_origin[1] = (
            by * oz - bz * oy, bz * ox - bx * oz, bx * oy - by * ox,
        )  # fmt: skip
        per_column[2], per_row[2], at_origin[2] = (
            oy * az - oz * ay, oz * ax - ox * az, ox * ay - oy * ax,
        )  # fmt: skip
        volume = ox * per_column[0] + oy * per_row[0] + oz * at_origin[0]
        if volume == 0.0:
            continue
        # From rays to the window's columns and rows, and where each edge crosses a row.
        slope = descent = offset = 0.0
        for i in range(3):
            per_column[i] *= step / (volume * fx)
            per_row[i] *= step / (volume * fy)
            at_origin[i] = (
                at_origin[i] / volume
                + per_column[i] * ((left - cx) / step)
                + per_row[i] * ((top - cy) / step)
            )
            slope += per_column[i]
            descent += per_row[i]
            offset += at_origin[i]
            if per_column[i] != 0.0:
                crossing[i] = -at_origin[i] / per_column[i]
                tilt[i] = -per_row[i] / per_column[i]
        for row in range(first_row, last_row):
            # Each edge leaves a half line of this row: their common part is the triangle's.
            begin, end = float(first_column), float(last_column - 1)
            for i in range(3):
                if per_column[i] > 0.0:
                    begin = max(begin, crossing[i] + tilt[i] * row - 1e-9)
                elif per_column[i] < 0.0:
                    end = min(end, crossing[i] + tilt[i] * row + 1e-9)
                elif per_row[i] * row + at_origin[i] < 0.0:
                    end = -1.0
            if not begin <= end:  # nor where an edge is so far away that no integer holds it
                continue
            rest = descent * row + offset
            for column in range(int(np.ceil(begin)), int(np.floor(end)) + 1):
                near = slope * column + rest
                if near > nearness[row, column] and near < 1.0 / _NEAREST_M:
                    nearness[row, column] = near
                    triangle[row, column] = k
    depth = np.full((h, w), np.inf, dtype=np.float32)
    for row in range(h):
        for column in range(w):
            if triangle[row, column] >= 0:
                depth[row, column] = 1.0 / nearness[row, column]
    return depth, triangle
