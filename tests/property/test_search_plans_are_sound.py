"""Plans: what they claim is true, no plan beats the optimum, and the bound is below it."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fluentboard.model.geometry import FloatArray
from fluentboard_modules.search.config import BranchAndBoundConfig, PlannerConfig
from fluentboard_modules.search.planners import (
    BranchAndBound,
    Greedy,
    IteratedLocalSearch,
    Planner,
    bounded,
)
from fluentboard_modules.search.planning import (
    Plan,
    PlanningProblem,
    carry_out,
    detection_probability,
)

EXACT = BranchAndBound(BranchAndBoundConfig(depth_limit=None, branch_limit=None))
LIMITED = BranchAndBound(BranchAndBoundConfig(depth_limit=2, branch_limit=1.3))
PRUNED = BranchAndBound(
    BranchAndBoundConfig(depth_limit=None, branch_limit=None, prune_dominated=True)
)
LOCAL = IteratedLocalSearch(PlannerConfig(rounds_max=10))
SEEDS = st.integers(0, 10_000)


def random_problem(
    rng: np.random.Generator,
    views: int,
    cells: int = 60,
    omega: float = 0.05,
    recall: float = 1.0,
    symmetric: bool = True,
) -> PlanningProblem:
    """Views strewn over a floor, each of which reveals the cells around it."""
    place = rng.uniform(0.0, 10.0, (views + 1, 2))
    cell_place = rng.uniform(0.0, 10.0, (cells, 2))
    cell_p = rng.choice([0.002, 0.01, 0.03], size=cells)
    lists = [
        np.flatnonzero(np.linalg.norm(cell_place - place[v + 1], axis=1) < rng.uniform(1.0, 3.5))
        for v in range(views)
    ]
    ptr = np.concatenate([[0], np.cumsum([len(c) for c in lists])]).astype(np.int64)
    times: FloatArray = 2.0 * np.linalg.norm(place[:, None] - place[None], axis=-1) + 8.0
    if not symmetric:
        times *= rng.uniform(0.7, 1.3, times.shape)
    return PlanningProblem(
        cell_p, ptr, np.concatenate(lists).astype(np.int64), times, omega, recall
    )


def plan_of(planner: Planner, problem: PlanningProblem) -> Plan:
    """The planner's plan with its lower bound."""
    return bounded(problem, planner.find(problem))


def expected_time_s(problem: PlanningProblem, views: Sequence[int]) -> tuple[float, float]:
    """E[T|L] (Eq. 5.4) and p(L) (Eq. 5.8) by sets of cells; for a perfect detector."""
    seen: set[int] = set()
    not_found, spent, here = 1.0, 0.0, 0
    for view in views:
        spent += not_found * float(problem.times_s[here, view + 1])
        for cell in set(problem.cells(view).tolist()) - seen:
            not_found *= 1.0 - float(problem.cell_p[cell])
            seen.add(cell)
        here = view + 1
    return spent, 1.0 - not_found


def is_complete(problem: PlanningProblem, probability: float) -> bool:
    """Eq. 5.9."""
    _, everything = expected_time_s(problem, range(problem.view_count))
    return probability > 1.0 - (1.0 - everything) / (1.0 - problem.omega) - 1e-12


def best_by_exhaustion(problem: PlanningProblem) -> float:
    """The least expected time of all sequences of views that end when they are complete."""
    best = math.inf

    def extend(views: tuple[int, ...]) -> None:
        nonlocal best
        spent, probability = expected_time_s(problem, views)
        if spent >= best:
            return
        if is_complete(problem, probability):
            best = spent
            return
        for view in range(problem.view_count):
            if view not in views:
                extend((*views, view))

    extend(())
    return best


@given(seed=SEEDS, views=st.integers(1, 6))
@settings(max_examples=25)
def test_unlimited_branch_and_bound_equals_exhaustive_search(seed: int, views: int) -> None:
    problem = random_problem(np.random.default_rng(seed), views, symmetric=bool(seed % 2))
    plan = plan_of(EXACT, problem)
    optimum = best_by_exhaustion(problem)
    assert plan.expected_time_s == pytest.approx(optimum, rel=1e-9)
    assert plan.gap == pytest.approx(0.0, abs=1e-12)


