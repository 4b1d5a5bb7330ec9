"""A lower bound of the expected time of every complete plan, so that a plan's gap is known.

E[T] is the integral of e^-W over time until W, the accumulated gain, reaches `need`. What bounds W
at a time from above bounds E[T] from below. By time t a plan has taken views whose ways cost at
most t, one way into each, and none that lies farther than t from the start. The most that such
views can gain is a weighted maximum coverage with a budget; its linear relaxation bounds it, and
so does every solution of the relaxation's dual: a rate lambda (gain per second) and a price per
cell give, for all t at once,

    W(t) <= lambda t + sum over cells in reach by t of max(0, w_c - price_c)
                     + sum over views in reach by t of max(0, price(v) - lambda cost_v).

Prices are improved by subgradient steps for a handful of rates; the smallest of the curves counts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fluentboard.model.geometry import FloatArray
from fluentboard_modules.search.bound_kernels import price_cells
from fluentboard_modules.search.planning import PlanningProblem, layer_weights

_POINTS = 400  # of the time axis; more tighten the bound by less than a per mille
_RATES = 8
_SLOWEST = 0.08  # of the highest rate; later gains hardly count
_ROUNDS = 80


@dataclass(frozen=True, eq=False)
class _Coverage:
    """A planning problem as a coverage: cells that the same views show are one.

    Attributes:
        ptr: `(v + 1,)`; range of each view in `members`.
        members: numbers of cells.
        weights: `(cells, layers)`; gain of each look at a cell.
        costs: `(v,)`; seconds of the quickest way into each view, from another.
        ready_s: `(v,)`; when each view can be taken at the earliest.
        cell_ready_s: `(cells,)`; when each cell can be seen at the earliest.
        delay_s: how much longer than `costs` the first way takes, at least.
    """

    ptr: NDArray[np.int64]
    members: NDArray[np.int64]
    weights: FloatArray
    costs: FloatArray
    ready_s: FloatArray
    cell_ready_s: FloatArray
    delay_s: float


def lower_bound_s(
    problem: PlanningProblem, views: Sequence[int], at_most_s: float, rounds: int = _ROUNDS
) -> float:
    """No complete plan of the problem has a smaller expected time than this, in seconds.

    Args:
        problem: views, cells and times.
        views: a good plan, which tells what rates are worth trying.
        at_most_s: E[T] of a complete plan, which the bound never exceeds.
        rounds: of subgradient steps per rate.
    """
    words = problem.words
    if words.need < 0.0:
        return 0.0
    coverage = _coverage(problem)
    if coverage is None:
        return at_most_s
    gains, spent = _steps(problem, coverage, views)
    gain_of_all = np.add.reduceat(
        np.append(coverage.weights[coverage.members, 0], 0.0), coverage.ptr[:-1]
    )
    highest = float((gain_of_all / coverage.costs).max(initial=0.0))
    if highest <= 0.0:
        return at_most_s
    grid = np.linspace(0.0, max(float(spent[-1]), 1.0), _POINTS + 1)
    most = np.full(len(grid), words.reachable)
    prices = np.zeros(len(coverage.weights))
    for rate in np.geomspace(highest, _SLOWEST * highest, _RATES):
        attained = float((gains - rate * spent).max())
        price_cells(
            coverage.ptr, coverage.members, coverage.weights, coverage.costs, float(rate),
            attained, rounds, prices,
        )  # fmt: skip
        most = np.minimum(most, _most_by(grid, coverage, float(rate), prices))
    # W never falls, so its value at the end of an interval holds for all of it from above.
    open_still = most[1:] <= words.need
    count = len(open_still) if open_still.all() else int(np.argmin(open_still))
    # In the interval in which `need` may be reached nothing is counted.
    bound = float(np.sum(np.diff(grid)[:count] * np.exp(-most[1 : count + 1])))
    return min(max(bound, 0.0), at_most_s)


def _most_by(grid: FloatArray, coverage: _Coverage, rate: float, prices: FloatArray) -> FloatArray:
    """The dual bound of W at times `grid`."""
    paid = np.add.reduceat(np.append(prices[coverage.members], 0.0), coverage.ptr[:-1])
    surplus = np.maximum(paid - rate * coverage.costs, 0.0)
    left = np.maximum(coverage.weights - prices[:, None], 0.0).sum(axis=1)
    # What is out of reach by a time counts for nothing.
    return (
        rate * np.maximum(grid - coverage.delay_s, 0.0)
        + _sum_until(grid, coverage.ready_s, surplus)
        + _sum_until(grid, coverage.cell_ready_s, left)
    )


def _sum_until(grid: FloatArray, when: FloatArray, values: FloatArray) -> FloatArray:
    order = np.argsort(when)
    total = np.concatenate([[0.0], np.cumsum(values[order])])
    found: FloatArray = total[np.searchsorted(when[order], grid, side="right")]
    return found


def _coverage(problem: PlanningProblem) -> _Coverage | None:
    """The problem as a coverage; None if no view can be reached."""
    times = problem.times_s.copy()
    np.fill_diagonal(times, np.inf)
    ready = _earliest(times)
    chosen = np.flatnonzero(np.isfinite(ready) & (np.diff(problem.view_ptr) > 0))
    if not len(chosen):
        return None
    first = times[0, 1:][chosen]
    quickest = times[1:, 1:][:, chosen].min(axis=0, initial=np.inf)
    costs = np.maximum(np.where(np.isfinite(quickest), quickest, first), 1e-9)
    delay = float((first - costs)[np.isfinite(first)].min(initial=np.inf))
    counts = np.diff(problem.view_ptr)[chosen]
    cells = np.concatenate([problem.cells(int(view)) for view in chosen])
    view = np.repeat(np.arange(len(chosen)), counts)
    # The sum of random numbers of the views that show a cell tells cells apart.
    mark = np.random.default_rng(0).integers(1, 1 << 63, len(chosen)).astype(np.uint64)
    signature = np.zeros(len(problem.cell_p), np.uint64)
    np.add.at(signature, cells, mark[view])
    shown = np.flatnonzero(signature)
    _, one_of, group = np.unique(signature[shown], return_index=True, return_inverse=True)
    weights = layer_weights(problem.cell_p[shown], problem.recall)
    summed = np.zeros((len(one_of), len(weights)))
    np.add.at(summed, group, weights.T)
    number = np.full(len(problem.cell_p), -1, np.int64)
    number[shown[one_of]] = np.arange(len(one_of))
    kept = number[cells] >= 0
    members = number[cells[kept]]
    ptr = np.concatenate([[0], np.cumsum(np.bincount(view[kept], minlength=len(chosen)))])
    cell_ready = np.full(len(one_of), np.inf)
    np.minimum.at(cell_ready, members, ready[chosen][view[kept]])
    return _Coverage(ptr.astype(np.int64), members, summed, costs, ready[chosen], cell_ready, delay)


def _earliest(times: FloatArray) -> FloatArray:
    """`(v,)`; the length of the shortest way from the start to each view, by way of others."""
    reached = times[0].copy()
    open_still = np.ones(len(times), np.bool_)
    open_still[0] = False
    while open_still.any():
        nearest = int(np.argmin(np.where(open_still, reached, np.inf)))
        open_still[nearest] = False
        if not np.isfinite(reached[nearest]):
            break
        reached = np.minimum(reached, reached[nearest] + times[nearest])
    return reached[1:]


def _steps(
    problem: PlanningProblem, coverage: _Coverage, views: Sequence[int]
) -> tuple[FloatArray, FloatArray]:
    """W and the time spent before and after each view of a plan."""
    layers = layer_weights(problem.cell_p, problem.recall)
    looks = np.zeros(len(problem.cell_p), np.int64)
    gains, spent, here = [0.0], [0.0], 0
    for view in views:
        cells = problem.cells(view)
        new = cells[looks[cells] < len(layers)]
        gains.append(gains[-1] + float(layers[looks[new], new].sum()))
        spent.append(spent[-1] + float(problem.times_s[here, view + 1]))
        looks[new] += 1
        here = view + 1
    return np.array(gains), np.array(spent)
