"""Which object is which anchor: worked examples, errata and the methods compared."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pytest

from fluentboard.model.geometry import BoundingBox, FloatArray, Pose
from fluentboard_modules.anchoring.association import assign_objects, gated_mismatch
from fluentboard_modules.anchoring.config import AssociationConfig
from fluentboard_modules.anchoring.similarity import Appearance, load_mismatch

Method = Literal["gnn", "nn", "thesis", "murty"]


def chosen(cost: FloatArray, method: Method = "gnn") -> list[int | None]:
    return [match.anchor for match in assign_objects(cost, AssociationConfig(method=method))]


def a_cup(x: float, confidence: tuple[float, ...] = (1.0, 0.0)) -> Appearance:
    return Appearance(BoundingBox(Pose(x, 0.0, 0.75), 0.08, 0.08, 0.1), np.array(confidence))


def test_best_total_wins_over_the_first_object() -> None:
    cost = np.array([[-0.9, -0.8], [-0.85, 0.5]])
    assert chosen(cost) == [1, 0]
    assert chosen(cost, "nn") == [0, None]  # Figure 4.5


def test_good_match_is_not_sacrificed_for_a_hopeless_one() -> None:
    # Algorithm 4.1 minimises the sum first, and so gives away the match of -1 (E6).
    cost = np.array([[-1.0, -0.9], [-0.5, 3.0]])
    assert chosen(cost) == [1, 0]
    cost = np.array([[-1.0, 0.5], [0.2, 3.0]])
    assert chosen(cost) == [0, None]
    assert chosen(cost, "thesis") == [None, None]


def test_every_object_is_reacquired_or_discovered() -> None:
    cost = np.array([[-1.0], [-0.5], [-0.2]])
    assert chosen(cost) == [0, None, None]
    printed = assign_objects(cost, AssociationConfig(method="thesis"))
    assert [match.is_left_over for match in printed] == [False, True, True]  # E5


@pytest.mark.parametrize("method", ["gnn", "nn", "thesis", "murty"])
def test_without_anchors_everything_is_discovered(method: Method) -> None:
    matches = assign_objects(np.zeros((2, 0)), AssociationConfig(method=method))
    assert [match.anchor for match in matches] == [None, None]
    assert not any(match.is_left_over for match in matches)


@pytest.mark.parametrize("method", ["gnn", "nn", "thesis", "murty"])
def test_without_objects_nothing_happens(method: Method) -> None:
    assert assign_objects(np.zeros((0, 3)), AssociationConfig(method=method)) == []


def test_evidence_names_the_runner_up() -> None:
    (match,) = assign_objects(np.array([[-0.2, -0.9, np.inf]]), AssociationConfig())
    assert (match.anchor, match.runner_up) == (1, 0)
    assert match.runner_up_cost == pytest.approx(-0.2)


def test_ambiguous_pairs_wait_with_many_hypotheses() -> None:
    clear = assign_objects(np.array([[-1.0, 0.8]]), AssociationConfig(method="murty"))
    assert (clear[0].anchor, clear[0].is_decided) == (0, True)
    torn = AssociationConfig(method="murty", keep_share=0.6)
    matches = assign_objects(np.array([[-0.5, -0.5], [-0.5, -0.5]]), torn)
    assert not any(match.is_decided for match in matches)


def test_anchors_out_of_the_gate_are_no_candidates() -> None:
    cost = gated_mismatch([a_cup(0.0)], [a_cup(0.05), a_cup(2.0)], load_mismatch(), gate_m=0.4)
    assert cost[0, 0] < 0.0
    assert np.isinf(cost[0, 1])


def test_unlike_classes_and_distance_both_raise_the_mismatch() -> None:
    model = load_mismatch()
    here = a_cup(0.0)
    near, far = model.mismatch([here], [a_cup(0.05), a_cup(0.3)])[0]
    assert near < far
    unlike = model.mismatch([here], [a_cup(0.05, (0.0, 1.0))])[0, 0]
    assert near < unlike


def test_hidden_parts_bring_a_fragment_no_nearer_than_the_whole_allows() -> None:
    model = load_mismatch()
    plate = Appearance(BoundingBox(Pose(0.0, 0.0, 0.71), 0.24, 0.24, 0.02), np.array([0.0, 1.0]))
    half = BoundingBox(Pose(0.06, 0.0, 0.71), 0.12, 0.24, 0.02)
    told = np.array([0.0, 1.0])
    whole = model.mismatch([Appearance(half, told)], [plate])[0, 0]
    part = model.mismatch([Appearance(half, told, is_part=True)], [plate])[0, 0]
    assert part < whole
