"""Durable subscriptions: what is kept of them on disk, so that they survive restarts."""

from __future__ import annotations

import sqlite3
import threading
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

from fluentboard.board.subscriptions.messages import Mode
from fluentboard.errors import StorageFailed, SubscriptionExists, UnknownResource
from fluentboard.model.interval import Certainty

_SCHEMA = """
CREATE TABLE IF NOT EXISTS subscriptions (
    name TEXT PRIMARY KEY, query TEXT NOT NULL, mode TEXT NOT NULL, at TEXT, url TEXT, secret TEXT,
    author TEXT NOT NULL, created_s REAL NOT NULL, seen INTEGER, seen_s REAL,
    sequence INTEGER NOT NULL DEFAULT 0, is_paused INTEGER NOT NULL DEFAULT 0,
    is_broken INTEGER NOT NULL DEFAULT 0);
CREATE TABLE IF NOT EXISTS dead_letters (
    number INTEGER PRIMARY KEY AUTOINCREMENT, name TEXT NOT NULL, delivery TEXT NOT NULL,
    body BLOB NOT NULL, attempts INTEGER NOT NULL, reason TEXT NOT NULL, failed_s REAL NOT NULL);
CREATE INDEX IF NOT EXISTS dead_letters_name ON dead_letters (name, number);
"""
_VERSION = 1
COLUMNS = (
    "name, query, mode, at, url, secret, author, created_s, seen, seen_s, sequence, is_paused, "
    "is_broken"
)
"""Of the table of subscriptions."""


@dataclass(frozen=True, slots=True)
class Position:
    """What a subscriber has seen.

    Attributes:
        commit: the last commit.
        at_s: of a query at now: the time, in seconds; else None.
        sequence: number of the next message.
    """

    commit: int
    at_s: float | None = None
    sequence: int = 0


@dataclass(frozen=True, slots=True)
class DurableSubscription:
    """A subscription with a name of its own.

    Attributes:
        name: unique on the board.
        query: SPARQL text.
        mode: whether deltas carry bindings, fluents, or both.
        at: with which certainty a fluent must hold now to be seen; None sees the whole history.
        url: where its messages are posted; None where the subscriber fetches them.
        secret: the key that posts are signed with; None without `url`.
        author: who made it.
        created_s: when, in seconds since the Unix epoch.
        seen: what its subscriber has acknowledged; None before the first message.
        is_paused: nothing is posted until it is resumed.
        is_broken: the subscriber missed something, as a post was given up or the board was set
            back; what it gets next says `gap` and begins with a snapshot.
    """

    name: str
    query: str
    mode: Mode
    at: Certainty | None
    url: str | None
    secret: str | None
    author: str
    created_s: float
    seen: Position | None = None
    is_paused: bool = False
    is_broken: bool = False


@dataclass(frozen=True, slots=True)
class DeadLetter:
    """A post that was given up.

    Attributes:
        number: grows with time.
        delivery: the identifier that all attempts had in common.
        body: what was to be posted.
        attempts: how often it was tried.
        reason: what went wrong the last time.
        failed_s: when it was given up, in seconds since the Unix epoch.
    """

    number: int
    delivery: str
    body: bytes
    attempts: int
    reason: str
    failed_s: float


