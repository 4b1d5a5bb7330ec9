"""Listings 2.2, 4.1 and 4.2 as printed: what they say, and that they survive a round trip."""

from __future__ import annotations

from pathlib import Path

import pytest

from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.interval import UNKNOWN, Certainty, Interval
from fluentboard.model.yaml_format import fluent_to_yaml, read_fluents

HERE = Path(__file__).parent
PARTS_BEFORE = ["mug1", "poseMug1_0", "bBoxMug1_0", "poseBBMug1_0"]
UPDATE_S = 1423225357.28  # when the robot looked at mug1 in Listing 4.2


def listing(number: str) -> dict[str, Fluent]:
    path = HERE / f"listing_{number}.yaml"
    with path.open(encoding="utf-8") as stream:
        return {fluent.name: fluent for fluent in read_fluents(stream, path.name)}


def merged(first: dict[str, Fluent], second: dict[str, Fluent]) -> dict[str, Fluent]:
    return first | {
        name: first[name].merged(fluent) if name in first else fluent
        for name, fluent in second.items()
    }


@pytest.mark.parametrize(
    ("number", "names"),
    [
        ("2_2", ["pickUpObjectActivity_0X0", "on4", "holding0"]),
        ("4_1", PARTS_BEFORE),
        ("4_2", [*PARTS_BEFORE, "poseMug1_1", "bBoxMug1_1", "poseBBMug1_1"]),
    ],
)
def test_a_listing_holds_its_fluents_in_order(number: str, names: list[str]):
    assert list(listing(number)) == names


@pytest.mark.parametrize("number", ["2_2", "4_1", "4_2"])
def test_a_listing_survives_a_round_trip(number: str):
    fluents = list(listing(number).values())
    assert list(read_fluents("---\n".join(map(fluent_to_yaml, fluents)))) == fluents


def test_listing_2_2_is_written_as_printed_but_for_the_word_on():
    text = "---\n".join(fluent_to_yaml(fluent) for fluent in listing("2_2").values())
    printed = (HERE / "listing_2_2.yaml").read_text(encoding="utf-8")
    # A YAML 1.1 reader takes a bare On for true, so the class is written in quotes.
    assert text.replace('"On"', "On") == printed


def test_the_activity_of_listing_2_2_has_exact_times():
    activity = listing("2_2")["pickUpObjectActivity_0X0"]
    assert activity.class_name == "PickUpObjectActivity"
    assert (activity.start, activity.finish) == (Interval.at(119.621), Interval.at(161.817))
    assert activity.holds_at(119.621) is Certainty.CERTAIN
    assert activity.holds_at(161.817) is Certainty.IMPOSSIBLE
    assert activity.properties == (
        Property("hasArm", "Arm", "rightArm1"),
        Property("hasPassiveObject", "Mug", "mug1"),
        Property("hasResult", "xsd:string", "succeeded"),
        Property("hasOn", "On", "on4"),
        Property("hasHolding", "Holding", "holding0"),
    )


def test_on4_of_listing_2_2_held_since_ever_and_finished_during_the_activity():
    on4 = listing("2_2")["on4"]
    assert on4.class_name == "On"
    assert on4.start is UNKNOWN
    assert on4.finish == Interval(119.621, 161.817)
    assert on4.values("isInitialKnowledge") == (True,)
    assert on4.holds_at(100.0) is Certainty.CERTAIN
    assert on4.holds_at(161.817) is Certainty.IMPOSSIBLE


def test_holding0_of_listing_2_2_is_open():
    holding0 = listing("2_2")["holding0"]
    assert holding0.is_open
    assert holding0.holds_at(100.0) is Certainty.IMPOSSIBLE
    assert holding0.holds_at(161.817) is Certainty.CERTAIN
    assert holding0.holds_at(1e9) is Certainty.CERTAIN


@pytest.mark.parametrize("name", ["on4", "holding0"])
def test_during_the_activity_of_listing_2_2_both_relations_possibly_hold(name: str):
    assert listing("2_2")[name].holds_at(140.0) is Certainty.POSSIBLE


def test_the_fluents_of_listing_4_1_hold_at_all_times():
    for fluent in listing("4_1").values():
        assert fluent.start.is_unknown
        assert fluent.is_open
        assert fluent.holds_at(UPDATE_S) is Certainty.CERTAIN


def test_the_coordinates_of_listing_4_1_are_floats():
    pose = listing("4_1")["poseMug1_0"]
    assert {p.name: p.value for p in pose.properties} == {
        "hasX": 5.59,
        "hasY": 10.3,
        "hasZ": 0.71,
        "hasYaw": -1.4,
    }
    assert {p.type for p in pose.properties} == {"xsd:float"}


def test_merging_listing_4_2_over_4_1_gives_listing_4_2():
    assert merged(listing("4_1"), listing("4_2")) == listing("4_2")


def test_after_the_update_mug1_has_two_poses_and_two_boxes():
    mug1 = merged(listing("4_1"), listing("4_2"))["mug1"]
    assert mug1.values("hasPose") == ("poseMug1_0", "poseMug1_1")
    assert mug1.values("hasBoundingBox") == ("bBoxMug1_0", "bBoxMug1_1")
    assert mug1.is_open


@pytest.mark.parametrize("part", ["poseMug1", "bBoxMug1", "poseBBMug1"])
def test_the_update_ends_the_old_part_when_the_new_one_begins(part: str):
    after = merged(listing("4_1"), listing("4_2"))
    old, new = after[f"{part}_0"], after[f"{part}_1"]
    assert old.finish == new.start == Interval.at(UPDATE_S)
    assert new.is_open
    assert old.holds_at(UPDATE_S - 1.0) is Certainty.CERTAIN
    assert old.holds_at(UPDATE_S) is Certainty.IMPOSSIBLE
    assert new.holds_at(UPDATE_S) is Certainty.CERTAIN


def test_importing_the_older_listing_again_changes_nothing():
    after = listing("4_2")
    assert merged(after, listing("4_1")) == after
