"""True positives, errors and curves as in Section 3.3.1."""

from __future__ import annotations

import math

import pytest

from fluentboard.model.geometry import Pose
from fluentboard_modules.mapping.protocol import (
    Detection,
    TrueObject,
    area_under_curve,
    rate,
    roc_curve,
    table_lines,
    totals,
)


def chair(name: str, x: float, yaw: float = 0.0) -> TrueObject:
    return TrueObject(name, "Chair", "stool", Pose.from_rpy(x, 0.0, 0.0, yaw=yaw))


def found(x: float, yaw: float = 0.0, initial_x: float = 0.0) -> Detection:
    return Detection(
        "stool", Pose.from_rpy(x, 0.0, 0.0, yaw=yaw), Pose(initial_x, 0.0, 0.0), score=0.9
    )


def test_only_the_nearest_detection_of_an_object_counts() -> None:
    row = rate([found(0.1), found(0.05)], [chair("a", 0.0)], {"a"})["stool"]

    assert (row.true_positives, row.false_positives, row.false_negatives) == (1, 1, 0)
    assert row.final_m == pytest.approx([0.05])


def test_a_chair_must_be_within_15_cm_and_a_table_within_45() -> None:
    table = TrueObject("t", "Table", "stool", Pose(0.4, 0.0, 0.0))

    assert rate([found(0.16)], [chair("a", 0.0)], {"a"})["stool"].true_positives == 0
    assert rate([found(0.0)], [table], {"t"})["stool"].true_positives == 1


def test_what_is_hardly_to_be_seen_counts_neither_for_nor_against() -> None:
    hidden = chair("a", 0.0)

    assert rate([found(0.0)], [hidden], set()) == {}
    assert rate([], [hidden], set()) == {}


def test_rotation_counts_up_to_symmetry() -> None:
    table = TrueObject("t", "Table", "stool", Pose(0.0, 0.0, 0.0), symmetry_order=2)

    row = rate([found(0.0, yaw=math.pi - 0.1)], [table], {"t"})["stool"]

    assert row.final_rad == pytest.approx([0.1])


def test_totals_add_up_and_show_as_a_table() -> None:
    looks = [rate([found(0.0, initial_x=0.1)], [chair("a", 0.0)], {"a"}), rate([], [], set())]

    rows = totals(looks)
    lines = table_lines(rows, {"stool": "Stool"})

    assert rows["total"].f1 == 1.0
    assert lines[2].startswith("| Stool | 1 | 0 | 0 | 10.0 cm, 0.0° | 0.0 cm, 0.0° | 100.0 %")


def test_area_under_the_curve_is_the_chance_of_the_right_order() -> None:
    assert area_under_curve([(0.9, True), (0.2, False), (0.8, True)]) == 1.0
    assert area_under_curve([(0.9, True), (0.9, False)]) == 0.5
    assert math.isnan(area_under_curve([(0.9, True)]))


def test_the_curve_of_a_score_runs_from_nothing_accepted_to_everything() -> None:
    curve = roc_curve([(0.9, True), (0.8, True), (0.8, False), (0.1, False)])

    assert curve[0].tolist() == [1.0, 0.0, 0.0]
    assert curve[-1].tolist() == [0.0, 1.0, 1.0]
    assert [0.8, 0.5, 1.0] in curve.tolist()
