"""A query at now stays exact when commits and the clock fall into the middle of its evaluation."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import pytest

from fluentboard.board.blackboard import Blackboard
from fluentboard.board.commands import AssertFluent, EndFluent
from fluentboard.board.events import Commit
from fluentboard.board.subscriptions.evaluator import Evaluator
from fluentboard.board.subscriptions.messages import Delta, Snapshot
from fluentboard.board.subscriptions.query import parse
from fluentboard.board.subscriptions.results import Bag, bag_of
from fluentboard.board.subscriptions.settings import SubscriptionSettings
from fluentboard.board.subscriptions.subscription import Subscription, SubscriptionRequest
from fluentboard.board.time_views import TimedResults
from fluentboard.clock import ReplayClock
from fluentboard.model.fluent import Fluent
from fluentboard.model.interval import Certainty, Interval

TIMEOUT_S = 10.0
# Of the first tier, and of the last, which is evaluated again.
QUERIES = (
    "SELECT ?x { ?x a race:Mug }",
    "SELECT ?x ?y { ?x a race:Mug . ?y a race:Plate }",
    "SELECT (COUNT(*) AS ?n) { ?x a race:Mug }",
)


class Interrupted:
    """A board on which things happen just before and just after a query at now is evaluated."""

    def __init__(self, board: Blackboard) -> None:
        self._board = board
        self.before: list[Callable[[], Any]] = []
        self.after: list[Callable[[], Any]] = []

    def __getattr__(self, name: str) -> Any:
        return getattr(self._board, name)

    def timed_query(self, sparql: str, **options: Any) -> TimedResults:
        while self.before:
            self.before.pop(0)()
        found = self._board.timed_query(sparql, **options)
        while self.after:
            self.after.pop(0)()
        return found


class Desk:
    """An evaluator that hears of commits when it asks."""

    def __init__(self, board: Blackboard, clock: ReplayClock) -> None:
        self.clock = clock
        self.board: Any = Interrupted(board)
        self._settings = SubscriptionSettings()
        self._told: list[Commit] = []
        self._heard = threading.Condition()
        board.listen(self._hear)
        self.evaluator = Evaluator(self.board, self._settings, self._arrive)
        self.evaluator.begin_after(board.commit)

    def _hear(self, commits: Sequence[Commit]) -> None:
        with self._heard:
            self._told.extend(commits)
            self._heard.notify_all()

    def _arrive(self, commit: int) -> bool:
        with self._heard:
            for told in self._told:
                self.evaluator.route(told)
            self._told.clear()
        return self.evaluator.routed >= commit

    def write(self, *commands: AssertFluent | EndFluent) -> None:
        """Commits, and waits until the evaluator can hear of it."""
        number = self.board.execute(commands, "test").number
        with self._heard:
            assert self._heard.wait_for(
                lambda: self._told and self._told[-1].number >= number, TIMEOUT_S
            )

    def open(self, query: str) -> Subscription:
        subscription = Subscription(
            SubscriptionRequest(query, at=Certainty.POSSIBLE),
            "",
            self._settings,
            on_ready=None,
            on_drained=self.evaluator.refresh,
            on_close=lambda closed: self.evaluator.close(closed, now_s=0.0),
        )
        self.evaluator.open(subscription, parse(query))
        return subscription

    def settle(self) -> None:
        self.evaluator.pass_time()
        self._arrive(self.board.commit)
        while self.evaluator.has_work:
            self.evaluator.reevaluate_next()


@pytest.fixture
def desk() -> Iterator[Desk]:
    clock = ReplayClock(100.0)
    with Blackboard.open(None, clock=clock) as board:
        board.execute([AssertFluent(Fluent("plate1", "Plate"))], "test")
        desk = Desk(board, clock)
        # Somebody follows the clock already, so that the evaluator is at 100 s.
        desk.open("SELECT ?x { ?x a race:Fork }")
        yield desk


def mug(name: str, start_s: float, finish_s: float) -> AssertFluent:
    return AssertFluent(Fluent(name, "Mug", Interval.at(start_s), Interval.at(finish_s)))


def told(subscription: Subscription) -> Bag:
    """The result that a subscriber has put together from its messages."""
    bag: Bag = {}
    for message in subscription.poll(100):
        if isinstance(message, Snapshot):
            bag = dict(message.answer.bag)
        elif isinstance(message, Delta):
            by = message.change.difference
            for solution, count in by.added.items():
                bag[solution] = bag.get(solution, 0) + count
            for solution, count in by.removed.items():
                bag[solution] = bag.get(solution, 0) - count
    return {solution: count for solution, count in bag.items() if count}


def present(desk: Desk, query: str) -> Bag:
    return bag_of(desk.board.timed_query(query, at="now", certainty=Certainty.POSSIBLE).results)


@pytest.mark.parametrize("query", QUERIES)
def test_commit_in_the_middle_is_seen_at_the_time_of_the_evaluation(desk: Desk, query: str) -> None:
    # It held when the evaluator last looked at the clock, but not when the query is evaluated.
    desk.board.before.append(lambda: desk.clock.set(120.0))
    desk.board.after.append(lambda: desk.write(mug("over", 50.0, 110.0), mug("on", 50.0, 200.0)))
    subscription = desk.open(query)
    desk.settle()
    assert told(subscription) == present(desk, query)


@pytest.mark.parametrize("query", QUERIES)
def test_fluent_in_the_middle_that_began_since_the_last_look_is_seen(
    desk: Desk, query: str
) -> None:
    desk.write(mug("known", 105.0, 200.0))
    desk.board.before.append(lambda: desk.clock.set(120.0))
    desk.board.after.append(lambda: desk.write(mug("new", 115.0, 200.0), mug("late", 130.0, 200.0)))
    subscription = desk.open(query)
    desk.settle()
    assert told(subscription) == present(desk, query)


@pytest.mark.parametrize("query", QUERIES)
def test_end_that_passes_in_the_middle_is_told_once(desk: Desk, query: str) -> None:
    desk.write(mug("first", 50.0, 110.0), mug("second", 105.0, 200.0))
    desk.board.after.append(lambda: desk.clock.set(120.0))
    subscription = desk.open(query)
    desk.settle()
    assert told(subscription) == present(desk, query)


@pytest.mark.parametrize("query", QUERIES)
def test_ending_in_the_middle_that_the_clock_has_overtaken_is_told_once(
    desk: Desk, query: str
) -> None:
    desk.write(AssertFluent(Fluent("open", "Mug", Interval.at(50.0))))
    desk.board.before.append(lambda: desk.clock.set(120.0))
    desk.board.after.append(lambda: desk.write(EndFluent("open", Interval.at(110.0))))
    desk.board.after.append(lambda: desk.clock.set(130.0))
    subscription = desk.open(query)
    desk.settle()
    assert told(subscription) == present(desk, query)
