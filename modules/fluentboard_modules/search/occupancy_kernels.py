"""Compiled loops over the blocks of an occupancy map.

A map is a directory, an `(nx, ny, nz)` int32 array of block numbers (-1: no block), whose first
entry is the block at `low`; and per block 512 log-odds, NaN where the cell is unknown. Cell
(i, j, k) is the cube from i * resolution to (i + 1) * resolution along x, and so on: these are
OctoMap's keys without their offset.
"""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from fluentboard_modules.search.ray_kernels import along_axis, next_block, next_cell

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
) -> int:
    """The first occupied cell along each ray; see `OccupancyMap.cast_rays`.

    Returns:
        Number of a ray without a direction, -1 if all have one.
    """
    per_metre = 1.0 / resolution
    shared = origins.shape[0] == 1
    nx, ny, nz = directory.shape
    lx, ly, lz = low[0], low[1], low[2]
    # One look-up instead of two that wait for each other.
    contents = np.zeros((nx, ny, nz), np.uint8)
    for i in range(nx):
        for j in range(ny):
            for k in range(nz):
                b = directory[i, j, k]
                content = 2 if b < 0 else summary[b]
                contents[i, j, k] = content | 1 if content & 2 and not ignore_unknown else content
    outside = 2 if ignore_unknown else 3
    for n in range(directions.shape[0]):
        m = 0 if shared else n
        ox, oy, oz = origins[m, 0], origins[m, 1], origins[m, 2]
        ux, uy, uz = directions[n, 0], directions[n, 1], directions[n, 2]
        squared = ux * ux + uy * uy + uz * uz
        if not squared > 0.0:
            return n
        unit = 1.0 / math.sqrt(squared)
        ux, uy, uz = ux * unit, uy * unit, uz * unit
        x, sx, tx, dx, ix = along_axis(ox, ux, resolution, per_metre)
        y, sy, ty, dy, iy = along_axis(oy, uy, resolution, per_metre)
        z, sz, tz, dz, iz = along_axis(oz, uz, resolution, per_metre)
        travelled = 0.0
        found = OUT_OF_RANGE
        while travelled <= max_range:
            bx, by, bz = (x >> 3) - lx, (y >> 3) - ly, (z >> 3) - lz
            is_inside = 0 <= bx < nx and 0 <= by < ny and 0 <= bz < nz
            content = contents[bx, by, bz] if is_inside else outside
            if content & 1 == 0:
                # Nothing to meet in the whole block: leave it at once.
                x, y, z, tx, ty, tz, travelled = next_block(
                    x, y, z, sx, sy, sz, tx, ty, tz, dx, dy, dz, ix, iy, iz
                )
            else:
                b = directory[bx, by, bz] if is_inside else -1
                if b < 0:
                    found = UNKNOWN_MET
                    break
                # Cell by cell, until the ray leaves the block.
                i, j, k = x & 7, y & 7, z & 7
                while (i | j | k) & ~7 == 0 and travelled <= max_range:
                    value = log_odds[b, (i << 6) | (j << 3) | k]
                    if value >= 0.0:
                        found = HIT
                        break
                    if value != value and not ignore_unknown:
                        found = UNKNOWN_MET
                        break
                    i, j, k, tx, ty, tz, travelled = next_cell(
                        i, j, k, sx, sy, sz, tx, ty, tz, dx, dy, dz
                    )
                x, y, z = (x & ~7) + i, (y & ~7) + j, (z & ~7) + k
                if found != OUT_OF_RANGE:
                    break
        cells[n, 0], cells[n, 1], cells[n, 2] = x, y, z
        lengths[n] = travelled
        outcome[n] = found
    return -1


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
