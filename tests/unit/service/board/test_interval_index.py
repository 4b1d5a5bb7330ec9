"""The interval index: filters by time, class and relation, at any commit."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from fluentboard.board.intervals import FluentFilter, IntervalIndex
from fluentboard.model.fluent import Fluent
from fluentboard.model.interval import Certainty, Interval
from fluentboard.model.relations import (
    Bounds,
    Relation,
    bounds_of,
    holding_certainty,
    own_certainty,
    relation_certainty,
    window,
)

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


Known = dict[int, tuple[str, Bounds]]


@pytest.fixture(scope="module")
def history() -> tuple[IntervalIndex, list[Known]]:
    """An index after 400 commits, and what was known after each."""
    rng = np.random.default_rng(7)
    index, past = IntervalIndex(), [Known()]
    for commit in range(1, 400):
        s1, s2, f1, f2 = sorted(rng.integers(1, 9, 4).astype(float).tolist())
        known = dict(past[-1])
        row = min(int(rng.integers(30)), len(known))
        known[row] = "Mug" if rng.random() < 0.5 else "Plate", (s1, s2, f1, f2)
        index.put_outline(f"f{row}", *known[row], commit)
        past.append(known)
    return index, past


def test_many_changes_are_undone_as_a_replay_would_have_it(
    history: tuple[IntervalIndex, list[Known]],
):
    index, past = history
    for commit in (0, 1, 17, 200, 397, 398, 399):
        outline = index.outline(commit)
        known = {row: list(bounds) for row, (_, bounds) in past[commit].items()}
        assert dict(zip(outline.rows.tolist(), outline.bounds.T.tolist(), strict=True)) == known
        for row, bounds in known.items():
            assert list(index.bounds(row, commit) or ()) == bounds


@pytest.mark.parametrize("commit", [0, 1, 17, 200, 398, 399])
@pytest.mark.parametrize("certainty", [Certainty.POSSIBLE, Certainty.CERTAIN])
def test_filters_at_a_commit_pass_what_a_replay_would_pass(
    history: tuple[IntervalIndex, list[Known]], commit: int, certainty: Certainty
):
    index, past = history
    known = past[commit]

    def found(wanted: FluentFilter) -> list[int]:
        return index.rows(wanted, lambda name: name == wanted.class_name).tolist()

    holding = [r for r, (_, b) in known.items() if holding_certainty(b, 4.0) >= certainty]
    assert found(FluentFilter(at_s=4.0, as_of=commit, certainty=certainty)) == sorted(holding)
    for relation in Relation:
        for name in ("f0", "f11"):
            itself = int(name[1:])
            expected = [
                row
                for row, (class_name, bounds) in known.items()
                if itself in known
                and class_name == "Mug"
                and (
                    own_certainty(relation, bounds)
                    if row == itself
                    else relation_certainty(relation, bounds, known[itself][1])
                )
                >= certainty
            ]
            wanted = FluentFilter("Mug", None, None, certainty, as_of=commit)
            wanted = replace(wanted, relation=(relation, name))
            assert found(wanted) == sorted(expected)
