"""A model drawn into and compared with several depth images in one call, compiled.

A call from Python takes as long as the comparison with one thinned image; these also let other
threads work meanwhile.
"""

from __future__ import annotations

import numba as nb
import numpy as np
from numpy.typing import NDArray

from fluentboard.model.geometry import FloatArray
from fluentboard_modules.mapping.draw_kernels import Floats, Indices, draw, image_window, in_sensor
from fluentboard_modules.mapping.evidence_kernels import outline_lengths
from fluentboard_modules.mapping.refinement_kernels import pixel_equations
from fluentboard_modules.mapping.view_kernels import compare


@nb.njit(cache=True, nogil=True)
def areas_of_views(
    vertices: FloatArray,
    triangles: Indices,
    box_corners: FloatArray,
    voids: FloatArray,
    T_map_model: FloatArray,
    measured: Floats,
    sigma: Floats,
    cameras: FloatArray,
    sizes: NDArray[np.int64],
    T_sensor_map: FloatArray,
    n_views: int,
    step: int,
    tolerance_m: float,
    tolerance_sigma: float,
    beside_m: float,
    reach_m: float,
    floor_clear_m: float,
) -> FloatArray:
    """`(8,)`; the areas of `compare`, summed over the first views.

    Args:
        vertices: `(m, 3)`; of the model, metres.
        triangles: `(n, 3)`; indices of their vertices.
        box_corners: `(8, 3)`; of the box around the model.
        voids: `(v, 2, 3)`; lowest and highest corners of what must be empty.
        T_map_model: `(4, 4)`; where the model stands.
        measured: `(k, h, w)`; depth images, 0 where unknown.
        sigma: `(k, h, w)`; standard deviation of each of their pixels.
        cameras: `(k, 4)`; fx, fy, cx, cy, pixels.
        sizes: `(k, 2)`; rows and columns of each image.
        T_sensor_map: `(k, 4, 4)`; takes points of the map to the sensor.
        n_views: so many of them are looked at.
        step: every so many pixels.
        tolerance_m: as for `compare`, with all that follow.
        tolerance_sigma: see there.
        beside_m: see there.
        reach_m: see there.
        floor_clear_m: see there.
    """
    areas = np.zeros(8)
    for k in range(n_views):
        T_sensor_model = product(T_sensor_map[k], T_map_model)
        window = image_window(
            box_corners, T_sensor_model, cameras[k], sizes[k, 0], sizes[k, 1], reach_m
        )
        if window[1] == 0:
            continue
        corners = in_sensor(vertices, triangles, T_sensor_model)
        expected, triangle = draw(corners, cameras[k], window, step)
        of_view = compare(
            expected, triangle, corners, measured[k], sigma[k], cameras[k], window, step,
            rigid_inverse(T_sensor_model), voids, tolerance_m, tolerance_sigma, beside_m, reach_m,
            floor_clear_m,
        )  # fmt: skip
        for i in range(8):
            areas[i] += of_view[i]
    return areas


@nb.njit(cache=True, nogil=True)
def equations_of_views(
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
    scale_m: float,
    bias_m: float,
    least_gap_m: float,
) -> tuple[FloatArray, FloatArray, float, float, int]:
    """The sums of `pixel_equations` over all views.

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
        scale_m: as for `pixel_equations`, with all that follow.
        bias_m: see there.
        least_gap_m: see there.
    """
    information, gradient = np.zeros((3, 3)), np.zeros(3)
    weights = squares = 0.0
    count = 0
    for k in range(measured.shape[0]):
        T_sensor_model = product(T_sensor_map[k], T_map_model)
        window = image_window(
            box_corners, T_sensor_model, cameras[k], sizes[k, 0], sizes[k, 1], reach_m
        )
        if window[1] == 0:
            continue
        corners = in_sensor(vertices, triangles, T_sensor_model)
        expected, triangle = draw(corners, cameras[k], window, 1)
        of_view = pixel_equations(
            expected, triangle, corners, measured[k], sigma[k], cameras[k], window,
            rigid_inverse(T_sensor_model), scale_m, bias_m, least_gap_m,
        )  # fmt: skip
        for a in range(3):
            gradient[a] += of_view[1][a]
            for b in range(3):
                information[a, b] += of_view[0][a, b]
        weights += of_view[2]
        squares += of_view[3]
        count += of_view[4]
    return information, gradient, weights, squares, count


