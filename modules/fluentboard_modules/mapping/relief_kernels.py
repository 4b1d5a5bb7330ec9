"""How deep the openings of a front are, in several depth images, compiled: see `front_relief_m`."""

from __future__ import annotations

import numba as nb
import numpy as np
from numpy.typing import NDArray

from fluentboard.model.geometry import FloatArray
from fluentboard_modules.mapping.draw_kernels import Floats, Indices, draw, image_window, in_sensor
from fluentboard_modules.mapping.stack_kernels import product, rigid_inverse

_EDGE_M, _OPENING_M = 0.012, 0.06  # behind the front: up to here an edge, from there an opening
_LEAST_SIGMA_M = 1e-3


@nb.njit(cache=True, nogil=True)
def relief_equations(
    vertices: FloatArray,
    triangles: Indices,
    box_corners: FloatArray,
    T_map_model: FloatArray,
    measured: Floats,
    sigma: Floats,
    cameras: FloatArray,
    sizes: NDArray[np.int64],
    T_sensor_map: FloatArray,
    reach_m: float,
    front_m: float,
    relief_reach_m: float,
) -> tuple[FloatArray, FloatArray, NDArray[np.int64]]:
    """Least squares of depth behind a front: offset, slopes along y and z, relief in openings.

    Args:
        vertices: as for `areas_of_views`, with all up to `T_sensor_map`.
        triangles: see there.
        box_corners: see there.
        T_map_model: see there.
        measured: see there.
        sigma: see there.
        cameras: see there.
        sizes: see there.
        T_sensor_map: see there.
        reach_m: so much around the model is looked at.
        front_m: x of the front, model frame.
        relief_reach_m: what is measured further from the front says nothing.

    Returns:
        `(4, 4)` normal matrix, `(4,)` right side, `(2,)` pixels of edges and of openings.
    """
    matrix, right_side = np.zeros((4, 4)), np.zeros(4)
    counts = np.zeros(2, dtype=np.int64)
    terms = np.ones(4)
    for view in range(measured.shape[0]):
        T_sensor_model = product(T_sensor_map[view], T_map_model)
        T = rigid_inverse(T_sensor_model)
        camera = cameras[view]
        window = image_window(
            box_corners, T_sensor_model, camera, sizes[view, 0], sizes[view, 1], reach_m
        )
        if window[1] == 0 or T[0, 3] <= front_m:
            continue
        corners = in_sensor(vertices, triangles, T_sensor_model)
        expected, _ = draw(corners, camera, window, 1)
        for row in range(expected.shape[0]):
            y = (window[0] + row - camera[3]) / camera[1]
            for column in range(expected.shape[1]):
                z = expected[row, column]
                depth = measured[view, window[0] + row, window[2] + column]
                if not z < np.inf or depth <= 0.0:
                    continue
                x = (window[2] + column - camera[2]) / camera[0]
                along = T[0, 0] * x + T[0, 1] * y + T[0, 2]
                behind = front_m - T[0, 3] - depth * along
                if abs(behind) >= relief_reach_m:
                    continue
                drawn = front_m - T[0, 3] - z * along
                if _EDGE_M <= drawn <= _OPENING_M:
                    continue
                is_opening = drawn > _OPENING_M
                counts[1 if is_opening else 0] += 1
                terms[1] = T[1, 3] + depth * (T[1, 0] * x + T[1, 1] * y + T[1, 2])
                terms[2] = T[2, 3] + depth * (T[2, 0] * x + T[2, 1] * y + T[2, 2])
                terms[3] = 1.0 if is_opening else 0.0
                spread = max(sigma[view, window[0] + row, window[2] + column], _LEAST_SIGMA_M)
                weight = 1.0 / (spread * spread)
                for a in range(4):
                    right_side[a] += weight * terms[a] * behind
                    for b in range(4):
                        matrix[a, b] += weight * terms[a] * terms[b]
    return matrix, right_side, counts
