"""Three-valued relations of uncertain intervals, against trying all choices of their end points."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from fluentboard.model.fluent import Fluent
from fluentboard.model.interval import Certainty, Interval
from fluentboard.model.relations import (
    ALLEN,
    Bounds,
    Relation,
    bounds_of,
    duration_bounds,
    holding_certainty,
    holding_period,
    holding_periods,
    own_certainty,
    related,
    relation_certainty,
    window,
)

Points = NDArray[np.float64]
Truth = NDArray[np.bool_]

LAST = 3
TIMES = st.none() | st.integers(1, LAST).map(float)
# Between two neighbouring values, and beyond the outer ones, lie enough points to put all four end
# points of two intervals into any order.
GRID = np.array([-math.inf, *np.arange(-3.0, LAST + 5.0, 0.25), math.inf])

DEFINITIONS: dict[Relation, Callable[[Points, Points, Points, Points], Truth]] = {
    Relation.BEFORE: lambda s, f, t, g: f < t,
    Relation.AFTER: lambda s, f, t, g: s > g,
    Relation.MEETS: lambda s, f, t, g: f == t,
    Relation.MET_BY: lambda s, f, t, g: s == g,
    Relation.OVERLAPS: lambda s, f, t, g: (s < t) & (t < f) & (f < g),
    Relation.OVERLAPPED_BY: lambda s, f, t, g: (t < s) & (s < g) & (g < f),
    Relation.STARTS: lambda s, f, t, g: (s == t) & (f < g),
    Relation.STARTED_BY: lambda s, f, t, g: (s == t) & (f > g),
    Relation.DURING: lambda s, f, t, g: (s > t) & (f < g),
    Relation.CONTAINS: lambda s, f, t, g: (s < t) & (f > g),
    Relation.FINISHES: lambda s, f, t, g: (s > t) & (f == g),
    Relation.FINISHED_BY: lambda s, f, t, g: (s < t) & (f == g),
    Relation.EQUALS: lambda s, f, t, g: (s == t) & (f == g),
    # Half-open intervals share a moment iff the later start lies before the earlier finish.
    Relation.INTERSECTS: lambda s, f, t, g: np.maximum(s, t) < np.minimum(f, g),
    Relation.COVERS: lambda s, f, t, g: (s <= t) & (f >= g),
    Relation.WITHIN: lambda s, f, t, g: (s >= t) & (f <= g),
}


@st.composite
def intervals(draw: st.DrawFn) -> Interval:
    earliest, latest = draw(TIMES), draw(TIMES)
    if earliest is not None and latest is not None:
        earliest, latest = min(earliest, latest), max(earliest, latest)
    return Interval(earliest, latest)


@st.composite
def fluents(draw: st.DrawFn) -> Bounds:
    start, finish = draw(intervals()), draw(intervals())
    begins, ends = start.earliest, finish.latest
    assume(begins is None or ends is None or begins <= ends)
    return bounds_of(Fluent("on4", "On", start, finish))


def choices(bounds: Bounds) -> tuple[Points, Points]:
    """Start and finish of every admissible choice on the grid."""
    s1, s2, f1, f2 = bounds
    first, last = np.searchsorted(GRID, (s1, f1)), np.searchsorted(GRID, (s2, f2), "right")
    starts, finishes = np.meshgrid(GRID[first[0] : last[0]], GRID[first[1] : last[1]])
    keep = starts <= finishes
    assert keep.any()
    return starts[keep], finishes[keep]


def counted(truth: Truth) -> Certainty:
    if truth.all():
        return Certainty.CERTAIN
    return Certainty.POSSIBLE if truth.any() else Certainty.IMPOSSIBLE


@settings(max_examples=300)
@given(fluents(), fluents())
def test_a_relation_is_what_all_or_some_choices_of_end_points_say(one: Bounds, other: Bounds):
    s, f = choices(one)
    t, g = choices(other)
    for relation, definition in DEFINITIONS.items():
        truth = definition(s[:, None], f[:, None], t[None, :], g[None, :])
        assert relation_certainty(relation, one, other) is counted(truth), relation


@settings(max_examples=200)
@given(fluents(), st.integers(1, LAST), st.integers(0, LAST))
def test_a_relation_to_a_window_is_what_all_or_some_choices_say(
    one: Bounds, begin: int, length: int
):
    s, f = choices(one)
    t, g = np.array(float(begin)), np.array(float(begin + length))
    for relation, definition in DEFINITIONS.items():
        found = relation_certainty(relation, one, window(begin, begin + length))
        assert found is counted(definition(s, f, t, g)), relation


@given(fluents())
def test_a_relation_to_itself_has_the_same_end_points_on_both_sides(bounds: Bounds):
    s, f = choices(bounds)
    for relation, definition in DEFINITIONS.items():
        assert own_certainty(relation, bounds) is counted(definition(s, f, s, f)), relation


@given(st.lists(fluents(), max_size=5), fluents(), st.sampled_from(Certainty))
def test_many_intervals_at_once_give_the_same_answers(
    many: list[Bounds], other: Bounds, certainty: Certainty
):
    columns = np.array(many).reshape(-1, 4).T
    for relation in Relation:
        expected = [relation_certainty(relation, one, other) >= certainty for one in many]
        assert related(relation, columns, other, certainty).tolist() == expected


@given(fluents(), fluents())
def test_the_inverse_relation_has_the_same_certainty_the_other_way_round(
    one: Bounds, other: Bounds
):
    for relation in Relation:
        assert relation.inverse.inverse is relation
        assert relation_certainty(relation, one, other) is relation_certainty(
            relation.inverse, other, one
        )


@given(*(st.floats(-9, 9) for _ in range(4)))
def test_of_two_known_intervals_that_last_exactly_one_of_the_thirteen_holds(
    s: float, f: float, t: float, g: float
):
    assume(s != f and t != g)
    one, other = window(min(s, f), max(s, f)), window(min(t, g), max(t, g))
    found = [relation_certainty(relation, one, other) for relation in ALLEN]
    assert sorted(found) == [Certainty.IMPOSSIBLE] * 12 + [Certainty.CERTAIN]


@given(fluents())
def test_holding_agrees_with_the_period_of_holding(bounds: Bounds):
    s, f = choices(bounds)
    for time_s in GRID[np.isfinite(GRID)].tolist():
        found = holding_certainty(bounds, time_s)
        assert found is counted((s <= time_s) & (time_s < f))
        for certainty in Certainty:
            begin, end = holding_period(bounds, certainty)
            assert (begin <= time_s < end) is (found >= certainty)
            begins, ends = holding_periods(np.array([bounds]).T, certainty)
            assert ([begin], [end]) == (begins.tolist(), ends.tolist())


@given(*(st.integers(1, LAST) for _ in range(4)))
def test_the_bounds_of_a_duration_are_reached_and_never_passed(s: int, t: int, f: int, g: int):
    assume(min(s, t) <= max(f, g))
    bounds = (float(min(s, t)), float(max(s, t)), float(min(f, g)), float(max(f, g)))
    starts, finishes = choices(bounds)
    durations = finishes - starts
    assert duration_bounds(bounds) == (durations.min(), durations.max())


@pytest.mark.parametrize(
    ("bounds", "duration_s"),
    [
        ((-math.inf, -math.inf, math.inf, math.inf), (math.inf, math.inf)),
        ((5.0, 5.0, math.inf, math.inf), (math.inf, math.inf)),
        ((-math.inf, 5.0, 8.0, 9.0), (3.0, math.inf)),
        ((5.0, math.inf, 8.0, 9.0), (0.0, 4.0)),
        ((5.0, math.inf, math.inf, math.inf), (0.0, math.inf)),
        ((-math.inf, -math.inf, -math.inf, 5.0), (0.0, math.inf)),
    ],
)
def test_the_duration_is_unbounded_where_an_end_is_unknown(
    bounds: Bounds, duration_s: tuple[float, float]
):
    assert duration_bounds(bounds) == duration_s
