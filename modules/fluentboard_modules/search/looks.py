"""One look of a sensor, marked on a dense box of cells before the map takes it in."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fluentboard.errors import InvalidGeometry
from fluentboard.model.geometry import FloatArray
from fluentboard_modules.search import cloud_kernels, look_kernels

_CELLS_MAX = 1 << 30  # a gigabyte of marks; at 5 cm that is 164 m x 164 m x 5 m
_KEPT_MAX = 1 << 24


class LookMarks:
    """Which cells a look has hit, and which it has seen to be free.

    Its arrays are kept from look to look, so that a camera's frames need no new memory.

    Args:
        resolution_m: side of a cell in metres.
    """

    def __init__(self, resolution_m: float) -> None:
        self._resolution = resolution_m
        self._cells = np.zeros((0, 3), np.int32)
        self._ends = np.zeros((0, 3), np.float32)
        self._is_hit = np.zeros(0, np.bool_)
        self._order = np.zeros(0, np.int32)
        self._room = np.zeros(0, np.int32)
        self._table = np.zeros(1 << cloud_kernels.TABLE_BITS, np.int64)
        self._chunk = (
            np.zeros(3 * cloud_kernels.CHUNK, np.int32),
            np.zeros(cloud_kernels.CHUNK, np.int64),
            np.zeros(cloud_kernels.CHUNK, np.int32),
        )
        lanes = look_kernels.LANES
        self._lanes = (
            np.zeros(look_kernels.AIM_COLUMNS * lanes, np.float32),
            np.zeros(look_kernels.WALK_COLUMNS * lanes),
            np.zeros(look_kernels.STEP_COLUMNS * lanes, np.int32),
            np.zeros(look_kernels.STEPS * lanes, np.int32),
        )
        self.marks: NDArray[np.uint8] = np.zeros(0, np.uint8)
        """Flat; of the cells of a box, z running fastest; zeros beyond."""

    def mark(
        self, points: FloatArray, origin: FloatArray, range_max_m: float
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Marks the cells of a look; who reads the marks must clear them.

        Args:
            points: `(n, 3)`; map frame; rows with NaN or infinity are skipped.
            origin: `(3,)`; of the sensor.
            range_max_m: farther points only free the way to this distance; 0 for no limit.

        Returns:
            The first cell of the box and its numbers of cells, all multiples of 8.

        Raises:
            InvalidGeometry: a point lies absurdly far away.
        """
        if len(points) > len(self._cells):
            self._cells = np.zeros((len(points), 3), np.int32)
            self._ends = np.zeros((len(points), 3), np.float32)
            self._is_hit = np.zeros(len(points), np.bool_)
            self._order = np.zeros(len(points), np.int32)
        cells = self._cells[: len(points)]
        own = np.floor(origin / self._resolution)
        if np.abs(own).max() >= cloud_kernels.CELL_MAX:
            raise InvalidGeometry(f"a sensor at {origin} m; its position is absurdly far away")
        box = np.array([own, own], np.int64)
        count = cloud_kernels.distinct_cells(
            points.reshape(-1), self._resolution, *self._chunk, self._table, cells, box
        )
        if count and np.abs(box).max() >= cloud_kernels.CELL_MAX:
            raise InvalidGeometry(
                f"a point lies at {np.abs(points[np.isfinite(points)]).max():.3g} m; remove such "
                "points"
            )
        wide = float(np.prod((box[1] - box[0] + 16).astype(np.float64)))
        if range_max_m > 0.0 and wide > _KEPT_MAX:
            # Then farther points are cast once for each pixel, not for each cell.
            reach = math.ceil(range_max_m / self._resolution) + 1
            box = np.array([np.maximum(box[0], own - reach), np.minimum(box[1], own + reach)])
        # A ray may miss its end cell by rounding, and stop in the next one.
        low = (box[0].astype(np.int64) - 1) >> 3 << 3
        shape = ((box[1].astype(np.int64) + 1) >> 3 << 3) + 8 - low
        self._make_room(shape)
        ends = cloud_kernels.mark_ends(
            cells, count, origin, range_max_m, self._resolution, low, shape, self.marks,
            self._ends, self._is_hit,
        )  # fmt: skip
        look_kernels.mark_rays(
            cells, self._ends, ends, origin, self._resolution, low, shape, self.marks, *self._lanes,
            self._room, self._order,
        )  # fmt: skip
        look_kernels.mark_hits(cells, ends, self._is_hit, low, shape, self.marks)
        return low, shape

    def _make_room(self, shape: NDArray[np.int64]) -> None:
        size = float(np.prod(shape.astype(np.float64)))
        if size > _CELLS_MAX:
            raise InvalidGeometry(
                f"a look over {shape * self._resolution} m; limit the sensor's range "
                "(range_max_m) or remove the points that lie that far away"
            )
        # Memory for a rare wide look is given back at the next narrow one.
        if not size <= len(self.marks) <= max(_KEPT_MAX, size):
            self.marks = np.zeros(int(size), np.uint8)
        steps = int(shape.sum())
        if len(self._room) < steps:
            self._room = np.zeros(steps, np.int32)
