"""A log of commits in memory: for tests, and the shortest example of what a log has to do."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Sequence

from fluentboard.board.commit_signal import CommitSignal
from fluentboard.board.journal import KeyedCommit
from fluentboard.errors import StorageFailed, UnexpectedCommit


class MemoryLog:
    """Commits in a list; they are gone with the process.

    Example:
        >>> from fluentboard.board.events import Commit
        >>> log = MemoryLog()
        >>> log.append([KeyedCommit(Commit(1, 0.0, "example"))], expected=0)
        >>> [entry.commit.number for entry in log.read(0)]
        [1]
    """

    def __init__(self) -> None:
        self._entries: list[KeyedCommit] = []
        self._guard = threading.Lock()
        self._signal = CommitSignal()
        self._closed = False

    @property
    def last(self) -> int:
        """Number of the last commit, 0 if there is none."""
        return len(self._entries)

    def append(self, entries: Sequence[KeyedCommit], *, expected: int) -> None:
        """Adds commits, all or none; see `CommitLog.append`.

        Raises:
            UnexpectedCommit: the log is not at `expected`.
            StorageFailed: the log is closed.
        """
        with self._guard:
            if self._closed:
                raise StorageFailed("the log is closed; nothing was stored")
            check_expected(entries, expected, len(self._entries))
            self._entries.extend(entries)
        self._signal.appended()

    def read(self, after: int, up_to: int | None = None) -> Iterator[KeyedCommit]:
        """The commits with numbers in (after, up_to], in order."""
        yield from self._entries[after:up_to]

    def tail(self, after: int, *, patience_s: float | None = None) -> Iterator[KeyedCommit]:
        """The commits after a number, waiting for those to come; see `CommitLog.tail`."""
        return self._signal.tail(self.read, after, patience_s, is_shared=False)

    def close(self) -> None:
        """Takes no more commits, and ends every tail."""
        self._closed = True
        self._signal.close()


def check_expected(entries: Sequence[KeyedCommit], expected: int, last: int) -> None:
    """Refuses an append that does not follow the last commit without a gap.

    Args:
        entries: to be appended.
        expected: what the caller takes for the last commit.
        last: the last commit.

    Raises:
        UnexpectedCommit: it does not follow.
    """
    numbers = [entry.commit.number for entry in entries]
    if expected != last or numbers != list(range(expected + 1, expected + 1 + len(entries))):
        raise UnexpectedCommit(
            f"an append expected the journal at commit {expected}, but it is at {last}; another "
            "writer was faster: read what it committed and decide again. Nothing was stored",
            expected=expected,
            last=last,
        )
