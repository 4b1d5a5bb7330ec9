"""Compiled loops that take one look into an occupancy map: its rays, and its update.

A look is marked on a dense scratch box of cells, one byte each, z running fastest; the box begins
and ends with whole blocks. Only the update touches the map. Rays are walked many at a time, a few
steps of each after the other: the compiler makes vector instructions of that, without a branch that
the processor could guess wrongly. Indices are unsigned where the sign would have to be looked at.
The cells are those of Amanatides and Woo (1987) in OctoMap's arithmetic: single precision for
directions and log-odds, double for lengths.
"""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np

from fluentboard_modules.search.cloud_kernels import CELL_MAX, FREE_MARK, HIT_MARK
from fluentboard_modules.search.occupancy_kernels import block_at, make_block

LANES = 32
STEPS = 4  # of each ray, before it is the next one's turn
AIM_COLUMNS, WALK_COLUMNS, STEP_COLUMNS = 3, 7, 6

_jit: Any = numba.njit(cache=True, nogil=True, error_model="numpy")
_written_out: Any = numba.njit(inline="always", error_model="numpy")


@_jit
def mark_rays(
    cells: Any, ends: Any, count: int, origin: Any, resolution: float, low: Any, shape: Any,
    marks: Any, aim: Any, walk: Any, steps: Any, places: Any, room: Any, order: Any,
) -> None:  # fmt: skip
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
        aim: `(AIM_COLUMNS * LANES,)` float32; room for the ends of some rays.
        walk: `(WALK_COLUMNS * LANES,)`; room for what `_advance` says.
        steps: `(STEP_COLUMNS * LANES,)` int32; likewise.
        places: `(STEPS * LANES,)` int32; room for the places that they pass.
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
    row, plane = shape[2], shape[1] * shape[2]
    start = (x0 - low[0]) * plane + (y0 - low[1]) * row + z0 - low[2]
    for first in range(0, count, LANES):
        for lane in range(LANES):
            n = order[min(first + lane, count - 1)]
            aim[lane], aim[LANES + lane], aim[2 * LANES + lane] = ends[n, 0], ends[n, 1], ends[n, 2]
            # From cell to neighbouring cell, so many steps lead to the end cell.
            left = abs(cells[n, 0] - x0) + abs(cells[n, 1] - y0) + abs(cells[n, 2] - z0)
            steps[5 * LANES + lane] = left
        _set_out(aim, walk, steps, ox, oy, oz, x0, y0, z0, resolution, start, row, plane)
        shortest, longest = steps[5 * LANES], steps[6 * LANES - 1]
        for step in range(0, longest, STEPS):
            within = _advance(walk, steps, places)
            if step + STEPS <= min(within, shortest):
                for n in range(LANES * STEPS):
                    marks[np.uint64(places[n])] = FREE_MARK
            else:
                for lane in range(LANES):
                    ahead = min(steps[4 * LANES + lane], steps[5 * LANES + lane]) - step
                    for n in range(min(ahead, STEPS)):
                        marks[np.uint64(places[LANES * n + lane])] = FREE_MARK


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
def _set_out(
    aim: Any, walk: Any, steps: Any, ox: float, oy: float, oz: float, x0: int, y0: int, z0: int,
    resolution: float, start: int, row: int, plane: int,
) -> None:  # fmt: skip
    """Puts rays to the ends `aim` at their origin; `walk` and `steps` are those of `_advance`."""
    for lane in range(LANES):
        ux, uy, uz = aim[lane] - ox, aim[LANES + lane] - oy, aim[2 * LANES + lane] - oz
        length = np.float32(math.sqrt(ux * ux + uy * uy + uz * uz))
        ux, uy, uz = ux / length, uy / length, uz / length
        walk[lane] = _first_border(ox, ux, x0, resolution)
        walk[LANES + lane] = _first_border(oy, uy, y0, resolution)
        walk[2 * LANES + lane] = _first_border(oz, uz, z0, resolution)
        # Infinite on an axis that the ray does not move on.
        walk[3 * LANES + lane] = resolution / abs(ux)
        walk[4 * LANES + lane] = resolution / abs(uy)
        walk[5 * LANES + lane] = resolution / abs(uz)
        walk[6 * LANES + lane] = length
        steps[lane] = start
        steps[LANES + lane] = plane if ux > 0.0 else -plane
        steps[2 * LANES + lane] = row if uy > 0.0 else -row
        steps[3 * LANES + lane] = 1 if uz > 0.0 else -1
        steps[4 * LANES + lane] = 1


@_jit
def _first_border(origin: float, direction: float, cell: int, resolution: float) -> float:
    """Length along a ray to the first border of its cell on one axis.

    OctoMap's half cell is in single precision. Where a ray passes an edge as closely as can be,
    that decides which cell is next.
    """
    half = np.float64(np.float32(0.5 * resolution))
    side = half if direction > 0.0 else -half
    length = ((cell + 0.5) * resolution + side - origin) / direction
    return length if direction != 0.0 else np.inf


