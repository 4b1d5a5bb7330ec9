"""Ways of many places at once: sweeps and buckets find the same costs."""

from __future__ import annotations

import numpy as np
import pytest

from fluentboard.model.geometry import FloatArray
from fluentboard_modules.search import travel_times
from fluentboard_modules.search.route_sweeps import SweepGraph
from fluentboard_modules.search.travel_times import Routes
from fluentboard_modules.simulation.navigation import Costmap, cell_prices, inflated


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


@pytest.fixture(scope="module")
def hall() -> Costmap:
    """A floor of a hectare: rooms of 10 m with doors of 1.6 m, and a locked one."""
    occupied = np.zeros((1000, 1000), np.bool_)
    for wall in [*range(0, 1000, 100), 999]:
        occupied[wall] = occupied[:, wall] = True
    for wall in range(100, 1000, 100):
        for door in range(42, 1000, 100):
            occupied[wall, door : door + 16] = occupied[door : door + 16, wall] = False
    occupied[900, 900:] = occupied[900:, 900] = True
    return inflated(occupied, 0.1, (0.0, 0.0), 0.35)


def test_ways_over_a_hectare_are_planned_on_merged_cells(hall: Costmap) -> None:
    places = np.array([[2.0, 3.0], [93.0, 3.5], [48.0, 77.0], [5.0, 94.0], [95.0, 95.0]])
    exact = Routes(hall, cells_max=10**9).among(places)
    merged = Routes(hall).among(places)
    np.testing.assert_allclose(merged, exact, rtol=0.05)
    assert np.isinf(merged[4, :4]).all()
    np.testing.assert_allclose(Routes(hall).between(places[:2], places), merged[:2], rtol=1e-9)


def test_ways_over_still_larger_floors_are_those_of_clusters(
    hall: Costmap, rng: np.random.Generator
) -> None:
    places = np.concatenate([rng.uniform(2.0, 98.0, (70, 2)), [[95.0, 95.0]]])
    merged = Routes(hall, cells_max=60_000).among(places)  # by four, which does
    guessed = Routes(hall, cells_max=40_000).among(places)
    np.testing.assert_array_equal(np.isinf(guessed), np.isinf(merged))
    far = np.isfinite(merged) & (merged > 5_000.0)
    wrong = np.abs(guessed[far] / merged[far] - 1.0)
    assert wrong.mean() < 0.05
    np.testing.assert_allclose(guessed, guessed.T)
