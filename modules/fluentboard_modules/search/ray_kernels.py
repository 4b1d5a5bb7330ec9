"""Compiled steps of a ray through cells and blocks (Amanatides and Woo 1987).

A ray is where it is, cell `(x, y, z)`; the lengths to the next border along each axis,
`(tx, ty, tz)`; the signs of its steps; and the lengths `(dx, dy, dz)` from border to border with
their inverses. All functions here are written out at their place of use: they are the inner loops
of who casts rays and of who asks what a view reveals.
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
def next_block(
    x: int, y: int, z: int, sx: int, sy: int, sz: int, tx: float, ty: float, tz: float,
    dx: float, dy: float, dz: float, ix: float, iy: float, iz: float,
) -> Any:  # fmt: skip
    """The first cell outside of this block of 8 x 8 x 8 cells, as `next_cell` has it."""
    nx = cells_to_border(x, sx)
    ny = cells_to_border(y, sy)
    nz = cells_to_border(z, sz)
    ex = tx + (nx - 1) * dx if sx != 0 else np.inf
    ey = ty + (ny - 1) * dy if sy != 0 else np.inf
    ez = tz + (nz - 1) * dz if sz != 0 else np.inf
    at = min(ex, ey, ez)
    kx = nx if ex == at else (0 if at < tx else int((at - tx) * ix) + 1)
    ky = ny if ey == at else (0 if at < ty else int((at - ty) * iy) + 1)
    kz = nz if ez == at else (0 if at < tz else int((at - tz) * iz) + 1)
    # Along an axis that the ray does not move on, there is nothing to add to infinity.
    return (
        x + sx * kx,
        y + sy * ky,
        z + sz * kz,
        tx + kx * dx if kx > 0 else tx,
        ty + ky * dy if ky > 0 else ty,
        tz + kz * dz if kz > 0 else tz,
        at,
    )


@_jit
def cells_to_border(cell: int, step: int) -> int:
    """How many steps lead from a cell out of its block along one axis."""
    return 8 - (cell & 7) if step > 0 else (cell & 7) + 1
