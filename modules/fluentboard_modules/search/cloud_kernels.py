"""Compiled loops from the points of a look to the cells that they lie in, each once.

Some 30 pixels of a camera share a cell of 5 cm. Points are taken a chunk at a time, which stays in
the fastest memory; a small table of the cells met last tells nearly all repetitions.
"""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np

NO_POINT = np.iinfo(np.int32).min
FREE_MARK, HIT_MARK, SEEN_MARK = 1, 2, 4
CELL_MAX = 1 << 30  # cells on either side of the origin
CHUNK = 512
TABLE_BITS = 13

_KEY_BITS = 21
_KEY_MAX = 1 << (_KEY_BITS - 1)  # 52 km at 5 cm
_NO_KEY = -1
_GOLDEN = np.uint64(0x9E3779B97F4A7C15)  # Knuth's multiplicative hashing

_jit: Any = numba.njit(cache=True, nogil=True, error_model="numpy")


@_jit
def distinct_cells(
    values: Any, resolution: float, places: Any, keys: Any, fresh: Any, table: Any, cells: Any,
    box: Any,
) -> int:  # fmt: skip
    """Cells of points, nearly without repetitions.

    Args:
        values: coordinates of the points, flat; a point with NaN or infinity is skipped.
        resolution: of the map.
        places: `(3 * CHUNK,)` int32; room for the cells of a chunk.
        keys: `(CHUNK,)` int64; room for the same in one number each.
        fresh: `(CHUNK,)` int32; room for which of them are new.
        table: `(1 << TABLE_BITS,)` int64; room for the cells met last.
        cells: `(n, 3)` int32, of as many rows as there are points; the first are filled, with
            numbers up to CELL_MAX.
        box: `(2, 3)`; widened to the least and the greatest cell.

    Returns:
        How many cells there are.
    """
    per_metre = 1.0 / resolution
    table[:] = _NO_KEY
    count = values.shape[0] // 3
    kept = 0
    for first in range(0, count, CHUNK):
        points = min(CHUNK, count - first)
        _find_cells(values[3 * first : 3 * (first + points)], per_metre, places)
        is_far = _find_keys(places, points, keys)
        # No branch: a number is always written, and kept by counting it. Most neighbours in an
        # image share a cell; then the table need not be asked.
        changes, last = 0, np.int64(_NO_KEY)
        for n in range(points):
            fresh[changes] = n
            changes += np.int64((keys[n] != last) & (keys[n] != _NO_KEY))
            last = keys[n]
        new = 0
        for change in range(changes):
            n = fresh[change]
            key = keys[np.uint64(n)]
            slot = (np.uint64(key) * _GOLDEN) >> np.uint64(64 - TABLE_BITS)
            fresh[new] = n
            new += np.int64(table[slot] != key)
            table[slot] = key
        for n in range(new):
            at = 3 * np.uint64(fresh[n])
            for axis in range(3):
                cells[kept, axis] = places[at + np.uint64(axis)]
            kept += 1
        if is_far:
            for n in range(points):
                x, y, z = places[3 * n], places[3 * n + 1], places[3 * n + 2]
                if keys[n] == _NO_KEY and min(x, y, z) != NO_POINT:
                    cells[kept, 0], cells[kept, 1], cells[kept, 2] = x, y, z
                    kept += 1
    for n in range(kept):
        for axis in range(3):
            box[0, axis] = min(box[0, axis], cells[n, axis])
            box[1, axis] = max(box[1, axis], cells[n, axis])
    return kept


@_jit
def _find_cells(values: Any, per_metre: float, places: Any) -> None:
    """Cells of coordinates, both flat; NO_POINT for NaN and infinity, clipped to CELL_MAX."""
    most = float(CELL_MAX)
    for n in range(values.shape[0]):
        place = values[n] * per_metre
        place = place if place < most else most
        place = place if place > -most else -most
        places[n] = np.int32(math.floor(place)) if values[n] - values[n] == 0.0 else NO_POINT


@_jit
def _find_keys(places: Any, points: int, keys: Any) -> bool:
    """One number for each cell, _NO_KEY if it is too far for that or no cell; whether one is far.

    Indices are unsigned where the sign would have to be looked at: otherwise there are no vector
    instructions.
    """
    far = np.int64(0)
    for n in range(points):
        at = np.uint64(3) * np.uint64(n)
        x, y, z = places[at], places[at + np.uint64(1)], places[at + np.uint64(2)]
        i, j, k = np.int64(x) + _KEY_MAX, np.int64(y) + _KEY_MAX, np.int64(z) + _KEY_MAX
        beyond = (i | j | k) >> _KEY_BITS
        is_point = np.int64(min(x, min(y, z)) != NO_POINT)
        keys[n] = _NO_KEY if beyond != 0 else (i << (2 * _KEY_BITS)) | (j << _KEY_BITS) | k
        far |= beyond * is_point
    return far != 0


@_jit
def mark_ends(
    cells: Any,
    count: int,
    origin: Any,
    max_range: float,
    resolution: float,
    low: Any,
    shape: Any,
    marks: Any,
    ends: Any,
    is_hit: Any,
) -> int:
    """Leaves in `cells` and `ends` the end of every ray, and in `is_hit` whether it met something.

    Points beyond the range end where it does, without a hit. As in OctoMap with discretisation,
    rays go to the centres of the cells of points, and each cell has one ray.

    Args:
        cells: `(n, 3)` int32; in: cells of points; out: of the ends.
        count: how many points there are.
        origin: `(3,)`; of the sensor.
        max_range: in metres; 0: no limit.
        resolution: of the map.
        low: `(3,)`; first cell of the scratch box.
        shape: `(3,)`; of the scratch box, which all points within the range lie in.
        marks: the scratch box, flat.
        ends: `(n, 3)` float32; filled, in metres.
        is_hit: `(n,)`; filled.

    Returns:
        How many ends there are.
    """
    ox, oy, oz = np.float32(origin[0]), np.float32(origin[1]), np.float32(origin[2])
    reach = np.float32(max_range)
    found = 0
    for n in range(count):
        i, j, k = np.int64(cells[n, 0]), np.int64(cells[n, 1]), np.int64(cells[n, 2])
        x, y, z = i - low[0], j - low[1], k - low[2]
        if 0 <= x < shape[0] and 0 <= y < shape[1] and 0 <= z < shape[2]:
            place = (x * shape[1] + y) * shape[2] + z
            if marks[place] != 0:
                continue
            marks[place] = SEEN_MARK
        px = np.float32((i + 0.5) * resolution)
        py = np.float32((j + 0.5) * resolution)
        pz = np.float32((k + 0.5) * resolution)
        hit = True
        if max_range > 0.0:
            ux, uy, uz = px - ox, py - oy, pz - oz
            length = np.float32(math.sqrt(ux * ux + uy * uy + uz * uz))
            if length > max_range:
                hit = False
                px, py, pz = (
                    ox + ux / length * reach,
                    oy + uy / length * reach,
                    oz + uz / length * reach,
                )
                i = math.floor(px / resolution)
                j = math.floor(py / resolution)
                k = math.floor(pz / resolution)
        ends[found, 0], ends[found, 1], ends[found, 2] = px, py, pz
        cells[found, 0], cells[found, 1], cells[found, 2] = i, j, k
        is_hit[found] = hit
        found += 1
    return found
