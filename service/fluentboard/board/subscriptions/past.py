"""Replay: a subscription that begins in the past and goes on in its rhythm, until it is live.

A replay has a view of the board of its own, which is brought from commit to commit and from time to
time, and an evaluator of its own in its own thread. What it sends is what a subscriber would have
been sent then.
"""

from __future__ import annotations

import logging
import math
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import Literal

from fluentboard.board.class_closure import use_class_closure
from fluentboard.board.events import Commit
from fluentboard.board.store import QueryResults
from fluentboard.board.subscriptions.evaluator import Evaluator
from fluentboard.board.subscriptions.messages import Failed
from fluentboard.board.subscriptions.query import ParsedQuery
from fluentboard.board.subscriptions.reevaluate import Board
from fluentboard.board.subscriptions.settings import SubscriptionSettings
from fluentboard.board.subscriptions.subscription import Subscription
from fluentboard.board.time_functions import mentions_functions, time_functions
from fluentboard.board.time_view import Perspective, TimeView
from fluentboard.board.time_views import TimedResults
from fluentboard.board.vocabulary import Vocabulary
from fluentboard.clock import Clock, ReplayClock
from fluentboard.errors import FluentboardError, InvalidInput
from fluentboard.model.fluent import Fluent
from fluentboard.model.interval import Certainty
from fluentboard_ontology import PREFIXES

logger = logging.getLogger(__name__)

_AT_ONCE = 500
_LOOK_AGAIN_S = 0.05


@dataclass(frozen=True, slots=True)
class ReplayRequest:
    """Where a replay begins, and how fast it goes.

    Attributes:
        commit: begin after this commit, and go through the later ones as they were made.
        time_s: or begin at this time in seconds. A query over the whole history then goes through
            the commits made since; a query at now shows what held, as believed at present.
        speed: seconds of the past per real second.

    Raises:
        InvalidInput: not exactly one of commit and time is given, or the speed is not above 0.
    """

    commit: int | None = None
    time_s: float | None = None
    speed: float = 1.0

    def __post_init__(self) -> None:
        if (self.commit is None) == (self.time_s is None):
            raise InvalidInput("a replay begins at a commit or at a time; give one of the two")
        if self.commit is not None and self.commit < 0:
            raise InvalidInput(f"a replay begins after commit {self.commit}; give a commit number")
        if not 0.0 < self.speed < math.inf:
            raise InvalidInput(f"the speed of a replay is {self.speed}; give a number above 0")


class PastBoard:
    """The board as it was, as standing queries see it. Used by one thread."""

    def __init__(self, board: Board, at: Certainty | None, commit: int, now_s: float) -> None:
        self._board = board
        self.clock: Clock = ReplayClock(now_s)
        perspective = Perspective(
            None if at is None else "now", None, Certainty.POSSIBLE if at is None else at
        )
        self._view: TimeView = board.own_view(perspective)
        self.go_to(commit, now_s)

    @property
    def commit(self) -> int:
        """The commit that it shows."""
        return self._view.commit

    @property
    def vocabulary(self) -> Vocabulary:
        """What was declared then."""
        return self._view.vocabulary

    def go_to(self, commit: int, now_s: float) -> None:
        """Shows a later commit and time."""
        assert isinstance(self.clock, ReplayClock)
        self.clock.set(now_s)
        self._board.bring_up(self._view, commit, now_s)

    def snapshot_query(self, sparql: str) -> tuple[int, QueryResults]:
        """The results of a query, and the commit."""
        return self._view.commit, self._query(sparql)

    def timed_query(self, sparql: str, *, at: Literal["now"], certainty: Certainty) -> TimedResults:
        """The results of a query on what held, with the commit and the time they show."""
        return TimedResults(self._query(sparql), self._view.commit, self._view.at_s)

    def past_query(
        self, sparql: str, commit: int, at_s: float | None, certainty: Certainty | None
    ) -> QueryResults:
        """Not for replays: nobody comes back to one."""
        raise InvalidInput("a replay cannot be resumed")

    def fluent(self, name: str, as_of: int | None = None) -> Fluent:
        """A fluent as it stood after a commit."""
        return self._board.fluent(name, self.commit if as_of is None else as_of)

    def coming(self, certainty: Certainty, at_s: float, as_of: int) -> Iterable[tuple[float, str]]:
        """When fluents begin or cease to hold after a time, as believed after a commit."""
        return self._board.coming(certainty, at_s, as_of)

    def commits(self, after: int, up_to: int | None = None) -> Iterator[Commit]:
        """The commits in (after, up_to], in order."""
        return self._board.commits(after, up_to)

    def commit_at(self, wall_s: float) -> int:
        """Number of the last commit made at or before a wall-clock time."""
        return self._board.commit_at(wall_s)

    def listen(self, callback: Callable[[Sequence[Commit]], None]) -> Callable[[], None]:
        """Nobody listens: the replay routes the commits itself."""
        return lambda: None

    def own_view(self, perspective: Perspective) -> TimeView:
        """Not for replays."""
        raise InvalidInput("a replay cannot be replayed")

    def bring_up(self, view: TimeView, commit: int, now_s: float) -> None:
        """As the board does it."""
        self._board.bring_up(view, commit, now_s)

    def close(self) -> None:
        """Lets go of the view."""
        self._view.close()

    def _query(self, sparql: str) -> QueryResults:
        view, options = self._view, {}
        if mentions_functions(sparql):
            commit = view.commit
            options["custom_functions"] = time_functions(
                sparql, lambda name: view.bounds_of(name, commit), self.clock.now_s()
            )
        return view.query(use_class_closure(sparql, PREFIXES, view.vocabulary.is_node), **options)


