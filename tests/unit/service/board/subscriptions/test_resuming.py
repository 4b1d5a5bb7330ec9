"""Clients that come back with the last commit they saw."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from fluentboard.board.commands import AssertFluent, CorrectFluent, EndFluent
from fluentboard.board.subscriptions.messages import Gap, Mode
from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.interval import Interval

DeskOf = Callable[..., Any]

MUGS = "SELECT ?x { ?x a race:Mug }"
COUNT = "SELECT (COUNT(*) AS ?n) { ?x a race:Mug }"
ONTOLOGY_WITH_CUPS = """
@prefix rdfs: <http://www.w3.org/2000/01/rdf-schema#> .
@prefix owl: <http://www.w3.org/2002/07/owl#> .
@prefix race: <https://w3id.org/fluentboard/race#> .
race:Kitchenware a owl:Class .
race:Mug a owl:Class .
race:Plate a owl:Class ; rdfs:subClassOf race:Kitchenware .
race:Table a owl:Class .
"""


def mug(name: str, *properties: Property) -> AssertFluent:
    return AssertFluent(Fluent(name, "Mug", properties=properties))


def test_missed_deltas_follow_and_nothing_else(desk: Any) -> None:
    desk.open(COUNT)
    seen = desk.board.commit
    commits: list[int] = []
    for name in "ab":
        commits.append(desk.board.write(mug(name)).number)
        desk.settle()
    assert desk.outline(desk.open(COUNT, since=seen).poll()) == [
        ("resumed", seen, 0, 0),
        ("delta", commits[0], 1, 1),
        ("delta", commits[1], 1, 1),
    ]
    assert desk.outline(desk.open(COUNT, since=commits[0]).poll()) == [
        ("resumed", commits[0], 0, 0),
        ("delta", commits[1], 1, 1),
    ]


def test_query_lingers_after_its_last_subscriber(desk: Any) -> None:
    subscription = desk.open(COUNT)
    seen = desk.board.commit
    subscription.close()
    assert desk.evaluator.retire(now_s=59.0) == 60.0
    commit = desk.board.write(mug("a")).number
    desk.settle()
    again = desk.open(COUNT, since=seen)
    assert desk.outline(again.poll())[-1] == ("delta", commit, 1, 1)
    assert desk.evaluator.retire(now_s=61.0) is None
    assert len(desk.evaluator) == 1


def test_forgotten_query_leaves_a_gap(desk: Any) -> None:
    subscription = desk.open(COUNT)
    seen = desk.board.commit
    subscription.close()
    desk.evaluator.retire(now_s=61.0)
    assert len(desk.evaluator) == 0
    commit = desk.board.write(mug("a")).number
    desk.settle()
    messages = desk.open(COUNT, since=seen).poll()
    assert desk.outline(messages) == [("gap", commit, 0, 0), ("snapshot", commit, 1, 0)]
    assert isinstance(messages[0], Gap)
    assert messages[0].since == seen


@pytest.mark.parametrize("mode", ["bindings", "both"])
def test_star_is_replayed_from_the_journal(desk: Any, mode: Mode) -> None:
    desk.board.write(mug("a"))
    desk.settle()
    seen = desk.board.commit
    ended = desk.board.write(EndFluent("a", Interval.at(4.0))).number
    added = desk.board.write(mug("b")).number
    gone = desk.board.write(CorrectFluent(Fluent("a", "Plate"), "a plate")).number
    desk.settle()
    expected = [("resumed", seen, 0, 0), ("delta", added, 1, 0), ("delta", gone, 0, 1)]
    if mode == "both":
        expected.insert(1, ("delta", ended, 0, 0))
    assert desk.outline(desk.open(MUGS, mode, since=seen).poll()) == expected


def test_untouched_query_is_resumed_from_the_journal(desk: Any) -> None:
    seen = desk.board.commit
    desk.board.write(AssertFluent(Fluent("pose1", "Pose")))
    desk.settle()
    assert desk.outline(desk.open(COUNT, since=seen).poll()) == [("resumed", seen, 0, 0)]


def test_ontology_in_between_leaves_a_gap(desk: Any) -> None:
    seen = desk.board.commit
    desk.board.load(ONTOLOGY_WITH_CUPS)
    desk.settle()
    assert desk.outline(desk.open(MUGS, since=seen).poll())[0][0] == "gap"


def test_too_many_commits_leave_a_gap(board: Any, desk_of: DeskOf) -> None:
    desk = desk_of(replay_commits=1)
    seen = board.commit
    board.write(mug("a"))
    board.write(mug("b"))
    desk.settle()
    assert desk.outline(desk.open(MUGS, since=seen).poll())[0][0] == "gap"


def test_commit_from_the_future_leaves_a_gap(desk: Any) -> None:
    assert desk.outline(desk.open(MUGS, since=99).poll())[0][0] == "gap"


def test_commit_inside_a_coalesced_delta_leaves_a_gap(desk: Any) -> None:
    desk.open(COUNT)
    inside = desk.board.write(mug("a"), tell=False).number
    desk.board.write(mug("b"), tell=False)
    desk.settle()
    assert desk.outline(desk.open(COUNT, since=inside).poll())[0][0] == "gap"


def test_memory_of_deltas_is_bounded(board: Any, desk_of: DeskOf) -> None:
    desk = desk_of(ring_deltas=1, replay_commits=0)
    desk.open(MUGS)
    seen = board.commit
    one = board.write(mug("a")).number
    board.write(mug("b"))
    desk.settle()
    assert desk.outline(desk.open(MUGS, since=seen).poll())[0][0] == "gap"
    assert desk.outline(desk.open(MUGS, since=one).poll())[0][0] == "resumed"


def test_subscriber_for_fluents_needs_deltas_with_events(board: Any, desk_of: DeskOf) -> None:
    desk = desk_of(replay_commits=0)
    desk.open(MUGS)
    seen = board.commit
    board.write(mug("a"))
    desk.settle()
    assert desk.outline(desk.open(MUGS, "both", since=seen).poll())[0][0] == "gap"
    assert desk.outline(desk.open(MUGS, "both", since=board.commit).poll())[0][0] == "resumed"
