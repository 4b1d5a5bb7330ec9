"""Transition times between views: driving, lifting, turning the head, and the look itself.

The motion model is that of the robot (`RobotModel.transition_time_s`); this file evaluates it for
all pairs at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from fluentboard.model.geometry import FloatArray
from fluentboard_modules.search import route_kernels as kernels
from fluentboard_modules.search.route_sweeps import SweepGraph
from fluentboard_modules.simulation.navigation import INSCRIBED, Costmap, cell_prices
from fluentboard_modules.simulation.robots import DRIVES_FROM_M, RobotModel, View

_LEAST_PRICE = 50.0  # navfn's cost of a free cell
_SWEPT_FROM = 6  # sources
_CELLS_MAX = 400_000  # 1,000 m2 of free floor at 5 cm: 51 MB of costs
_MERGED_MAX = 4  # cells of 20 cm at 5 cm: no obstacle, made wider by a robot's radius, is as thin
_CLUSTERS = 50  # Table 5.1
_SWEEPS_MAX = 60  # of some ten in rooms; about what the search by buckets takes


class Routes:
    """The cheapest ways over a costmap.

    In maps as large as some rooms they are exact. In larger ones the cells are merged by two or
    four along each axis, a merged cell being free if one of them is, at their mean price: ways
    come out 1 % too dear or too cheap on average, and what is unreachable stays so. If that does
    not do, places are clustered as in Section 5.2.2.

    Args:
        costmap: where the base can drive.
        clusters: plan ways between so many representatives only, and guess those of the places
            near them. None: as many as the thesis has, if the map is too large for anything else.
        cells_max: so many free cells are not too large.
    """

    def __init__(
        self, costmap: Costmap, clusters: int | None = None, cells_max: int = _CELLS_MAX
    ) -> None:
        price = cell_prices(costmap)
        merged = 1
        while np.count_nonzero(np.isfinite(price)) > cells_max and merged < _MERGED_MAX:
            price = _halved(price)
            merged *= 2
        if clusters is None and np.count_nonzero(np.isfinite(price)) > cells_max:
            clusters = _CLUSTERS
        price = np.pad(price, 1, constant_values=np.inf)
        self._costmap = costmap
        self._clusters = clusters
        self._cells_max = cells_max
        self._merged = merged
        self._columns = price.shape[1]
        self._price = price.ravel()
        self._width = merged * _LEAST_PRICE
        longest = 2.0**0.5 * float(price[np.isfinite(price)].max(initial=self._width))
        self._buckets = int(longest / self._width) + 3

    def among(self, places: FloatArray) -> FloatArray:
        """`(n, n)`; costs of the ways between places `(n, 2)`, infinite where there is none."""
        cell = self._cells(places)
        if self._clusters is None:
            return self._table(cell)
        group = _clustered(places, cell >= 0, self._clusters)
        return self._guessed(places, group, self._table(cell[group]))

    def _guessed(
        self, places: FloatArray, group: NDArray[np.int64], costs: FloatArray
    ) -> FloatArray:
        """Costs between places by those between their representatives.

        The detour between two places is taken to be that between their representatives; within a
        cluster there is none.
        """
        away = np.linalg.norm(places[:, None] - places[None], axis=2)
        between = away[np.ix_(group, group)]
        straight = away * (_LEAST_PRICE / self._costmap.resolution_m)
        detour = np.divide(costs, between, out=np.zeros_like(costs), where=between > 0.0)
        reachable = np.isfinite(costs)
        guessed = np.where(between > 0.0, np.where(reachable, detour, 0.0) * away, straight)
        return np.where(reachable, guessed, np.inf)

    def _table(self, cell: NDArray[np.int64]) -> FloatArray:
        """`(n, n)`; costs of the ways between cells; -1 is no cell, and no way leads there."""
        chosen, number = np.unique(cell, return_inverse=True)
        first = int(np.searchsorted(chosen, 0))  # what is not free comes before
        free = chosen[first:]
        table = np.full((len(chosen), len(chosen)), np.inf)
        swept = self._swept(free, free)
        if swept is None:
            kernels.path_cost_table(
                self._price, self._columns, free, self._width, self._buckets, self._price.size,
                table[first:, first:],
            )  # fmt: skip
        else:
            # There and back the same costs are added up in another order.
            table[first:, first:] = np.minimum(swept, swept.T)
        return table[np.ix_(number, number)]

    def between(self, sources: FloatArray, goals: FloatArray) -> FloatArray:
        """`(n, m)`; costs of the ways from places `(n, 2)` to places `(m, 2)`."""
        start, goal = self._cells(sources), self._cells(goals)
        table = np.full((len(start), len(goal)), np.inf)
        here, there = np.flatnonzero(start >= 0), np.flatnonzero(goal >= 0)
        swept = self._swept(start[here], goal[there])
        if swept is None:
            swept = np.full((len(here), len(there)), np.inf)
            kernels.path_costs_between(
                self._price, self._columns, start[here], goal[there], self._width, self._buckets,
                self._price.size, swept,
            )  # fmt: skip
        table[np.ix_(here, there)] = swept
        return table

    def _swept(self, sources: NDArray[np.int64], goals: NDArray[np.int64]) -> FloatArray | None:
        """Costs by sweeps; None where buckets are better: few sources, large maps, mazes."""
        if len(sources) < _SWEPT_FROM or self._graph.size > self._cells_max:
            return None
        return self._graph.costs(sources, goals, _SWEEPS_MAX)

    @cached_property
    def _graph(self) -> SweepGraph:
        return SweepGraph(self._price.reshape(-1, self._columns))

    def _cells(self, places: FloatArray) -> NDArray[np.int64]:
        """`(n,)`; numbers of the cells of places, -1 where the base cannot stand."""
        costmap = self._costmap
        rows, columns = costmap.cost.shape
        row = np.floor((places[:, 1] - costmap.origin[1]) / costmap.resolution_m).astype(np.int64)
        column = np.floor((places[:, 0] - costmap.origin[0]) / costmap.resolution_m)
        column = column.astype(np.int64)
        inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
        row, column = np.where(inside, row, 0), np.where(inside, column, 0)
        free = inside & (costmap.cost[row, column] < INSCRIBED)
        row, column = row // self._merged, column // self._merged
        return np.where(free, (row + 1) * self._columns + column + 1, -1)


def _halved(price: FloatArray) -> FloatArray:
    """Prices of cells twice as wide: a step costs twice the mean of what is free in them."""
    rows, columns = price.shape
    padded = np.pad(price, ((0, rows % 2), (0, columns % 2)), constant_values=np.inf)
    four = padded.reshape(padded.shape[0] // 2, 2, padded.shape[1] // 2, 2)
    free = np.isfinite(four)
    total = np.where(free, four, 0.0).sum(axis=(1, 3))
    count = free.sum(axis=(1, 3))
    return np.divide(2.0 * total, count, out=np.full(total.shape, np.inf), where=count > 0)


def places_of(views: Sequence[View]) -> FloatArray:
    """`(n, 2)`; base positions of views."""
    return np.array([[view.x, view.y] for view in views]).reshape(-1, 2)


def seconds_between(
    model: RobotModel, sources: Sequence[View], goals: Sequence[View], costs: FloatArray
) -> FloatArray:
    """`(n, m)`; transition times between views whose ways cost `costs` `(n, m)`."""
    here, there = (
        np.array([[v.x, v.y, v.yaw_rad, v.torso_m, v.pan_rad, v.tilt_rad] for v in views]).reshape(
            -1, 6
        )
        for views in (sources, goals)
    )
    change = there[None] - here[:, None]
    far = np.hypot(change[..., 0], change[..., 1]) > DRIVES_FROM_M
    turn = np.abs(change[..., 2]) % (2.0 * np.pi)
    turn = np.minimum(turn, 2.0 * np.pi - turn)
    driving = np.where(
        far, model.seconds_per_cost * costs + model.drive_start_s, turn / model.turn_rad_s
    )
    seconds = driving + np.abs(change[..., 3]) / model.lift_m_s
    head = np.abs(change[..., 4:]).max(axis=-1, initial=0.0) / model.head_rad_s
    seconds = np.where(seconds == 0.0, head, seconds) + model.acquisition_s
    # Two views at one place: no way is needed, but the place must be one to stand at.
    return np.where(np.isfinite(costs), seconds, np.inf)


def transition_times_s(
    model: RobotModel,
    costmap: Costmap,
    start: View,
    views: Sequence[View],
    clusters: int | None = None,
) -> FloatArray:
    """`(v + 1, v + 1)`; seconds from each view (row) to each other (column), 0 for the start.

    The time of a view includes the look there. Infinite where no way leads, or where the base
    cannot stand. Symmetric, as the ways are.

    Args:
        model: of the robot.
        costmap: where its base can drive.
        start: where it is.
        views: where it may look.
        clusters: see `Routes`.
    """
    everything = [start, *views]
    costs = Routes(costmap, clusters).among(places_of(everything))
    return seconds_between(model, everything, everything, costs)


def _clustered(places: FloatArray, free: NDArray[np.bool_], clusters: int) -> NDArray[np.int64]:
    """`(n,)`; the representative of each place, chosen farthest from those before."""
    standing = np.flatnonzero(free)
    nearest = np.arange(len(places))
    if len(standing) <= clusters:
        return nearest
    chosen = [int(standing[0])]
    distance = np.linalg.norm(places[standing] - places[chosen[0]], axis=1)
    owner = np.full(len(standing), chosen[0])
    while len(chosen) < clusters:
        farthest = int(standing[int(distance.argmax())])
        chosen.append(farthest)
        to_new = np.linalg.norm(places[standing] - places[farthest], axis=1)
        owner = np.where(to_new < distance, farthest, owner)
        distance = np.minimum(distance, to_new)
    nearest[standing] = owner
    return nearest
