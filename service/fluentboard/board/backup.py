"""Backup: a copy of the journal as of a commit, and a board made from one.

The journal is the truth of what is believed; the RDF store is built from it when the restored board
starts. A backup is a journal itself: a SQLite file that any SQLite can read. The durable
subscriptions stand in it as well, in tables of their own.
"""

from __future__ import annotations

import os
import shutil
import sqlite3
from contextlib import closing
from pathlib import Path

from fluentboard.board.sqlite_journal import FORMAT_VERSION
from fluentboard.board.subscriptions.packing import pack_subscriptions, unpack_subscriptions
from fluentboard.errors import InvalidInput, StorageFailed

JOURNAL = "journal.sqlite"
"""Name of the journal in a data folder."""

SUBSCRIPTIONS = "subscriptions.sqlite"
"""Name of the durable subscriptions in a data folder."""

_TABLES = (("statements", "commit_number"), ("changes", "commit_number"), ("commits", "number"))


def write_backup(journal: Path, target: Path, up_to: int | None = None) -> int:
    """Copies a journal as it is at this moment, while it is written, into a new file.

    Args:
        journal: file of the journal.
        target: the copy; must not exist.
        up_to: the last commit that is in the copy; None for all.

    Returns:
        Number of the last commit in the copy.

    Raises:
        InvalidInput: the target exists, or the commit has not been made.
        StorageFailed: there is no journal, or the copy cannot be written.
    """
    if not journal.is_file():
        raise StorageFailed(f"there is no journal at {journal}; give the data folder of a board")
    if target.exists():
        raise InvalidInput(f"{target} is there already; give a new file")
    try:
        with closing(sqlite3.connect(f"{journal.resolve().as_uri()}?mode=ro", uri=True)) as source:
            # One read transaction: in WAL mode nobody waits for it, and it waits for nobody.
            source.execute("VACUUM INTO ?", (str(target),))
        pack_subscriptions(journal.with_name(SUBSCRIPTIONS), target)
        return _cut(target, up_to)
    except sqlite3.Error as problem:
        target.unlink(missing_ok=True)
        raise StorageFailed(f"the backup {target} cannot be written: {problem}") from None
    except BaseException:
        target.unlink(missing_ok=True)
        raise


def restore_backup(backup: Path, data: Path, up_to: int | None = None) -> int:
    """Makes a data folder from a backup; `fluentboard serve --data` starts from it.

    Args:
        backup: what `write_backup` wrote.
        data: folder, made if missing; it must hold no board yet.
        up_to: the last commit that is to be there; None for all.

    Returns:
        Number of the last commit.

    Raises:
        InvalidInput: the folder holds a board, the file is no backup, or the commit is not in it.
        StorageFailed: the disk is full or broken; the folder is as it was.
    """
    target = data / JOURNAL
    if target.exists():
        raise InvalidInput(
            f"{data} holds a board already; restore into a new folder, or move that one away"
        )
    if not backup.is_file():
        raise InvalidInput(f"{backup}: no such file; give a backup")
    check_backup(backup)
    partial = target.with_name(JOURNAL + ".partial")
    try:
        data.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(backup, partial)
        last = _cut(partial, up_to)
        unpack_subscriptions(partial, data / SUBSCRIPTIONS, last)
        with partial.open("rb+") as file:
            os.fsync(file.fileno())
        # A store that lies there belongs to another journal.
        shutil.rmtree(data / "store", ignore_errors=True)
        partial.replace(target)
        return last
    except (OSError, sqlite3.Error) as problem:
        raise StorageFailed(f"cannot restore into {data}: {problem}") from None
    finally:
        partial.unlink(missing_ok=True)


def check_backup(file: Path) -> None:
    """Refuses a file that is no journal of this version, or a damaged one.

    Raises:
        InvalidInput: the message says what is wrong.
    """
    try:
        with closing(sqlite3.connect(f"{file.resolve().as_uri()}?mode=ro", uri=True)) as copy:
            (version,) = copy.execute("PRAGMA user_version").fetchone()
            (complaint,) = copy.execute("PRAGMA integrity_check(1)").fetchone()
            count, last = copy.execute(
                "SELECT count(*), coalesce(max(number), 0) FROM commits"
            ).fetchone()
    except sqlite3.Error as problem:
        raise InvalidInput(f"{file} is no backup of a board: {problem}") from None
    if version != FORMAT_VERSION:
        raise InvalidInput(
            f"{file} has format {version}, this fluentboard reads {FORMAT_VERSION}; use the "
            "version that wrote it"
        )
    if complaint != "ok" or count != last:
        what = complaint if complaint != "ok" else f"{last - count} of {last} commits are missing"
        raise InvalidInput(f"{file} is damaged: {what}; use another backup")


def _cut(file: Path, up_to: int | None) -> int:
    """Takes the commits after one out of a copy, and gives the number of its last."""
    with closing(sqlite3.connect(file, isolation_level=None)) as copy:
        (last,) = copy.execute("SELECT coalesce(max(number), 0) FROM commits").fetchone()
        if up_to is None or up_to == last:
            return last
        if up_to > last:
            raise InvalidInput(
                f"commit {up_to} has not been made yet; the last is {last}", commit=last
            )
        copy.execute("BEGIN")
        for table, column in _TABLES:
            copy.execute(f"DELETE FROM {table} WHERE {column} > ?", (up_to,))
        copy.execute("COMMIT")
        copy.execute("VACUUM")
        return up_to
