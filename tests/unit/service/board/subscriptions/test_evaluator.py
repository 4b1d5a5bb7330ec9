"""Standing queries stay exact, whatever happens between a commit and its telling."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from fluentboard.board.commands import AssertFluent, CorrectFluent, EndFluent, RefineFluent
from fluentboard.board.subscriptions.messages import Delta, Failed, Snapshot
from fluentboard.board.subscriptions.results import Bag, Difference
from fluentboard.board.subscriptions.subscription import Subscription
from fluentboard.errors import InvalidQuery
from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.interval import Interval

DeskOf = Callable[..., Any]

MUGS = "SELECT ?x { ?x a race:Mug }"
COUNT = "SELECT (COUNT(*) AS ?n) { ?x a race:Mug }"
JOIN = "SELECT ?x ?l { ?x upper:onTop ?t . ?t upper:label ?l }"
ROUND = Property("label", "xsd:string", "round")
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


def on(table: str) -> Property:
    return Property("onTop", "Table", table)


def test_snapshot_comes_first_and_is_exact_at_its_commit(desk: Any) -> None:
    commit = desk.board.write(mug("a"), mug("b")).number
    assert desk.outline(desk.open(MUGS).poll()) == [("snapshot", commit, 2, 0)]


@pytest.mark.parametrize("query", [MUGS, COUNT, JOIN])
def test_commit_applied_but_not_yet_told_is_in_the_snapshot_once(desk: Any, query: str) -> None:
    desk.board.write(mug("a", on("t")), AssertFluent(Fluent("t", "Table", properties=(ROUND,))))
    desk.settle()
    desk.board.write(mug("b", on("t")), tell=False)
    subscription = desk.open(query)
    desk.settle()
    assert [kind for kind, *_ in desk.outline(subscription.poll())] == ["snapshot"]


@pytest.mark.parametrize("query", [MUGS + " LIMIT 9", JOIN])
def test_commit_between_evaluation_and_telling_is_covered_once(desk: Any, query: str) -> None:
    desk.board.write(AssertFluent(Fluent("t", "Table", properties=(ROUND,))))
    subscription = desk.open(query)
    subscription.poll()
    desk.board.write(mug("a", on("t")))
    desk.board.before_next_query = lambda: desk.board.write(mug("b", on("t")), tell=False)
    desk.settle()
    desk.settle()
    messages = desk.outline(subscription.poll())
    assert sum(came for _, _, came, _ in messages) == 2
    assert not sum(went for *_, went in messages)


def test_star_tells_of_each_commit_by_itself(desk: Any) -> None:
    subscription = desk.open(MUGS)
    subscription.poll()
    one = desk.board.write(mug("a"), tell=False).number
    two = desk.board.write(mug("b"), tell=False).number
    desk.settle()
    assert desk.outline(subscription.poll()) == [("delta", one, 1, 0), ("delta", two, 1, 0)]


def test_full_evaluation_covers_all_commits_that_piled_up(desk: Any) -> None:
    subscription = desk.open(COUNT)
    subscription.poll()
    start = desk.board.commit
    for name in "abc":
        desk.board.write(mug(name), tell=False)
    desk.settle()
    (message,) = subscription.poll()
    assert isinstance(message, Delta)
    assert (message.since, message.commit) == (start, start + 3)


@pytest.mark.parametrize("query", [MUGS, COUNT, JOIN])
def test_commit_outside_the_footprint_asks_nothing(desk: Any, query: str) -> None:
    subscription = desk.open(query)
    subscription.poll()
    desk.board.questions.clear()
    desk.board.write(AssertFluent(Fluent("pose1", "Pose")))
    desk.settle()
    assert subscription.poll() == []
    assert desk.board.questions == []


def test_same_text_is_evaluated_once_for_all_subscribers(desk: Any) -> None:
    subscriptions = [desk.open(COUNT) for _ in range(3)]
    desk.board.questions.clear()
    desk.board.write(mug("a"))
    desk.settle()
    assert len(desk.board.questions) == 1
    assert [len(subscription.poll()) for subscription in subscriptions] == [2, 2, 2]


def test_ontology_changes_the_answer_of_every_tier(desk: Any) -> None:
    kitchenware = "?x rdf:type/rdfs:subClassOf* race:Kitchenware"
    desk.board.write(mug("a", on("t")), AssertFluent(Fluent("t", "Table", properties=(ROUND,))))
    queries = [
        f"SELECT ?x {{ {kitchenware} }}",
        f"SELECT ?x {{ {kitchenware} FILTER(ISIRI(?x)) }}",
        f"SELECT ?x {{ {kitchenware} ; upper:onTop ?t . ?t upper:label ?l }}",
        f"SELECT ?x {{ {kitchenware} }} LIMIT 5",
    ]
    subscriptions = [desk.open(query) for query in queries]
    commit = desk.board.load(ONTOLOGY_WITH_CUPS).number
    desk.settle()
    after = desk.board.write(AssertFluent(Fluent("p", "Plate", properties=(on("t"),)))).number
    desk.settle()
    for subscription in subscriptions:
        assert desk.outline(subscription.poll())[1:] == [
            ("delta", commit, 0, 1),
            ("delta", after, 1, 0),
        ]


def test_fluent_that_an_ontology_speaks_of_too_is_evaluated_on_the_board(desk: Any) -> None:
    desk.board.load(
        ONTOLOGY_WITH_CUPS
        + "@prefix upper: <https://w3id.org/fluentboard/upper#> .\n"
        + "@prefix fluent: <https://w3id.org/fluentboard/fluent/> .\n"
        + "fluent:a upper:onTop fluent:t ."
    )
    desk.settle()
    subscription = desk.open("SELECT ?x { ?x a race:Mug ; upper:onTop fluent:t }")
    commit = desk.board.write(mug("a")).number
    desk.settle()
    assert desk.outline(subscription.poll())[1:] == [("delta", commit, 1, 0)]


def test_query_that_fails_tells_its_subscribers_and_stops_nobody_else(
    desk: Any, caplog: pytest.LogCaptureFixture
) -> None:
    failing, lasting = desk.open(COUNT), desk.open(MUGS)
    failing.poll()
    lasting.poll()

    def fail() -> None:
        raise InvalidQuery("the store is gone")

    desk.board.before_next_query = fail
    desk.board.write(mug("a"))
    desk.settle()
    assert [type(message) for message in failing.poll()] == [Failed]
    assert [type(message) for message in lasting.poll()] == [Delta]
    assert "the store is gone" in caplog.text


def test_query_that_fails_while_somebody_joins_is_begun_anew(desk: Any) -> None:
    first = desk.open(COUNT)
    desk.board.write(mug("a"), tell=False)

    def fail() -> None:
        raise InvalidQuery("the store is busy")

    desk.board.before_next_query = fail
    joined = desk.open(COUNT)
    commit = desk.board.write(mug("b")).number
    desk.settle()
    assert [type(message) for message in first.poll()] == [Snapshot, Failed]
    assert desk.outline(joined.poll()) == [("snapshot", commit - 1, 1, 0), ("delta", commit, 1, 1)]


def test_error_nobody_thought_of_is_told_as_a_failure(
    desk: Any, caplog: pytest.LogCaptureFixture
) -> None:
    def fail() -> None:
        raise KeyError("unexpected")

    desk.board.before_next_query = fail
    assert [type(message) for message in desk.open(COUNT).poll()] == [Failed]
    assert "unexpected" in caplog.text


class TestEvents:
    """Modes `fluents` and `both`."""

    def names(self, subscription: Subscription) -> list[list[str]]:
        return [
            [f"{event.kind} {event.after.name}" for _, event in message.change.events]
            for message in subscription.poll()
            if isinstance(message, Delta)
        ]

    def test_added_fluent_comes_with_the_solution(self, desk: Any) -> None:
        subscription = desk.open(MUGS, "both")
        desk.board.write(mug("a"), AssertFluent(Fluent("pose1", "Pose")))
        desk.settle()
        assert self.names(subscription) == [["added a"]]

    @pytest.mark.parametrize("query", [MUGS, MUGS + " ORDER BY ?x LIMIT 9"])
    def test_change_of_a_fluent_that_still_matches_is_told(self, desk: Any, query: str) -> None:
        desk.board.write(mug("a"))
        subscription = desk.open(query, "fluents")
        desk.board.write(EndFluent("a", Interval.at(4.0)))
        desk.board.write(RefineFluent("a", properties=(on("t"),)))
        desk.settle()
        assert self.names(subscription) == [["ended a"], ["refined a"]]

    def test_fluent_that_leaves_the_result_is_told(self, desk: Any) -> None:
        desk.board.write(mug("a"))
        subscription = desk.open(MUGS, "fluents")
        desk.board.write(CorrectFluent(Fluent("a", "Plate"), "a plate"))
        desk.board.write(EndFluent("a", Interval.at(4.0)))
        desk.settle()
        assert self.names(subscription) == [["corrected a"]]

    @pytest.mark.parametrize("query", [COUNT, "ASK { ?x a race:Mug }"])
    def test_cause_is_told_where_the_result_names_no_fluent(self, desk: Any, query: str) -> None:
        subscription = desk.open(query, "fluents")
        desk.board.write(mug("a"), AssertFluent(Fluent("pose1", "Pose")))
        desk.settle()
        assert self.names(subscription) == [["added a"]]

    def test_cause_is_told_where_it_completes_another_fluent(self, desk: Any) -> None:
        desk.board.write(mug("a", on("t")))
        subscription = desk.open("SELECT ?x { ?x upper:onTop ?t . ?t upper:label ?l }", "both")
        desk.board.write(AssertFluent(Fluent("t", "Table", properties=(ROUND,))))
        desk.settle()
        assert self.names(subscription) == [["added t"]]

    def test_events_of_piled_up_commits_come_in_their_order(self, desk: Any) -> None:
        subscription = desk.open(MUGS + " LIMIT 9", "both")
        desk.board.write(mug("a"), tell=False)
        desk.board.write(EndFluent("a", Interval.at(4.0)), tell=False)
        desk.settle()
        assert self.names(subscription) == [["added a", "ended a"]]

    def test_subscriber_for_bindings_is_not_told_of_events_alone(self, desk: Any) -> None:
        desk.board.write(mug("a"))
        bindings, fluents = desk.open(MUGS), desk.open(MUGS, "fluents")
        desk.board.write(EndFluent("a", Interval.at(4.0)))
        desk.settle()
        assert self.names(bindings) == []
        assert self.names(fluents) == [["ended a"]]


def test_subscriber_that_lagged_is_sent_the_present_result(board: Any, desk_of: DeskOf) -> None:
    desk = desk_of(queue_messages=2)
    subscription = desk.open(MUGS)
    for name in "abc":
        board.write(mug(name))
    desk.settle()
    assert desk.outline(subscription.poll()) == [("lagged", 0, 0, 0)]
    assert desk.outline(subscription.poll()) == [("snapshot", board.commit, 3, 0)]


def never_fits(_bag: Bag, _change: Difference) -> bool:
    return False


def test_incremental_tier_that_disagrees_is_put_right(
    desk: Any, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    subscription = desk.open(MUGS)
    monkeypatch.setattr("fluentboard.board.subscriptions.standing.apply", never_fits)
    commit = desk.board.write(mug("a")).number
    desk.settle()
    assert "disagrees" in caplog.text
    assert desk.outline(subscription.poll())[1:] == [("delta", commit, 1, 0)]
