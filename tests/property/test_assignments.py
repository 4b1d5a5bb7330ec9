"""Assignments: one to one, independent of order, and as good as trying everything."""

from __future__ import annotations

import itertools
from typing import Literal

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from fluentboard.model.geometry import FloatArray
from fluentboard_modules.anchoring.association import assign_objects, discovery_matrix
from fluentboard_modules.anchoring.config import AssociationConfig
from fluentboard_modules.anchoring.murty import best_assignments

entries = st.one_of(st.floats(-2.0, 2.0), st.just(float("inf")))


@st.composite
def costs(draw: st.DrawFn) -> FloatArray:
    n, m = draw(st.integers(0, 4)), draw(st.integers(0, 4))
    values = draw(st.lists(entries, min_size=n * m, max_size=n * m))
    return np.array(values, dtype=np.float64).reshape(n, m)


def all_totals(cost: FloatArray) -> list[float]:
    """Totals of all assignments of each row to a column of its own, cheapest first."""
    wide = discovery_matrix(cost)
    columns = range(int(wide.shape[1]))
    totals = [
        sum((float(wide[i, j]) for i, j in enumerate(chosen)), 0.0)
        for chosen in itertools.permutations(columns, int(wide.shape[0]))
    ]
    return sorted(total for total in totals if np.isfinite(total))


def total(cost: FloatArray, anchors: list[int | None]) -> float:
    return float(sum(cost[i, j] for i, j in enumerate(anchors) if j is not None))


@given(costs(), st.sampled_from(["gnn", "nn", "thesis", "murty"]))
def test_no_anchor_is_given_twice(
    cost: FloatArray, method: Literal["gnn", "nn", "thesis", "murty"]
) -> None:
    matches = assign_objects(cost, AssociationConfig(method=method))
    given_away = [match.anchor for match in matches if match.anchor is not None]
    assert len(given_away) == len(set(given_away))
    assert len(matches) == cost.shape[0]


@given(costs())
def test_assignment_equals_brute_force(cost: FloatArray) -> None:
    anchors = [match.anchor for match in assign_objects(cost, AssociationConfig())]
    assert np.isclose(total(cost, anchors), all_totals(cost)[0], atol=1e-9)


@given(costs(), st.integers(0, 100))
def test_assignment_does_not_depend_on_the_order_of_objects(cost: FloatArray, seed: int) -> None:
    order = np.random.default_rng(seed).permutation(cost.shape[0])
    first = [m.anchor for m in assign_objects(cost, AssociationConfig())]
    second = [m.anchor for m in assign_objects(cost[order], AssociationConfig())]
    assert np.isclose(total(cost, first), total(cost[order], second), atol=1e-9)


@given(costs(), st.integers(1, 12))
def test_k_best_assignments_are_the_k_cheapest(cost: FloatArray, k: int) -> None:
    expected = all_totals(cost)[:k]
    found = best_assignments(discovery_matrix(cost), k)
    assert len(found) == len(expected)
    assert np.allclose([ranked.cost for ranked in found], expected, atol=1e-6)
    assert len({tuple(ranked.columns.tolist()) for ranked in found}) == len(found)
