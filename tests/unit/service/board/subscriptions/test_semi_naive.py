"""Tier 3: what a join asks for, and how its solutions move on."""

from __future__ import annotations

from collections.abc import Callable

# The board of conftest.py.
from typing import Any

import pytest

from fluentboard.board.commands import AssertFluent, CorrectFluent, RefineFluent
from fluentboard.board.subscriptions.changes import CommitChange
from fluentboard.board.subscriptions.reevaluate import evaluate
from fluentboard.board.subscriptions.semi_naive import Moves, SemiNaive, moves_of
from fluentboard.board.subscriptions.standing import Plan
from fluentboard.model.fluent import Fluent, Property

QUERY = "SELECT ?x ?l { ?x a race:Mug ; upper:onTop ?t . ?t upper:label ?l }"
LABEL = Property("label", "xsd:string", "round")


def mug(name: str, *tables: str) -> Fluent:
    return Fluent(
        name, "Mug", properties=tuple(Property("onTop", "Table", table) for table in tables)
    )


@pytest.fixture
def join(plan_of: Callable[[str], Plan]) -> SemiNaive:
    chosen = plan_of(QUERY)
    assert isinstance(chosen, SemiNaive)
    return chosen


def moves(change: CommitChange) -> Moves:
    return moves_of([change])


def test_nothing_is_asked_where_no_pattern_matches(
    join: SemiNaive, change_of: Callable[..., CommitChange]
) -> None:
    change = change_of(AssertFluent(Fluent("pose1", "Pose")))
    assert join.question(moves(change)) == ""


def test_added_statement_is_bound_in_the_question(
    join: SemiNaive, change_of: Callable[..., CommitChange]
) -> None:
    change = change_of(AssertFluent(Fluent("table1", "Table", properties=(LABEL,))))
    question = join.question(moves(change))
    assert question is not None
    assert 'VALUES (?t ?l) { (<https://w3id.org/fluentboard/fluent/table1> "round") }' in question
    assert question.count("VALUES") == 1


def test_fluent_whose_class_is_not_admitted_asks_nothing(
    plan_of: Callable[[str], Plan], change_of: Callable[..., CommitChange]
) -> None:
    join = plan_of(
        "SELECT ?x { ?x a ?c . ?c rdfs:subClassOf* upper:Area . ?x upper:near ?y . ?y a race:Mug }"
    )
    assert isinstance(join, SemiNaive)
    assert join.question(moves(change_of(AssertFluent(Fluent("plate1", "Plate"))))) == ""
    assert join.question(moves(change_of(AssertFluent(Fluent("area1", "FloorArea")))))


def test_too_many_new_statements_are_left_to_a_full_evaluation(
    join: SemiNaive, change_of: Callable[..., CommitChange]
) -> None:
    many = [f"t{number}" for number in range(501)]
    assert join.question(moves(change_of(AssertFluent(mug("mug1", *many))))) is None


def test_solutions_come_and_go_with_their_statements(join: SemiNaive, board: Any) -> None:
    board.write(AssertFluent(Fluent("table1", "Table", properties=(LABEL,))))
    join.support_of(evaluate(board, join.view.text)[2])
    for command, added, removed in (
        (AssertFluent(mug("mug1", "table1")), 1, 0),
        (AssertFluent(mug("mug2", "table1")), 1, 0),
        (RefineFluent("mug1", properties=(Property("onTop", "Table", "table2"),)), 0, 0),
        (AssertFluent(Fluent("table2", "Table", properties=(LABEL,))), 1, 0),
        (CorrectFluent(mug("mug1", "table2"), "elsewhere"), 0, 1),
        (CorrectFluent(Fluent("table1", "Table"), "no label"), 0, 1),
    ):
        step = moves(CommitChange(board.write(command), board.vocabulary))
        question = join.question(step)
        assert question is not None
        found = evaluate(board, question)[2] if question else {}
        change = join.advance(step, found)
        assert (sum(change.added.values()), sum(change.removed.values())) == (added, removed)


def test_statement_that_comes_back_has_not_moved(change_of: Callable[..., CommitChange]) -> None:
    change_of(AssertFluent(mug("mug1", "table1")))
    gone = change_of(CorrectFluent(mug("mug1"), "not there"))
    back = change_of(CorrectFluent(mug("mug1", "table1"), "there after all"))
    assert moves_of([gone, back]).removed == []


def test_solutions_are_counted_after_projection(plan_of: Callable[[str], Plan], board: Any) -> None:
    join = plan_of("SELECT ?l { ?x upper:onTop ?t . ?t upper:label ?l }")
    board.write(
        AssertFluent(Fluent("table1", "Table", properties=(LABEL,))),
        AssertFluent(mug("mug1", "table1")),
        AssertFluent(mug("mug2", "table1")),
    )
    support = join.support_of(evaluate(board, join.view.text)[2])
    assert list(support.values()) == [2]
