from __future__ import annotations

import math
from typing import Any

import pytest

from fluentboard.errors import (
    FluentboardError,
    IntervalReversed,
    InvalidName,
    InvalidTime,
    NotARefinement,
)
from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.interval import UNKNOWN, Certainty, Interval

MUG = Property("hasPassiveObject", "Mug", "mug1")


def on4(start: Interval = UNKNOWN, finish: Interval = UNKNOWN, *properties: Property) -> Fluent:
    return Fluent("on4", "On", start, finish, properties)


# Properties


def test_a_property_with_an_xsd_type_holds_a_literal():
    statement = Property("hasX", "xsd:float", "5.59")
    assert statement.value == 5.59
    assert not statement.is_reference


def test_a_property_with_a_class_refers_to_another_fluent():
    assert MUG.is_reference


@pytest.mark.parametrize(
    "name", ["", "has pose", "has<pose", "a\x00b", "\ud800", "x" * 513, 5, None]
)
def test_a_property_name_can_be_part_of_an_iri(name: Any):
    with pytest.raises(InvalidName, match="not a name or an IRI"):
        Property(name, "xsd:float", 1.0)


def test_a_property_name_may_be_an_iri():
    assert Property("http://example.org/terms#hasX", "xsd:float", 1.0).value == 1.0


@pytest.mark.parametrize("kind", ["", "x y", None])
def test_a_property_type_is_a_name(kind: Any):
    with pytest.raises(InvalidName, match="XSD type such as"):
        Property("hasX", kind, 1.0)


@pytest.mark.parametrize("value", ["mug 1", "", "a/b", ".", "..", 5.0, None])
def test_a_reference_is_the_name_of_a_fluent(value: Any):
    with pytest.raises(InvalidName, match="refers to"):
        Property("hasPassiveObject", "Mug", value)


# Fluents


@pytest.mark.parametrize(
    "name", ["mug1", "pickUpObjectActivity_0X0", "Tasse_größe", "茶碗", "a.b-c~d"]
)
def test_a_fluent_may_have_a_name_of_any_script(name: str):
    assert Fluent(name, "Mug").name == name


@pytest.mark.parametrize("name", ["", "mug 1", "a/b", "a#b", ".", "..", "x" * 257, "a\n", None, 5])
def test_a_fluent_name_can_stand_in_an_iri_path(name: Any):
    with pytest.raises(InvalidName, match="fluent name"):
        Fluent(name, "Mug")


@pytest.mark.parametrize("class_name", ["", "A Mug", None])
def test_a_class_is_a_name(class_name: Any):
    with pytest.raises(InvalidName, match="of fluent 'mug1'"):
        Fluent("mug1", class_name)


def test_a_repeated_statement_is_kept_once():
    more = Property("hasPassiveObject", "Mug", "mug2")
    assert on4(UNKNOWN, UNKNOWN, MUG, more, MUG).properties == (MUG, more)


def test_properties_may_come_as_any_iterable():
    statements: Any = [MUG]
    assert Fluent("on4", "On", properties=statements).properties == (MUG,)


def test_a_fluent_cannot_finish_before_it_can_have_started():
    with pytest.raises(IntervalReversed, match=r"start.earliest 10\.0 s, finish.latest 5\.0 s"):
        on4(Interval(10.0, 20.0), Interval(2.0, 5.0))


def test_start_and_finish_may_overlap():
    assert on4(Interval(1.0, 20.0), Interval(2.0, 5.0)).start.latest == 20.0


def test_unknown_ends_lie_at_infinity():
    assert on4().start_bounds == (-math.inf, -math.inf)
    assert on4().finish_bounds == (math.inf, math.inf)


def test_a_half_known_end_is_uncertain_on_the_other_side():
    assert on4(start=Interval(None, 3.0)).start_bounds == (-math.inf, 3.0)
    assert on4(finish=Interval(3.0, None)).finish_bounds == (3.0, math.inf)


@pytest.mark.parametrize(
    ("time_s", "certainty"),
    [
        (0.5, Certainty.IMPOSSIBLE),
        (1.0, Certainty.POSSIBLE),
        (2.0, Certainty.CERTAIN),
        (4.9, Certainty.CERTAIN),
        (5.0, Certainty.POSSIBLE),
        (6.0, Certainty.IMPOSSIBLE),
    ],
)
def test_a_fluent_certainly_holds_from_its_latest_start_to_its_earliest_finish(
    time_s: float, certainty: Certainty
):
    assert on4(Interval(1.0, 2.0), Interval(5.0, 6.0)).holds_at(time_s) is certainty


