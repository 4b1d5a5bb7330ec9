"""Frontiers: unknown cells of the region that a view can aim at, and from which side."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fluentboard.model.geometry import FloatArray
from fluentboard_modules.search.occupancy import FREE, UNKNOWN, OccupancyMap
from fluentboard_modules.search.region import Region


@dataclass(frozen=True, eq=False)
class Frontiers:
    """The frontier cells of a region.

    Attributes:
        centres: `(n, 3)`; in metres, map frame.
        normals: `(n, 3)`; unit vectors towards the known side; zero where it has none.
        is_border: `(n,)`; whether a cell has no free neighbour and is here because it lies at the
            border of its volume.
    """

    centres: FloatArray
    normals: FloatArray
    is_border: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.centres)


def frontiers_of(region: Region, occupancy: OccupancyMap) -> Frontiers:
    """All frontier cells of the region (Section 5.2.1).

    A frontier cell is unknown and has a free neighbour among its six. Unknown cells at the border
    of a volume join them, so that a volume enclosed in unknown space is seen from somewhere.

    The normal joins the mean of the unknown to the mean of the free among the 26 neighbours; that
    of a border cell the mean of those inside to the mean of those outside the volume.
    """
    unknown_now = region.unknown(occupancy)
    centres: list[FloatArray] = []
    normals: list[FloatArray] = []
    borders: list[NDArray[np.bool_]] = []
    taken = np.zeros(len(region.cells), np.bool_)
    for members in region.members:
        cells = region.cells[members]
        low = cells.min(axis=0) - 1
        shape = tuple(int(n) for n in cells.max(axis=0) + 2 - low)
        states = occupancy.dense(low, (shape[0], shape[1], shape[2]))
        index = tuple((cells - low).T)
        inside = np.zeros(shape, np.bool_)
        inside[index] = True
        free, unknown = states == FREE, states == UNKNOWN
        at_free = _has_neighbour(free)[index]
        at_border = _has_neighbour(~inside)[index]
        chosen = unknown_now[members] & (at_free | at_border) & ~taken[members]
        taken[members[chosen]] = True
        place = tuple(axis[chosen] for axis in index)
        by_sight = _mean_offset(free, place) - _mean_offset(unknown, place)
        by_volume = _mean_offset(~inside, place) - _mean_offset(inside, place)
        border = ~at_free[chosen]
        normal = np.where(border[:, None], by_volume, by_sight)
        length = np.linalg.norm(normal, axis=1, keepdims=True)
        normals.append(np.divide(normal, length, out=np.zeros_like(normal), where=length > 1e-9))
        centres.append(occupancy.centres(cells[chosen]))
        borders.append(border)
    return Frontiers(np.concatenate(centres), np.concatenate(normals), np.concatenate(borders))


def _has_neighbour(flags: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Whether one of the six neighbours is set; the array's own border does not matter."""
    found = np.zeros_like(flags)
    for axis in range(3):
        before = [slice(None)] * 3
        after = [slice(None)] * 3
        before[axis], after[axis] = slice(None, -1), slice(1, None)
        found[tuple(before)] |= flags[tuple(after)]
        found[tuple(after)] |= flags[tuple(before)]
    return found


def _mean_offset(flags: NDArray[np.bool_], place: tuple[NDArray[np.int64], ...]) -> FloatArray:
    """`(n, 3)`; mean offset, in cells, of the set ones among the 26 neighbours; 0 if there is none.

    The places are at least one cell away from the array's border.
    """
    total = np.zeros((len(place[0]), 3))
    count = np.zeros(len(place[0]))
    for dx in (-1, 0, 1):
        for dy in (-1, 0, 1):
            for dz in (-1, 0, 1):
                if dx == dy == dz == 0:
                    continue
                there = flags[place[0] + dx, place[1] + dy, place[2] + dz]
                count += there
                total += there[:, None] * np.array([dx, dy, dz])
    return total / np.maximum(count, 1.0)[:, None]
