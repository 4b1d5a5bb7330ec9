"""A lower bound of the expected time of every complete plan, so that a plan's gap is known.

Coverage is submodular: for any set A of views, no set that costs at most t gains more than
W(A) + K_A(t), where K_A(t) fills the time t with the marginal gains after A in the order of gain
per time, the last one in part (a fractional knapsack; Leskovec et al. 2007, Section 3.2). The best
of several A, here the beginnings of a good plan, bounds W at every time from above, and E[T], the
integral of e^-W over time until W reaches `need`, from below.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from fluentboard.model.geometry import FloatArray
from fluentboard_modules.search import plan_kernels as kernels
from fluentboard_modules.search.planning import PlanningProblem

_POINTS = 400  # of the time axis; more tighten the bound by less than a per mille


def lower_bound_s(problem: PlanningProblem, views: Sequence[int], at_most_s: float) -> float:
    """No complete plan of the problem has a smaller expected time than this, in seconds.

    Args:
        problem: views, cells and times.
        views: a good plan; its beginnings serve as the sets A.
        at_most_s: E[T] of a complete plan, which the bound never exceeds.
    """
    words = problem.words
    if words.need < 0.0:
        return 0.0
    times = problem.times_s.copy()
    np.fill_diagonal(times, np.inf)
    quickest = times[:, 1:].min(axis=0, initial=np.inf)  # into each view, from wherever
    # The first way begins at the start, which may be farther than the quickest way.
    finite = np.isfinite(times[0, 1:])
    if not finite.any():
        return at_most_s
    delay = float((times[0, 1:][finite] - quickest[finite]).min())
    used = np.zeros(problem.view_count, np.bool_)
    gains = np.zeros(problem.view_count)
    state = words.start.copy()
    curves: list[tuple[FloatArray, FloatArray]] = []
    gained = 0.0
    for view in (*views, None):
        kernels.all_gains(state, used, *words.views, gains)
        curves.append(_knapsack(gains, quickest, gained))
        if view is not None:
            gained += float(gains[view])
            kernels.look(view, state, words.ptr, words.idx, words.bits)
    # The largest W by any time lies below all curves; find when it can reach `need`.
    end = max(float(_time_at(curve, words.need)) for curve in curves)
    if not math.isfinite(end):
        return at_most_s
    grid = np.linspace(0.0, end, _POINTS + 1)
    most = np.min([np.interp(grid, t, w) for t, w in curves], axis=0)
    # W never falls, so its value at the end of an interval holds for all of it from above.
    bound = delay + float(np.sum(np.diff(grid) * np.exp(-np.minimum(most[1:], words.need))))
    return min(max(bound, 0.0), at_most_s)


def _knapsack(gains: FloatArray, costs: FloatArray, base: float) -> tuple[FloatArray, FloatArray]:
    """Time and W at the corners of W(A) + K_A(t)."""
    worth = (gains > 0.0) & np.isfinite(costs)
    gain, cost = gains[worth], np.maximum(costs[worth], 1e-9)
    order = np.argsort(-gain / cost)
    times = np.concatenate([[0.0], np.cumsum(cost[order])])
    return times, base + np.concatenate([[0.0], np.cumsum(gain[order])])


def _time_at(curve: tuple[FloatArray, FloatArray], need: float) -> float:
    """When a curve reaches `need`; infinite if it never does."""
    times, gained = curve
    if gained[-1] < need:
        return math.inf
    after = int(np.searchsorted(gained, need))
    if after == 0:
        return 0.0
    share = (need - gained[after - 1]) / (gained[after] - gained[after - 1])
    return float(times[after - 1] + share * (times[after] - times[after - 1]))
