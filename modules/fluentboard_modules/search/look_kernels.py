"""Compiled loops that take one look into an occupancy map: its end cells, its rays, its update.

A look is marked on a dense scratch box of cells, one byte each, z running fastest; the box begins
and ends with whole blocks. Only the update touches the map. Rays are walked many at a time, one
step of each after the other: the compiler makes vector instructions of that, without a branch that
the processor could guess wrongly. The cells are those of Amanatides and Woo (1987) in OctoMap's
arithmetic: single precision for directions, double for lengths.
"""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np

from fluentboard_modules.search.occupancy_kernels import (
    block_at,
    make_block,
)
from fluentboard_modules.search.ray_kernels import sign

FREE_MARK, HIT_MARK, SEEN_MARK = 1, 2, 4
NO_POINT = np.iinfo(np.int32).min
CELL_MAX = 1 << 30  # cells on either side of the origin
LANES = 32
WALK_COLUMNS, STEP_COLUMNS = 7, 6

_jit: Any = numba.njit(cache=True, nogil=True, error_model="numpy")


@_jit
def find_cells(values: Any, resolution: float, cells: Any) -> None:
    """Cells of coordinates, both flat; NO_POINT for NaN and infinity, clipped to CELL_MAX."""
    per_metre = 1.0 / resolution
    most = float(CELL_MAX)
    for n in range(values.shape[0]):
        place = values[n] * per_metre
        place = place if place < most else most
        place = place if place > -most else -most
        cells[n] = np.int32(math.floor(place)) if values[n] - values[n] == 0.0 else NO_POINT


@_jit
def drop_repeats(cells: Any, box: Any) -> int:
    """Moves to the front of `cells` `(n, 3)` what is a point and no repetition of the one before.

    Most neighbours in an image share a cell. `box` `(2, 3)` is widened to the least and the
    greatest of what is kept. Returns how many are kept.
    """
    kept = 0
    x0 = y0 = z0 = np.int32(NO_POINT)
    for n in range(cells.shape[0]):
        x, y, z = cells[n, 0], cells[n, 1], cells[n, 2]
        # No branch: the cell is always written, and kept by counting it.
        cells[kept, 0], cells[kept, 1], cells[kept, 2] = x, y, z
        is_point = min(x, min(y, z)) != NO_POINT
        kept += np.int64(is_point & (((x ^ x0) | (y ^ y0) | (z ^ z0)) != 0))
        x0, y0, z0 = x, y, z
    low_x, low_y, low_z = np.int32(box[0, 0]), np.int32(box[0, 1]), np.int32(box[0, 2])
    high_x, high_y, high_z = np.int32(box[1, 0]), np.int32(box[1, 1]), np.int32(box[1, 2])
    for n in range(kept):
        x, y, z = cells[n, 0], cells[n, 1], cells[n, 2]
        low_x, low_y, low_z = min(low_x, x), min(low_y, y), min(low_z, z)
        high_x, high_y, high_z = max(high_x, x), max(high_y, y), max(high_z, z)
    box[0, 0], box[0, 1], box[0, 2] = low_x, low_y, low_z
    box[1, 0], box[1, 1], box[1, 2] = high_x, high_y, high_z
    return kept


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


