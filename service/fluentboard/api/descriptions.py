"""Descriptions: what an RDF document says of each fluent, wherever in the document it says it."""

from __future__ import annotations

import sqlite3
import tempfile
from collections.abc import Iterator
from itertools import groupby
from pathlib import Path
from typing import Self

import pyoxigraph as ox

from fluentboard.board.vocabulary import RDF_TYPE
from fluentboard.errors import StorageFailed

_IN_MEMORY_MAX = 100_000

_SCHEMA = """
PRAGMA journal_mode = OFF;
PRAGMA synchronous = OFF;
PRAGMA cache_size = -16000;
CREATE TABLE said (name TEXT, triples TEXT);
CREATE INDEX said_of ON said (name);
BEGIN;
"""


class Descriptions:
    """Statements by the fluent that they are about; in memory, or on disk when they are many.

    On disk they are text, because an RDF store would round numbers to the type that they have.

    Args:
        in_memory_max: how many statements are kept in memory.
    """

    def __init__(self, in_memory_max: int = _IN_MEMORY_MAX) -> None:
        self._in_memory_max = in_memory_max
        self._said: dict[str, dict[ox.Triple, None]] = {}
        self._count = 0
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        self._rows: sqlite3.Connection | None = None

    def add(self, name: str, statement: ox.Triple) -> None:
        """Keeps a statement about a fluent.

        Raises:
            StorageFailed: the temporary file cannot be written.
        """
        self._said.setdefault(name, {})[statement] = None
        self._count += 1
        if self._count > self._in_memory_max:
            self._put_away()

    def class_of(self, name: str) -> str | None:
        """IRI of the class that the document gives a fluent; None if it gives none."""
        for triple in self._about(name):
            if triple.predicate.value == RDF_TYPE and isinstance(triple.object, ox.NamedNode):
                return triple.object.value
        return None

    def __iter__(self) -> Iterator[list[ox.Triple]]:
        """The statements about each fluent, once all are there."""
        if self._rows is None:
            yield from map(list, self._said.values())
            return
        self._put_away()
        rows = self._rows.execute("SELECT name, triples FROM said ORDER BY name")
        for _, parts in groupby(rows, key=lambda row: row[0]):
            yield _parsed("".join(text for _, text in parts))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self._rows is not None:
            self._rows.close()
        if self._folder is not None:
            self._folder.cleanup()

    def _about(self, name: str) -> list[ox.Triple]:
        if self._rows is None:
            return list(self._said.get(name, ()))
        rows = self._rows.execute("SELECT triples FROM said WHERE name = ?", (name,))
        return _parsed("".join(text for (text,) in rows))

    def _put_away(self) -> None:
        try:
            if self._rows is None:
                self._folder = tempfile.TemporaryDirectory(prefix="fluentboard-import-")
                file = Path(self._folder.name) / "said.sqlite"
                # Filled and read by one thread, and closed by whoever gives up.
                self._rows = sqlite3.connect(file, isolation_level=None, check_same_thread=False)
                self._rows.executescript(_SCHEMA)
            self._rows.executemany(
                "INSERT INTO said VALUES (?, ?)",
                (
                    (name, "".join(f"{triple} .\n" for triple in triples))
                    for name, triples in self._said.items()
                ),
            )
        except (sqlite3.OperationalError, OSError) as problem:
            raise StorageFailed(
                f"the import needs a temporary file, which cannot be written: {problem}; make room "
                "in the folder for temporary files, or set TMPDIR to another one"
            ) from None
        self._said, self._count = {}, 0


def _parsed(text: str) -> list[ox.Triple]:
    quads = ox.parse(text, format=ox.RdfFormat.N_TRIPLES)
    return list(dict.fromkeys(quad.triple for quad in quads))
