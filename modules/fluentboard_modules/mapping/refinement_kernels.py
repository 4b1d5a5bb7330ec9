"""Sums over the pixels in which a drawn model and a depth image agree: loops of `refinement`."""

from __future__ import annotations

import numba as nb
import numpy as np
from numpy.typing import NDArray

from fluentboard.model.geometry import FloatArray
from fluentboard_modules.mapping.draw_kernels import Floats, Indices

_STEEP = 0.2  # a surface that a ray meets at less than this sine says little


@nb.njit(cache=True, nogil=True)
def pixel_equations(
    expected: Floats,
    triangle: Indices,
    corners: FloatArray,
    measured: Floats,
    sigma: Floats,
    camera: FloatArray,
    window: NDArray[np.int64],
    T_model_sensor: FloatArray,
    scale_m: float,
    bias_m: float,
    least_gap_m: float,
) -> tuple[FloatArray, FloatArray, float, float, int]:
    """One Gauss-Newton step of x, y and yaw: point to plane along the rays of the pixels.

    Args:
        expected: `(h, w)`; depth of the model from `draw` with step 1.
        triangle: `(h, w)`; its triangles.
        corners: `(n, 3, 3)`; their corners in the sensor's frame.
        measured: the whole depth image, 0 where unknown.
        sigma: standard deviation of each of its pixels.
        camera: `(4,)`; fx, fy, cx, cy.
        window: `(4,)`; first row, row behind the last, first column, column behind the last.
        T_model_sensor: `(4, 4)`; takes points of the sensor's frame to the model's.
        scale_m: residuals that are larger do not vote (Tukey).
        bias_m: added to the deviation of each depth.
        least_gap_m: a pixel whose drawn depth bends by more between its neighbours is an edge
            and does not vote.

    Returns:
        `(3, 3)` information, `(3,)` gradient, sum of the weights, weighted sum of the squared
        residuals over their variances, and how many pixels voted.
    """
    information, gradient = np.zeros((3, 3)), np.zeros(3)
    sum_weights = sum_squares = 0.0
    count = 0
    h, w = expected.shape
    top, left = window[0], window[2]
    fx, fy, cx, cy = camera[0], camera[1], camera[2], camera[3]
    R = T_model_sensor
    row3 = np.zeros(3)
    for row in range(1, h - 1):
        y = (top + row - cy) / fy
        for column in range(1, w - 1):
            z = expected[row, column]
            depth = measured[top + row, left + column]
            if not z < np.inf or depth <= 0.0:
                continue
            k = triangle[row, column]
            x = (left + column - cx) / fx
            ax, ay, az = corners[k, 0, 0], corners[k, 0, 1], corners[k, 0, 2]
            px, py, pz = corners[k, 1, 0] - ax, corners[k, 1, 1] - ay, corners[k, 1, 2] - az
            qx, qy, qz = corners[k, 2, 0] - ax, corners[k, 2, 1] - ay, corners[k, 2, 2] - az
            nx, ny, nz = py * qz - pz * qy, pz * qx - px * qz, px * qy - py * qx
            length = np.sqrt(nx * nx + ny * ny + nz * nz)
            if length == 0.0:
                continue
            nx, ny, nz = nx / length, ny / length, nz / length
            along = nx * x + ny * y + nz
            if abs(along) < _STEEP * np.sqrt(x * x + y * y + 1.0):
                continue
            residual = along * (depth - z)
            if abs(residual) >= scale_m or abs(depth - z) >= 3.0 * scale_m:
                continue
            jump = max(
                abs(expected[row - 1, column] + expected[row + 1, column] - 2.0 * z),
                abs(expected[row, column - 1] + expected[row, column + 1] - 2.0 * z),
            )
            if not jump < least_gap_m:
                continue
            spread = (abs(along) * sigma[top + row, left + column]) ** 2 + bias_m * bias_m
            weight = (1.0 - (residual / scale_m) ** 2) ** 2
            mx = R[0, 0] * nx + R[0, 1] * ny + R[0, 2] * nz
            my = R[1, 0] * nx + R[1, 1] * ny + R[1, 2] * nz
            fx_m = R[0, 3] + z * (R[0, 0] * x + R[0, 1] * y + R[0, 2])
            fy_m = R[1, 3] + z * (R[1, 0] * x + R[1, 1] * y + R[1, 2])
            row3[0], row3[1], row3[2] = mx, my, my * fx_m - mx * fy_m
            count += 1
            sum_weights += weight
            sum_squares += weight * residual * residual / spread
            for a in range(3):
                gradient[a] += weight * row3[a] * residual / spread
                for b in range(3):
                    information[a, b] += weight * row3[a] * row3[b] / spread
    return information, gradient, sum_weights, sum_squares, count