@_written_out
def _advance(walk: Any, steps: Any, places: Any) -> int:
    """Some steps of many rays, noting in `places` where they are before each.

    `walk` has, lane by lane, the lengths to the next border along x, y and z, those from border to
    border, and the length of the ray; `steps` where it is, what to add for a step along x, y and
    z, and how many steps lie within its length: beyond it, a ray has missed its end cell by
    rounding. Everything is read before anything is chosen: otherwise there are no vector
    instructions. Returns how many steps lie within the length of every ray.
    """
    least = np.int32(CELL_MAX)
    for lane in range(LANES):
        tx, ty, tz = walk[lane], walk[LANES + lane], walk[2 * LANES + lane]
        dx, dy, dz = walk[3 * LANES + lane], walk[4 * LANES + lane], walk[5 * LANES + lane]
        length = walk[6 * LANES + lane]
        place, within = steps[lane], steps[4 * LANES + lane]
        to_x, to_y, to_z = steps[LANES + lane], steps[2 * LANES + lane], steps[3 * LANES + lane]
        for step in range(STEPS):
            places[np.uint64(LANES * step) + np.uint64(lane)] = place
            x_first = tx < ty
            nearer = tx if x_first else ty
            z_first = nearer >= tz
            nearest = tz if z_first else nearer
            add_x = dx if x_first else 0.0
            add_y = 0.0 if x_first else dy
            to_next = to_x if x_first else to_y
            place += to_z if z_first else to_next
            tx += 0.0 if z_first else add_x
            ty += 0.0 if z_first else add_y
            tz += dz if z_first else 0.0
            within += np.int32(1) if nearest <= length else np.int32(0)
        walk[lane], walk[LANES + lane], walk[2 * LANES + lane] = tx, ty, tz
        steps[lane], steps[4 * LANES + lane] = place, within
        least = min(least, within)
    return least


@_jit
def mark_hits(cells: Any, count: int, is_hit: Any, low: Any, shape: Any, marks: Any) -> None:
    """Marks the cells of the ends that were hit; a hit wins over the rays through its cell."""
    for n in range(count):
        if is_hit[n]:
            x, y, z = cells[n, 0] - low[0], cells[n, 1] - low[1], cells[n, 2] - low[2]
            marks[(x * shape[1] + y) * shape[2] + z] = HIT_MARK


@_jit
def apply_marks(
    marks: Any, low: Any, shape: Any, first: int, directory: Any, directory_low: Any, blocks: Any,
    log_odds: Any, counts: Any, hit: Any, miss: Any, least: Any, most: Any,
) -> int:  # fmt: skip
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
        hit: float32; added to the log-odds of a cell that is hit.
        miss: added to those of a free one.
        least: log-odds of a cell are no lower,
        most: and no higher.

    Returns:
        The first block that is not done because the map has no room for another one.
    """
    words = marks[: shape[0] * shape[1] * shape[2]].view(np.uint64)
    cells = log_odds.reshape(-1)
    ny, nz = shape[1] >> 3, shape[2] >> 3
    last = (shape[0] >> 3) * ny * nz
    for number in range(first, last):
        bx, by, bz = number // (ny * nz), number // nz % ny, number % nz
        corner = 8 * (bx * shape[1] + by) * nz + bz
        found = np.uint64(0)
        for x in range(8):
            for y in range(8):
                found |= words[np.uint64(corner + (x * shape[1] + y) * nz)]
        if found == 0:
            continue
        kx, ky, kz = bx + (low[0] >> 3), by + (low[1] >> 3), bz + (low[2] >> 3)
        b = block_at(directory, directory_low, kx, ky, kz)
        if b < 0:
            if counts[0] == blocks.shape[0]:
                return number
            b = make_block(directory, directory_low, blocks, log_odds, counts[0], kx, ky, kz)
            counts[0] += 1
        at = np.uint64(512 * b)
        updated = 0
        for x in range(8):
            for y in range(8):
                word = np.uint64(corner + (x * shape[1] + y) * nz)
                if words[word] != 0:
                    for z in range(8):
                        mark = marks[np.uint64(8) * word + np.uint64(z)]
                        before = cells[at + np.uint64(z)]
                        value = before if before == before else np.float32(0.0)
                        value += hit if mark == HIT_MARK else miss
                        value = min(max(value, least), most)
                        is_met = (mark & (FREE_MARK | HIT_MARK)) != 0
                        cells[at + np.uint64(z)] = value if is_met else before
                        updated += np.int64(is_met)
                    words[word] = 0
                at += np.uint64(8)
        counts[1] += updated
    return last