@_jit
def mark_rays(
    cells: Any,
    ends: Any,
    count: int,
    origin: Any,
    resolution: float,
    low: Any,
    shape: Any,
    marks: Any,
    walk: Any,
    steps: Any,
    places: Any,
    room: Any,
    order: Any,
) -> None:
    """Marks as free what lies between the origin and each end.

    Args:
        cells: `(n, 3)` int32; of the ends.
        ends: `(n, 3)` float32; in metres.
        count: how many of them.
        origin: `(3,)`; of the sensor.
        resolution: of the map.
        low: `(3,)`; first cell of the scratch box.
        shape: `(3,)`; of the scratch box.
        marks: the scratch box, flat.
        walk: `(WALK_COLUMNS * LANES,)`; room for what `_advance` says.
        steps: `(STEP_COLUMNS * LANES,)` int32; likewise.
        places: `(LANES * sum(shape),)` int32; room for the places that rays pass.
        room: `(sum(shape),)` int32; room to sort by numbers of steps.
        order: `(n,)` int32; likewise.
    """
    ox, oy, oz = np.float32(origin[0]), np.float32(origin[1]), np.float32(origin[2])
    x0, y0, z0 = (
        math.floor(ox / resolution),
        math.floor(oy / resolution),
        math.floor(oz / resolution),
    )
    _by_steps(cells, count, x0, y0, z0, room, order)
    row, plane = np.int64(shape[2]), np.int64(shape[1] * shape[2])
    start = (x0 - low[0]) * plane + (y0 - low[1]) * row + z0 - low[2]
    for first in range(0, count, LANES):
        longest = 0
        for lane in range(LANES):
            n = order[min(first + lane, count - 1)]
            x1, y1, z1 = cells[n, 0], cells[n, 1], cells[n, 2]
            ux, uy, uz = ends[n, 0] - ox, ends[n, 1] - oy, ends[n, 2] - oz
            length = np.float32(math.sqrt(ux * ux + uy * uy + uz * uz))
            ux, uy, uz = ux / length, uy / length, uz / length
            sx, sy, sz = sign(ux), sign(uy), sign(uz)
            walk[lane] = _first_border(ox, ux, x0, resolution)
            walk[LANES + lane] = _first_border(oy, uy, y0, resolution)
            walk[2 * LANES + lane] = _first_border(oz, uz, z0, resolution)
            walk[3 * LANES + lane] = resolution / abs(ux) if sx != 0 else np.inf
            walk[4 * LANES + lane] = resolution / abs(uy) if sy != 0 else np.inf
            walk[5 * LANES + lane] = resolution / abs(uz) if sz != 0 else np.inf
            walk[6 * LANES + lane] = length
            steps[lane] = start
            steps[LANES + lane] = sx * plane
            steps[2 * LANES + lane] = sy * row
            steps[3 * LANES + lane] = sz
            # From cell to neighbouring cell, so many steps lead to the end cell.
            left = abs(x1 - x0) + abs(y1 - y0) + abs(z1 - z0)
            steps[4 * LANES + lane] = 1
            steps[5 * LANES + lane] = left if first + lane < count else 0
            longest = max(longest, left)
        for step in range(longest):
            _advance(walk, steps, places, np.uint64(LANES * step))
        for lane in range(LANES):
            for step in range(min(steps[4 * LANES + lane], steps[5 * LANES + lane])):
                marks[places[LANES * step + lane]] = FREE_MARK


@_jit
def _first_border(origin: float, direction: float, cell: int, resolution: float) -> float:
    """Length along a ray to the first border of its cell on one axis.

    OctoMap's half cell is in single precision. Where a ray passes an edge as closely as can be,
    that decides which cell is next.
    """
    half = np.float64(np.float32(0.5 * resolution))
    if direction > 0.0:
        return ((cell + 0.5) * resolution + half - origin) / direction
    if direction < 0.0:
        return ((cell + 0.5) * resolution - half - origin) / direction
    return np.inf


@_jit
def _by_steps(cells: Any, count: int, x0: int, y0: int, z0: int, room: Any, order: Any) -> None:
    """Orders rays by how many steps they take, so that those walked together end together."""
    room[:] = 0
    for n in range(count):
        room[abs(cells[n, 0] - x0) + abs(cells[n, 1] - y0) + abs(cells[n, 2] - z0)] += 1
    before = np.int32(0)
    for steps in range(room.shape[0]):
        here = room[steps]
        room[steps] = before
        before += here
    for n in range(count):
        steps = abs(cells[n, 0] - x0) + abs(cells[n, 1] - y0) + abs(cells[n, 2] - z0)
        order[room[steps]] = n
        room[steps] += 1


