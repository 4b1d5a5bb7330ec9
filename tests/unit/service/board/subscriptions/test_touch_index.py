"""Statements lead to the holders of their shapes, and to nobody else."""

from __future__ import annotations

from fluentboard.board.subscriptions.footprint import ANYTHING, Shape
from fluentboard.board.subscriptions.touch_index import TouchIndex, matches

STATEMENT = ("<s>", "<p>", "<o>")


def test_each_way_of_naming_a_statement_finds_it() -> None:
    index: TouchIndex[Shape] = TouchIndex()
    shapes: list[Shape] = [
        (subject, predicate, target)
        for subject in ("<s>", None)
        for predicate in ("<p>", None)
        for target in ("<o>", None)
    ]
    for shape in shapes:
        index.add(shape, [shape])
        index.add(("<x>", *shape[1:]), [("<x>", *shape[1:])])
    assert set(index.touched([STATEMENT])) == set(shapes)


def test_removed_holder_is_not_found_and_others_stay() -> None:
    index: TouchIndex[str] = TouchIndex()
    index.add("one", [(None, "<p>", None), ANYTHING])
    index.add("two", [(None, "<p>", None)])
    index.remove("one", [(None, "<p>", None), ANYTHING])
    index.remove("one", [(None, "<p>", None)])
    assert list(index.touched([STATEMENT])) == ["two"]
    index.remove("two", [(None, "<p>", None)])
    assert not len(index)
    assert not index.touched([STATEMENT])


def test_holder_is_found_once_for_many_statements() -> None:
    index: TouchIndex[str] = TouchIndex()
    index.add("one", [(None, "<p>", None)])
    assert list(index.touched([STATEMENT, ("<t>", "<p>", "<q>")])) == ["one"]


def test_shape_matches_where_its_constants_are_equal() -> None:
    assert matches(("<s>", None, "<o>"), STATEMENT)
    assert not matches(("<s>", None, "<q>"), STATEMENT)
