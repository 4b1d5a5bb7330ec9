"""Compiled loops over the blocks of an occupancy map.

A map is a directory, an `(nx, ny, nz)` int32 array of block numbers (-1: no block), whose first
entry is the block at `low`; and per block 512 log-odds, NaN where the cell is unknown. Cell
(i, j, k) is the cube from i * resolution to (i + 1) * resolution along x, and so on: these are
OctoMap's keys without their offset. All loops here visit the cells of a ray in the order of
Amanatides and Woo (1987).
"""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

MISS, HIT, UNKNOWN_MET, OUT_OF_RANGE = 0, 1, 2, 3

Int32Array = NDArray[np.int32]
Float32Array = NDArray[np.float32]
_jit: Any = numba.njit(cache=True, nogil=True, error_model="numpy")


@_jit
def block_at(directory: Any, low: Any, bx: int, by: int, bz: int) -> int:
    """Number of the block at block coordinates, -1 if there is none."""
    x, y, z = bx - low[0], by - low[1], bz - low[2]
    if x < 0 or y < 0 or z < 0:
        return -1
    if x >= directory.shape[0] or y >= directory.shape[1] or z >= directory.shape[2]:
        return -1
    return directory[x, y, z]


@_jit
def cell_in_block(x: int, y: int, z: int) -> int:
    """Position of a cell within its block, 0 to 511."""
    return ((x & 7) << 6) | ((y & 7) << 3) | (z & 7)


@_jit
def make_block(
    directory: Any, low: Any, blocks: Any, log_odds: Any, count: int, bx: int, by: int, bz: int
) -> int:
    """Enters a new, unknown block with number `count`; the directory must reach there."""
    log_odds[count, :] = np.nan
    directory[bx - low[0], by - low[1], bz - low[2]] = count
    blocks[count, 0] = bx
    blocks[count, 1] = by
    blocks[count, 2] = bz
    return count


@_jit
def first_border(origin: float, direction: float, cell: int, resolution: float) -> float:
    """Length along a ray to the first border of its cell on one axis."""
    if direction > 0.0:
        return ((cell + 1) * resolution - origin) / direction
    if direction < 0.0:
        return (cell * resolution - origin) / direction
    return np.inf


@_jit
def sign(value: float) -> int:
    """-1, 0 or 1."""
    return 1 if value > 0.0 else (-1 if value < 0.0 else 0)


@_jit
def cells_to_border(cell: int, step: int) -> int:
    """How many steps lead from a cell out of its block along one axis."""
    return 8 - (cell & 7) if step > 0 else (cell & 7) + 1


@_jit
def steps_before(length: float, border: float, delta: float) -> int:
    """How many borders of one axis a ray has crossed by a length."""
    return 0 if length < border else int((length - border) / delta) + 1


@_jit
def summarise(log_odds: Any, summary: Any) -> None:
    """Per block: bit 1 if a cell is occupied, bit 2 if one is unknown."""
    for b in range(log_odds.shape[0]):
        found = 0
        for c in range(512):
            value = log_odds[b, c]
            if value >= 0.0:
                found |= 1
            elif value != value:
                found |= 2
        summary[b] = found


