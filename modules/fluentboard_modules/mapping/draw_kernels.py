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