@given(seed=SEEDS, views=st.integers(1, 8))
@settings(max_examples=25)
def test_no_planner_beats_the_optimum_and_none_is_worse_than_greedy(seed: int, views: int) -> None:
    problem = random_problem(np.random.default_rng(seed), views)
    optimum = plan_of(EXACT, problem).expected_time_s
    greedy = plan_of(Greedy(), problem).expected_time_s
    for planner in (LIMITED, PRUNED, LOCAL):
        found = plan_of(planner, problem).expected_time_s
        assert optimum * (1.0 - 1e-9) <= found <= greedy * (1.0 + 1e-9), planner.name


@given(
    seed=SEEDS,
    views=st.integers(1, 7),
    omega=st.sampled_from([0.0, 0.05, 0.3]),
    recall=st.sampled_from([1.0, 0.7]),
)
@settings(max_examples=40)
def test_the_lower_bound_is_one(seed: int, views: int, omega: float, recall: float) -> None:
    problem = random_problem(
        np.random.default_rng(seed), views, omega=omega, recall=recall, symmetric=False
    )
    optimum = plan_of(EXACT, problem).expected_time_s
    for planner in (Greedy(), LOCAL, LIMITED):
        plan = plan_of(planner, problem)
        assert plan.lower_bound_s <= optimum * (1.0 + 1e-9)
        assert 0.0 <= plan.gap <= 1.0


def test_the_lower_bound_knows_what_views_share() -> None:
    # Ten views of the same cells, of which one suffices: no two of them gain more than one.
    cells = np.arange(200)
    ptr = np.arange(0, 2_001, 200)
    times = np.full((11, 11), 10.0)
    alike = PlanningProblem(np.full(200, 0.005), ptr, np.tile(cells, 10), times)
    plan = plan_of(LOCAL, alike)
    assert len(plan.views) == 1
    assert plan.gap < 0.05


def test_a_view_out_of_reach_does_not_weaken_the_bound() -> None:
    times = np.array([[0.0, 20.0, 40.0], [20.0, 0.0, 20.0], [40.0, 20.0, 0.0]])
    problem = PlanningProblem(
        np.full(20, 0.02), np.array([0, 10, 20]), np.arange(20), times, omega=0.0
    )
    plan = plan_of(EXACT, problem)
    found = bounded(problem, Greedy().find(problem))
    # By 20 s nothing can be seen, and by 40 s one view: both are in the bound.
    assert found.lower_bound_s > 0.9 * plan.expected_time_s


@given(seed=SEEDS, views=st.integers(1, 25))
@settings(max_examples=25)
def test_a_plan_says_its_expected_time_and_probability_truly(seed: int, views: int) -> None:
    problem = random_problem(np.random.default_rng(seed), views, cells=300)
    for planner in (Greedy(), LIMITED, LOCAL):
        plan = plan_of(planner, problem)
        spent, probability = expected_time_s(problem, plan.views)
        assert plan.expected_time_s == pytest.approx(spent, rel=1e-9)
        assert plan.success_probability == pytest.approx(probability, rel=1e-9)
        assert plan.is_complete == is_complete(problem, probability)
        assert len(set(plan.views)) == len(plan.views)


@given(seed=SEEDS)
@settings(max_examples=20)
def test_the_same_problem_gives_the_same_plan(seed: int) -> None:
    problem = random_problem(np.random.default_rng(seed), 20, cells=200)
    again = random_problem(np.random.default_rng(seed), 20, cells=200)
    assert plan_of(LOCAL, problem) == plan_of(LOCAL, again)


@given(p=st.lists(st.floats(0.0, 0.9), max_size=8), more=st.lists(st.floats(0.0, 0.9), max_size=4))
def test_the_probability_to_detect_grows_with_the_cells_seen(
    p: list[float], more: list[float]
) -> None:
    assert detection_probability(p) <= detection_probability([*p, *more]) + 1e-12
    assert detection_probability([]) == 0.0


@given(seed=SEEDS)
@settings(max_examples=20)
def test_an_imperfect_detector_makes_a_second_look_worth_while(seed: int) -> None:
    rng = np.random.default_rng(seed)
    problem = random_problem(rng, 4, cells=40, recall=0.6)
    twice = carry_out(problem, [0, 1, 2, 3])
    missed = np.ones(40)
    for view in range(4):
        missed[problem.cells(view)] *= 0.4
    exact = detection_probability(problem.cell_p * (1.0 - missed))
    if len(twice.views) == 4:
        assert twice.success_probability == pytest.approx(exact, rel=1e-9)
    assert twice.success_probability <= exact + 1e-12