class DurableSubscriptions:
    """The durable subscriptions of a board, in a SQLite file. Safe to use from any thread.

    The file is opened when it is needed; every method raises StorageFailed if it cannot be opened,
    read or written, or another version wrote it. What could not be written leaves no trace.

    Args:
        path: the file, created with the first subscription; None keeps them in memory.
        dead_letters_max: how many dead letters are kept per subscription; the oldest go first.
    """

    def __init__(self, path: Path | None, dead_letters_max: int = 1_000) -> None:
        self._dead_letters_max = dead_letters_max
        self._lock = threading.Lock()
        self._path = path
        self._connection: sqlite3.Connection | None = None

    def add(self, subscription: DurableSubscription) -> None:
        """Keeps a new subscription.

        Raises:
            SubscriptionExists: there is one of that name.
        """
        one = subscription
        try:
            with self._changing() as database:
                database.execute(
                    "INSERT INTO subscriptions (name, query, mode, at, url, secret, author, "
                    "created_s, seen, seen_s, sequence) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
                    (
                        one.name,
                        one.query,
                        one.mode,
                        None if one.at is None else one.at.name,
                        one.url,
                        one.secret,
                        one.author,
                        one.created_s,
                        None if one.seen is None else one.seen.commit,
                        None if one.seen is None else one.seen.at_s,
                        0 if one.seen is None else one.seen.sequence,
                    ),
                )
        except sqlite3.IntegrityError:
            raise SubscriptionExists(
                f"there is a subscription {one.name!r} already; delete it first, or choose another "
                "name",
                name=one.name,
            ) from None

    def get(self, name: str) -> DurableSubscription:
        """The subscription of a name.

        Raises:
            UnknownResource: there is none.
        """
        rows = self._read(f"SELECT {COLUMNS} FROM subscriptions WHERE name = ?", name)
        if not rows:
            raise _unknown(name)
        return _subscription(rows[0])

    def all(self) -> list[DurableSubscription]:
        """All of them, by name."""
        rows = self._read(f"SELECT {COLUMNS} FROM subscriptions ORDER BY name")
        return [_subscription(row) for row in rows]

    def remove(self, name: str) -> None:
        """Forgets a subscription with its dead letters.

        Raises:
            UnknownResource: there is none of that name.
        """
        with self._changing() as database:
            gone = database.execute("DELETE FROM subscriptions WHERE name = ?", (name,)).rowcount
            database.execute("DELETE FROM dead_letters WHERE name = ?", (name,))
        if not gone:
            raise _unknown(name)

    def advance(self, name: str, seen: Position) -> None:
        """Notes what the subscriber has seen; does nothing if the subscription is gone."""
        with self._changing() as database:
            database.execute(
                "UPDATE subscriptions SET seen = ?, seen_s = ?, sequence = ?, is_broken = 0 "
                "WHERE name = ?",
                (seen.commit, seen.at_s, seen.sequence, name),
            )

    def pause(self, name: str, *, is_paused: bool) -> None:
        """Stops or resumes the posts of a subscription."""
        with self._changing() as database:
            database.execute(
                "UPDATE subscriptions SET is_paused = ? WHERE name = ?", (is_paused, name)
            )

    def bury(
        self, name: str, delivery: str, body: bytes, attempts: int, reason: str, failed_s: float
    ) -> None:
        """Keeps a post that was given up, and notes that its subscriber missed something."""
        with self._changing() as database:
            database.execute(
                "INSERT INTO dead_letters (name, delivery, body, attempts, reason, failed_s) "
                "VALUES (?, ?, ?, ?, ?, ?)",
                (name, delivery, body, attempts, reason, failed_s),
            )
            database.execute(
                "DELETE FROM dead_letters WHERE name = ? AND number NOT IN (SELECT number FROM "
                "dead_letters WHERE name = ? ORDER BY number DESC LIMIT ?)",
                (name, name, self._dead_letters_max),
            )
            database.execute("UPDATE subscriptions SET is_broken = 1 WHERE name = ?", (name,))

    def dead_letters(self, name: str) -> list[DeadLetter]:
        """The posts that were given up, the oldest first.

        Raises:
            UnknownResource: there is no subscription of that name.
        """
        self.get(name)
        rows = self._read(
            "SELECT number, delivery, body, attempts, reason, failed_s FROM dead_letters "
            "WHERE name = ? ORDER BY number",
            name,
        )
        return [DeadLetter(*row) for row in rows]

    def discard(self, name: str, number: int | None = None) -> int:
        """Forgets one dead letter, or all; how many those were."""
        with self._changing() as database:
            if number is None:
                found = database.execute("DELETE FROM dead_letters WHERE name = ?", (name,))
            else:
                found = database.execute(
                    "DELETE FROM dead_letters WHERE name = ? AND number = ?", (name, number)
                )
            return found.rowcount

    def create(self) -> None:
        """Makes the file, where there is none yet."""
        with self._lock:
            self._opened()

    def close(self) -> None:
        """Lets go of the file."""
        with self._lock:
            if self._connection is not None:
                self._connection.close()
                self._connection = None

    def _read(self, sql: str, *parameters: Any) -> list[Any]:
        with self._lock:
            if self._connection is None and (self._path is None or not self._path.exists()):
                return []
            try:
                return self._opened().execute(sql, parameters).fetchall()
            except sqlite3.Error as problem:
                raise StorageFailed(f"cannot read the subscriptions: {problem}") from None

    def _opened(self) -> sqlite3.Connection:
        if self._connection is not None:
            return self._connection
        path = self._path
        try:
            if path is not None:
                path.parent.mkdir(parents=True, exist_ok=True)
                # It holds the keys that posts are signed with.
                path.touch(0o600)
            database = sqlite3.connect(
                path or ":memory:", isolation_level=None, check_same_thread=False
            )
            database.execute("PRAGMA journal_mode = WAL")
            database.execute("PRAGMA synchronous = NORMAL")
            (version,) = database.execute("PRAGMA user_version").fetchone()
            if version not in (0, _VERSION):
                database.close()
                raise StorageFailed(
                    f"{path} has format {version}, this fluentboard reads {_VERSION}; use the "
                    "version that wrote it"
                )
            database.executescript(_SCHEMA)
            database.execute(f"PRAGMA user_version = {_VERSION}")
        except (sqlite3.Error, OSError) as problem:
            raise StorageFailed(f"cannot open the subscriptions in {path}: {problem}") from None
        self._connection = database
        return database

    @contextmanager
    def _changing(self) -> Generator[sqlite3.Connection]:
        with self._lock:
            database = self._opened()
            try:
                database.execute("BEGIN IMMEDIATE")
                yield database
                database.execute("COMMIT")
            except sqlite3.OperationalError as problem:
                raise StorageFailed(
                    f"the durable subscriptions cannot be written: {problem}; free disk space and "
                    "repeat the request"
                ) from None
            finally:
                if database.in_transaction:
                    database.execute("ROLLBACK")


def _subscription(row: tuple[Any, ...]) -> DurableSubscription:
    name, query, mode, at, url, secret, author, created_s, seen, seen_s, sequence, *flags = row
    return DurableSubscription(
        name,
        query,
        cast("Mode", mode),
        None if at is None else Certainty[at],
        url,
        secret,
        author,
        created_s,
        None if seen is None else Position(seen, seen_s, sequence),
        *(bool(flag) for flag in flags),
    )


def _unknown(name: str) -> UnknownResource:
    return UnknownResource(
        f"there is no durable subscription {name!r}; GET /subscriptions lists them", name=name
    )
