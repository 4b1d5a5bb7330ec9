"""Packing: the durable subscriptions of a board into its backup, and out of it again.

They stand there as tables beside the journal's. Nothing that reads a journal knows these tables.
"""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

from fluentboard.board.subscriptions.durable import COLUMNS, DurableSubscriptions

_PACKED = {
    "subscriptions": ("packed_subscriptions", COLUMNS),
    "dead_letters": (
        "packed_dead_letters",
        "number, name, delivery, body, attempts, reason, failed_s",
    ),
}


def pack_subscriptions(file: Path, backup: Path) -> None:
    """Copies the durable subscriptions into a backup, secrets and dead letters included.

    Args:
        file: where a board keeps them; it may not exist.
        backup: a copy of the journal that nobody reads yet.

    Raises:
        sqlite3.Error: one of the files cannot be read or written.
    """
    if not file.is_file():
        return
    with closing(sqlite3.connect(f"{backup.resolve().as_uri()}?mode=rw", uri=True)) as target:
        target.execute("ATTACH ? AS board", (f"{file.resolve().as_uri()}?mode=ro",))
        # A file without its tables belongs to a board that is about to keep its first one.
        found = target.execute("SELECT name FROM board.sqlite_master WHERE type = 'table'")
        tables = {name for (name,) in found}
        target.execute("BEGIN")
        for table, (packed, columns) in _PACKED.items():
            if table in tables:
                target.execute(f"CREATE TABLE {packed} AS SELECT {columns} FROM board.{table}")
        target.commit()


def unpack_subscriptions(backup: Path, file: Path, last: int) -> None:
    """Takes the durable subscriptions out of a backup and has a board keep them.

    A subscriber that had seen a commit which the board does not have any more gets a `gap` and a
    snapshot: whatever takes the number of that commit will be another one.

    Args:
        backup: the file; the tables are gone from it afterwards.
        file: where the board keeps its subscriptions.
        last: number of the last commit that the board has.

    Raises:
        StorageFailed: the file cannot be written.
        sqlite3.Error: likewise, or the backup is damaged.
    """
    with closing(sqlite3.connect(backup.resolve().as_uri() + "?mode=rw", uri=True)) as source:
        found = source.execute("SELECT name FROM sqlite_master WHERE type = 'table'")
        tables = {name for (name,) in found}
        if not tables.intersection(packed for packed, _ in _PACKED.values()):
            return
        kept = DurableSubscriptions(file)
        kept.create()
        kept.close()
        source.execute("ATTACH ? AS board", (f"{file.resolve().as_uri()}?mode=rw",))
        source.execute("BEGIN")
        for table, (packed, columns) in _PACKED.items():
            if packed in tables:
                source.execute(f"DELETE FROM board.{table}")
                source.execute(
                    f"INSERT INTO board.{table} ({columns}) SELECT {columns} FROM main.{packed}"
                )
                source.execute(f"DROP TABLE main.{packed}")
        source.execute("UPDATE board.subscriptions SET is_broken = 1 WHERE seen > ?", (last,))
        source.commit()
