"""Spool: the fluents of an import, checked one by one and kept on disk until all of them are good.

An import may be far longer than memory, and nothing of it may reach the board if any part of it is
wrong. So its fluents wait in a temporary SQLite file, which also finds the fluents that a file
describes twice, and the references that lead nowhere.
"""

from __future__ import annotations

import sqlite3
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, Self

import orjson

from fluentboard.board.blackboard import Blackboard
from fluentboard.board.commands import AssertFluent, decide
from fluentboard.board.short_names import check_property
from fluentboard.board.vocabulary import Vocabulary
from fluentboard.board.writer import Whole
from fluentboard.errors import FluentboardError, StorageFailed, UnknownFluent
from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.json_format import fluent_from_json, fluent_to_json
from fluentboard_ontology import UPPER

_WARNINGS_MAX = 100

_SCHEMA = """
PRAGMA journal_mode = OFF;
PRAGMA synchronous = OFF;
PRAGMA cache_size = -16000;
CREATE TABLE fluent (position INTEGER PRIMARY KEY, name TEXT UNIQUE, statement BLOB);
CREATE TABLE reference (target TEXT PRIMARY KEY, source TEXT) WITHOUT ROWID;
BEGIN;
"""


class Spool:
    """Checked fluents on their way to a board.

    Args:
        board: where they are to go.

    Raises:
        StorageFailed: the temporary file cannot be written.
    """

    def __init__(self, board: Blackboard) -> None:
        self._board = board
        self._undeclared: dict[str, None] = {}
        self._folder = tempfile.TemporaryDirectory(prefix="fluentboard-import-")
        # Filled by one thread and emptied by another, never by two at a time.
        self._rows = sqlite3.connect(
            Path(self._folder.name) / "spool.sqlite", isolation_level=None, check_same_thread=False
        )
        with _disk_errors():
            self._rows.executescript(_SCHEMA)
        self.count = 0

    def add(self, fluent: Fluent) -> None:
        """Checks one fluent against the vocabulary, the board and the ones before it; keeps it.

        Raises:
            UnknownClass: no loaded ontology declares its class, or that of a reference.
            NotARefinement: it contradicts what the board, or the import itself, says of it.
            StorageFailed: the temporary file cannot be written.
        """
        self.count += 1
        try:
            fluent = self._normalised(fluent)
            self._check_with_board(fluent)
            with _disk_errors():
                self._keep(fluent)
        except FluentboardError as problem:
            if isinstance(problem, StorageFailed):
                raise
            raise type(problem)(
                f"fluent {self.count} of the import ({fluent.name!r}): {problem.message}",
                **problem.detail,
            ) from None

    def batches(self, size: int) -> Iterator[list[Fluent]]:
        """The fluents in their order, some at a time."""
        last = 0
        while True:
            with _disk_errors():
                rows: list[tuple[int, bytes]] = self._rows.execute(
                    "SELECT position, statement FROM fluent WHERE position > ? "
                    "ORDER BY position LIMIT ?",
                    (last, size),
                ).fetchall()
            if not rows:
                return
            last = rows[-1][0]
            yield [fluent_from_json(orjson.loads(statement)) for _, statement in rows]

    def check_shapes(self, size: int) -> Whole | None:
        """Checks all fluents against the board's shapes, as they would be when all are stored.

        Args:
            size: how many fluents are looked at together.

        Returns:
            What the batches are a part of; None if the board has no shapes.

        Raises:
            ShapeViolation: some violate one.
        """
        if not self._board.has_shapes:
            return None
        commit = self._board.commit
        for batch in self.batches(size):
            made = (self.coming(fluent.name) for fluent in batch)
            self._board.check_shapes([fluent for fluent in made if fluent], self.coming)
        return Whole(self.coming, commit)

    def coming(self, name: str) -> Fluent | None:
        """A fluent as it will be with all of the import on the board, or None.

        Raises:
            NotARefinement: somebody else has said otherwise meanwhile.
        """
        current = self._current(name)
        with _disk_errors():
            row = self._rows.execute(
                "SELECT statement FROM fluent WHERE name = ?", (name,)
            ).fetchone()
        if row is None:
            return current
        event = decide(AssertFluent(fluent_from_json(orjson.loads(row[0])), merge=True), current)
        return current if event is None else event.after

    def warnings(self) -> list[str]:
        """What is allowed but perhaps not meant; at most 100 of it."""
        found = [f"property {name!r} is in no loaded ontology" for name in self._undeclared]
        dangling = self._rows.execute(
            "SELECT source, target FROM reference "
            "WHERE target NOT IN (SELECT name FROM fluent) LIMIT ?",
            (_WARNINGS_MAX,),
        )
        found += [
            f"{source!r} refers to {target!r}, which is not on the board"
            for source, target in dangling
            if target not in self._board
        ]
        return found[:_WARNINGS_MAX]

    def close(self) -> None:
        """Lets go of the temporary file."""
        self._rows.close()
        self._folder.cleanup()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _keep(self, fluent: Fluent) -> None:
        added = self._rows.execute(
            "INSERT INTO fluent (name, statement) VALUES (?, ?) ON CONFLICT DO NOTHING",
            (fluent.name, _statement(fluent)),
        )
        if added.rowcount == 0:
            self._merge(fluent)
        targets = [
            (str(p.value), fluent.name)
            for p in fluent.properties
            if p.is_reference and str(p.value) not in self._board
        ]
        if targets:
            self._rows.executemany(
                "INSERT INTO reference VALUES (?, ?) ON CONFLICT DO NOTHING", targets
            )

    def _merge(self, fluent: Fluent) -> None:
        (earlier,) = self._rows.execute(
            "SELECT statement FROM fluent WHERE name = ?", (fluent.name,)
        ).fetchone()
        merged = fluent_from_json(orjson.loads(earlier)).merged(fluent)
        self._check_with_board(merged)
        self._rows.execute(
            "UPDATE fluent SET statement = ? WHERE name = ?", (_statement(merged), fluent.name)
        )

    def _check_with_board(self, fluent: Fluent) -> None:
        current = self._current(fluent.name)
        if current is not None:
            decide(AssertFluent(fluent, merge=True), current)

    def _current(self, name: str) -> Fluent | None:
        try:
            return self._board.fluent(name)
        except UnknownFluent:
            return None

    def _normalised(self, fluent: Fluent) -> Fluent:
        """The fluent in the short names that the board keeps."""
        vocabulary = self._board.vocabulary
        class_name = vocabulary.class_name(fluent.class_name)
        properties = tuple(self._normalised_property(p, vocabulary) for p in fluent.properties)
        return replace(fluent, class_name=class_name, properties=properties)

    def _normalised_property(self, statement: Property, vocabulary: Vocabulary) -> Property:
        name = vocabulary.property_name(statement.name)
        check_property(name, statement.name)
        plain = name.removeprefix(UPPER)
        if plain != name and vocabulary.property_iri(plain) == name:
            # An undeclared plain name stands for this IRI, as Turtle has it.
            name = plain
        if name not in self._undeclared and not vocabulary.declares_property(name):
            self._undeclared[name] = None
        kind = vocabulary.class_name(statement.type) if statement.is_reference else statement.type
        if name == statement.name and kind == statement.type:
            return statement
        return Property(name, kind, statement.value)


class _disk_errors:
    """Turns what SQLite says of the disk into StorageFailed."""

    def __enter__(self) -> None:
        return None

    def __exit__(self, kind: Any, error: BaseException | None, traceback: Any) -> None:
        if isinstance(error, sqlite3.OperationalError | sqlite3.ProgrammingError):
            raise StorageFailed(
                f"the import needs a temporary file, which cannot be written: {error}; make room "
                "in the folder for temporary files, or set TMPDIR to another one"
            ) from None


def _statement(fluent: Fluent) -> bytes:
    return orjson.dumps(fluent_to_json(fluent))
