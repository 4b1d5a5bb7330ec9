"""Checking: whether the journal is sound, and whether its projections say what it says."""

from __future__ import annotations

import sqlite3
import tempfile
from collections.abc import Callable, Iterable
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path

import pyoxigraph as ox

from fluentboard.board.backup import JOURNAL
from fluentboard.board.intervals import IntervalIndex
from fluentboard.board.projections import Projections
from fluentboard.board.rdf_store import RdfStore
from fluentboard.board.sqlite_journal import SqliteJournal
from fluentboard.board.store import META, EmbeddedStore
from fluentboard.board.triples import fluent_name
from fluentboard.errors import FluentboardError, StorageFailed

_LISTED_MAX = 100


@dataclass(slots=True)
class CheckReport:
    """What a check found.

    Attributes:
        commit: the last commit of the journal.
        fluents: how many there are.
        statements: how many the RDF store should have.
        replayed: commits that the RDF store had not seen yet, as after a crash; a start replays
            them, so they are no fault.
        faults: what is wrong, one sentence each, at most 100.
        fault_count: how much is wrong.
    """

    commit: int = 0
    fluents: int = 0
    statements: int = 0
    replayed: int = 0
    faults: list[str] = field(default_factory=list[str])
    fault_count: int = 0

    @property
    def is_sound(self) -> bool:
        """Nothing is wrong."""
        return self.fault_count == 0

    def add(self, fault: str) -> None:
        """Notes a fault."""
        self.fault_count += 1
        if len(self.faults) < _LISTED_MAX:
            self.faults.append(fault)


def check_board(data: Path) -> CheckReport:
    """Checks the board in a data folder, which no service may use meanwhile; changes nothing.

    The journal is checked by itself: SQLite's own check, numbers without gaps, every change
    readable and with its commit. Then a store is built from the journal alone and compared with
    the board's, statement by statement.

    Raises:
        StorageFailed: there is no board, or a service uses it.
    """
    report = CheckReport()
    file = data / JOURNAL
    if not file.is_file():
        raise StorageFailed(f"there is no journal at {file}; give the data folder of a board")
    with tempfile.TemporaryDirectory(prefix=".check-", dir=data) as name:
        folder = Path(name)
        had_store = (data / "store").is_dir()
        seen = 0
        if had_store:
            try:
                store = EmbeddedStore(data / "store")
            except StorageFailed as problem:
                raise StorageFailed(
                    f"{problem.message}. If a service uses it, stop that one first"
                ) from None
            # A start rebuilds a store that may be ahead of the journal, so it has nothing to tell.
            had_store = not store.may_be_ahead
            seen = store.checkpoint(folder / "found")
            store.let_go()
        _check_journal(file, report)
        if report.is_sound:
            try:
                _compare(file, folder, seen if had_store else None, report)
            except FluentboardError as problem:
                report.add(f"journal: {problem.message}")
    return report


def _check_journal(file: Path, report: CheckReport) -> None:
    with closing(sqlite3.connect(f"{file.resolve().as_uri()}?mode=ro", uri=True)) as journal:
        try:
            for (complaint,) in journal.execute("PRAGMA integrity_check"):
                if complaint != "ok":
                    report.add(f"journal: {complaint}")
            (report.commit,) = journal.execute(
                "SELECT coalesce(max(number), 0) FROM commits"
            ).fetchone()
            gaps = journal.execute(
                "SELECT number FROM commits WHERE number > 1 "
                "AND number - 1 NOT IN (SELECT number FROM commits)"
            )
            for (number,) in gaps:
                report.add(f"journal: the commit before {number} is missing")
            for table in ("changes", "statements"):
                lost = journal.execute(
                    f"SELECT commit_number, count(*) FROM {table} "
                    "WHERE commit_number NOT IN (SELECT number FROM commits) GROUP BY 1"
                )
                for number, count in lost:
                    report.add(f"journal: {count} {table} belong to commit {number}, which is gone")
        except sqlite3.DatabaseError as problem:
            report.add(f"journal: {problem}")


