"""Standing queries stay exact, whatever happens between a commit and its telling."""

from __future__ import annotations

from typing import Any

import pytest

from fluentboard.board.commands import AssertFluent, CorrectFluent, EndFluent, RefineFluent
from fluentboard.board.subscriptions.evaluator import Evaluator
from fluentboard.board.subscriptions.messages import Delta, Failed, Gap, Message, Mode, Snapshot
from fluentboard.board.subscriptions.query import parse
from fluentboard.board.subscriptions.results import Bag, Difference
from fluentboard.board.subscriptions.settings import SubscriptionSettings
from fluentboard.board.subscriptions.subscription import Subscription, SubscriptionRequest
from fluentboard.errors import InvalidQuery
from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.interval import Interval

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


class Desk:
    """An evaluator over the fake board, which is told of commits at `settle`."""

    def __init__(self, board: Any, **settings: Any) -> None:
        self.board = board
        self._settings = SubscriptionSettings.model_validate(settings)
        self.evaluator = Evaluator(board, self._settings, self._arrive)
        self._told: list[Any] = []
        board.listen(self._told.extend)
        self.evaluator.begin_after(board.commit)

    def open(self, query: str, mode: Mode = "bindings", since: int | None = None) -> Subscription:
        subscription = Subscription(
            SubscriptionRequest(query, mode, since),
            "",
            self._settings,
            on_ready=None,
            on_drained=self.evaluator.refresh,
            on_close=lambda closed: self.evaluator.close(closed, now_s=0.0),
        )
        self.evaluator.open(subscription, parse(query))
        return subscription

    def settle(self) -> None:
        """Tells of everything and evaluates what is stale."""
        self._arrive(self.board.commit)
        while self.evaluator.has_work:
            self.evaluator.reevaluate_next()

    def _arrive(self, commit: int) -> bool:
        self.board.tell()
        for told in self._told:
            self.evaluator.route(told)
        self._told.clear()
        return self.evaluator.routed >= commit


@pytest.fixture
def desk(board: Any) -> Desk:
    return Desk(board)


def mug(name: str, *properties: Property) -> AssertFluent:
    return AssertFluent(Fluent(name, "Mug", properties=properties))


def on(table: str) -> Property:
    return Property("onTop", "Table", table)


def outline(messages: list[Message]) -> list[tuple[str, int, int, int]]:
    """Kind, commit, and how many solutions came and went."""
    found: list[tuple[str, int, int, int]] = []
    for message in messages:
        if isinstance(message, Delta):
            change = message.change.difference
            came, went = sum(change.added.values()), sum(change.removed.values())
            found.append(("delta", message.commit, came, went))
        elif isinstance(message, Snapshot):
            count = sum(message.answer.bag.values())
            found.append(("snapshot", message.commit, count, 0))
        else:
            found.append((type(message).__name__.lower(), getattr(message, "commit", 0), 0, 0))
    return found


def test_snapshot_comes_first_and_is_exact_at_its_commit(desk: Desk) -> None:
    commit = desk.board.write(mug("a"), mug("b")).number
    assert outline(desk.open(MUGS).poll()) == [("snapshot", commit, 2, 0)]


@pytest.mark.parametrize("query", [MUGS, COUNT, JOIN])
def test_commit_applied_but_not_yet_told_is_in_the_snapshot_once(desk: Desk, query: str) -> None:
    desk.board.write(mug("a", on("t")), AssertFluent(Fluent("t", "Table", properties=(ROUND,))))
    desk.settle()
    desk.board.write(mug("b", on("t")), tell=False)
    subscription = desk.open(query)
    desk.settle()
    assert [kind for kind, *_ in outline(subscription.poll())] == ["snapshot"]


@pytest.mark.parametrize("query", [MUGS + " LIMIT 9", JOIN])
def test_commit_between_evaluation_and_telling_is_covered_once(desk: Desk, query: str) -> None:
    desk.board.write(AssertFluent(Fluent("t", "Table", properties=(ROUND,))))
    subscription = desk.open(query)
    subscription.poll()
    desk.board.write(mug("a", on("t")))
    desk.board.before_next_query = lambda: desk.board.write(mug("b", on("t")), tell=False)
    desk.settle()
    desk.settle()
    messages = outline(subscription.poll())
    assert sum(came for _, _, came, _ in messages) == 2
    assert not sum(went for *_, went in messages)


def test_star_tells_of_each_commit_by_itself(desk: Desk) -> None:
    subscription = desk.open(MUGS)
    subscription.poll()
    one = desk.board.write(mug("a"), tell=False).number
    two = desk.board.write(mug("b"), tell=False).number
    desk.settle()
    assert outline(subscription.poll()) == [("delta", one, 1, 0), ("delta", two, 1, 0)]


def test_full_evaluation_covers_all_commits_that_piled_up(desk: Desk) -> None:
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
def test_commit_outside_the_footprint_asks_nothing(desk: Desk, query: str) -> None:
    subscription = desk.open(query)
    subscription.poll()
    desk.board.questions.clear()
    desk.board.write(AssertFluent(Fluent("pose1", "Pose")))
    desk.settle()
    assert subscription.poll() == []
    assert desk.board.questions == []


