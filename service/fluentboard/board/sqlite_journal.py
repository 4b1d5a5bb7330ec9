"""The journal in SQLite: an append-only log of commits, the truth that all else is rebuilt from.

SQLite in WAL mode. With durability "disk" each append is fsynced before it returns. A row of
`changes` holds what the commit added to one fluent, so a fluent's present state is the fold of its
rows, and its state at any earlier commit the fold of the earlier ones.
"""

from __future__ import annotations

import sqlite3
import threading
from collections.abc import Iterator, Sequence
from contextlib import nullcontext
from dataclasses import replace
from itertools import groupby
from pathlib import Path
from typing import Any

from fluentboard.board.audit import AuditEntry, AuditFilter, audit_query
from fluentboard.board.commit_signal import CommitSignal
from fluentboard.board.events import Commit, FluentAdded, FluentEvent, StatementsChanged
from fluentboard.board.journal import Durability, KeyedCommit
from fluentboard.board.journal_rows import Row, encoded, event_of, folded
from fluentboard.board.memory_log import check_expected
from fluentboard.board.thread_connections import ThreadConnections
from fluentboard.errors import StorageFailed, UnknownFluent
from fluentboard.model.fluent import Fluent

_SCHEMA = """
CREATE TABLE IF NOT EXISTS commits (
    number INTEGER PRIMARY KEY, wall_s REAL NOT NULL, author TEXT NOT NULL, reason TEXT NOT NULL,
    idempotency_key TEXT, digest TEXT);
CREATE UNIQUE INDEX IF NOT EXISTS commits_key ON commits (idempotency_key)
    WHERE idempotency_key IS NOT NULL;
CREATE TABLE IF NOT EXISTS changes (
    commit_number INTEGER NOT NULL, position INTEGER NOT NULL, kind TEXT NOT NULL,
    name TEXT NOT NULL, class TEXT NOT NULL, s1 REAL, s2 REAL, f1 REAL, f2 REAL,
    properties BLOB NOT NULL, PRIMARY KEY (commit_number, position)) WITHOUT ROWID;
CREATE INDEX IF NOT EXISTS changes_name ON changes (name, commit_number);
CREATE INDEX IF NOT EXISTS changes_corrected ON changes (commit_number, name)
    WHERE kind = 'corrected';
CREATE TABLE IF NOT EXISTS statements (
    commit_number INTEGER NOT NULL, position INTEGER NOT NULL, graph TEXT NOT NULL,
    ontology TEXT NOT NULL, digest TEXT NOT NULL, added TEXT NOT NULL, removed TEXT NOT NULL,
    graph_event TEXT NOT NULL, PRIMARY KEY (commit_number, position)) WITHOUT ROWID;
"""
FORMAT_VERSION = 2
"""Of the file; kept in SQLite's `user_version`."""

_STATEMENT_COLUMNS = "graph, added, removed, ontology, digest, graph_event"
_COLUMNS = (
    "c.commit_number, c.kind, c.name, c.class, c.s1, c.s2, c.f1, c.f2, c.properties, m.author"
)
_CHANGES = f"SELECT {_COLUMNS} FROM changes c JOIN commits m ON m.number = c.commit_number"


