"""Compiled steps of a ray through cells and blocks (Amanatides and Woo 1987).

A ray is where it is, cell `(x, y, z)`; the lengths to the next border along each axis,
`(tx, ty, tz)`; the signs of its steps; and the lengths `(dx, dy, dz)` from border to border with
their inverses. It goes from block to block by the same steps, and from cell to cell in those blocks
only that have something for it. All functions here are written out at their place of use: they are
the inner loops of who casts rays and of who asks what a view reveals. (`look_kernels` walks many
rays at a time, in vector instructions, and in OctoMap's arithmetic.)
"""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np

_jit: Any = numba.njit(cache=True, nogil=True, error_model="numpy")
_written_out: Any = numba.njit(inline="always", error_model="numpy")


@_jit
def sign(value: float) -> int:
    """-1, 0 or 1."""
    return 1 if value > 0.0 else (-1 if value < 0.0 else 0)


@_written_out
def along_axis(origin: float, direction: float, resolution: float, per_metre: float) -> Any:
    """A ray on one axis: its cell, sign, first border, length between borders and its inverse."""
    cell = math.floor(origin * per_metre)
    step = sign(direction)
    if step == 0:
        return cell, 0, np.inf, np.inf, 0.0
    length = 1.0 / abs(direction)
    border = cell + 1 if step > 0 else cell
    first = abs(border * resolution - origin) * length
    return cell, step, first, resolution * length, abs(direction) * per_metre


@_written_out
def next_cell(
    x: int, y: int, z: int, sx: int, sy: int, sz: int, tx: float, ty: float, tz: float,
    dx: float, dy: float, dz: float,
) -> Any:  # fmt: skip
    """The neighbouring cell, the borders ahead of it, and the length at which it is entered."""
    if tx < ty and tx < tz:
        return x + sx, y, z, tx + dx, ty, tz, tx
    if ty < tz and not tx < ty:
        return x, y + sy, z, tx, ty + dy, tz, ty
    return x, y, z + sz, tx, ty, tz + dz, tz


@_written_out
def end_of_block(cell: int, step: int, border: float, length: float) -> float:
    """Way to the border of a block of 8 x 8 x 8 cells along one axis; see `along_axis`."""
    return np.inf if step == 0 else border + (cells_to_border(cell, step) - 1) * length


@_written_out
def enter_block(
    block: int, travelled: float, cell: int, step: int, border: float, length: float,
    per_length: float,
) -> Any:  # fmt: skip
    """Where a ray is in a block that it enters, 0 to 7, and the way to the next border, on an axis.

    Rounding must not put it into another block.
    """
    passed = 0 if travelled < border else int((travelled - border) * per_length) + 1
    now = min(max(cell + step * passed, 8 * block), 8 * block + 7)
    return now & 7, (np.inf if step == 0 else border + abs(now - cell) * length)


@_jit
def cells_to_border(cell: int, step: int) -> int:
    """How many steps lead from a cell out of its block along one axis."""
    return 8 - (cell & 7) if step > 0 else (cell & 7) + 1
