"""Belief that something is there: what a frame adds, and what adds nothing."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from fluentboard.model.fluent import Fluent, Property
from fluentboard_modules.frames.sensor_frame import SensorFrame
from fluentboard_modules.mapping.config import ExistenceConfig, FusionConfig
from fluentboard_modules.mapping.existence import (
    after_detections,
    after_misses,
    combined_belief,
    log_odds,
    probability,
    supported_belief,
    verified_belief,
)
from fluentboard_modules.mapping.remembered_places import RememberedPlaces, remembered_planes

CONFIG = ExistenceConfig()
Render = Callable[..., SensorFrame]


def test_cad_file_that_agrees_makes_up_for_few_frames() -> None:
    seen_twice = supported_belief(2, CONFIG)
    assert verified_belief(seen_twice, 0.99, CONFIG) > 0.9 > 0.6 > seen_twice
    assert verified_belief(seen_twice, 0.5, CONFIG) == pytest.approx(seen_twice)
    assert verified_belief(seen_twice, 0.0, CONFIG) < 0.02
    assert verified_belief(1.0 - 1e-9, 1.0, CONFIG) == pytest.approx(CONFIG.belief_max)


def test_belief_follows_bayes() -> None:
    odds = after_misses(after_detections(log_odds(0.5), 2, CONFIG), 1, CONFIG)
    there = 0.7 * 0.7 * 0.3
    not_there = 0.4 * 0.4 * 0.6
    assert probability(odds) == pytest.approx(there / (there + not_there))


def test_belief_is_never_certain() -> None:
    assert supported_belief(10_000, CONFIG) == pytest.approx(CONFIG.belief_max)
    assert probability(after_misses(0.0, 10_000, CONFIG)) == pytest.approx(1 - CONFIG.belief_max)


def test_few_frames_of_an_empty_place_end_the_belief_of_many() -> None:
    odds = after_detections(log_odds(CONFIG.prior), 10_000, CONFIG)
    assert probability(after_misses(odds, 7, CONFIG)) < 0.3


def test_beliefs_of_two_runs_add_up() -> None:
    assert combined_belief(CONFIG.prior, 0.6, CONFIG) == pytest.approx(0.6)
    assert combined_belief(0.7, 0.6, CONFIG) > 0.9


def test_rates_that_tell_nothing_are_refused() -> None:
    with pytest.raises(ValueError, match="detection_rate"):
        ExistenceConfig(detection_rate=0.4)


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
    assert gone_after(place, render([]), 20) == 7


def test_doubt_of_one_run_counts_in_the_next(place: RememberedPlaces, render: Render) -> None:
    assert place.doubts == {}
    assert gone_after(place, render([]), 4) is None
    assert gone_after(table_place(place.doubts), render([]), 20) == 3


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
