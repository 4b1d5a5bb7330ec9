"""The projector: a thread that brings the RDF store up to the journal, and then tells listeners.

A write is answered as soon as it is durable, while the store is brought up on the other core. A
query waits until the store has everything that was answered before the query came.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Sequence

from fluentboard.board.events import Commit
from fluentboard.board.projections import Projections
from fluentboard.errors import StorageFailed

logger = logging.getLogger(__name__)

Listener = Callable[[Sequence[Commit]], None]

_WAITING_EVENTS_MAX = 50_000
_GROUP_EVENTS_MAX = 20_000
# A store that failed is tried again so often.
_RETRY_S = 1.0
# How long the next commit is waited for, and all that follow each other as closely.
_LINGER_S = 0.002
_LINGER_MAX_S = 0.02


class Projector:
    """Applies commits to the RDF store in order, many at a time.

    What a full disk or a lost endpoint has stopped is tried again until it succeeds.

    Args:
        projections: has the store.
        retry_s: how long to wait after a failure, in seconds.

    Attributes:
        failure: why the store is behind the journal at present; None while nothing is wrong.
    """

    def __init__(self, projections: Projections, retry_s: float = _RETRY_S) -> None:
        self._projections = projections
        self._retry_s = retry_s
        lock = threading.Lock()
        self._changed = threading.Condition(lock)
        self._arrived = threading.Condition(lock)
        self._urgent = threading.Condition(lock)
        self._readers = 0
        self._waiting: list[Commit] = []
        self._waiting_events = 0
        self._closing = False
        self._listeners: tuple[Listener, ...] = ()
        self.failure: str | None = None
        self._thread = threading.Thread(target=self._run, name="fluentboard-projector", daemon=True)
        self._thread.start()

    def put(self, commits: Sequence[Commit]) -> None:
        """Hands over commits that are durable; waits while too many are in the queue."""
        with self._changed:
            self._changed.wait_for(
                lambda: self._waiting_events < _WAITING_EVENTS_MAX or self.failure is not None
            )
            if not self._waiting:
                self._arrived.notify()
            self._waiting.extend(commits)
            self._waiting_events += sum(len(commit.events) for commit in commits)
            if self._waiting_events >= _GROUP_EVENTS_MAX:
                self._urgent.notify()

    @property
    def is_behind(self) -> bool:
        """So much waits that who hands over more may have to wait too."""
        return self._waiting_events >= _WAITING_EVENTS_MAX // 2

    def wait_for(self, commit: int) -> None:
        """Returns when the RDF store has applied a commit.

        Raises:
            StorageFailed: the store cannot be written at present.
        """
        if self._projections.store.applied >= commit:
            return
        with self._changed:
            self._readers += 1
            self._urgent.notify()
            self._changed.wait_for(
                lambda: self._projections.store.applied >= commit or self.failure is not None
            )
            self._readers -= 1
            if self.failure is not None and self._projections.store.applied < commit:
                raise StorageFailed(self.failure)

    def listen(self, callback: Listener) -> Callable[[], None]:
        """Adds a listener; the returned function removes it."""
        with self._changed:
            self._listeners = (*self._listeners, callback)

        def stop() -> None:
            with self._changed:
                self._listeners = tuple(one for one in self._listeners if one is not callback)

        return stop

    def close(self) -> None:
        """Applies what is in the queue, if that can be done, and stops."""
        with self._changed:
            self._closing = True
            self._arrived.notify()
            self._urgent.notify()
        self._thread.join()

    def _run(self) -> None:
        while True:
            with self._changed:
                self._arrived.wait_for(lambda: self._waiting or self._closing)
                if not self._waiting:
                    return
                # Nobody reads: a moment later there may be more to apply in the same transaction,
                # and the writers have the interpreter to themselves meanwhile.
                self._linger()
                group = self._next_group()
            while not self._projected(group):
                with self._changed:
                    if self._urgent.wait_for(lambda: self._closing, self._retry_s):
                        return
            with self._changed:
                self._waiting_events -= sum(len(commit.events) for commit in group)
                self._changed.notify_all()
                # Taken only now: who began to listen meanwhile may have read the store before this
                # group, and must be told of it.
                listeners = self._listeners
            for listener in listeners:
                try:
                    listener(group)
                except Exception:
                    logger.exception("a listener failed on commit %s", group[-1].number)

    def _projected(self, group: Sequence[Commit]) -> bool:
        """Tries to apply commits, and says in `failure` why it cannot be done at present."""
        try:
            self._projections.project(group)
        except Exception as problem:
            # The commits are durable, only their projection is missing.
            if self.failure is None:
                logger.exception("the RDF store fell behind the journal")
            with self._changed:
                self.failure = (
                    f"the RDF store cannot follow the journal ({problem}); it is tried again every "
                    f"{self._retry_s:g} s: make room on its disk, or see to its endpoint. A "
                    "restart catches up from the journal, too"
                )
                self._changed.notify_all()
            return False
        if self.failure is not None:
            logger.warning("the RDF store follows the journal again")
            self.failure = None
        return True

    def _linger(self) -> None:
        until_s = time.monotonic() + _LINGER_MAX_S
        had = 0
        while had < len(self._waiting) and time.monotonic() < until_s:
            had = len(self._waiting)
            if self._urgent.wait_for(self._is_urgent, _LINGER_S):
                return

    def _is_urgent(self) -> bool:
        return self._readers > 0 or self._closing or self._waiting_events >= _GROUP_EVENTS_MAX

    def _next_group(self) -> list[Commit]:
        count = events = 0
        for commit in self._waiting:
            events += len(commit.events)
            if count and events > _GROUP_EVENTS_MAX:
                break
            count += 1
        group, self._waiting = self._waiting[:count], self._waiting[count:]
        return group
