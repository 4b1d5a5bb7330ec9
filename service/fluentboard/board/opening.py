"""Opening: finds the journal and the RDF store of a board, and brings them into step."""

from __future__ import annotations

from pathlib import Path

from fluentboard.board.audit import AuditFilter
from fluentboard.board.endpoint import Endpoint
from fluentboard.board.folder_lock import FolderLock
from fluentboard.board.intervals import IntervalIndex
from fluentboard.board.journal import CommitLog, Durability, Journal
from fluentboard.board.mirrored_journal import MirroredJournal
from fluentboard.board.projections import Projections
from fluentboard.board.rdf_store import RdfStore
from fluentboard.board.remote_store import RemoteStore
from fluentboard.board.sqlite_journal import SqliteJournal
from fluentboard.board.store import EmbeddedStore
from fluentboard.errors import InvalidInput


def open_projections(
    data: Path | None,
    durability: Durability,
    log: CommitLog | None,
    endpoint: Endpoint | None,
) -> Projections:
    """The projections of a journal, recovered if need be; as `Blackboard.open` says.

    Args:
        data: folder of the journal and the RDF store, created if missing; None keeps nothing.
        durability: whether a write waits for the disk.
        log: where commits are kept instead; the journal in `data` is a mirror of it.
        endpoint: holds the RDF store instead. It is closed if there is an error.

    Raises:
        StorageFailed: the folder is in use, damaged or not writable.
    """
    lock = None
    if data is not None:
        _make_folder(data)
        lock = FolderLock(data)
    try:
        return _opened(data, durability, log, endpoint, lock)
    except BaseException:
        if lock is not None:
            lock.close()
        if endpoint is not None:
            endpoint.close()
        raise


def _opened(
    data: Path | None,
    durability: Durability,
    log: CommitLog | None,
    endpoint: Endpoint | None,
    lock: FolderLock | None,
) -> Projections:
    own = SqliteJournal(data and data / "journal.sqlite", durability)
    journal: Journal = own
    try:
        if log is not None:
            journal = MirroredJournal(log, own)
        store: RdfStore = (
            EmbeddedStore(data and data / "store")
            if endpoint is None
            else RemoteStore(endpoint, lambda: _identity(journal))
        )
        projections = Projections(journal, store, IntervalIndex(), durability, lock)
        projections.recover()
    except BaseException:
        journal.close()
        raise
    return projections


def _identity(journal: Journal) -> str | None:
    """What a journal is recognised by: its first commit; None while it has none."""
    first = journal.audit(AuditFilter(), 1)
    return f"{first[0].wall_s!r} {len(first[0].fluents)}" if first else None


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as problem:
        raise InvalidInput(
            f"cannot make the data folder {folder}: {problem}; give a writable folder with --data"
        ) from None
