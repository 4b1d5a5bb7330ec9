"""How a depth image shows the cells of a plane of the map."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fluentboard.model.geometry import FloatArray, Transform
from fluentboard_modules.frames.sensor_frame import SensorFrame
from fluentboard_modules.mapping.plane_kernels import look_at_cells

_NEAREST_M = 0.3  # nearer to the sensor nothing is judged


@dataclass(frozen=True, slots=True)
class Visibility:
    """How a frame saw the cells of a map plane.

    Attributes:
        seen: cells that the plane's own region covers.
        seen_through: cells behind which the sensor measured something.
        expected: cells in view and not hidden by something in front.
    """

    seen: int
    seen_through: int
    expected: int


def looked_at(
    frame: SensorFrame,
    T_sensor_grid: Transform,
    fit: FloatArray,
    corner: NDArray[np.int32],
    cell_m: float,
    present: NDArray[np.bool_],
    hit: NDArray[np.bool_],
    tolerance_m: float,
) -> NDArray[np.uint8]:
    """`(rows, columns)`; what the frame says of each cell, as `plane_kernels` numbers it.

    Args:
        frame: what the sensor measured.
        T_sensor_grid: takes the grid's frame to the sensor's.
        fit: `(3,)`; a, b and c of z = a x + b y + c in the grid's frame, in metres.
        corner: `(2,)`; column and row of the first cell.
        cell_m: edge of a cell.
        present: `(rows, columns)`; cells that belong to the plane.
        hit: `(rows, columns)`; cells that this frame's own regions hit, which are not judged again.
        tolerance_m: how far behind the plane a measurement must be to prove it absent.
    """
    # The plane is affine in column and row, and so is its image in the camera frame.
    a, b, c = fit
    matrix = T_sensor_grid.matrix
    x, y = (corner[0] + 0.5) * cell_m, (corner[1] + 0.5) * cell_m
    first = (matrix @ (x, y, a * x + b * y + c, 1.0))[:3]
    along = cell_m * np.array([[1.0, 0.0, a], [0.0, 1.0, b]]) @ matrix[:3, :3].T
    normal = np.cross(along[0], along[1])
    camera = frame.camera
    return look_at_cells(
        present,
        hit,
        first.astype(np.float32),
        along.astype(np.float32),
        (normal / np.linalg.norm(normal)).astype(np.float32),
        frame.depth_m,
        np.array([camera.fx, camera.fy, camera.cx, camera.cy], dtype=np.float32),
        tolerance_m,
        _NEAREST_M,
    )