@nb.njit(cache=True, nogil=True)
def outline_of_views(
    vertices: FloatArray,
    triangles: Indices,
    box_corners: FloatArray,
    T_map_model: FloatArray,
    measured: Floats,
    sigma: Floats,
    cameras: FloatArray,
    sizes: NDArray[np.int64],
    T_sensor_map: FloatArray,
    T_map_sensor: FloatArray,
    reach_m: float,
    tolerance_m: float,
    tolerance_sigma: float,
    outline_m: float,
    floor_clear_m: float,
) -> tuple[float, float]:
    """The lengths of `outline_lengths`, summed over all views.

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
        T_map_sensor: `(k, 4, 4)`; takes points of the sensor to the map.
        reach_m: so much around the model is looked at.
        tolerance_m: as for `outline_lengths`, with all that follow.
        tolerance_sigma: see there.
        outline_m: see there.
        floor_clear_m: see there.
    """
    shown = missing = 0.0
    for k in range(measured.shape[0]):
        T_sensor_model = product(T_sensor_map[k], T_map_model)
        window = image_window(
            box_corners, T_sensor_model, cameras[k], sizes[k, 0], sizes[k, 1], reach_m
        )
        if window[1] == 0:
            continue
        corners = in_sensor(vertices, triangles, T_sensor_model)
        expected, triangle = draw(corners, cameras[k], window, 1)
        of_view = outline_lengths(
            expected, triangle, corners, measured[k], sigma[k], cameras[k], window,
            T_map_sensor[k], tolerance_m, tolerance_sigma, outline_m, floor_clear_m,
        )  # fmt: skip
        shown += of_view[0]
        missing += of_view[1]
    return shown, missing


@nb.njit(cache=True, nogil=True)
def first_in_box(
    points: FloatArray, cubes: NDArray[np.int64], T_box_map: FloatArray, half_size: FloatArray
) -> NDArray[np.int64]:
    """Indices of the points inside a box, of each cube the first one only.

    Args:
        points: `(n, 3)`; map frame.
        cubes: `(n,)`; the number of each point's cube, in ascending order.
        T_box_map: `(4, 4)`; takes points of the map to the box.
        half_size: `(3,)`; half of the box's edges, metres.
    """
    T = T_box_map
    chosen = np.zeros(points.shape[0], dtype=np.int64)
    count, last = 0, np.int64(-1)
    for k in range(points.shape[0]):
        if cubes[k] == last:
            continue
        x, y, z = points[k, 0], points[k, 1], points[k, 2]
        if abs(T[0, 0] * x + T[0, 1] * y + T[0, 2] * z + T[0, 3]) > half_size[0]:
            continue
        if abs(T[1, 0] * x + T[1, 1] * y + T[1, 2] * z + T[1, 3]) > half_size[1]:
            continue
        if abs(T[2, 0] * x + T[2, 1] * y + T[2, 2] * z + T[2, 3]) > half_size[2]:
            continue
        last = cubes[k]
        chosen[count] = k
        count += 1
    return chosen[:count]


@nb.njit(cache=True, nogil=True)
def product(a: FloatArray, b: FloatArray) -> FloatArray:
    """`(4, 4)`; one rigid motion after another."""
    result = np.zeros((4, 4))
    for i in range(4):
        for j in range(4):
            result[i, j] = (
                a[i, 0] * b[0, j] + a[i, 1] * b[1, j] + a[i, 2] * b[2, j] + a[i, 3] * b[3, j]
            )
    return result


@nb.njit(cache=True, nogil=True)
def rigid_inverse(T: FloatArray) -> FloatArray:
    """`(4, 4)`; the rigid motion back."""
    back = np.zeros((4, 4))
    for i in range(3):
        for j in range(3):
            back[i, j] = T[j, i]
        back[i, 3] = -(T[0, i] * T[0, 3] + T[1, i] * T[1, 3] + T[2, i] * T[2, 3])
    back[3, 3] = 1.0
    return back