def test_nothing_can_be_said_about_nan():
    with pytest.raises(InvalidTime, match="NaN"):
        on4().holds_at(math.nan)


def test_values_of_a_property_keep_their_order():
    poses = [Property("hasPose", "Pose", f"pose{i}") for i in (3, 1, 2)]
    assert on4(UNKNOWN, UNKNOWN, *poses, MUG).values("hasPose") == ("pose3", "pose1", "pose2")


# Ending and refining


def test_ending_an_open_fluent_sets_its_finish():
    assert on4().ended(5.0) == on4(finish=Interval.at(5.0))
    assert on4().ended(Interval(5.0, 7.0)).finish == Interval(5.0, 7.0)


def test_a_fluent_is_ended_at_a_known_time():
    with pytest.raises(InvalidTime, match="say when it ended"):
        on4().ended(UNKNOWN)


def test_an_ended_fluent_cannot_end_at_another_time():
    with pytest.raises(NotARefinement, match="finish of 'on4'"):
        on4().ended(5.0).ended(6.0)


def test_a_fluent_cannot_end_before_it_started():
    with pytest.raises(IntervalReversed):
        on4(start=Interval.at(10.0)).ended(5.0)


def test_refining_narrows_intervals_and_adds_statements():
    refined = on4(Interval(1.0, 9.0)).refined(start=Interval(2.0, 3.0), properties=[MUG])
    assert refined == on4(Interval(2.0, 3.0), UNKNOWN, MUG)


@pytest.mark.parametrize("finish", [UNKNOWN, Interval(4.0, 6.0), Interval(5.0, 7.0)])
def test_refining_never_widens_or_unends(finish: Interval):
    with pytest.raises(NotARefinement, match="would widen it"):
        on4(finish=Interval(5.0, 6.0)).refined(finish=finish)


# Merging


def test_a_half_known_start_is_completed_by_the_other_half():
    merged = on4(Interval(3.0, None)).merged(on4(Interval(None, 5.0)))
    assert merged.start == Interval(3.0, 5.0)


def test_overlapping_accounts_leave_what_both_admit():
    assert on4(Interval(1, 5)).merged(on4(Interval(3, 9))).start == Interval(3, 5)


@pytest.mark.parametrize("wider", [UNKNOWN, Interval(1.0, 9.0), Interval(None, 9.0)])
def test_a_less_precise_account_changes_nothing(wider: Interval):
    known = on4(Interval(3.0, 4.0))
    assert known.merged(on4(wider)) is known


def test_an_account_that_does_not_overlap_is_a_conflict():
    with pytest.raises(NotARefinement, match="no time lies in both"):
        on4(finish=Interval(1.0, 2.0)).merged(on4(finish=Interval(3.0, 4.0)))


def test_accounts_that_reverse_the_fluent_together_are_a_conflict():
    early_finish = on4(Interval(1.0, 9.0), Interval(5.0, 6.0))
    late_start = on4(Interval(8.0, 9.0), Interval(5.0, 10.0))
    with pytest.raises(NotARefinement, match=r"started at 8\.0 s .* finished at 6\.0 s"):
        early_finish.merged(late_start)


def test_merging_adds_only_new_statements_at_the_end():
    first, second = (Property("hasPose", "Pose", f"pose{i}") for i in (1, 2))
    merged = on4(UNKNOWN, UNKNOWN, first, MUG).merged(on4(UNKNOWN, UNKNOWN, second, first))
    assert merged.properties == (first, MUG, second)


@pytest.mark.parametrize("other", [Fluent("on5", "On"), Fluent("on4", "Under")])
def test_accounts_of_another_fluent_or_class_do_not_merge(other: Fluent):
    with pytest.raises(NotARefinement):
        on4().merged(other)


def test_merging_keeps_what_the_board_knows_about_the_commit():
    board = Fluent("on4", "On", version=7, author="mapping", created=3)
    merged = board.merged(on4(UNKNOWN, UNKNOWN, MUG))
    assert (merged.version, merged.author, merged.created) == (7, "mapping", 3)


def test_a_message_cuts_a_huge_name():
    with pytest.raises(FluentboardError) as failure:
        Fluent("x" * 1_000_000, "Mug")
    assert len(str(failure.value)) < 300