@_jit
def _advance(walk: Any, steps: Any, places: Any, at: Any) -> None:
    """One step of many rays, after noting in `places`, from `at` on, where they are.

    `walk` has, lane by lane, the lengths to the next border along x, y and z, those from border to
    border, and the length of the ray; `steps` where it is, what to add for a step along x, y and
    z, and how many steps lie within its length: beyond it, a ray has missed its end cell by
    rounding. Everything is read before anything is chosen, and indices are unsigned where the sign
    would have to be looked at: otherwise there are no vector instructions.
    """
    for lane in range(LANES):
        tx, ty, tz = walk[lane], walk[LANES + lane], walk[2 * LANES + lane]
        dx, dy, dz = walk[3 * LANES + lane], walk[4 * LANES + lane], walk[5 * LANES + lane]
        length = walk[6 * LANES + lane]
        place, within = steps[lane], steps[4 * LANES + lane]
        to_x, to_y, to_z = steps[LANES + lane], steps[2 * LANES + lane], steps[3 * LANES + lane]
        places[at + np.uint64(lane)] = place
        x_first = tx < ty
        nearer = tx if x_first else ty
        z_first = nearer >= tz
        nearest = tz if z_first else nearer
        add_x = dx if x_first else 0.0
        add_y = 0.0 if x_first else dy
        to_next = to_x if x_first else to_y
        to_next = to_z if z_first else to_next
        walk[lane] = tx + (0.0 if z_first else add_x)
        walk[LANES + lane] = ty + (0.0 if z_first else add_y)
        walk[2 * LANES + lane] = tz + (dz if z_first else 0.0)
        steps[lane] = place + to_next
        steps[4 * LANES + lane] = within + (1 if nearest <= length else 0)


@_jit
def mark_hits(cells: Any, count: int, is_hit: Any, low: Any, shape: Any, marks: Any) -> None:
    """Marks the cells of the ends that were hit; a hit wins over the rays through its cell."""
    for n in range(count):
        if is_hit[n]:
            x, y, z = cells[n, 0] - low[0], cells[n, 1] - low[1], cells[n, 2] - low[2]
            marks[(x * shape[1] + y) * shape[2] + z] = HIT_MARK


@_jit
def apply_marks(
    marks: Any,
    low: Any,
    shape: Any,
    first: int,
    directory: Any,
    directory_low: Any,
    blocks: Any,
    log_odds: Any,
    counts: Any,
    hit: float,
    miss: float,
    least: float,
    most: float,
) -> int:
    """Adds hits and misses to marked cells, clamped, and clears the marks.

    Args:
        marks: the scratch box, flat.
        low: `(3,)`; its first cell.
        shape: `(3,)`; its cells, multiples of 8.
        first: where to begin, a number of a block of the box.
        directory: of the map; reaches all of the box.
        directory_low: of the map.
        blocks: of the map.
        log_odds: of the map.
        counts: `(2,)`; blocks of the map, and cells updated so far.
        hit: added to the log-odds of a cell that is hit.
        miss: added to those of a free one.
        least: log-odds of a cell are no lower,
        most: and no higher.

    Returns:
        The first block that is not done because the map has no room for another one.
    """
    words = marks[: shape[0] * shape[1] * shape[2]].view(np.uint64)
    nx, ny, nz = shape[0] >> 3, shape[1] >> 3, shape[2] >> 3
    for number in range(first, nx * ny * nz):
        bx, by, bz = number // (ny * nz), number // nz % ny, number % nz
        found = np.uint64(0)
        for x in range(8 * bx, 8 * bx + 8):
            for y in range(8 * by, 8 * by + 8):
                found |= words[(x * shape[1] + y) * nz + bz]
        if found == 0:
            continue
        kx, ky, kz = bx + (low[0] >> 3), by + (low[1] >> 3), bz + (low[2] >> 3)
        b = block_at(directory, directory_low, kx, ky, kz)
        if b < 0:
            if counts[0] == blocks.shape[0]:
                return number
            b = make_block(directory, directory_low, blocks, log_odds, counts[0], kx, ky, kz)
            counts[0] += 1
        cell = 0
        for x in range(8 * bx, 8 * bx + 8):
            for y in range(8 * by, 8 * by + 8):
                row = (x * shape[1] + y) * nz + bz
                if words[row] != 0:
                    for z in range(8):
                        mark = marks[8 * row + z]
                        if mark & (FREE_MARK | HIT_MARK) != 0:
                            value = log_odds[b, cell + z]
                            if value != value:
                                value = np.float32(0.0)
                            value += hit if mark == HIT_MARK else miss
                            log_odds[b, cell + z] = min(max(value, least), most)
                            counts[1] += 1
                    words[row] = 0
                cell += 8
    return nx * ny * nz
