"""Ways of many places at once: sweeps and buckets find the same costs."""

from __future__ import annotations

import numpy as np
import pytest

from fluentboard.model.geometry import FloatArray
from fluentboard_modules.search import travel_times
from fluentboard_modules.search.route_sweeps import SweepGraph
from fluentboard_modules.search.travel_times import Routes
from fluentboard_modules.simulation.navigation import Costmap, cell_prices


@pytest.fixture
def cluttered(rng: np.random.Generator) -> Costmap:
    """Slopes, obstacles, and a wall that parts the floor but for a door."""
    cost = rng.integers(0, 200, (40, 60)).astype(np.uint8)
    cost[rng.random(cost.shape) < 0.25] = 254
    cost[:, 30] = 254
    cost[20, 28:33] = 0
    return Costmap(cost, 0.1, (-1.0, 2.0))


def some_places(costmap: Costmap, rng: np.random.Generator, count: int) -> FloatArray:
    rows, columns = costmap.cost.shape
    return np.array([-1.0, 2.0]) + rng.random((count, 2)) * np.array([columns, rows]) * 0.1


def test_sweeps_find_the_costs_that_buckets_find(
    cluttered: Costmap, rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    places = some_places(cluttered, rng, 37)
    swept, swept_from = Routes(cluttered).among(places), Routes(cluttered).between(places, places)
    monkeypatch.setattr(travel_times, "_SWEPT_FROM", 1_000)
    searched = Routes(cluttered).among(places)
    np.testing.assert_allclose(swept, searched, rtol=1e-12)
    np.testing.assert_allclose(swept_from, searched, rtol=1e-12)
    assert np.array_equal(swept, swept.T)
    assert np.isfinite(swept).any()
    assert np.isinf(swept).any()


def test_a_maze_is_left_to_the_search_by_buckets() -> None:
    cost = np.zeros((41, 41), np.uint8)
    for n, row in enumerate(range(1, 41, 2)):
        cost[row] = 254
        cost[row, -1 if n % 2 == 0 else 0] = 0
    maze = Costmap(cost, 1.0, (0.0, 0.0))
    price = np.pad(cell_prices(maze), 1, constant_values=np.inf)
    first, last = np.array([44]), np.array([41 * 43 + 41])
    assert SweepGraph(price).costs(first, last, 20) is None
    costs = SweepGraph(price).costs(first, last, 100)
    assert costs is not None
    places = np.array([[0.5, 0.5], [40.5, 40.5]])
    assert Routes(maze).between(places, places)[0, 1] == pytest.approx(costs[0, 0])
