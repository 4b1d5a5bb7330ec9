"""The journal as the board sees it: an append-only log of commits, and the look-ups on it.

`CommitLog` is all that a place to keep commits has to offer: append after an expected commit, read
from a commit on, tail. `Journal` adds what the board looks up in it. `SqliteJournal` is both; any
other log becomes a journal by `MirroredJournal`, which keeps a local SQLite mirror of it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, Protocol

from fluentboard.board.audit import AuditEntry, AuditFilter
from fluentboard.board.events import Commit, StatementsChanged
from fluentboard.model.fluent import Fluent

Durability = Literal["disk", "process"]


@dataclass(frozen=True, slots=True)
class KeyedCommit:
    """A commit as the log keeps it, with the idempotency key of the request that asked for it.

    Attributes:
        commit: what to append.
        key: the idempotency key, or None.
        digest: fingerprint of the request; the same key with another digest is a conflict.
    """

    commit: Commit
    key: str | None = None
    digest: str | None = None


class CommitLog(Protocol):
    """A place where commits are kept for good. Safe to use from any thread.

    What `append` has returned for is never lost and never changes; every reader sees the same
    commits in the same order. Whether it survives the process or the machine, the implementation
    says.
    """

    @property
    def last(self) -> int:
        """Number of the last commit, 0 if there is none."""
        ...

    def append(self, entries: Sequence[KeyedCommit], *, expected: int) -> None:
        """Adds commits, all or none; they are kept when it returns.

        Args:
            entries: numbered without gap from `expected + 1` on.
            expected: number of the last commit that the caller has seen.

        Raises:
            UnexpectedCommit: the log goes on beyond `expected`, or is not there yet; nothing was
                stored. Read on and decide again.
            StorageFailed: the log cannot be written; nothing was stored.
        """
        ...

    def read(self, after: int, up_to: int | None = None) -> Iterator[KeyedCommit]:
        """The commits with numbers in (after, up_to] that are there by now, in order."""
        ...

    def tail(self, after: int, *, patience_s: float | None = None) -> Iterator[KeyedCommit]:
        """The commits after a number, in order, waiting for those that are still to come.

        Args:
            after: number of the last commit that the caller has seen.
            patience_s: ends when nothing came for so long; None waits until the log is closed.
        """
        ...

    def close(self) -> None:
        """Lets go of it, and ends every `tail`. Closing twice is harmless."""
        ...


class Journal(CommitLog, Protocol):
    """A log in which the board can look things up."""

    @property
    def file(self) -> Path | None:
        """The SQLite file that another process can read the journal from; None if there is none."""
        ...

    @property
    def waits_for_disk(self) -> bool:
        """An append takes as long as a disk, or a network, does."""
        ...

    @property
    def failure(self) -> str | None:
        """Why look-ups lack what was appended; None while they do not."""
        ...

    def mend(self) -> bool:
        """Completes what look-ups lack after a failure; False if that is nothing.

        Raises:
            StorageFailed: it fails again.
        """
        ...

    def fluent(self, name: str, as_of: int | None = None) -> Fluent:
        """The fluent as it stands, or as it stood after commit `as_of`.

        Raises:
            UnknownFluent: it was not asserted (by then).
        """
        ...

    def history(self, name: str) -> list[Commit]:
        """The commits that changed a fluent, each with the events about it alone.

        Raises:
            UnknownFluent: it was never asserted.
        """
        ...

    def commits(self, after: int, up_to: int | None = None) -> Iterator[Commit]:
        """The commits with numbers in (after, up_to], in order, each event with its before."""
        ...

    def fluents(self, as_of: int | None = None) -> Iterator[Fluent]:
        """Every fluent as it stands, or stood after a commit, by name, in bounded memory."""
        ...

    def corrected(self, after: int) -> set[str]:
        """Names of the fluents that were corrected after a commit."""
        ...

    def outlines(
        self, after: int = 0, up_to: int | None = None
    ) -> Iterator[tuple[str, str, Any, Any, Any, Any, int]]:
        """Per change, in commit order: name, class, s1, s2, f1, f2 afterwards, commit number."""
        ...

    def statements(
        self, after: int = 0, up_to: int | None = None
    ) -> Iterator[tuple[int, StatementsChanged]]:
        """What was said outside fluents by commits in (after, up_to], in order, with the commit."""
        ...

    def statements_by_commit(
        self, after: int = 0, up_to: int | None = None
    ) -> Iterator[tuple[int, list[StatementsChanged]]]:
        """Like `statements`, with what each commit changed in one list."""
        ...

    def request(self, key: str) -> tuple[int, str] | None:
        """Commit number and digest of the request that used an idempotency key."""
        ...

    def commit(self, number: int) -> Commit:
        """One commit, whole."""
        ...

    def commit_at(self, wall_s: float) -> int:
        """Number of the last commit made at or before a wall-clock time; 0 if there is none."""
        ...

    def audit(self, wanted: AuditFilter, limit: int) -> list[AuditEntry]:
        """Who changed what and when, at most `limit` commits of it, in order."""
        ...
