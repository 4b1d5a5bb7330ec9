"""The registry: any thread opens and closes, one thread evaluates."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from typing import Any

import pytest

from fluentboard.board.commands import AssertFluent
from fluentboard.board.subscriptions.messages import Delta, Lagged, Snapshot
from fluentboard.board.subscriptions.registry import SubscriptionRegistry
from fluentboard.board.subscriptions.settings import SubscriptionSettings
from fluentboard.errors import InvalidInput, InvalidQuery
from fluentboard.model.fluent import Fluent

MUGS = "SELECT ?x { ?x a race:Mug }"
COUNT = "SELECT (COUNT(*) AS ?n) { ?x a race:Mug }"


def mug(name: str) -> AssertFluent:
    return AssertFluent(Fluent(name, "Mug"))


@pytest.fixture
def registry(board: Any) -> Iterator[SubscriptionRegistry]:
    opened = SubscriptionRegistry(board)
    yield opened
    opened.close()


def settled(registry: SubscriptionRegistry, board: Any) -> None:
    assert registry.wait_until(board.commit, timeout_s=5.0)


def test_snapshot_arrives_and_then_deltas(registry: SubscriptionRegistry, board: Any) -> None:
    ready = threading.Event()
    subscription = registry.open(MUGS, on_ready=ready.set)
    assert ready.wait(5.0)
    board.write(mug("a"))
    settled(registry, board)
    assert [type(message) for message in subscription.poll()] == [Snapshot, Delta]


def test_commits_before_the_first_subscription_are_not_missed(
    registry: SubscriptionRegistry, board: Any
) -> None:
    board.write(mug("a"))
    board.write(mug("b"), tell=False)
    subscription = registry.open(COUNT)
    board.tell()
    board.write(mug("c"))
    settled(registry, board)
    snapshot, *deltas = subscription.poll()
    assert isinstance(snapshot, Snapshot)
    assert sum(isinstance(message, Delta) for message in deltas) <= 2
    assert registry.open(COUNT).explanation.startswith("tier 4")


def test_board_without_subscribers_settles_at_once(
    registry: SubscriptionRegistry, board: Any
) -> None:
    board.write(mug("a"), tell=False)
    assert registry.wait_until(board.commit, timeout_s=0.0)


def test_wrong_query_is_refused_at_once(registry: SubscriptionRegistry) -> None:
    with pytest.raises(InvalidQuery):
        registry.open("SELECT nonsense")


def test_unknown_mode_and_negative_since_are_refused(registry: SubscriptionRegistry) -> None:
    with pytest.raises(InvalidInput, match="mode"):
        registry.open(MUGS, "everything")  # type: ignore[arg-type]
    with pytest.raises(InvalidInput, match="since"):
        registry.open(MUGS, since=-1)


def test_open_subscriptions_are_listed_until_they_are_closed(
    registry: SubscriptionRegistry,
) -> None:
    one, two = registry.open(MUGS), registry.open(COUNT)
    one.close()
    assert registry.subscriptions() == [two]


def test_slow_subscriber_does_not_hold_up_another(board: Any) -> None:
    registry = SubscriptionRegistry(board, SubscriptionSettings(queue_messages=4))
    slow, quick = registry.open(MUGS), registry.open(MUGS)
    settled(registry, board)
    seen = 0
    for number in range(20):
        board.write(mug(f"m{number}"))
        settled(registry, board)
        seen += len(quick.poll())
    assert seen == 21
    assert [type(message) for message in slow.poll()] == [Lagged]
    settled(registry, board)
    (snapshot,) = slow.poll()
    assert isinstance(snapshot, Snapshot)
    assert len(snapshot.answer.bag) == 20
    registry.close()


def test_subscriptions_can_be_opened_and_closed_from_many_threads(
    registry: SubscriptionRegistry, board: Any
) -> None:
    def come_and_go() -> None:
        for _ in range(5):
            registry.open(MUGS).close()

    threads = [threading.Thread(target=come_and_go) for _ in range(4)]
    for thread in threads:
        thread.start()
    board.write(mug("a"))
    for thread in threads:
        thread.join()
    settled(registry, board)
    assert registry.subscriptions() == []


def test_closing_ends_subscriptions_and_refuses_new_ones(board: Any) -> None:
    registry = SubscriptionRegistry(board)
    subscription = registry.open(MUGS)
    registry.close()
    registry.close()
    assert subscription.is_closed
    with pytest.raises(InvalidInput, match="closing"):
        registry.open(MUGS)


def test_explanation_is_given_without_subscribing(registry: SubscriptionRegistry) -> None:
    assert registry.explain(MUGS).startswith("tier 1")
    assert registry.subscriptions() == []
