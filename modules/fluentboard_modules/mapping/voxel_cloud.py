"""Points of any number of frames to one mean point per voxel: an unorganised or registered scene.

Deviates from section 3.2.1, which reconstructs a mesh of the whole cloud first: a voxel keeps what
a plane needs of its points, so a scene of ten million points shrinks to some hundred thousand
voxels in about a second, and frames can be added one by one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fluentboard.errors import InvalidFrame
from fluentboard.model.geometry import FloatArray
from fluentboard_modules.mapping.work_ahead import worked_in_parts

_BITS = 21  # of a packed key, per axis: 20 km at 2 cm
_HALF = 1 << (_BITS - 1)
_CHUNK = 500_000  # points between two checks of the table's size

Keys = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class VoxelCloud:
    """One point per occupied voxel.

    Attributes:
        voxel_m: edge length.
        points: `(n, 3)`; mean of the points in each voxel, map frame.
        counts: `(n,)`; how many points that were.
        towards_sensor: `(n, 3)`; sum of unit vectors from the points to where they were seen from;
            zero where that is unknown.
        neighbours: `(n, 26)`; numbers of the occupied voxels around each, -1 where there is none.
    """

    voxel_m: float
    points: FloatArray
    counts: NDArray[np.int64]
    towards_sensor: FloatArray
    neighbours: NDArray[np.int32]

    def __len__(self) -> int:
        return len(self.points)


class SceneCloud:
    """Points of a scene, fused into voxels as they come.

    Args:
        voxel_m: edge length of a voxel.

    Example:
        >>> scene = SceneCloud(voxel_m=0.1)
        >>> scene.add(np.array([[0.01, 0.0, 0.0], [0.03, 0.0, 0.0], [np.nan, 0.0, 0.0]]))
        >>> scene.voxels().points.round(3).tolist()
        [[0.02, 0.0, 0.0]]
    """

    def __init__(self, voxel_m: float = 0.02) -> None:
        self._voxel_m = voxel_m
        self._table_keys: Keys = np.full(4, -1, dtype=np.int64)
        self._table_rows = np.zeros(4, dtype=np.int32)
        self._keys: Keys = np.zeros(0, dtype=np.int64)
        self._sums = np.zeros((0, 7))
        self._n = 0
        self.n_points = 0

    def __len__(self) -> int:
        return self._n

    def add(self, points_map: FloatArray, sensor_position: FloatArray | None = None) -> None:
        """Adds points.

        Args:
            points_map: `(..., 3)` in the map frame, metres; NaN and infinite ones are left out.
            sensor_position: `(3,)` where they were seen from, map frame; None if unknown.

        Raises:
            InvalidFrame: a point is farther from the origin than voxels can be numbered.
        """
        points = np.ascontiguousarray(points_map.reshape(-1, 3), dtype=np.float64)
        sensor = np.full(3, np.nan) if sensor_position is None else np.asarray(sensor_position)
        for first in range(0, len(points), _CHUNK):
            chunk = points[first : first + _CHUNK]
            self._make_room(self._n + len(chunk))
            self._n, taken = _insert(
                chunk,
                sensor.astype(np.float64),
                1.0 / self._voxel_m,
                self._table_keys,
                self._table_rows,
                self._keys,
                self._sums,
                self._n,
            )
            if taken < 0:
                reach_m = _HALF * self._voxel_m
                raise InvalidFrame(
                    f"a point lies more than {reach_m:.0f} m from the origin of the map; check the "
                    "unit of the cloud (metres) and its pose"
                )
            self.n_points += taken

    def voxels(self) -> VoxelCloud:
        """All occupied voxels, in the order in which they were first seen."""
        sums = self._sums[: self._n]
        counts = sums[:, 6]
        keys = self._keys[: self._n]
        neighbours = np.full((self._n, 26), -1, dtype=np.int32)
        worked_in_parts(
            lambda first, last: _find_neighbours(
                keys, self._table_keys, self._table_rows, neighbours, first, last
            ),
            self._n,
        )
        return VoxelCloud(
            voxel_m=self._voxel_m,
            points=sums[:, :3] / np.maximum(counts, 1.0)[:, None],
            counts=counts.astype(np.int64),
            towards_sensor=sums[:, 3:6].copy(),
            neighbours=neighbours,
        )

    def _make_room(self, n_voxels: int) -> None:
        """So many voxels fit, with the table no more than half full."""
        if n_voxels > len(self._keys):
            spare = max(n_voxels, len(self._keys) * 3 // 2) - len(self._keys)
            self._keys = np.pad(self._keys, (0, spare))
            self._sums = np.pad(self._sums, ((0, spare), (0, 0)))
        if 2 * n_voxels > len(self._table_keys):
            size = 1 << int(2 * n_voxels - 1).bit_length()
            self._table_keys = np.full(size, -1, dtype=np.int64)
            self._table_rows = np.zeros(size, dtype=np.int32)
            _fill(self._keys[: self._n], self._table_keys, self._table_rows)


@njit(cache=True, nogil=True)
def _slot(key: int, table_keys: Keys) -> int:
    """Where a key is in the table, or where it would be put."""
    mask = len(table_keys) - 1
    mixed = key * 0x9E3779B97F4A7C1
    slot = (mixed ^ (mixed >> 29)) & mask
    while table_keys[slot] != -1 and table_keys[slot] != key:
        slot = (slot + 1) & mask
    return slot


@njit(cache=True, nogil=True)
def _fill(keys: Keys, table_keys: Keys, table_rows: NDArray[np.int32]) -> None:
    for row in range(len(keys)):
        slot = _slot(keys[row], table_keys)
        table_keys[slot] = keys[row]
        table_rows[slot] = row


@njit(cache=True, nogil=True)
def _insert(
    points: FloatArray,
    sensor: FloatArray,
    per_voxel: float,
    table_keys: Keys,
    table_rows: NDArray[np.int32],
    keys: Keys,
    sums: FloatArray,
    n: int,
) -> tuple[int, int]:
    """Adds points to their voxels; the new number of voxels, and how many points were taken."""
    has_sensor = not np.isnan(sensor[0])
    taken = 0
    for i in range(len(points)):
        x, y, z = points[i]
        if not (np.isfinite(x) and np.isfinite(y) and np.isfinite(z)):
            continue
        kx, ky, kz = np.floor(x * per_voxel), np.floor(y * per_voxel), np.floor(z * per_voxel)
        if max(abs(kx), abs(ky), abs(kz)) >= _HALF - 1:
            return n, -1
        key = (
            ((np.int64(kx) + _HALF) << (2 * _BITS))
            | ((np.int64(ky) + _HALF) << _BITS)
            | (np.int64(kz) + _HALF)
        )
        slot = _slot(key, table_keys)
        if table_keys[slot] == -1:
            table_keys[slot] = key
            table_rows[slot] = n
            keys[n] = key
            n += 1
        row = table_rows[slot]
        sums[row, 0] += x
        sums[row, 1] += y
        sums[row, 2] += z
        if has_sensor:
            dx, dy, dz = sensor[0] - x, sensor[1] - y, sensor[2] - z
            length = np.sqrt(dx * dx + dy * dy + dz * dz) + 1e-12
            sums[row, 3] += dx / length
            sums[row, 4] += dy / length
            sums[row, 5] += dz / length
        sums[row, 6] += 1.0
        taken += 1
    return n, taken


@njit(cache=True, nogil=True)
def _find_neighbours(
    keys: Keys,
    table_keys: Keys,
    table_rows: NDArray[np.int32],
    found: NDArray[np.int32],
    first: int,
    last: int,
) -> None:
    """Fills in rows of `found` `(n, 26)`: the voxels around each; where there is none, it stays."""
    for row in range(first, last):
        key = keys[row]
        column = 0
        for dx in range(-1, 2):
            for dy in range(-1, 2):
                for dz in range(-1, 2):
                    if dx == 0 and dy == 0 and dz == 0:
                        continue
                    other = key + (dx << (2 * _BITS)) + (dy << _BITS) + dz
                    slot = _slot(other, table_keys)
                    if table_keys[slot] == other:
                        found[row, column] = table_rows[slot]
                    column += 1
