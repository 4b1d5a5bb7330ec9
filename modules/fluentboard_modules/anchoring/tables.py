"""Tops over many frames: what is hidden in one view was seen in another."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fluentboard.model.geometry import BoundingBox
from fluentboard_modules.anchoring.config import SupportConfig
from fluentboard_modules.anchoring.supports import Raster, Top

_LEAST_OVERLAP = 0.3  # of the smaller region
_BELIEVED_VIEWS = 3  # poses drift: cells seen more rarely are no part of the outline yet
_BELIEVED_SHARE = 0.15


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """A top that has been seen, or that the board knows.

    Attributes:
        views: `(nx, ny)` int32; how often each cell was seen as part of it.
        origin: index of the first cell.
        cell_m: size of a cell.
        height_m: of the last view, at the centre.
        frames: how many frames have shown it.
        name: of its placing area on the board, or empty.
        known: the region that the board gives; None if it is not from there.
    """

    views: NDArray[np.int32]
    origin: tuple[int, int]
    cell_m: float
    height_m: float
    frames: int
    name: str = ""
    known: Raster | None = None

    @property
    def raster(self) -> Raster:
        """Where it is believed to extend."""
        least = min(_BELIEVED_VIEWS, max(1.0, _BELIEVED_SHARE * self.frames))
        inside = self.views >= least
        if self.known is None:
            return Raster(inside, self.origin, self.cell_m)
        return _united(Raster(inside, self.origin, self.cell_m), self.known)


class TableMap:
    """Remembers tops, and completes those of a frame by what was seen before."""

    def __init__(self, config: SupportConfig) -> None:
        self._config = config
        self._tables: list[Table] = []

    @property
    def tables(self) -> Sequence[Table]:
        """All tops seen so far."""
        return self._tables

    def know(self, name: str, box: BoundingBox) -> None:
        """Takes over a placing area from the board.

        Args:
            name: of its fluent.
            box: its extent in the map; the top is at its bottom.
        """
        cell = self._config.cell_m
        corners = box.corners()[:, :2]
        low = np.floor(corners.min(axis=0) / cell).astype(np.int64)
        high = np.floor(corners.max(axis=0) / cell).astype(np.int64)
        nx, ny = (high - low + 1).tolist()
        grid = np.stack(np.meshgrid(np.arange(nx), np.arange(ny), indexing="ij"), axis=-1)
        flat = (grid + 0.5 + low) * cell
        local = (flat - (box.pose.x, box.pose.y)) @ _turn(box.pose.yaw_rad)
        # Areas are rectangles around what was seen of a top; beyond its real edge stand chairs.
        half = np.maximum(0.5 * box.sizes[:2] - self._config.area_margin_m, 0.0)
        inside = np.all(np.abs(local) <= half, axis=-1)
        origin = (int(low[0]), int(low[1]))
        bottom = box.pose.z - 0.5 * box.z_size
        self._tables = [table for table in self._tables if table.name != name]
        views = np.zeros((nx, ny), dtype=np.int32)
        raster = Raster(inside, origin, cell)
        self._tables.append(Table(views, origin, cell, bottom, 0, name, raster))

    def forget(self, name: str) -> None:
        """Drops a placing area that the board has ended."""
        self._tables = [
            replace(table, name="", known=None) if table.name == name else table
            for table in self._tables
            if table.name != name or table.frames > 0
        ]

    def complete(self, tops: Sequence[Top]) -> list[Top]:
        """The tops of a frame with the outlines and names that are known of them.

        A small one is left out, unless it belongs to a table that is known.
        """
        completed: list[Top] = []
        for top in tops:
            index = self._find(top)
            if index is None:
                if top.raster.area_m2 >= self._config.area_min_m2:
                    self._tables.append(_new(top))
                    completed.append(top)
                continue
            table = _seen(self._tables[index], top)
            self._tables[index] = table
            completed.append(
                replace(top, raster=_united(top.raster, table.raster), name=table.name)
            )
        return completed

    def _find(self, top: Top) -> int | None:
        """The table that a top belongs to; None if it is a new one."""
        rated: list[tuple[float, int]] = []
        for index, table in enumerate(self._tables):
            region = table.raster if table.raster.inside.any() else None
            if region is None:
                continue
            overlap = _overlap(top.raster, region)
            if overlap.any_m2 < _LEAST_OVERLAP * min(top.raster.area_m2, region.area_m2):
                continue
            height = float(top.height_at(overlap.centre_map[None])[0])
            # The board's areas may stem from another day's floor.
            allowed = self._config.same_height_m * (2.0 if table.frames == 0 else 1.0)
            if abs(height - table.height_m) < allowed:
                rated.append((overlap.any_m2, index))
        return max(rated)[1] if rated else None


@dataclass(frozen=True, slots=True, eq=False)
class _Overlap:
    any_m2: float
    centre_map: NDArray[np.float64]


def _overlap(a: Raster, b: Raster) -> _Overlap:
    cells = np.argwhere(a.inside) + a.origin - np.array(b.origin)
    within = np.all((cells >= 0) & (cells < b.inside.shape), axis=1)
    cells = cells[within]
    common = cells[b.inside[tuple(cells.T)]]
    if not len(common):
        return _Overlap(0.0, np.zeros(2))
    centre = (common.mean(axis=0) + b.origin + 0.5) * b.cell_m
    return _Overlap(len(common) * a.cell_m**2, centre)


def _new(top: Top) -> Table:
    raster = top.raster
    return Table(
        raster.inside.astype(np.int32),
        raster.origin,
        raster.cell_m,
        float(top.height_at(raster.centre()[None])[0]),
        frames=1,
    )


def _seen(table: Table, top: Top) -> Table:
    """The table after one more view."""
    window = _window(table.origin, table.views.shape, top.raster.origin, top.raster.inside.shape)
    views = np.zeros(window.shape, dtype=np.int32)
    views[window.first] = table.views
    views[window.second] += top.raster.inside
    height = float(top.height_at(top.raster.centre()[None])[0])
    # A slow mean: single views are some centimetres off.
    weight = 1.0 / min(table.frames + 1, 10)
    return replace(
        table,
        views=views,
        origin=window.origin,
        height_m=table.height_m + weight * (height - table.height_m),
        frames=table.frames + 1,
    )


def _united(a: Raster, b: Raster) -> Raster:
    window = _window(a.origin, a.inside.shape, b.origin, b.inside.shape)
    inside = np.zeros(window.shape, dtype=bool)
    inside[window.first] |= a.inside
    inside[window.second] |= b.inside
    return Raster(inside, window.origin, a.cell_m)


@dataclass(frozen=True, slots=True)
class _Window:
    origin: tuple[int, int]
    shape: tuple[int, int]
    first: tuple[slice, slice]
    second: tuple[slice, slice]


def _window(
    origin_a: tuple[int, int],
    shape_a: tuple[int, ...],
    origin_b: tuple[int, int],
    shape_b: tuple[int, ...],
) -> _Window:
    """The smallest window around two, and where each lies in it."""
    low = (min(origin_a[0], origin_b[0]), min(origin_a[1], origin_b[1]))
    high = [max(origin_a[k] + shape_a[k], origin_b[k] + shape_b[k]) for k in (0, 1)]

    def part(origin: tuple[int, int], shape: tuple[int, ...]) -> tuple[slice, slice]:
        i, j = origin[0] - low[0], origin[1] - low[1]
        return slice(i, i + shape[0]), slice(j, j + shape[1])

    return _Window(
        low, (high[0] - low[0], high[1] - low[1]), part(origin_a, shape_a), part(origin_b, shape_b)
    )


def _turn(yaw_rad: float) -> NDArray[np.float64]:
    """`(2, 2)`; takes row vectors of the map to the axes of a box turned by the yaw."""
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    return np.array([[cos, -sin], [sin, cos]])
