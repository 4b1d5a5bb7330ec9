"""One subscriber's end of a standing query: a bounded queue of messages."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from fluentboard.board.subscriptions.messages import (
    Answer,
    Change,
    Delta,
    Failed,
    Gap,
    Lagged,
    Live,
    Message,
    Mode,
    Resumed,
    Snapshot,
)
from fluentboard.board.subscriptions.settings import SubscriptionSettings
from fluentboard.model.interval import Certainty


@dataclass(frozen=True, slots=True)
class SubscriptionRequest:
    """What a client asks for.

    Attributes:
        query: SPARQL text.
        mode: whether deltas carry bindings, fluents, or both.
        since: the client has seen everything up to this commit; None for a new client.
        at: with which certainty a fluent must hold now to be seen; None sees the whole history.
        since_s: with `at` and `since`: the time that the client saw last, in seconds.
        sequence: number of the first message.
    """

    query: str
    mode: Mode = "bindings"
    since: int | None = None
    at: Certainty | None = None
    since_s: float | None = None
    sequence: int = 0

    @property
    def key(self) -> tuple[str, Certainty | None]:
        """What the standing query that serves it is known by."""
        return self.query, self.at


class Subscription:
    """A queue of messages that never grows beyond its bounds and never makes anybody wait.

    The evaluator puts, one consumer polls. When the consumer is too slow, everything that waits
    is replaced by one `Lagged`; once that is taken, a fresh `Snapshot` follows.

    Attributes:
        request: what the client asked for.
        explanation: which evaluation tier the query has, and why.
    """

    def __init__(
        self,
        request: SubscriptionRequest,
        explanation: str,
        settings: SubscriptionSettings,
        *,
        on_ready: Callable[[], None] | None,
        on_drained: Callable[[Subscription], None],
        on_close: Callable[[Subscription], None],
    ) -> None:
        self.request = request
        self.explanation = explanation
        self._settings = settings
        self._on_ready = on_ready
        self._on_drained = on_drained
        self._on_close = on_close
        self._changed = threading.Condition()
        # Each with how many solutions it has; `_solutions` is their sum.
        self._queue: deque[tuple[Message, int]] = deque()
        self._solutions = 0
        self._sequence = request.sequence
        self._lags = False
        self._closed = False

    @property
    def is_closed(self) -> bool:
        """It was closed; nothing is put any more."""
        return self._closed

    @property
    def waiting(self) -> int:
        """How many messages wait to be polled."""
        return len(self._queue)

    def set_on_ready(self, on_ready: Callable[[], None] | None) -> None:
        """Sets what is called when messages wait that did not before.

        It is called from another thread, must return at once, and is called right away if messages
        wait already. In asyncio: `lambda: loop.call_soon_threadsafe(event.set)`.
        """
        with self._changed:
            self._on_ready = on_ready
            ready = bool(self._queue)
        if ready and on_ready is not None:
            on_ready()

    def poll(self, limit: int | None = None) -> list[Message]:
        """Takes the messages that wait, oldest first; empty if there are none."""
        with self._changed:
            count = len(self._queue) if limit is None else min(limit, len(self._queue))
            taken = [self._queue.popleft() for _ in range(count)]
            self._solutions -= sum(solutions for _, solutions in taken)
            drained = self._lags and bool(taken) and not self._queue
        if drained:
            self._on_drained(self)
        return [message for message, _ in taken]

    def wait(self, timeout_s: float | None = None) -> bool:
        """Blocks until messages wait or the subscription is closed; False after the time-out."""
        with self._changed:
            return self._changed.wait_for(lambda: bool(self._queue) or self._closed, timeout_s)

    def close(self) -> None:
        """Ends the subscription; closing twice is harmless."""
        with self._changed:
            if self._closed:
                return
            self._closed = True
            self._queue.clear()
            self._changed.notify_all()
        self._on_close(self)

    # What follows is called by the evaluator's thread alone.

    def put_snapshot(self, commit: int, answer: Answer, at_s: float | None = None) -> None:
        """Queues the whole result at a commit; deltas that follow are relative to it."""
        self._lags = False
        self._put(Snapshot(self._sequence, commit, answer, at_s), 0)
        self._sequence += 1

    def put_change(self, change: Change) -> None:
        """Queues a change, unless it says nothing in this subscription's mode."""
        mode = self.request.mode
        says_something = (bool(change.difference) and mode != "fluents") or (
            bool(change.events) and mode != "bindings"
        )
        if self._lags or not says_something:
            return
        self._put(Delta(self._sequence, change, mode), len(change))
        self._sequence += 1

    def put(self, message: Resumed | Gap | Live | Failed) -> None:
        """Queues a message without a sequence number."""
        if isinstance(message, Resumed):
            # The snapshot that the client has already is number 0.
            self._sequence = max(self._sequence, 1)
        self._put(message, 0)

    def _put(self, message: Message, solutions: int) -> None:
        with self._changed:
            if self._closed:
                return
            was_empty = not self._queue
            full = len(self._queue) >= self._settings.queue_messages
            # A single delta larger than the bound is let through: a snapshot would be no smaller.
            too_much = bool(self._queue) and (
                self._solutions + solutions > self._settings.queue_solutions
            )
            # Nothing comes after a failure, so it cannot be lost among what waits.
            if (full or too_much) and not isinstance(message, Failed):
                self._queue.clear()
                self._queue.append((Lagged(), 0))
                self._solutions = 0
                self._lags = True
            else:
                self._queue.append((message, solutions))
                self._solutions += solutions
            on_ready = self._on_ready if was_empty else None
            self._changed.notify_all()
        if on_ready is not None:
            on_ready()
