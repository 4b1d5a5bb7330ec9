"""Any log of commits as a journal: a local SQLite mirror answers what the board looks up.

This is how a replicated log joins: it only has to implement `CommitLog`. Each board keeps a mirror,
so reads never leave the machine, and a mirror that is lost or behind is filled again from the log.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import Any

from fluentboard.board.audit import AuditEntry, AuditFilter
from fluentboard.board.events import Commit, StatementsChanged
from fluentboard.board.journal import CommitLog, KeyedCommit
from fluentboard.board.sqlite_journal import SqliteJournal
from fluentboard.errors import StorageFailed
from fluentboard.model.fluent import Fluent

_AT_ONCE = 1_000


class MirroredJournal:
    """A journal whose truth is a log elsewhere.

    An append goes to the log first, which decides; then to the mirror. If the process ends between
    the two, or the mirror cannot be written, `catch_up` copies what the mirror has missed: at the
    next start, or before the next append.

    Args:
        log: the truth.
        mirror: what is read.

    Raises:
        StorageFailed: the mirror has commits that the log has not: it belongs to another log.
    """

    def __init__(self, log: CommitLog, mirror: SqliteJournal) -> None:
        self._log = log
        self._mirror = mirror
        self._failure: str | None = None
        if mirror.last > log.last:
            raise StorageFailed(
                f"the local mirror is at commit {mirror.last}, but the log only at {log.last}: "
                "they do not belong together. Delete the mirror to copy the log anew"
            )
        self.catch_up()

    def catch_up(self) -> int:
        """Copies what the mirror has missed, and gives the number of its last commit."""
        waiting = self._log.read(self._mirror.last)
        while entries := list(islice(waiting, _AT_ONCE)):
            self._mirror.append(entries, expected=self._mirror.last)
        return self._mirror.last

    @property
    def file(self) -> Path | None:
        """The mirror's file."""
        return self._mirror.file

    @property
    def waits_for_disk(self) -> bool:
        """An append takes as long as the log does."""
        return True

    @property
    def failure(self) -> str | None:
        """Why the mirror lacks what the log has; None while it does not."""
        return self._failure

    def mend(self) -> bool:
        """Copies what the mirror has missed when it could not be written; False if that is nothing.

        Raises:
            StorageFailed: it cannot be written yet.
        """
        if self._failure is None:
            return False
        self.catch_up()
        self._failure = None
        return True

    @property
    def last(self) -> int:
        """Number of the last commit that can be read."""
        return self._mirror.last

    def append(self, entries: Sequence[KeyedCommit], *, expected: int) -> None:
        """Adds commits, all or none; see `CommitLog.append`.

        Raises:
            StorageFailed: the log has the commits, but not the mirror; `failure` says so until
                `mend` has succeeded.
        """
        self._log.append(entries, expected=expected)
        try:
            self._mirror.append(entries, expected=expected)
        except StorageFailed as problem:
            self._failure = (
                f"the log has commits up to {entries[-1].commit.number}, but the local mirror only "
                f"up to {self._mirror.last} ({problem.message}). The next write copies them"
            )
            raise StorageFailed(self._failure) from None

    def read(self, after: int, up_to: int | None = None) -> Iterator[KeyedCommit]:
        """The commits with numbers in (after, up_to], in order."""
        return self._mirror.read(after, up_to)

    def tail(self, after: int, *, patience_s: float | None = None) -> Iterator[KeyedCommit]:
        """The commits after a number, waiting for those to come; see `CommitLog.tail`."""
        return self._log.tail(after, patience_s=patience_s)

    def fluent(self, name: str, as_of: int | None = None) -> Fluent:
        """See `Journal.fluent`."""
        return self._mirror.fluent(name, as_of)

    def history(self, name: str) -> list[Commit]:
        """See `Journal.history`."""
        return self._mirror.history(name)

    def commits(self, after: int, up_to: int | None = None) -> Iterator[Commit]:
        """See `Journal.commits`."""
        return self._mirror.commits(after, up_to)

    def fluents(self, as_of: int | None = None) -> Iterator[Fluent]:
        """See `Journal.fluents`."""
        return self._mirror.fluents(as_of)

    def corrected(self, after: int) -> set[str]:
        """See `Journal.corrected`."""
        return self._mirror.corrected(after)

    def outlines(
        self, after: int = 0, up_to: int | None = None
    ) -> Iterator[tuple[str, str, Any, Any, Any, Any, int]]:
        """See `Journal.outlines`."""
        return self._mirror.outlines(after, up_to)

    def statements(
        self, after: int = 0, up_to: int | None = None
    ) -> Iterator[tuple[int, StatementsChanged]]:
        """See `Journal.statements`."""
        return self._mirror.statements(after, up_to)

    def statements_by_commit(
        self, after: int = 0, up_to: int | None = None
    ) -> Iterator[tuple[int, list[StatementsChanged]]]:
        """See `Journal.statements_by_commit`."""
        return self._mirror.statements_by_commit(after, up_to)

    def request(self, key: str) -> tuple[int, str] | None:
        """See `Journal.request`."""
        return self._mirror.request(key)

    def commit(self, number: int) -> Commit:
        """See `Journal.commit`."""
        return self._mirror.commit(number)

    def commit_at(self, wall_s: float) -> int:
        """See `Journal.commit_at`."""
        return self._mirror.commit_at(wall_s)

    def audit(self, wanted: AuditFilter, limit: int) -> list[AuditEntry]:
        """See `Journal.audit`."""
        return self._mirror.audit(wanted, limit)

    def close(self) -> None:
        """Lets go of both."""
        self._log.close()
        self._mirror.close()
