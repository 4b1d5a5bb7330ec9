"""A subscriber's queue is bounded, and says so when it was too short."""

from __future__ import annotations

import pyoxigraph as ox
import pytest

from fluentboard.board.subscriptions.messages import (
    Answer,
    Change,
    Delta,
    Failed,
    Gap,
    Lagged,
    Mode,
    Resumed,
    Snapshot,
)
from fluentboard.board.subscriptions.results import Bag, Difference
from fluentboard.board.subscriptions.settings import SubscriptionSettings
from fluentboard.board.subscriptions.subscription import Subscription, SubscriptionRequest
from fluentboard.errors import InvalidQuery

ANSWER = Answer("select", ("x",), {})


def change(commit: int, solutions: int = 1) -> Change:
    added: Bag = {(ox.Literal(number),): 1 for number in range(solutions)}
    return Change("select", ("x",), commit - 1, commit, Difference(added, {}), (), None)


class Ends:
    """Notes what the subscription calls."""

    def __init__(self, mode: Mode = "bindings", **limits: int) -> None:
        self.calls: list[str] = []
        self.subscription = Subscription(
            SubscriptionRequest("SELECT ...", mode),
            "",
            SubscriptionSettings.model_validate(limits),
            on_ready=lambda: self.calls.append("ready"),
            on_drained=lambda _: self.calls.append("drained"),
            on_close=lambda _: self.calls.append("close"),
        )


def test_messages_are_numbered_from_the_snapshot_on() -> None:
    subscription = Ends().subscription
    subscription.put_snapshot(3, ANSWER)
    subscription.put_change(change(4))
    subscription.put_change(change(5))
    messages = subscription.poll()
    assert [type(message) for message in messages] == [Snapshot, Delta, Delta]
    assert [getattr(message, "sequence", None) for message in messages] == [0, 1, 2]


def test_resumed_client_goes_on_after_the_snapshot_it_has() -> None:
    subscription = Ends().subscription
    subscription.put(Resumed(3))
    subscription.put_change(change(4))
    assert [getattr(message, "sequence", None) for message in subscription.poll()] == [None, 1]


def test_snapshot_after_a_gap_is_the_first() -> None:
    subscription = Ends().subscription
    subscription.put(Gap(1, 3))
    subscription.put_snapshot(3, ANSWER)
    assert [getattr(message, "sequence", None) for message in subscription.poll()] == [None, 0]


def test_readiness_is_told_once_until_the_queue_is_empty_again() -> None:
    ends = Ends()
    ends.subscription.put_change(change(1))
    ends.subscription.put_change(change(2))
    assert ends.calls == ["ready"]
    ends.subscription.poll()
    ends.subscription.put_change(change(3))
    assert ends.calls == ["ready", "ready"]


def test_late_listener_is_told_at_once_that_messages_wait() -> None:
    ends = Ends()
    ends.subscription.put_change(change(1))
    calls: list[str] = []
    ends.subscription.set_on_ready(lambda: calls.append("late"))
    assert calls == ["late"]


def test_poll_takes_no_more_than_asked_for() -> None:
    subscription = Ends().subscription
    for commit in (1, 2, 3):
        subscription.put_change(change(commit))
    assert [len(subscription.poll(2)), subscription.waiting] == [2, 1]


def test_overflow_leaves_one_lagged_and_asks_for_a_snapshot_when_it_is_taken() -> None:
    ends = Ends(queue_messages=2)
    for commit in range(1, 9):
        ends.subscription.put_change(change(commit))
    assert ends.calls == ["ready"]
    assert [type(message) for message in ends.subscription.poll()] == [Lagged]
    assert ends.calls == ["ready", "drained"]
    ends.subscription.put_change(change(9))
    assert ends.subscription.poll() == []
    ends.subscription.put_snapshot(9, ANSWER)
    ends.subscription.put_change(change(10))
    assert [message.commit for message in ends.subscription.poll()] == [9, 10]  # type: ignore[union-attr]


def test_failure_is_told_even_when_the_queue_is_full() -> None:
    subscription = Ends(queue_messages=2).subscription
    subscription.put_snapshot(3, ANSWER)
    subscription.put_change(change(4))
    subscription.put(Failed(InvalidQuery("it cannot be evaluated any more")))
    assert [type(message) for message in subscription.poll()] == [Snapshot, Delta, Failed]


def test_many_solutions_overflow_a_short_queue() -> None:
    subscription = Ends(queue_solutions=10).subscription
    subscription.put_change(change(1, solutions=6))
    subscription.put_change(change(2, solutions=6))
    assert [type(message) for message in subscription.poll()] == [Lagged]


def test_one_large_change_passes_an_empty_queue() -> None:
    subscription = Ends(queue_solutions=10).subscription
    subscription.put_change(change(1, solutions=60))
    assert [type(message) for message in subscription.poll()] == [Delta]


@pytest.mark.parametrize("mode", ["fluents", "bindings"])
def test_change_that_says_nothing_in_the_mode_is_left_out(mode: Mode) -> None:
    subscription = Ends(mode).subscription
    silent = change(1) if mode == "fluents" else change(1, solutions=0)
    subscription.put_change(silent)
    assert subscription.poll() == []


def test_closed_subscription_is_empty_and_stays_so() -> None:
    ends = Ends()
    ends.subscription.put_change(change(1))
    ends.subscription.close()
    ends.subscription.close()
    ends.subscription.put_change(change(2))
    assert ends.subscription.is_closed
    assert ends.subscription.poll() == []
    assert ends.calls == ["ready", "close"]


def test_waiting_ends_with_a_message_or_the_time_out() -> None:
    subscription = Ends().subscription
    assert not subscription.wait(timeout_s=0.0)
    subscription.put_change(change(1))
    assert subscription.wait(timeout_s=0.0)


def test_what_was_taken_does_not_count_any_more_though_something_always_waits() -> None:
    subscription = Ends(queue_solutions=5).subscription
    subscription.put_change(change(1, 2))
    for commit in range(2, 12):
        subscription.put_change(change(commit, 2))
        assert [type(message) for message in subscription.poll(1)] == [Delta]
    assert subscription.waiting == 1