def _compare(file: Path, folder: Path, seen: int | None, report: CheckReport) -> None:
    expected = _projected(file, EmbeddedStore(folder / "expected"), is_trusted=False)
    report.fluents = len(expected.index)
    _check_fluents(expected, report)
    report.statements = sum(1 for _ in _statements(expected.store))
    if seen is None:
        report.replayed = report.commit
    elif seen > report.commit:
        report.add(
            f"store: it is at commit {seen}, but the journal ends at {report.commit}: the journal "
            "has lost commits, or the store belongs to another one"
        )
    else:
        report.replayed = report.commit - seen
        found = _projected(file, EmbeddedStore(folder / "found", applied=seen), is_trusted=seen > 0)
        _differences(expected.store, found.store, report)
        found.close()
    expected.close()


def _projected(file: Path, store: EmbeddedStore, *, is_trusted: bool) -> Projections:
    journal = SqliteJournal(file, read_only=True)
    projections = Projections(journal, store, IntervalIndex(), "disk")
    projections.recover(is_trusted=is_trusted)
    return projections


def _check_fluents(projections: Projections, report: CheckReport) -> None:
    """Whether every fluent can be folded, and the index has it as the fold says."""
    index = projections.index
    for fluent in projections.journal.fluents():
        row = index.row(fluent.name)
        if row is None:
            report.add(f"fluent {fluent.name!r}: it is in the journal but not in the index")
        elif index.version(row) != fluent.version:
            report.add(
                f"fluent {fluent.name!r}: the index has commit {index.version(row)}, the journal "
                f"{fluent.version}"
            )


def _differences(expected: RdfStore, found: RdfStore, report: CheckReport) -> None:
    for quad in _absent(_statements(expected), lambda quad: quad in found):
        report.add(f"store: {_subject(quad)}the statement {_shown(quad)} is missing")
    for quad in _absent(_statements(found), lambda quad: quad in expected):
        report.add(f"store: {_subject(quad)}it has the statement {_shown(quad)} in excess")


def _statements(store: RdfStore) -> Iterable[ox.Quad]:
    return (quad for quad in store.everything() if quad.graph_name != META)


def _absent(quads: Iterable[ox.Quad], has: Callable[[ox.Quad], bool]) -> Iterable[ox.Quad]:
    return (quad for quad in quads if not has(quad))


def _shown(quad: ox.Quad) -> str:
    graph = "" if isinstance(quad.graph_name, ox.DefaultGraph) else f" in graph {quad.graph_name}"
    return f"{quad.triple}{graph}"


def _subject(quad: ox.Quad) -> str:
    name = fluent_name(quad.subject.value) if isinstance(quad.subject, ox.NamedNode) else None
    return "" if name is None else f"fluent {name!r}: "


def compact_board(data: Path) -> tuple[int, int]:
    """Gives back the room that the files of a stopped board do not need.

    Args:
        data: folder of the board.

    Returns:
        Size of the folder in bytes before and after.

    Raises:
        StorageFailed: there is no board, a service uses it, or the disk is full.
    """
    file = data / JOURNAL
    if not file.is_file():
        raise StorageFailed(f"there is no journal at {file}; give the data folder of a board")
    before = size_bytes(data)
    # RocksDB's lock tells whether a service is there, so the store comes first.
    store = EmbeddedStore(data / "store")
    store.compact()
    store.let_go()
    for log in (data / "store").glob("LOG.old.*"):
        log.unlink()
    try:
        with closing(sqlite3.connect(file, isolation_level=None)) as journal:
            journal.execute("PRAGMA wal_checkpoint(TRUNCATE)")
            journal.execute("VACUUM")
            journal.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    except sqlite3.Error as problem:
        raise StorageFailed(f"the journal cannot be compacted: {problem}") from None
    return before, size_bytes(data)


def size_bytes(folder: Path) -> int:
    """Size of all files in a folder, in bytes."""
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())
