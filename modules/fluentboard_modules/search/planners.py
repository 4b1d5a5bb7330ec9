"""The planners: greedy, the thesis's branch and bound, and the default (Section 5.2.2).

All are deterministic: their effort is counted in nodes and rounds; a time limit only ends them
earlier.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from fluentboard_modules.search import plan_kernels as kernels
from fluentboard_modules.search.config import (
    BranchAndBoundConfig,
    PlannerConfig,
    SearchConfig,
)
from fluentboard_modules.search.improvement_kernels import improve, shake_and_improve
from fluentboard_modules.search.plan_bounds import lower_bound_s
from fluentboard_modules.search.planning import Plan, PlanningProblem, carry_out

_SWEEPS_MAX = 100


class Planner(Protocol):
    """Anything that finds a sequence of views for a problem."""

    @property
    def name(self) -> str:
        """What to call it in tables."""
        ...

    def find(self, problem: PlanningProblem, previous: tuple[int, ...] = ()) -> Plan:
        """A plan; its lower bound is only that which the search itself proves (see `bounded`).

        Args:
            problem: views, cells and times.
            previous: the rest of the last plan, as far as its views still exist.
        """
        ...


@dataclass(frozen=True, slots=True)
class Greedy:
    """Always the view of the highest utility, p(s|L) / t (Eq. 5.6): the baseline of Section 5.3."""

    name: str = "greedy"

    def find(self, problem: PlanningProblem, previous: tuple[int, ...] = ()) -> Plan:
        """The greedy plan; a previous one does not matter."""
        return _greedy(problem)


@dataclass(frozen=True, slots=True)
class BranchAndBound:
    """The thesis's planner: branch and bound with a depth and a branch limit.

    Attributes:
        config: depth limit psi, branch limit phi, domination pruning zeta, and limits of effort.
    """

    config: BranchAndBoundConfig

    @property
    def name(self) -> str:
        """With its parameters, as in Figure 5.9."""
        depth = "∞" if self.config.depth_limit is None else str(self.config.depth_limit)
        zeta = int(self.config.prune_dominated)
        return f"b&b ψ={depth} φ={self.config.branch_limit:g} ζ={zeta}"

    def find(self, problem: PlanningProblem, previous: tuple[int, ...] = ()) -> Plan:
        """The best plan found; without limits and pruning its bound is its expected time."""
        first = _greedy(problem)
        found, finished = branch_and_bound(problem, first, self.config)
        if finished and self.config.is_exact:
            return replace(found, lower_bound_s=found.expected_time_s)
        return found


@dataclass(frozen=True, slots=True)
class IteratedLocalSearch:
    """The default: local search from the greedy and the previous plan, shaken until it rests.

    Attributes:
        config: limits of effort and the seed.
    """

    config: PlannerConfig = field(default_factory=PlannerConfig)
    name: str = "local search"

    def find(self, problem: PlanningProblem, previous: tuple[int, ...] = ()) -> Plan:
        """The best plan found within the limits; deterministic if the time limit is not met."""
        begun = time.perf_counter()
        greedy = _greedy(problem)
        if not greedy.views or not greedy.is_complete:
            return greedy
        best = _improved(problem, greedy)
        # What is left of a good plan is a good beginning, and the next look will change it again.
        rounds = self.config.replanning_rounds if previous else self.config.rounds_max
        if previous:
            before = _improved(problem, _finished(problem, carry_out(problem, previous)))
            if before.is_complete and before.expected_time_s < best.expected_time_s:
                best = before
        # xorshift needs a seed that is not 0.
        seed = np.array([2 * self.config.seed + 1], np.uint64) * np.uint64(0x9E3779B97F4A7C15)
        plan, length = _room(problem, best.views)
        expected, idle, words = best.expected_time_s, 0, problem.words
        for _ in range(rounds):
            length, expected, waited = shake_and_improve(
                plan, length, expected, words.need, words.start, problem.times_s,
                *words.views, 1, seed,
            )  # fmt: skip
            idle = idle + 1 if waited else 0
            if idle >= self.config.idle_rounds:
                break
            if time.perf_counter() - begun > self.config.time_limit_s:
                break
        return carry_out(problem, plan[:length])


def bounded(problem: PlanningProblem, plan: Plan) -> Plan:
    """The plan with a lower bound of what any plan takes, if it is complete.

    Apart from planning, as it takes longer than some planners do.
    """
    if not plan.is_complete or plan.lower_bound_s >= plan.expected_time_s:
        return plan
    return replace(plan, lower_bound_s=lower_bound_s(problem, plan.views, plan.expected_time_s))


def branch_and_bound(
    problem: PlanningProblem, first: Plan, config: BranchAndBoundConfig
) -> tuple[Plan, bool]:
    """The best plan that branch and bound finds, and whether it came to its end.

    Args:
        problem: views, cells and times.
        first: an incumbent, such as the greedy plan.
        config: limits; nodes are counted, and the clock is looked at now and then.
    """
    if not first.views or not first.is_complete:
        return first, True
    words = problem.words
    plan, length = _room(problem, first.views)
    depth = problem.view_count if config.depth_limit is None else config.depth_limit
    limit = math.inf if config.branch_limit is None else config.branch_limit
    best = np.array([length, first.expected_time_s])
    _, finished = kernels.branch_and_bound(
        words.start, words.need, problem.times_s, *words.views, depth, limit,
        config.prune_dominated, config.nodes_max, plan, best,
    )  # fmt: skip
    return carry_out(problem, plan[: int(best[0])]), bool(finished)


def planner_of(config: SearchConfig, *, looks_on_the_way: bool = False) -> Planner:
    """The planner that the settings ask for.

    Args:
        config: names a method, or leaves it to us: what is seen on the way upsets the end of every
            plan, so greedy is better then with a map, and as good without one.
        looks_on_the_way: whether the robot looks while it drives.
    """
    method = config.method
    if method == "auto":
        method = "greedy" if looks_on_the_way else "local-search"
    match method:
        case "greedy":
            return Greedy()
        case "branch-and-bound":
            return BranchAndBound(config.branch_and_bound)
        case "local-search":
            return IteratedLocalSearch(config.planner)


def _greedy(problem: PlanningProblem) -> Plan:
    return _finished(problem, Plan((), 0.0, 0.0))


def _finished(problem: PlanningProblem, begun: Plan) -> Plan:
    """The plan, continued greedily until it is complete."""
    words = problem.words
    plan, length = _room(problem, begun.views)
    state = words.start.copy()
    used = np.zeros(problem.view_count, np.bool_)
    length, gained, spent = kernels.walk(
        plan, length, 0, state, 0.0, 0.0, np.inf, words.need, problem.times_s, *words.views
    )
    used[plan[:length]] = True
    length, gained, spent = kernels.finish_greedily(
        plan, length, state, used, gained, spent, words.need, problem.times_s, *words.views, 0.0,
        np.ones(1, np.uint64),
    )  # fmt: skip
    return Plan(
        tuple(int(v) for v in plan[:length]),
        float(spent),
        1.0 - math.exp(-gained),
        is_complete=bool(gained > words.need),
    )


def _improved(problem: PlanningProblem, begun: Plan) -> Plan:
    if not begun.views or not begun.is_complete:
        return begun
    words = problem.words
    plan, length = _room(problem, begun.views)
    length, _, _ = improve(
        plan, length, words.need, words.start, problem.times_s, *words.views, _SWEEPS_MAX
    )
    return carry_out(problem, plan[:length])


def _room(problem: PlanningProblem, views: tuple[int, ...]) -> tuple[NDArray[np.int64], int]:
    plan = np.zeros(problem.view_count + 2, np.int64)
    plan[: len(views)] = views
    return plan, len(views)
