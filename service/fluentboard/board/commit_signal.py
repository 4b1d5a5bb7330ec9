"""Commit signal: lets those who tail a log wait for its next commit."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator

from fluentboard.board.journal import KeyedCommit

_LOOK_EVERY_S = 0.2

Read = Callable[[int], Iterator[KeyedCommit]]


class CommitSignal:
    """Wakes waiting threads when something was appended, and ends them when the log closes."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._appended = 0
        self._closed = False

    def appended(self) -> None:
        """Tells of new commits."""
        with self._changed:
            self._appended += 1
            self._changed.notify_all()

    def close(self) -> None:
        """Ends every tail."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()

    def tail(
        self, read: Read, after: int, patience_s: float | None, *, is_shared: bool
    ) -> Iterator[KeyedCommit]:
        """What `CommitLog.tail` gives.

        Args:
            read: gives the commits after a number that are there by now.
            after: number of the last commit that the caller has seen.
            patience_s: ends when nothing came for so long; None for never.
            is_shared: another process may append, and cannot tell.
        """
        while True:
            with self._changed:
                seen, is_closed = self._appended, self._closed
            if is_closed:
                return
            found = False
            for entry in read(after):
                after, found = entry.commit.number, True
                yield entry
            if not found and not self._waited(seen, after, read, patience_s, is_shared):
                return

    def _waited(
        self, seen: int, after: int, read: Read, patience_s: float | None, is_shared: bool
    ) -> bool:
        """Whether there is more to read; False when patience ends or the log is closed."""
        began_s = time.monotonic()
        while True:
            left_s = None if patience_s is None else patience_s - (time.monotonic() - began_s)
            if left_s is not None and left_s <= 0.0:
                return False
            look_s = min(_LOOK_EVERY_S, left_s or _LOOK_EVERY_S) if is_shared else left_s
            with self._changed:
                woken = self._changed.wait_for(
                    lambda: self._appended != seen or self._closed, look_s
                )
                if self._closed:
                    return False
            if woken or (is_shared and next(read(after), None) is not None):
                return True
