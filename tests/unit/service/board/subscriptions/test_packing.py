"""A backup holds the durable subscriptions; a board that was set back tells their readers so."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest

from fluentboard.board.backup import (
    JOURNAL,
    SUBSCRIPTIONS,
    check_backup,
    restore_backup,
    write_backup,
)
from fluentboard.board.blackboard import Blackboard
from fluentboard.board.commands import AssertFluent
from fluentboard.board.subscriptions.durable import (
    DurableSubscription,
    DurableSubscriptions,
    Position,
)
from fluentboard.model.fluent import Fluent
from fluentboard.model.interval import Certainty

ONE = DurableSubscription(
    "plates",
    "SELECT ?p { ?p a race:Plate }",
    "both",
    Certainty.CERTAIN,
    "http://localhost/",
    "whsec_" + "A" * 32,
    "ann",
    1.5,
)


@pytest.fixture
def data(tmp_path: Path) -> Path:
    """Folder of a board of four commits, whose subscriber has seen three of them."""
    folder = tmp_path / "data"
    with Blackboard.open(folder, durability="process") as board:
        for name in ("plate1", "plate2", "plate3"):
            board.execute([AssertFluent(Fluent(name, "Plate"))], "ann")
        assert board.commit == 4
    kept = DurableSubscriptions(folder / SUBSCRIPTIONS)
    kept.add(ONE)
    kept.add(replace(ONE, name="new", url=None, secret=None))
    kept.bury("plates", "msg_1", b"{}", 8, "status 500", 9.0)
    kept.advance("plates", Position(3, 2.5, 7))
    kept.close()
    return folder


def restored(data: Path, folder: Path, up_to: int | None = None) -> DurableSubscriptions:
    write_backup(data / JOURNAL, folder / "backup", up_to)
    restore_backup(folder / "backup", folder / "again")
    return DurableSubscriptions(folder / "again" / SUBSCRIPTIONS)


def test_restored_board_has_its_subscriptions(data: Path, tmp_path: Path) -> None:
    kept = restored(data, tmp_path)
    seen, new = kept.get("plates"), kept.get("new")
    letters = kept.dead_letters("plates")
    kept.close()
    assert seen == replace(ONE, seen=Position(3, 2.5, 7))
    assert new == replace(ONE, name="new", url=None, secret=None)
    assert [letter.delivery for letter in letters] == ["msg_1"]


def test_their_keys_stay_out_of_sight(data: Path, tmp_path: Path) -> None:
    restored(data, tmp_path).close()
    assert (tmp_path / "again" / SUBSCRIPTIONS).stat().st_mode & 0o077 == 0


@pytest.mark.parametrize(("up_to", "is_broken"), [(2, True), (3, False)])
def test_reader_that_saw_what_is_gone_has_missed_something(
    data: Path, tmp_path: Path, up_to: int, is_broken: bool
) -> None:
    kept = restored(data, tmp_path, up_to)
    broken = kept.get("plates").is_broken, kept.get("new").is_broken
    kept.close()
    assert broken == (is_broken, False)


def test_restored_journal_is_a_journal_alone(data: Path, tmp_path: Path) -> None:
    restored(data, tmp_path).close()
    check_backup(tmp_path / "again" / JOURNAL)
    with closing(sqlite3.connect(tmp_path / "again" / JOURNAL)) as journal:
        tables = {name for (name,) in journal.execute("SELECT name FROM sqlite_master")}
    assert not any("packed" in table for table in tables)


def test_board_without_subscriptions_is_restored_without_a_file(tmp_path: Path) -> None:
    with Blackboard.open(tmp_path / "data", durability="process"):
        pass
    restored(tmp_path / "data", tmp_path).close()
    assert not (tmp_path / "again" / SUBSCRIPTIONS).exists()
