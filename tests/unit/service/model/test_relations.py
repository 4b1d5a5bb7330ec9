"""Relations of uncertain intervals: names, windows, and the examples of the reference."""

from __future__ import annotations

import math

import pytest

from fluentboard.errors import IntervalReversed, InvalidTime
from fluentboard.model.fluent import Fluent
from fluentboard.model.interval import UNKNOWN, Certainty, Interval
from fluentboard.model.relations import (
    ALLEN,
    Relation,
    bounds_of,
    own_certainty,
    relation_certainty,
    window,
)

PICK_UP = bounds_of(
    Fluent("pickUp", "PickUpObjectActivity", Interval.at(119.621), Interval.at(161.817))
)
ON = bounds_of(Fluent("on4", "On", UNKNOWN, Interval(119.621, 161.817)))
HOLDING = bounds_of(Fluent("holding0", "Holding", Interval(119.621, 161.817), UNKNOWN))


def test_there_are_thirteen_relations_of_allen():
    assert len(ALLEN) == 13
    assert Relation.INTERSECTS not in ALLEN


def test_a_relation_has_a_name_for_the_wire_for_sparql_and_for_owl_time():
    assert Relation("met-by") is Relation.MET_BY
    assert Relation.MET_BY.camel == "MetBy"
    assert Relation.MET_BY.owl_time == "intervalMetBy"
    assert Relation.COVERS.owl_time is None


@pytest.mark.parametrize(
    ("relation", "one", "other", "certainty"),
    [
        (Relation.OVERLAPS, ON, PICK_UP, Certainty.POSSIBLE),
        (Relation.MEETS, ON, PICK_UP, Certainty.POSSIBLE),
        (Relation.CONTAINS, ON, PICK_UP, Certainty.IMPOSSIBLE),
        (Relation.BEFORE, ON, HOLDING, Certainty.POSSIBLE),
        (Relation.DURING, ON, HOLDING, Certainty.IMPOSSIBLE),
        (Relation.INTERSECTS, PICK_UP, window(100.0, 130.0), Certainty.CERTAIN),
        (Relation.INTERSECTS, ON, window(120.0, 130.0), Certainty.POSSIBLE),
        (Relation.COVERS, ON, window(1.0, 100.0), Certainty.CERTAIN),
    ],
)
def test_the_fluents_of_listing_2_2_relate_as_the_reference_says(
    relation: Relation, one: tuple[float, ...], other: tuple[float, ...], certainty: Certainty
):
    s1, s2, f1, f2 = one
    t1, t2, g1, g2 = other
    assert relation_certainty(relation, (s1, s2, f1, f2), (t1, t2, g1, g2)) is certainty


def test_during_a_window_is_false_for_what_ended_before_it():
    event = window(10.0, 50.0)
    for relation in (Relation.DURING, Relation.INTERSECTS, Relation.WITHIN):
        assert relation_certainty(relation, event, window(60.0, 70.0)) is Certainty.IMPOSSIBLE


def test_a_fluent_equals_itself_however_little_is_known():
    assert own_certainty(Relation.EQUALS, ON) is Certainty.CERTAIN
    assert relation_certainty(Relation.EQUALS, ON, ON) is Certainty.POSSIBLE


def test_two_open_fluents_finish_together():
    one, other = window(1.0, math.inf), window(2.0, math.inf)
    assert relation_certainty(Relation.FINISHED_BY, one, other) is Certainty.CERTAIN


def test_an_instant_at_the_start_of_an_interval_both_meets_and_starts_it():
    for relation in (Relation.MEETS, Relation.STARTS):
        found = relation_certainty(relation, window(3.0, 3.0), window(3.0, 5.0))
        assert found is Certainty.CERTAIN


def test_a_reversed_window_is_refused():
    with pytest.raises(IntervalReversed, match=r"5\.0 s, before it begins at 6\.0 s"):
        window(6.0, 5.0)


def test_a_window_without_a_number_is_refused():
    with pytest.raises(InvalidTime, match="NaN"):
        window(math.nan, 5.0)
