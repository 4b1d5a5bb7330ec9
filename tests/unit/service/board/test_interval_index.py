"""The interval index: filters by time, class and relation, at any commit."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fluentboard.board.intervals import FluentFilter, IntervalIndex
from fluentboard.model.fluent import Fluent
from fluentboard.model.interval import Certainty, Interval
from fluentboard.model.relations import Relation, bounds_of, window

MUG = Fluent("mug1", "Mug", Interval(1.0, 2.0), Interval())
ENDED = Fluent("mug1", "Mug", Interval(1.0, 2.0), Interval(5.0, 6.0))
PLATE = Fluent("plate1", "Plate", Interval.at(3.0), Interval.at(9.0))


@pytest.fixture
def index() -> IntervalIndex:
    index = IntervalIndex()
    index.put([(MUG, 1), (PLATE, 2), (ENDED, 3)])
    return index


def names(index: IntervalIndex, wanted: FluentFilter) -> list[str]:
    rows = index.rows(wanted, lambda name: name == wanted.class_name)
    return [index.name(row) for row in rows.tolist()]


def test_what_holds_now_is_listed_in_the_order_of_assertion(index: IntervalIndex):
    assert names(index, FluentFilter(at_s=4.0)) == ["mug1", "plate1"]
    assert names(index, FluentFilter(at_s=7.0)) == ["plate1"]


def test_certainty_narrows_a_filter(index: IntervalIndex):
    assert names(index, FluentFilter(at_s=5.5)) == ["mug1", "plate1"]
    assert names(index, FluentFilter(at_s=5.5, certainty=Certainty.CERTAIN)) == ["plate1"]


def test_an_earlier_belief_is_filtered_by_what_was_believed_then(index: IntervalIndex):
    assert names(index, FluentFilter(at_s=7.0, as_of=2)) == ["mug1", "plate1"]
    assert names(index, FluentFilter(at_s=7.0, as_of=1)) == ["mug1"]
    assert names(index, FluentFilter(as_of=0)) == []


def test_what_was_open_then_is_not_open_now(index: IntervalIndex):
    assert names(index, FluentFilter(is_open=True, as_of=2)) == ["mug1"]
    assert names(index, FluentFilter(is_open=True)) == []


def test_a_class_is_the_class_of_the_time(index: IntervalIndex):
    index.put([(Fluent("mug1", "Plate"), 4)])
    assert names(index, FluentFilter(class_name="Plate")) == ["mug1", "plate1"]
    assert names(index, FluentFilter(class_name="Plate", as_of=3)) == ["plate1"]


def test_a_window_lists_what_may_hold_at_some_moment_of_it(index: IntervalIndex):
    assert names(index, FluentFilter(during=(5.5, 5.6))) == ["mug1", "plate1"]
    assert names(index, FluentFilter(during=(6.0, 8.0))) == ["plate1"]
    assert names(index, FluentFilter(during=(5.0, 5.0))) == []


def test_a_relation_to_an_interval_filters(index: IntervalIndex):
    within = (Relation.WITHIN, window(1.0, 7.0))
    assert names(index, FluentFilter(relation=within)) == ["mug1"]
    assert names(index, FluentFilter(relation=(Relation.STARTS, bounds_of(MUG)))) == ["mug1"]


def test_a_fluent_relates_to_itself_with_the_same_end_points(index: IntervalIndex):
    equal = (Relation.EQUALS, "mug1")
    assert names(index, FluentFilter(relation=equal, certainty=Certainty.CERTAIN)) == ["mug1"]
    assert names(index, FluentFilter(relation=(Relation.MEETS, "mug1"))) == []


def test_a_relation_to_a_fluent_is_to_what_was_believed_of_it(index: IntervalIndex):
    after = (Relation.FINISHED_BY, "mug1")
    wanted = FluentFilter(relation=after, certainty=Certainty.POSSIBLE)
    assert names(index, wanted) == []
    index.put([(Fluent("plate1", "Plate", Interval.at(1.5), Interval.at(5.5)), 4)])
    assert names(index, FluentFilter(relation=(Relation.FINISHES, "mug1"))) == ["plate1"]
    assert names(index, FluentFilter(relation=(Relation.FINISHES, "mug1"), as_of=3)) == []
    assert names(index, FluentFilter(relation=(Relation.WITHIN, "mug1"), as_of=2)) == [
        "mug1",
        "plate1",
    ]
    assert names(index, FluentFilter(relation=(Relation.EQUALS, "nobody"))) == []


def test_bounds_are_those_of_the_commit(index: IntervalIndex):
    assert index.bounds(0, 3) == (1.0, 2.0, 5.0, 6.0)
    assert index.bounds(0, 2) == (1.0, 2.0, math.inf, math.inf)
    assert index.bounds(1, 1) is None


def test_what_changed_between_two_commits_is_as_believed_after_the_second(index: IntervalIndex):
    index.put([(Fluent("mug1", "Mug", Interval(1.0, 1.5), Interval(5.0, 5.5)), 4)])
    changed = index.changed(1, 3)
    assert changed.rows.tolist() == [0, 1]
    assert changed.bounds.T.tolist() == [[1.0, 2.0, 5.0, 6.0], [3.0, 3.0, 9.0, 9.0]]
    assert index.changed(4, 4).rows.tolist() == []


def test_many_changes_are_undone_as_a_replay_would_have_it():
    rng = np.random.default_rng(7)
    index, past = IntervalIndex(), [dict[int, list[float]]()]
    for commit in range(1, 400):
        row = int(rng.integers(min(commit, 30)))
        bounds = sorted(rng.uniform(1.0, 9.0, 4).tolist())
        known = dict(past[-1])
        row = len(known) if row >= len(known) else row
        known[row] = bounds
        index.put_outline(f"f{row}", "Mug", (bounds[0], bounds[1], bounds[2], bounds[3]), commit)
        past.append(known)
    for commit in (0, 1, 17, 200, 397, 398, 399):
        outline = index.outline(commit)
        assert (
            dict(zip(outline.rows.tolist(), outline.bounds.T.tolist(), strict=True)) == past[commit]
        )
        for row, bounds in past[commit].items():
            assert list(index.bounds(row, commit) or ()) == bounds
        held = [row for row, (s1, _, _, f2) in past[commit].items() if s1 <= 4.0 < f2]
        wanted = FluentFilter(at_s=4.0, as_of=commit)
        assert index.rows(wanted, lambda _name: True).tolist() == sorted(held)
