"""Which planner the settings ask for."""

from __future__ import annotations

import pytest

from fluentboard_modules.search.config import BranchAndBoundConfig, SearchConfig
from fluentboard_modules.search.planners import (
    BranchAndBound,
    Greedy,
    IteratedLocalSearch,
    Planner,
    planner_of,
)

THESIS = BranchAndBoundConfig(depth_limit=4, branch_limit=None)


@pytest.mark.parametrize(
    ("method", "planner"),
    [
        ("local-search", IteratedLocalSearch()),
        ("branch-and-bound", BranchAndBound(THESIS)),
        ("greedy", Greedy()),
    ],
)
def test_method_chooses_the_planner(method: str, planner: Planner) -> None:
    config = SearchConfig.model_validate({"method": method, "branch_and_bound": THESIS})
    assert planner_of(config) == planner


def test_robots_that_look_while_they_drive_plan_greedily_unless_told_otherwise() -> None:
    assert planner_of(SearchConfig(), looks_on_the_way=True) == Greedy()
    assert planner_of(SearchConfig()) == IteratedLocalSearch()
    told = SearchConfig(method="local-search")
    assert planner_of(told, looks_on_the_way=True) == IteratedLocalSearch()