@_jit
def cast(
    origins: Any,
    directions: Any,
    max_range: float,
    ignore_unknown: bool,
    resolution: float,
    directory: Any,
    low: Any,
    log_odds: Any,
    summary: Any,
    cells: Any,
    lengths: Any,
    outcome: Any,
) -> None:
    """The first occupied cell along each ray; see `OccupancyMap.cast_rays`."""
    for n in range(origins.shape[0]):
        ox, oy, oz = origins[n, 0], origins[n, 1], origins[n, 2]
        ux, uy, uz = directions[n, 0], directions[n, 1], directions[n, 2]
        norm = math.sqrt(ux * ux + uy * uy + uz * uz)
        ux, uy, uz = ux / norm, uy / norm, uz / norm
        x, y, z = (
            math.floor(ox / resolution),
            math.floor(oy / resolution),
            math.floor(oz / resolution),
        )
        sx, sy, sz = sign(ux), sign(uy), sign(uz)
        tx = first_border(ox, ux, x, resolution)
        ty = first_border(oy, uy, y, resolution)
        tz = first_border(oz, uz, z, resolution)
        dx = resolution / abs(ux) if sx != 0 else np.inf
        dy = resolution / abs(uy) if sy != 0 else np.inf
        dz = resolution / abs(uz) if sz != 0 else np.inf
        travelled = 0.0
        outcome[n] = OUT_OF_RANGE
        bx, by, bz = x >> 3, y >> 3, z >> 3
        b = block_at(directory, low, bx, by, bz)
        while travelled <= max_range:
            content = 2 if b < 0 else summary[b]
            if content & 2 and not ignore_unknown:
                content |= 1
            if content & 1 == 0:
                # Nothing to meet in the whole block: leave it at once.
                ex = tx + (cells_to_border(x, sx) - 1) * dx if sx != 0 else np.inf
                ey = ty + (cells_to_border(y, sy) - 1) * dy if sy != 0 else np.inf
                ez = tz + (cells_to_border(z, sz) - 1) * dz if sz != 0 else np.inf
                travelled = min(ex, ey, ez)
                kx = cells_to_border(x, sx) if ex == travelled else steps_before(travelled, tx, dx)
                ky = cells_to_border(y, sy) if ey == travelled else steps_before(travelled, ty, dy)
                kz = cells_to_border(z, sz) if ez == travelled else steps_before(travelled, tz, dz)
                if kx > 0:
                    x += sx * kx
                    tx += kx * dx
                if ky > 0:
                    y += sy * ky
                    ty += ky * dy
                if kz > 0:
                    z += sz * kz
                    tz += kz * dz
            else:
                value = np.float32(np.nan)
                if b >= 0:
                    value = log_odds[b, cell_in_block(x, y, z)]
                if value >= 0.0:
                    outcome[n] = HIT
                    break
                if value != value and not ignore_unknown:
                    outcome[n] = UNKNOWN_MET
                    break
                if tx < ty and tx < tz:
                    travelled = tx
                    x += sx
                    tx += dx
                elif ty < tz and not tx < ty:
                    travelled = ty
                    y += sy
                    ty += dy
                else:
                    travelled = tz
                    z += sz
                    tz += dz
            if x >> 3 != bx or y >> 3 != by or z >> 3 != bz:
                bx, by, bz = x >> 3, y >> 3, z >> 3
                b = block_at(directory, low, bx, by, bz)
        cells[n, 0], cells[n, 1], cells[n, 2] = x, y, z
        lengths[n] = travelled


@_jit
def copy_dense(directory: Any, low: Any, log_odds: Any, first: Any, out: Any) -> None:
    """Copies the log-odds of a dense box of cells that begins at cell `first`."""
    for x in range(out.shape[0]):
        i = first[0] + x
        for y in range(out.shape[1]):
            j = first[1] + y
            for z in range(out.shape[2]):
                k = first[2] + z
                b = block_at(directory, low, i >> 3, j >> 3, k >> 3)
                if b < 0:
                    out[x, y, z] = np.nan
                else:
                    out[x, y, z] = log_odds[b, cell_in_block(i, j, k)]


@_jit
def read_cells(directory: Any, low: Any, log_odds: Any, cells: Any, out: Any) -> None:
    """Log-odds of single cells, NaN where unknown."""
    for n in range(cells.shape[0]):
        i, j, k = cells[n, 0], cells[n, 1], cells[n, 2]
        b = block_at(directory, low, i >> 3, j >> 3, k >> 3)
        out[n] = np.nan if b < 0 else log_odds[b, cell_in_block(i, j, k)]


@_jit
def write_cells(
    directory: Any, low: Any, blocks: Any, log_odds: Any, count: int, cells: Any, values: Any
) -> int:
    """Sets single cells; the directory reaches them and there is room. Returns the block count."""
    for n in range(cells.shape[0]):
        i, j, k = cells[n, 0], cells[n, 1], cells[n, 2]
        b = block_at(directory, low, i >> 3, j >> 3, k >> 3)
        if b < 0:
            b = make_block(directory, low, blocks, log_odds, count, i >> 3, j >> 3, k >> 3)
            count += 1
        log_odds[b, cell_in_block(i, j, k)] = values[n]
    return count