def test_same_text_is_evaluated_once_for_all_subscribers(desk: Desk) -> None:
    subscriptions = [desk.open(COUNT) for _ in range(3)]
    desk.board.questions.clear()
    desk.board.write(mug("a"))
    desk.settle()
    assert len(desk.board.questions) == 1
    assert [len(subscription.poll()) for subscription in subscriptions] == [2, 2, 2]


def test_ontology_changes_the_answer_of_every_tier(desk: Desk) -> None:
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
        assert outline(subscription.poll())[1:] == [("delta", commit, 0, 1), ("delta", after, 1, 0)]


def test_fluent_that_an_ontology_speaks_of_too_is_evaluated_on_the_board(desk: Desk) -> None:
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
    assert outline(subscription.poll())[1:] == [("delta", commit, 1, 0)]


def test_query_that_fails_tells_its_subscribers_and_stops_nobody_else(
    desk: Desk, caplog: pytest.LogCaptureFixture
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


def test_query_that_fails_while_somebody_joins_is_begun_anew(desk: Desk) -> None:
    first = desk.open(COUNT)
    desk.board.write(mug("a"), tell=False)

    def fail() -> None:
        raise InvalidQuery("the store is busy")

    desk.board.before_next_query = fail
    joined = desk.open(COUNT)
    commit = desk.board.write(mug("b")).number
    desk.settle()
    assert [type(message) for message in first.poll()] == [Snapshot, Failed]
    assert outline(joined.poll()) == [("snapshot", commit - 1, 1, 0), ("delta", commit, 1, 1)]


def test_error_nobody_thought_of_is_told_as_a_failure(
    desk: Desk, caplog: pytest.LogCaptureFixture
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

    def test_added_fluent_comes_with_the_solution(self, desk: Desk) -> None:
        subscription = desk.open(MUGS, "both")
        desk.board.write(mug("a"), AssertFluent(Fluent("pose1", "Pose")))
        desk.settle()
        assert self.names(subscription) == [["added a"]]

    @pytest.mark.parametrize("query", [MUGS, MUGS + " ORDER BY ?x LIMIT 9"])
    def test_change_of_a_fluent_that_still_matches_is_told(self, desk: Desk, query: str) -> None:
        desk.board.write(mug("a"))
        subscription = desk.open(query, "fluents")
        desk.board.write(EndFluent("a", Interval.at(4.0)))
        desk.board.write(RefineFluent("a", properties=(on("t"),)))
        desk.settle()
        assert self.names(subscription) == [["ended a"], ["refined a"]]

    def test_fluent_that_leaves_the_result_is_told(self, desk: Desk) -> None:
        desk.board.write(mug("a"))
        subscription = desk.open(MUGS, "fluents")
        desk.board.write(CorrectFluent(Fluent("a", "Plate"), "a plate"))
        desk.board.write(EndFluent("a", Interval.at(4.0)))
        desk.settle()
        assert self.names(subscription) == [["corrected a"]]

    @pytest.mark.parametrize("query", [COUNT, "ASK { ?x a race:Mug }"])
    def test_cause_is_told_where_the_result_names_no_fluent(self, desk: Desk, query: str) -> None:
        subscription = desk.open(query, "fluents")
        desk.board.write(mug("a"), AssertFluent(Fluent("pose1", "Pose")))
        desk.settle()
        assert self.names(subscription) == [["added a"]]

    def test_cause_is_told_where_it_completes_another_fluent(self, desk: Desk) -> None:
        desk.board.write(mug("a", on("t")))
        subscription = desk.open("SELECT ?x { ?x upper:onTop ?t . ?t upper:label ?l }", "both")
        desk.board.write(AssertFluent(Fluent("t", "Table", properties=(ROUND,))))
        desk.settle()
        assert self.names(subscription) == [["added t"]]

    def test_events_of_piled_up_commits_come_in_their_order(self, desk: Desk) -> None:
        subscription = desk.open(MUGS + " LIMIT 9", "both")
        desk.board.write(mug("a"), tell=False)
        desk.board.write(EndFluent("a", Interval.at(4.0)), tell=False)
        desk.settle()
        assert self.names(subscription) == [["added a", "ended a"]]

    def test_subscriber_for_bindings_is_not_told_of_events_alone(self, desk: Desk) -> None:
        desk.board.write(mug("a"))
        bindings, fluents = desk.open(MUGS), desk.open(MUGS, "fluents")
        desk.board.write(EndFluent("a", Interval.at(4.0)))
        desk.settle()
        assert self.names(bindings) == []
        assert self.names(fluents) == [["ended a"]]


class TestResume:
    """Clients that come back with the last commit they saw."""

    def test_missed_deltas_follow_and_nothing_else(self, desk: Desk) -> None:
        desk.open(COUNT)
        seen = desk.board.commit
        commits: list[int] = []
        for name in "ab":
            commits.append(desk.board.write(mug(name)).number)
            desk.settle()
        assert outline(desk.open(COUNT, since=seen).poll()) == [
            ("resumed", seen, 0, 0),
            ("delta", commits[0], 1, 1),
            ("delta", commits[1], 1, 1),
        ]
        assert outline(desk.open(COUNT, since=commits[0]).poll()) == [
            ("resumed", commits[0], 0, 0),
            ("delta", commits[1], 1, 1),
        ]

    def test_query_lingers_after_its_last_subscriber(self, desk: Desk) -> None:
        subscription = desk.open(COUNT)
        seen = desk.board.commit
        subscription.close()
        assert desk.evaluator.retire(now_s=59.0) == 60.0
        commit = desk.board.write(mug("a")).number
        desk.settle()
        again = desk.open(COUNT, since=seen)
        assert outline(again.poll())[-1] == ("delta", commit, 1, 1)
        assert desk.evaluator.retire(now_s=61.0) is None
        assert len(desk.evaluator) == 1

    def test_forgotten_query_leaves_a_gap(self, desk: Desk) -> None:
        subscription = desk.open(COUNT)
        seen = desk.board.commit
        subscription.close()
        desk.evaluator.retire(now_s=61.0)
        assert len(desk.evaluator) == 0
        commit = desk.board.write(mug("a")).number
        desk.settle()
        messages = desk.open(COUNT, since=seen).poll()
        assert outline(messages) == [("gap", commit, 0, 0), ("snapshot", commit, 1, 0)]
        assert isinstance(messages[0], Gap)
        assert messages[0].since == seen

    @pytest.mark.parametrize("mode", ["bindings", "both"])
    def test_star_is_replayed_from_the_journal(self, desk: Desk, mode: Mode) -> None:
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
        assert outline(desk.open(MUGS, mode, since=seen).poll()) == expected

    def test_untouched_query_is_resumed_from_the_journal(self, desk: Desk) -> None:
        seen = desk.board.commit
        desk.board.write(AssertFluent(Fluent("pose1", "Pose")))
        desk.settle()
        assert outline(desk.open(COUNT, since=seen).poll()) == [("resumed", seen, 0, 0)]

    def test_ontology_in_between_leaves_a_gap(self, desk: Desk) -> None:
        seen = desk.board.commit
        desk.board.load(ONTOLOGY_WITH_CUPS)
        desk.settle()
        assert outline(desk.open(MUGS, since=seen).poll())[0][0] == "gap"

    def test_too_many_commits_leave_a_gap(self, board: Any) -> None:
        desk = Desk(board, replay_commits=1)
        seen = board.commit
        board.write(mug("a"))
        board.write(mug("b"))
        desk.settle()
        assert outline(desk.open(MUGS, since=seen).poll())[0][0] == "gap"

    def test_commit_from_the_future_leaves_a_gap(self, desk: Desk) -> None:
        assert outline(desk.open(MUGS, since=99).poll())[0][0] == "gap"

    def test_commit_inside_a_coalesced_delta_leaves_a_gap(self, desk: Desk) -> None:
        desk.open(COUNT)
        inside = desk.board.write(mug("a"), tell=False).number
        desk.board.write(mug("b"), tell=False)
        desk.settle()
        assert outline(desk.open(COUNT, since=inside).poll())[0][0] == "gap"

    def test_memory_of_deltas_is_bounded(self, board: Any) -> None:
        desk = Desk(board, ring_deltas=1, replay_commits=0)
        desk.open(MUGS)
        seen = board.commit
        one = board.write(mug("a")).number
        board.write(mug("b"))
        desk.settle()
        assert outline(desk.open(MUGS, since=seen).poll())[0][0] == "gap"
        assert outline(desk.open(MUGS, since=one).poll())[0][0] == "resumed"

    def test_subscriber_for_fluents_needs_deltas_with_events(self, board: Any) -> None:
        desk = Desk(board, replay_commits=0)
        desk.open(MUGS)
        seen = board.commit
        board.write(mug("a"))
        desk.settle()
        assert outline(desk.open(MUGS, "both", since=seen).poll())[0][0] == "gap"
        assert outline(desk.open(MUGS, "both", since=board.commit).poll())[0][0] == "resumed"


def test_subscriber_that_lagged_is_sent_the_present_result(board: Any) -> None:
    desk = Desk(board, queue_messages=2)
    subscription = desk.open(MUGS)
    for name in "abc":
        board.write(mug(name))
    desk.settle()
    assert outline(subscription.poll()) == [("lagged", 0, 0, 0)]
    assert outline(subscription.poll()) == [("snapshot", board.commit, 3, 0)]


def never_fits(_bag: Bag, _change: Difference) -> bool:
    return False


def test_incremental_tier_that_disagrees_is_put_right(
    desk: Desk, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    subscription = desk.open(MUGS)
    monkeypatch.setattr("fluentboard.board.subscriptions.standing.apply", never_fits)
    commit = desk.board.write(mug("a")).number
    desk.settle()
    assert "disagrees" in caplog.text
    assert outline(subscription.poll())[1:] == [("delta", commit, 1, 0)]