class Replay:
    """One replay with its thread.

    Args:
        board: the present one.
        settings: bounds.
        subscription: who is sent what.
        query: the query.
        request: where it begins.
        on_end: called in the replay's thread when it has come to the present or was stopped; with
            the evaluator, which knows what was told last, or None if it failed.
    """

    def __init__(
        self,
        board: Board,
        settings: SubscriptionSettings,
        subscription: Subscription,
        query: ParsedQuery,
        request: ReplayRequest,
        on_end: Callable[[Replay, Evaluator | None], None],
    ) -> None:
        self._board = board
        self._settings = settings
        self._request = request
        self._on_end = on_end
        self._stopping = threading.Event()
        self.subscription = subscription
        self.query = query
        self.lags = False
        self._thread = threading.Thread(target=self._run, name="fluentboard-replay", daemon=True)

    @property
    def is_stopping(self) -> bool:
        """It was asked to stop."""
        return self._stopping.is_set()

    def start(self) -> None:
        """Begins."""
        self._thread.start()

    def stop(self) -> None:
        """Has it end soon."""
        self._stopping.set()

    def join(self) -> None:
        """Waits until it has ended."""
        self._thread.join()

    def _run(self) -> None:
        evaluator = None
        try:
            evaluator = self._replayed()
        except FluentboardError as problem:
            self.subscription.put(Failed(problem))
        except Exception as failure:
            logger.exception("a replay met an unexpected error")
            self.subscription.put(Failed(FluentboardError(f"the replay failed: {failure}")))
        self._on_end(self, evaluator)

    def _replayed(self) -> Evaluator | None:
        board, request, at = self._board, self._request, self.subscription.request.at
        commit, now_s = self._beginning()
        follows_commits = request.commit is not None or at is None
        past = PastBoard(board, at, commit, now_s)
        try:
            said = (c for one in board.commits(0, commit) for c in one.statements)
            evaluator = Evaluator(past, self._settings, lambda number: number <= past.commit, said)
            evaluator.begin_after(commit)
            evaluator.open(self.subscription, self.query)
            if not len(evaluator):
                return None
            began_s, from_s = time.monotonic(), now_s
            waiting: list[Commit] = []
            while not self.is_stopping:
                if follows_commits and not waiting:
                    waiting = list(islice(board.commits(past.commit), _AT_ONCE))[::-1]
                due_s = waiting[-1].wall_s if waiting else math.inf
                next_s = evaluator.next_change_s
                if next_s > board.clock.now_s():
                    next_s = math.inf
                if due_s == next_s == math.inf:
                    return evaluator
                moment_s = max(now_s, min(due_s, next_s))
                if not self._wait(began_s + (moment_s - from_s) / request.speed, evaluator):
                    break
                now_s = moment_s
                if due_s <= next_s:
                    one = waiting.pop()
                    past.go_to(one.number, now_s)
                    evaluator.pass_time()
                    evaluator.route(one)
                else:
                    past.go_to(past.commit, now_s)
                    evaluator.pass_time()
                while evaluator.has_work:
                    evaluator.reevaluate_next()
            return None
        finally:
            past.close()

    def _beginning(self) -> tuple[int, float]:
        board, request = self._board, self._request
        last = board.commit
        if request.commit is None:
            assert request.time_s is not None
            if self.subscription.request.at is not None:
                return last, request.time_s
            return board.commit_at(request.time_s), request.time_s
        if request.commit > last:
            raise InvalidInput(
                f"commit {request.commit} has not been made yet; the last is {last}", commit=last
            )
        first = next(board.commits(max(0, request.commit - 1), max(1, request.commit)), None)
        return request.commit, board.clock.now_s() if first is None else first.wall_s

    def _wait(self, until_s: float, evaluator: Evaluator) -> bool:
        """Waits for a moment, and for a subscriber that is slow; False if the replay is stopped."""
        enough = self._settings.queue_messages // 2
        while True:
            if self.lags:
                self.lags = False
                evaluator.refresh(self.subscription)
            left_s = until_s - time.monotonic()
            if left_s <= 0.0 and self.subscription.waiting <= enough:
                return not self.is_stopping
            if self._stopping.wait(_LOOK_AGAIN_S if left_s <= 0.0 else min(left_s, 1.0)):
                return False
