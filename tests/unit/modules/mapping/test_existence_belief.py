"""Belief that something is there: what a frame adds, and what adds nothing."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import pytest

from fluentboard.model.fluent import Fluent, Property
from fluentboard_modules.frames.sensor_frame import SensorFrame
from fluentboard_modules.mapping.config import ExistenceConfig, FusionConfig
from fluentboard_modules.mapping.existence import (
    ExistenceBelief,
    combined_belief,
    probability,
    verified_belief,
)
from fluentboard_modules.mapping.remembered_places import RememberedPlaces, remembered_planes

CONFIG = ExistenceConfig()
Render = Callable[..., SensorFrame]


AROUND = [(2.0 * math.cos(k), 2.0 * math.sin(k), 0.7) for k in range(6)]
"""Places around a thing, each far from the others."""


def after(looks: Iterable[tuple[bool, Sequence[float]]], odds: float | None = None) -> float:
    """Log-odds after some looks."""
    belief = ExistenceBelief(CONFIG, odds)
    for shows, eye in looks:
        belief.take(shows, eye)
    return belief.odds


def test_cad_file_that_agrees_makes_up_for_few_frames() -> None:
    seen_twice = probability(after([(True, (2.0, 0.0, 0.7)), (True, (2.0, 0.4, 0.7))]))
    assert verified_belief(seen_twice, 0.99, CONFIG) > 0.9 > 0.6 > seen_twice
    assert verified_belief(seen_twice, 0.5, CONFIG) == pytest.approx(seen_twice)
    assert verified_belief(seen_twice, 0.0, CONFIG) < 0.05
    assert verified_belief(1.0 - 1e-9, 1.0, CONFIG) == pytest.approx(CONFIG.belief_max)


def test_looks_from_all_around_follow_bayes() -> None:
    odds = after([(True, AROUND[0]), (False, AROUND[2]), (True, AROUND[4])], 0.0)
    there = CONFIG.shown_if_there**2 * CONFIG.through_if_there
    not_there = CONFIG.shown_if_gone**2 * CONFIG.through_if_gone
    assert probability(odds) == pytest.approx(there / (there + not_there), abs=0.01)


@pytest.mark.parametrize("shows", [True, False])
def test_looks_from_one_place_say_less_and_less(shows: bool) -> None:
    belief = ExistenceBelief(CONFIG, 0.0)
    steps: list[float] = []
    for _ in range(6):
        before = belief.odds
        belief.take(shows, (2.0, 0.3, 0.7))
        steps.append(abs(belief.odds - before))
    assert steps == sorted(steps, reverse=True)
    assert steps[1] < 0.2 * steps[0]


def test_a_look_from_the_other_side_counts_in_full() -> None:
    near, far = (2.0, 0.3, 0.7), (-2.0, 0.3, 0.7)
    once = after([(True, near)], -3.0)
    assert after([(True, near), (True, far)], -3.0) - once > 0.9 * (once + 3.0)


def test_a_look_of_a_drive_says_some_of_what_an_independent_one_does() -> None:
    drive = [(True, (2.0 * math.cos(0.25 * k), 2.0 * math.sin(0.25 * k), 0.7)) for k in range(9)]
    odds = [after(drive[:n], 0.0) for n in range(1, 6)]
    assert 0.05 * odds[0] < (odds[4] - odds[0]) / 4.0 < 0.3 * odds[0]


def test_belief_is_never_certain() -> None:
    assert probability(after([(True, eye) for eye in AROUND])) == pytest.approx(CONFIG.belief_max)
    gone = after([(False, eye) for eye in AROUND])
    assert probability(gone) == pytest.approx(1.0 - CONFIG.belief_max)


def test_few_frames_of_an_empty_place_end_the_belief_of_many() -> None:
    belief = ExistenceBelief(CONFIG)
    for number in range(100):
        belief.take(True, AROUND[number % 6])
    for step in range(4):
        belief.take(False, (2.0, 0.3 * step, 0.7))
    assert belief.probability < 0.3


def test_a_single_look_past_it_ends_no_belief() -> None:
    seen = [(True, eye) for eye in AROUND]
    assert 0.3 < probability(after([*seen, (False, AROUND[0])])) < 0.6
    assert probability(after([*seen, (False, AROUND[0]), (True, AROUND[0])])) > 0.8


def test_beliefs_of_two_runs_add_up() -> None:
    assert combined_belief(CONFIG.prior, 0.6, CONFIG) == pytest.approx(0.6)
    assert combined_belief(0.7, 0.6, CONFIG) > 0.9


def test_rates_that_tell_nothing_are_refused() -> None:
    with pytest.raises(ValueError, match="shown_if_there"):
        ExistenceConfig(shown_if_there=0.05)
    with pytest.raises(ValueError, match="through_if_gone"):
        ExistenceConfig(through_if_gone=0.01)


def table_place(beliefs: dict[str, float] | None = None) -> RememberedPlaces:
    """The top of the table of the conftest, as the board has it."""
    contour = (
        "MULTIPOLYGON Z (((-0.7 1.2 0.72, 0.7 1.2 0.72, 0.7 2 0.72, -0.7 2 0.72, -0.7 1.2 0.72)))"
    )
    table = Fluent(
        "table1", "Table", properties=(Property("hasMainPlane", "TablePlane", "plane1"),)
    )
    top = Fluent(
        "plane1", "TablePlane", properties=(Property("hasContour", "xsd:string", contour),)
    )
    planes = remembered_planes([table], {"plane1": top})
    return RememberedPlaces(planes, FusionConfig(), 0.3, beliefs)


@pytest.fixture
def place() -> RememberedPlaces:
    """The same, fully believed in."""
    return table_place()


def gone_after(place: RememberedPlaces, frame: SensorFrame, looks: int) -> int | None:
    """After how many looks the table counts as gone."""
    for number in range(looks):
        if place.look(frame, ["table1"]):
            return number + 1
    return None


def test_remembered_table_that_is_seen_through_is_gone(
    place: RememberedPlaces, render: Render
) -> None:
    assert gone_after(place, render([]), 20) == 10


def test_doubt_of_one_run_counts_in_the_next(place: RememberedPlaces, render: Render) -> None:
    assert place.doubts == {}
    assert gone_after(place, render([]), 4) is None
    assert gone_after(table_place(place.doubts), render([]), 20) == 2


def test_remembered_table_that_stands_there_stays(
    place: RememberedPlaces, render: Render, table_boxes: Any
) -> None:
    assert gone_after(place, render(table_boxes), 20) is None


def test_remembered_table_behind_a_screen_or_out_of_sight_stays(
    place: RememberedPlaces, render: Render
) -> None:
    screen = ((-2.0, 0.6, 0.0), (2.0, 0.7, 2.0))
    assert gone_after(place, render([screen]), 20) is None
    assert gone_after(place, render([], target=(0.0, -3.0, 0.3)), 20) is None


@pytest.mark.parametrize("contour", ["", "POINT (1 2)", "MULTIPOLYGON EMPTY", "no shape"])
def test_contour_that_is_none_leaves_the_piece_alone(contour: str) -> None:
    piece = Fluent(
        "table1", "Table", properties=(Property("hasMainPlane", "TablePlane", "plane1"),)
    )
    plane = Fluent(
        "plane1", "TablePlane", properties=(Property("hasContour", "xsd:string", contour),)
    )
    assert remembered_planes([piece], {"plane1": plane}) == {}
