"""Compiled loops over the blocks of an occupancy map.

A map is a directory, an `(nx, ny, nz)` int32 array of block numbers (-1: no block), whose first
entry is the block at `low`; and per block 512 log-odds, NaN where the cell is unknown. Cell
(i, j, k) is the cube from i * resolution to (i + 1) * resolution along x, and so on: these are
OctoMap's keys without their offset.
"""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

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
