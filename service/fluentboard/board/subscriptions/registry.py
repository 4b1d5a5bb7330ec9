"""The subscriptions of a board: open one from any thread, and be told what changes."""

from __future__ import annotations

import logging
import math
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from typing import Any, Literal

from fluentboard.board.events import Commit, StatementsChanged
from fluentboard.board.subscriptions.evaluator import Evaluator
from fluentboard.board.subscriptions.messages import Mode
from fluentboard.board.subscriptions.past import Replay, ReplayRequest
from fluentboard.board.subscriptions.planner import Choice, choose, explanation
from fluentboard.board.subscriptions.query import ParsedQuery, parse
from fluentboard.board.subscriptions.reevaluate import Board
from fluentboard.board.subscriptions.schema import Schema
from fluentboard.board.subscriptions.settings import SubscriptionSettings
from fluentboard.board.subscriptions.subscription import Subscription, SubscriptionRequest
from fluentboard.errors import InvalidInput, TooManySubscriptions
from fluentboard.model.interval import Certainty

logger = logging.getLogger(__name__)

_ARRIVAL_TIMEOUT_S = 5.0


class SubscriptionRegistry:
    """Standing queries over a board, evaluated in a thread of their own.

    Writers only leave their commits here and go on. Subscribers have bounded queues, so a slow one
    slows down nobody.

    Args:
        board: the blackboard.
        settings: bounds; the defaults suit one robot.
        outside: statements outside fluents that the board has already (ontologies, graph updates).

    Example:
        >>> from fluentboard.board.blackboard import Blackboard
        >>> board = Blackboard.open(None)
        >>> registry = SubscriptionRegistry(board)
        >>> mugs = registry.open("SELECT ?mug WHERE { ?mug a race:Mug }")
        >>> mugs.wait(timeout_s=10)
        True
        >>> [message.to_json("mugs")["type"] for message in mugs.poll()]
        ['snapshot']
        >>> registry.close()
        >>> board.close()
    """

    def __init__(
        self,
        board: Board,
        settings: SubscriptionSettings | None = None,
        outside: Iterable[StatementsChanged] = (),
    ) -> None:
        self._board = board
        self._settings = settings or SubscriptionSettings()
        self._evaluator = Evaluator(board, self._settings, self._arrive, outside)
        self._schema = Schema(board.vocabulary)
        self._subscriptions: dict[Subscription, None] = {}
        self._replays: dict[Subscription, Replay] = {}
        self._state = threading.Condition()
        self._groups: deque[Sequence[Commit]] = deque()
        self._tasks: deque[Callable[[], None]] = deque()
        self._is_listening = False
        self._delivered = 0
        self._busy = False
        self._closed = False
        self._clock_moved = False
        self._next_change_s = math.inf
        self._stop_watching = board.clock.listen(self._on_clock)
        self._stop_listening = board.listen(self._on_commits)
        # Commits up to this one may not be told of any more, all later ones will be.
        applied, _ = board.snapshot_query("ASK {}")
        self._delivered = max(self._delivered, applied)
        self._thread = threading.Thread(
            target=self._run, name="fluentboard-subscriptions", daemon=True
        )
        self._thread.start()

    def open(
        self,
        query: str,
        mode: Mode = "bindings",
        since: int | None = None,
        on_ready: Callable[[], None] | None = None,
        *,
        at: Literal["now"] | None = None,
        certainty: Certainty = Certainty.POSSIBLE,
        since_s: float | None = None,
        sequence: int = 0,
    ) -> Subscription:
        """Registers a query. The snapshot comes as the first message, a moment later.

        Args:
            query: SPARQL SELECT, ASK or CONSTRUCT.
            mode: whether deltas carry the changed solutions, the fluents, or both.
            since: resume: the client has seen everything up to this commit.
            on_ready: called (from another thread) when messages wait that did not before.
            at: "now" sees only the fluents that hold now, and the clock changes the result, too.
            certainty: with `at`: what may hold, or only what surely does.
            since_s: with `at` and `since`: the time that the client saw last, in seconds.
            sequence: number of the first message.

        Raises:
            InvalidQuery: the query does not parse, or cannot be subscribed to.
            InvalidInput: the mode is unknown or `since` is negative.
        """
        if since is not None and since < 0:
            raise InvalidInput(f"since is {since}; give a commit number", since=since)
        request = SubscriptionRequest(query, mode, since, _held(at, certainty), since_s, sequence)
        subscription, parsed = self._made(request, on_ready)
        with self._state:
            self._admit(subscription)
            self._tasks.append(lambda: self._evaluator.open(subscription, parsed))
            self._state.notify_all()
        return subscription

    def _made(
        self, request: SubscriptionRequest, on_ready: Callable[[], None] | None
    ) -> tuple[Subscription, ParsedQuery]:
        if request.mode not in ("bindings", "fluents", "both"):
            raise InvalidInput(
                f"mode is {request.mode!r}; use bindings, fluents or both", mode=request.mode
            )
        parsed = parse(request.query)
        subscription = Subscription(
            request,
            explanation(parsed, self.choose(parsed, follows_clock=request.at is not None).plan),
            self._settings,
            on_ready=on_ready,
            on_drained=self._on_drained,
            on_close=self._on_close,
        )
        return subscription, parsed

    def _admit(self, subscription: Subscription) -> None:
        """Has commits kept, from here on, for a subscriber that is to be live; under `_state`."""
        if self._closed:
            raise InvalidInput("the board is closing; it takes no more subscriptions")
        self._subscriptions[subscription] = None
        if not self._is_listening:
            # None after the first evaluation is missed.
            self._is_listening = True
            floor = self._delivered
            self._tasks.append(lambda: self._evaluator.begin_after(floor))

    def replay(
        self,
        query: str,
        request: ReplayRequest,
        mode: Mode = "bindings",
        on_ready: Callable[[], None] | None = None,
        *,
        at: Literal["now"] | None = None,
        certainty: Certainty = Certainty.POSSIBLE,
    ) -> Subscription:
        """Registers a query as of the past; its subscriber is told what it would have been told.

        When the replay has come to the present, it goes on live. The subscriber of a replay sets
        its pace: one that is slow is waited for.

        Args:
            query: SPARQL SELECT, ASK or CONSTRUCT.
            request: where to begin, and how fast to go.
            mode: whether deltas carry the changed solutions, the fluents, or both.
            on_ready: called (from another thread) when messages wait that did not before.
            at: "now" sees only the fluents that hold at the time of the replay.
            certainty: with `at`: what may hold, or only what surely does.

        Raises:
            InvalidQuery, InvalidInput: as for `open`.
            TooManySubscriptions: as many replays are under way as may be.
        """
        subscription, parsed = self._made(
            SubscriptionRequest(query, mode, at=_held(at, certainty)), on_ready
        )
        replay = Replay(
            self._board, self._settings, subscription, parsed, request, self._on_replayed
        )
        with self._state:
            if self._closed:
                raise InvalidInput("the board is closing; it takes no more subscriptions")
            if len(self._replays) >= self._settings.replays_max:
                raise TooManySubscriptions(
                    f"{len(self._replays)} replays are under way, as many as may be; wait for one "
                    "to end, or raise subscriptions.replays_max",
                    limit=self._settings.replays_max,
                )
            self._subscriptions[subscription] = None
            self._replays[subscription] = replay
        replay.start()
        return subscription

    def explain(self, query: str) -> str:
        """Which evaluation tier a query would have, and why.

        Raises:
            InvalidQuery: the query does not parse, or cannot be subscribed to.
        """
        parsed = parse(query)
        return explanation(parsed, self.choose(parsed).plan)

    def choose(self, parsed: ParsedQuery, *, follows_clock: bool = False) -> Choice:
        """How a query would be evaluated, and why not by a cheaper tier."""
        vocabulary = self._board.vocabulary
        if self._schema.vocabulary is not vocabulary:
            self._schema = Schema(vocabulary)
        first_tier = self._settings.first_tier
        return choose(parsed, self._schema, first_tier, follows_clock=follows_clock)

    def subscriptions(self) -> list[Subscription]:
        """All open subscriptions, oldest first."""
        with self._state:
            return list(self._subscriptions)

    def wait_until(self, commit: int, timeout_s: float | None = None) -> bool:
        """Blocks until all that a commit changes has been queued for its subscribers.

        Returns:
            False if that took longer than the time-out.
        """
        with self._state:
            return self._state.wait_for(lambda: self._closed or self._is_settled(commit), timeout_s)

    def close(self) -> None:
        """Ends all subscriptions and the thread. Closing twice is harmless."""
        with self._state:
            if self._closed:
                return
            self._closed = True
            open_ones = list(self._subscriptions)
            replays = list(self._replays.values())
            self._state.notify_all()
        for replay in replays:
            replay.stop()
        for replay in replays:
            replay.join()
        self._stop_listening()
        self._stop_watching()
        self._thread.join()
        for subscription in open_ones:
            subscription.close()

    def _on_commits(self, commits: Sequence[Commit]) -> None:
        """Called by a thread of the board, which must not wait."""
        with self._state:
            self._delivered = commits[-1].number
            # Without subscribers only ontologies matter: later queries must know of them.
            kept = commits if self._is_listening else [c for c in commits if c.statements]
            if kept:
                self._groups.append(kept)
            self._state.notify_all()

    def _on_clock(self) -> None:
        """Called by whoever sets the clock."""
        with self._state:
            self._clock_moved = True
            self._state.notify_all()

    def _on_replayed(self, replay: Replay, evaluator: Evaluator | None) -> None:
        """Called by a replay's thread when it has ended: its subscriber goes on live."""
        subscription = replay.subscription
        told = None if evaluator is None else evaluator.told(subscription)
        with self._state:
            self._replays.pop(subscription, None)
            if told is None or self._closed or subscription.is_closed:
                return
            commit, _, answer = told
            self._admit(subscription)
            self._tasks.append(
                lambda: self._evaluator.adopt(subscription, replay.query, commit, answer)
            )
            self._state.notify_all()

    def _on_drained(self, subscription: Subscription) -> None:
        with self._state:
            replay = self._replays.get(subscription)
            if replay is not None:
                replay.lags = True
                return
            self._tasks.append(lambda: self._evaluator.refresh(subscription))
            self._state.notify_all()

    def _on_close(self, subscription: Subscription) -> None:
        with self._state:
            self._subscriptions.pop(subscription, None)
            replay = self._replays.get(subscription)
            if replay is not None:
                replay.stop()
                return
            self._tasks.append(lambda: self._evaluator.close(subscription, time.monotonic()))
            self._state.notify_all()

    def _is_settled(self, commit: int) -> bool:
        if self._groups or self._tasks or self._busy or self._clock_moved:
            return False
        if self._board.clock.now_s() >= self._next_change_s:
            return False
        return not self._is_listening or max(self._delivered, self._evaluator.routed) >= commit

    def _run(self) -> None:
        """The evaluator's thread."""
        rest_until_s = 0.0
        due_s: float | None = None
        while True:
            with self._state:
                self._busy = self._evaluator.has_work
                self._next_change_s = self._evaluator.next_change_s
                self._state.notify_all()
                while not (self._closed or self._groups or self._tasks or self._clock_moved):
                    timeout_s = self._sleep_s(rest_until_s, due_s)
                    if timeout_s is not None and timeout_s <= 0.0:
                        break
                    self._state.wait(timeout_s)
                if self._closed:
                    return
                self._busy = True
                self._clock_moved = False
                task = self._tasks.popleft() if self._tasks else None
            try:
                self._evaluator.pass_time()
                self._route_arrived()
                if task is not None:
                    task()
                began_s = time.monotonic()
                if self._evaluator.has_work and began_s >= rest_until_s:
                    self._evaluator.reevaluate_next()
                    took_s = time.monotonic() - began_s
                    share = self._settings.reevaluation_share
                    rest_until_s = began_s + took_s / share
                due_s = self._evaluator.retire(time.monotonic())
            except Exception:
                logger.exception("the subscriptions met an unexpected error")
            if not len(self._evaluator):
                self._stop_keeping()

    def _sleep_s(self, rest_until_s: float, due_s: float | None) -> float | None:
        """How long the evaluator's thread has nothing to do; None if until it is woken."""
        now_s = time.monotonic()
        times_s: list[float] = []
        if self._evaluator.has_work:
            times_s.append(rest_until_s - now_s)
        elif due_s is not None:
            times_s.append(due_s - now_s)
        if self._next_change_s < math.inf:
            clock = self._board.clock
            # A commit may have said what should have come already.
            is_due = clock.now_s() >= self._next_change_s
            wait_s = 0.0 if is_due else clock.wait_s(self._next_change_s)
            if wait_s is not None:
                times_s.append(wait_s)
        return min(times_s, default=None)

    def _stop_keeping(self) -> None:
        """Nobody subscribes: commits need not be kept."""
        with self._state:
            if not (self._tasks or self._groups):
                self._is_listening = False

    def _route_arrived(self) -> None:
        while True:
            with self._state:
                group = self._groups.popleft() if self._groups else None
            if group is None:
                return
            for commit in group:
                self._evaluator.route(commit)

    def _arrive(self, commit: int) -> bool:
        """Routes commits until the given one has been routed; False if it does not come.

        A query may see a group of commits a moment before the board has told of it.
        """
        deadline_s = time.monotonic() + _ARRIVAL_TIMEOUT_S
        while True:
            self._route_arrived()
            if self._evaluator.routed >= commit:
                return True
            with self._state:
                left_s = deadline_s - time.monotonic()
                if not self._state.wait_for(lambda: self._closed or self._groups, max(0.0, left_s)):
                    return False
                if self._closed:
                    return False


def _held(at: Any, certainty: Certainty) -> Certainty | None:
    """With which certainty a fluent must hold to be seen; None sees the whole history."""
    if at not in (None, "now"):
        raise InvalidInput(f"at is {at!r}; a subscription sees `now`, or all times", at=at)
    return None if at is None else certainty
