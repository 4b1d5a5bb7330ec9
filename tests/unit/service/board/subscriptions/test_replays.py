"""Replays: what a subscriber would have been told, told again, and then live."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from fluentboard.board.blackboard import Blackboard
from fluentboard.board.commands import AssertFluent, EndFluent
from fluentboard.board.subscriptions.messages import Delta, Live, Message, Snapshot
from fluentboard.board.subscriptions.past import ReplayRequest
from fluentboard.board.subscriptions.registry import SubscriptionRegistry
from fluentboard.board.subscriptions.results import Bag, apply, bag_of
from fluentboard.board.subscriptions.settings import SubscriptionSettings
from fluentboard.board.subscriptions.subscription import Subscription
from fluentboard.clock import ReplayClock
from fluentboard.errors import InvalidInput, TooManySubscriptions
from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.interval import UNKNOWN, Interval

ONTOLOGY = """
@prefix owl: <http://www.w3.org/2002/07/owl#> .
@prefix race: <https://w3id.org/fluentboard/race#> .
race:Mug a owl:Class .
race:Table a owl:Class .
"""
QUERIES = (
    "SELECT ?x { ?x a race:Mug }",
    "SELECT (COUNT(*) AS ?n) { ?x a race:Mug }",
    "SELECT ?x ?y { ?x upper:onTop ?y . ?y a race:Table }",
)
TIMEOUT_S = 20.0


@pytest.fixture
def clock() -> ReplayClock:
    return ReplayClock(100.0)


@pytest.fixture
def board(tmp_path: Path, clock: ReplayClock) -> Iterator[Blackboard]:
    file = tmp_path / "small.ttl"
    file.write_text(ONTOLOGY, encoding="utf-8")
    with Blackboard.open(None, builtin_ontologies=False, ontologies=[file], clock=clock) as opened:
        yield opened


@pytest.fixture
def registry(board: Blackboard) -> Iterator[SubscriptionRegistry]:
    opened = SubscriptionRegistry(board, outside=board.statements())
    yield opened
    opened.close()


def put(board: Blackboard, clock: ReplayClock, name: str, finish: Interval = UNKNOWN) -> int:
    """A mug on a table, asserted one second after what was before."""
    clock.set(clock.now_s() + 1.0)
    on = Property("onTop", "Table", "table1")
    mug = Fluent(name, "Mug", Interval.at(clock.now_s()), finish, (on,))
    return board.execute([AssertFluent(mug)], "tests").number


def until_live(subscription: Subscription) -> list[Message]:
    told: list[Message] = []
    while not any(isinstance(message, Live) for message in told):
        assert subscription.wait(TIMEOUT_S)
        told += subscription.poll()
    return told


@pytest.mark.parametrize("query", QUERIES)
def test_replay_tells_commit_by_commit_what_was_told_then(
    board: Blackboard, registry: SubscriptionRegistry, clock: ReplayClock, query: str
) -> None:
    first = board.execute([AssertFluent(Fluent("table1", "Table"))], "tests").number
    put(board, clock, "a")
    put(board, clock, "b")
    board.execute([EndFluent("a", Interval.at(clock.now_s()))], "tests")
    put(board, clock, "c")
    replay = ReplayRequest(commit=first, speed=1_000.0)
    subscription = registry.replay(query, replay, "both")
    state: Bag = {}
    commits: list[int] = []
    for message in until_live(subscription):
        if isinstance(message, Snapshot):
            state = dict(message.answer.bag)
            assert message.commit == first
        elif isinstance(message, Delta):
            assert apply(state, message.change.difference)
            commits.append(message.commit)
            assert state == bag_of(board.query(query, as_of=message.commit))
    assert set(commits) >= {first + 1, first + 2, first + 4}
    late = put(board, clock, "d")
    assert registry.wait_until(late, TIMEOUT_S)
    (delta,) = subscription.poll()
    assert isinstance(delta, Delta)
    assert apply(state, delta.change.difference)
    assert state == bag_of(board.query(query))


def test_episode_is_replayed_in_its_own_time(
    board: Blackboard, registry: SubscriptionRegistry, clock: ReplayClock
) -> None:
    # Imported in one go; what matters is when it held.
    fluents = [
        Fluent("a", "Mug", Interval.at(10.0), Interval.at(30.0)),
        Fluent("b", "Mug", Interval.at(20.0), Interval.at(50.0)),
        Fluent("c", "Mug", Interval.at(40.0)),
    ]
    board.execute([AssertFluent(fluent) for fluent in fluents], "tests")
    subscription = registry.replay(QUERIES[1], ReplayRequest(time_s=15.0, speed=1_000.0), at="now")
    told = until_live(subscription)
    times = [message.at_s for message in told if isinstance(message, Snapshot | Delta)]
    # At 30 s a goes and at 40 s c comes.
    assert times == [15.0, 20.0, 30.0, 40.0, 50.0]


def test_replay_goes_at_the_pace_of_its_subscriber(board: Blackboard, clock: ReplayClock) -> None:
    registry = SubscriptionRegistry(
        board, SubscriptionSettings(queue_messages=4), board.statements()
    )
    for number in range(20):
        put(board, clock, f"m{number}")
    subscription = registry.replay(QUERIES[0], ReplayRequest(commit=1, speed=1e6))
    assert subscription.wait(TIMEOUT_S)
    assert subscription.waiting <= 4
    told = until_live(subscription)
    assert [type(message) for message in told] == [Snapshot, *[Delta] * 20, Live]
    registry.close()


def test_replays_are_counted_and_ended(
    board: Blackboard, registry: SubscriptionRegistry, clock: ReplayClock
) -> None:
    for number in range(2):
        put(board, clock, f"m{number}")
    slow = ReplayRequest(commit=1, speed=1e-3)
    opened = [registry.replay(QUERIES[0], slow) for _ in range(4)]
    with pytest.raises(TooManySubscriptions):
        registry.replay(QUERIES[0], slow)
    for subscription in opened:
        subscription.close()
    assert registry.subscriptions() == []


@pytest.mark.parametrize(
    ("commit", "time_s", "speed"),
    [(None, None, 1.0), (1, 2.0, 1.0), (-1, None, 1.0), (1, None, 0.0), (1, None, float("inf"))],
)
def test_replay_that_begins_nowhere_is_refused(
    commit: int | None, time_s: float | None, speed: float
) -> None:
    with pytest.raises(InvalidInput):
        ReplayRequest(commit, time_s, speed)


def test_replay_from_the_future_fails(board: Blackboard, registry: SubscriptionRegistry) -> None:
    subscription = registry.replay(QUERIES[0], ReplayRequest(commit=99))
    assert subscription.wait(TIMEOUT_S)
    (failed,) = subscription.poll()
    assert failed.to_json("a")["problem"]["code"] == "invalid-input"