class SqliteJournal:
    """The journal in one SQLite file. One writer, any number of readers.

    Args:
        path: the file, created if missing; None keeps the journal in memory.
        durability: "disk" fsyncs each append; "process" survives a crash of the process only.
        read_only: another process writes; this one only reads what it has appended.

    Raises:
        StorageFailed: the file cannot be opened or is not a journal of this version.
    """

    def __init__(
        self, path: Path | None, durability: Durability = "disk", *, read_only: bool = False
    ) -> None:
        self.failure: str | None = None
        self._path = path
        self._read_only = read_only
        self._signal = CommitSignal()
        self.waits_for_disk = path is not None and durability == "disk"
        self._readers = ThreadConnections(self._connect)
        self._appending = threading.Lock()
        # In memory there is one connection for all threads, so reads and appends take turns.
        self._exclusive = threading.Lock() if path is None else nullcontext()
        try:
            if read_only and path is not None and not path.is_file():
                raise StorageFailed(f"there is no journal at {path}; give the data folder of one")
            self._writer = self._connect()
        except sqlite3.Error as problem:
            raise StorageFailed(f"cannot open the journal {path}: {problem}") from None
        try:
            self._prepare(durability)
        except sqlite3.Error as problem:
            self._writer.close()
            raise StorageFailed(f"cannot open the journal {path}: {problem}") from None
        except StorageFailed:
            self._writer.close()
            raise
        (self._last,) = self._writer.execute(
            "SELECT coalesce(max(number), 0) FROM commits"
        ).fetchone()

    @property
    def file(self) -> Path | None:
        """The file; None if the journal is in memory."""
        return self._path

    def mend(self) -> bool:
        """Nothing that was appended is ever lacking."""
        return False

    @property
    def last(self) -> int:
        """Number of the last commit, 0 if there is none."""
        if self._read_only:
            rows = self._read("SELECT coalesce(max(number), 0) FROM commits", ())
            self._last = next(iter(rows))[0]
        return self._last

    def append(self, entries: Sequence[KeyedCommit], *, expected: int) -> None:
        """Adds commits, all or none; durable when it returns.

        Args:
            entries: numbered without gap from `expected + 1` on.
            expected: number of the last commit that the caller has seen.

        Raises:
            UnexpectedCommit: the journal is at another commit; nothing was stored.
            StorageFailed: the disk is full or broken; nothing was stored.
        """
        with self._appending:
            check_expected(entries, expected, self._last)
            with self._exclusive:
                self._append(entries)
            self._last += len(entries)
        self._signal.appended()

    def read(self, after: int, up_to: int | None = None) -> Iterator[KeyedCommit]:
        """The commits with numbers in (after, up_to], with their keys, in order."""
        for commit in self.commits(after, up_to):
            rows = self._read(
                "SELECT idempotency_key, digest FROM commits WHERE number = ?", (commit.number,)
            )
            key, digest = next(iter(rows))
            yield KeyedCommit(commit, key, digest)

    def tail(self, after: int, *, patience_s: float | None = None) -> Iterator[KeyedCommit]:
        """The commits after a number, waiting for those to come; see `CommitLog.tail`."""
        return self._signal.tail(self.read, after, patience_s, is_shared=self._read_only)

    def _append(self, commits: Sequence[KeyedCommit]) -> None:
        connection = self._writer
        try:
            connection.execute("BEGIN IMMEDIATE")
            connection.executemany(
                "INSERT INTO commits VALUES (?, ?, ?, ?, ?, ?)",
                [
                    (c.number, c.wall_s, c.author, c.reason, entry.key, entry.digest)
                    for entry in commits
                    for c in (entry.commit,)
                ],
            )
            connection.executemany(
                "INSERT INTO changes VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
                [
                    encoded(entry.commit.number, position, event)
                    for entry in commits
                    for position, event in enumerate(entry.commit.events)
                ],
            )
            said = [
                (
                    entry.commit.number,
                    position,
                    change.graph,
                    change.ontology,
                    change.digest,
                    change.added,
                    change.removed,
                    change.graph_event,
                )
                for entry in commits
                for position, change in enumerate(entry.commit.statements)
            ]
            if said:
                connection.executemany(
                    "INSERT INTO statements VALUES (?, ?, ?, ?, ?, ?, ?, ?)", said
                )
            connection.execute("COMMIT")
        except sqlite3.Error as problem:
            if connection.in_transaction:
                connection.execute("ROLLBACK")
            raise StorageFailed(
                f"the journal cannot be written: {problem}; nothing was stored. Free disk space in "
                f"{self._path.parent if self._path else 'memory'} and repeat the request"
            ) from None

    def fluent(self, name: str, as_of: int | None = None) -> Fluent:
        """The fluent as it stands, or as it stood after commit `as_of`.

        Raises:
            UnknownFluent: it was not asserted (by then).
        """
        rows = self._rows("WHERE c.name = ? AND c.commit_number <= ?", (name, _number(as_of)))
        fluent: Fluent | None = None
        for event in folded(rows):
            fluent = event.after
        if fluent is None:
            raise UnknownFluent(_unknown(name, as_of), name=name)
        return fluent

    def history(self, name: str) -> list[Commit]:
        """The commits that changed a fluent, each with the events about it alone.

        Raises:
            UnknownFluent: it was never asserted.
        """
        events = list(folded(self._rows("WHERE c.name = ?", (name,))))
        if not events:
            raise UnknownFluent(_unknown(name, None), name=name)
        by_commit: dict[int, list[FluentEvent]] = {}
        for event in events:
            by_commit.setdefault(event.after.version, []).append(event)
        return [
            replace(self._commit(number), events=tuple(of_commit))
            for number, of_commit in by_commit.items()
        ]

    def commits(self, after: int, up_to: int | None = None) -> Iterator[Commit]:
        """The commits with numbers in (after, up_to], in order, each event with its before."""
        known: dict[str, Fluent] = {}
        for number, wall_s, author, reason in self._read(
            "SELECT number, wall_s, author, reason FROM commits "
            "WHERE number > ? AND number <= ? ORDER BY number",
            (after, _number(up_to)),
        ):
            events: list[FluentEvent] = []
            for row in list(self._rows("WHERE c.commit_number = ?", (number,), "c.position")):
                name = row[2]
                if name not in known and row[1] != FluentAdded.kind:
                    known[name] = self.fluent(name, number - 1)
                event = event_of(row, known.get(name))
                known[name] = event.after
                events.append(event)
            yield Commit(number, wall_s, author, tuple(events), self._statements(number), reason)

    def fluents(self, as_of: int | None = None) -> Iterator[Fluent]:
        """Every fluent as it stands, or stood after a commit, by name, in bounded memory."""
        rows = self._rows(
            "WHERE c.commit_number <= ?", (_number(as_of),), "c.name, c.commit_number, c.position"
        )
        for _, of_name in groupby(rows, key=lambda row: row[2]):
            fluent: Fluent | None = None
            for event in folded(of_name):
                fluent = event.after
            if fluent is not None:
                yield fluent

    def corrected(self, after: int) -> set[str]:
        """Names of the fluents that were corrected after a commit."""
        rows = self._read(
            "SELECT name FROM changes WHERE kind = 'corrected' AND commit_number > ?", (after,)
        )
        return {name for (name,) in rows}

    def outlines(
        self, after: int = 0, up_to: int | None = None
    ) -> Iterator[tuple[str, str, Any, Any, Any, Any, int]]:
        """Per change, in commit order: name, class, s1, s2, f1, f2 afterwards, commit number."""
        yield from self._read(
            "SELECT name, class, s1, s2, f1, f2, commit_number FROM changes "
            "WHERE commit_number > ? AND commit_number <= ? ORDER BY commit_number, position",
            (after, _number(up_to)),
        )

    def statements(
        self, after: int = 0, up_to: int | None = None
    ) -> Iterator[tuple[int, StatementsChanged]]:
        """What was said outside fluents by commits in (after, up_to], in order, with the commit."""
        for number, *parts in self._read(
            f"SELECT commit_number, {_STATEMENT_COLUMNS} FROM statements "
            "WHERE commit_number > ? AND commit_number <= ? ORDER BY commit_number, position",
            (after, _number(up_to)),
        ):
            yield number, StatementsChanged(*parts)

    def statements_by_commit(
        self, after: int = 0, up_to: int | None = None
    ) -> Iterator[tuple[int, list[StatementsChanged]]]:
        """Like `statements`, with what each commit changed in one list."""
        changes = self.statements(after, up_to)
        for number, of_commit in groupby(changes, key=lambda entry: entry[0]):
            yield number, [change for _, change in of_commit]

    def request(self, key: str) -> tuple[int, str] | None:
        """Commit number and digest of the request that used an idempotency key."""
        rows = self._read("SELECT number, digest FROM commits WHERE idempotency_key = ?", (key,))
        return next(iter(rows), None)

    def commit(self, number: int) -> Commit:
        """One commit, whole."""
        return next(self.commits(number - 1, number))

    def commit_at(self, wall_s: float) -> int:
        """Number of the last commit made at or before a wall-clock time; 0 if there is none."""
        rows = self._read(
            "SELECT coalesce(max(number), 0) FROM commits WHERE wall_s <= ?", (wall_s,)
        )
        return next(iter(rows))[0]

    def audit(self, wanted: AuditFilter, limit: int) -> list[AuditEntry]:
        """Who changed what and when, at most `limit` commits of it, in order."""
        sql, values = audit_query(wanted, limit)
        entries = [AuditEntry(*row) for row in self._read(sql, tuple(values))]
        for entry in entries:
            entry.fluents = [
                {"event": kind, "name": name, "class": class_name}
                for kind, name, class_name in self._read(
                    "SELECT kind, name, class FROM changes WHERE commit_number = ? "
                    "ORDER BY position",
                    (entry.commit,),
                )
            ]
            entry.statements = [
                {
                    "graph": change.graph,
                    "ontology": change.ontology,
                    "added": change.added.count("\n"),
                    "removed": change.removed.count("\n"),
                }
                for change in self._statements(entry.commit)
            ]
        return entries

    def close(self) -> None:
        """Lets go of the file, and ends every tail."""
        self._signal.close()
        self._readers.close()
        self._writer.close()

    def _prepare(self, durability: Durability) -> None:
        """Checks the format of the file, and makes or completes its tables."""
        (version,) = self._writer.execute("PRAGMA user_version").fetchone()
        if version not in ((FORMAT_VERSION,) if self._read_only else (0, 1, FORMAT_VERSION)):
            raise StorageFailed(
                f"journal {self._path} has format {version}, this fluentboard reads "
                f"{FORMAT_VERSION}; use the version that wrote it"
            )
        if self._read_only:
            self._writer.execute("PRAGMA query_only = ON")
            return
        self._writer.execute(f"PRAGMA synchronous = {'FULL' if durability == 'disk' else 'NORMAL'}")
        if version == 1:
            self._writer.execute(
                "ALTER TABLE statements ADD COLUMN graph_event TEXT NOT NULL DEFAULT ''"
            )
        self._writer.executescript(_SCHEMA)
        self._writer.execute(f"PRAGMA user_version = {FORMAT_VERSION}")

    def _connect(self) -> sqlite3.Connection:
        connection = sqlite3.connect(
            self._path or ":memory:", isolation_level=None, check_same_thread=False, timeout=30.0
        )
        connection.execute("PRAGMA journal_mode = WAL")
        return connection

    def _read(self, sql: str, parameters: tuple[Any, ...]) -> Iterator[Any]:
        if self._path is None:
            with self._exclusive:
                return iter(self._writer.execute(sql, parameters).fetchall())
        return self._readers.mine().execute(sql, parameters)

    def _rows(
        self, where: str, parameters: tuple[Any, ...], order: str = "c.commit_number, c.position"
    ) -> Iterator[Row]:
        return self._read(f"{_CHANGES} {where} ORDER BY {order}", parameters)

    def _commit(self, number: int) -> Commit:
        rows = self._read(
            "SELECT number, wall_s, author, reason FROM commits WHERE number = ?", (number,)
        )
        number, wall_s, author, reason = next(iter(rows))
        return Commit(number, wall_s, author, reason=reason)

    def _statements(self, number: int) -> tuple[StatementsChanged, ...]:
        rows = self._read(
            f"SELECT {_STATEMENT_COLUMNS} FROM statements "
            "WHERE commit_number = ? ORDER BY position",
            (number,),
        )
        return tuple(StatementsChanged(*row) for row in rows)


def _number(as_of: int | None) -> int:
    return (1 << 62) if as_of is None else as_of


def _unknown(name: str, as_of: int | None) -> str:
    when = "" if as_of is None else f" at commit {as_of}"
    return (
        f"no fluent {name!r} on the board{when}; names are case-sensitive, GET /fluents lists them"
    )
