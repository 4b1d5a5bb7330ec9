"""Compiled loops that cast rays into an occupancy map.

A ray goes from block to block, and from cell to cell only where a block has something to meet: one
bit for each cell says what, 64 bytes for each block, so that all of a building's bits stay in fast
memory.
"""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np

from fluentboard_modules.search.ray_kernels import (
    along_axis,
    end_of_block,
    enter_block,
    next_cell,
)

HIT, UNKNOWN_MET, OUT_OF_RANGE = 1, 2, 3
NOTHING, ANYTHING = -1, -2
"""Instead of a block's number: a ray passes, and a ray stops at once."""

_jit: Any = numba.njit(cache=True, nogil=True, error_model="numpy")


@_jit
def find_stops(log_odds: Any, stops_at_unknown: bool, stops: Any) -> None:
    """Fills `stops` `(blocks, 8)` uint64 with a bit for each cell, set if a ray ends there.

    Cells of the same x share a number; in it, z runs fastest.
    """
    for b in range(log_odds.shape[0]):
        for x in range(8):
            found = np.uint64(0)
            for n in range(64):
                value = log_odds[b, 64 * x + n]
                is_stop = (value >= 0.0) | (stops_at_unknown & (value != value))
                found |= np.uint64(is_stop) << np.uint64(n)
            stops[b, x] = found


@_jit
def find_meetings(directory: Any, stops: Any, outside: int, meetings: Any) -> None:
    """Fills `meetings`, shaped like the directory, with the blocks that a ray must look into.

    NOTHING stands for the others, and `outside` where there is no block.
    """
    nx, ny, nz = directory.shape
    for i in range(nx):
        for j in range(ny):
            for k in range(nz):
                b = directory[i, j, k]
                met = outside
                if b >= 0:
                    found = np.uint64(0)
                    for x in range(8):
                        found |= stops[b, x]
                    met = b if found != 0 else NOTHING
                meetings[i, j, k] = met


@_jit
def cast(
    origins: Any, directions: Any, max_range: float, resolution: float, meetings: Any, low: Any,
    outside: int, stops: Any, log_odds: Any, cells: Any, lengths: Any, outcome: Any,
) -> int:  # fmt: skip
    """The first cell along each ray where it stops; see `OccupancyMap.cast_rays`.

    Args:
        origins: `(n, 3)`, or `(1, 3)` for all.
        directions: `(n, 3)`; of any length.
        max_range: how far rays go.
        resolution: of the map.
        meetings: see `find_meetings`.
        low: `(3,)`; block coordinates of its first entry.
        outside: what a ray meets beyond it, NOTHING or ANYTHING.
        stops: see `find_stops`.
        log_odds: of the map.
        cells: `(n, 3)`; filled, with the last cells.
        lengths: `(n,)`; filled, with the way to their borders.
        outcome: `(n,)`; filled.

    Returns:
        Number of a ray without a direction, -1 if all have one.
    """
    per_metre = 1.0 / resolution
    shared = origins.shape[0] == 1
    nx, ny, nz = [np.uint64(size) for size in meetings.shape]
    lx, ly, lz = low[0], low[1], low[2]
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
        # The same for blocks as for cells.
        bx, by, bz = x >> 3, y >> 3, z >> 3
        ex = end_of_block(x, sx, tx, dx)
        ey = end_of_block(y, sy, ty, dy)
        ez = end_of_block(z, sz, tz, dz)
        travelled = 0.0
        found = OUT_OF_RANGE
        i = j = k = 0
        while True:
            # Unsigned, what lies before the first is beyond the last.
            px, py, pz = np.uint64(bx - lx), np.uint64(by - ly), np.uint64(bz - lz)
            met = meetings[px, py, pz] if (px < nx) & (py < ny) & (pz < nz) else outside
            if met != NOTHING or travelled > max_range:
                i, cx = enter_block(bx, travelled, x, sx, tx, dx, ix)
                j, cy = enter_block(by, travelled, y, sy, ty, dy, iy)
                k, cz = enter_block(bz, travelled, z, sz, tz, dz, iz)
                if travelled > max_range:
                    break
                if met == ANYTHING:
                    found = UNKNOWN_MET
                    break
                # Cell by cell, until the ray leaves the block.
                while (i | j | k) & ~7 == 0 and travelled <= max_range:
                    stops_here = stops[np.uint64(met), np.uint64(i)] >> np.uint64((j << 3) | k)
                    if stops_here & np.uint64(1):
                        is_occupied = log_odds[met, (i << 6) | (j << 3) | k] >= 0.0
                        found = HIT if is_occupied else UNKNOWN_MET
                        break
                    i, j, k, cx, cy, cz, travelled = next_cell(
                        i, j, k, sx, sy, sz, cx, cy, cz, dx, dy, dz
                    )
                if found != OUT_OF_RANGE or travelled > max_range:
                    break
            bx, by, bz, ex, ey, ez, travelled = next_cell(
                bx, by, bz, sx, sy, sz, ex, ey, ez, 8.0 * dx, 8.0 * dy, 8.0 * dz
            )
        cells[n, 0], cells[n, 1], cells[n, 2] = 8 * bx + i, 8 * by + j, 8 * bz + k
        lengths[n] = travelled
        outcome[n] = found
    return -1
