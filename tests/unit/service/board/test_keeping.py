"""Backup, restore, check, compact and audit of boards on disk."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

import pyoxigraph as ox
import pytest

from fluentboard.board.audit import AuditFilter
from fluentboard.board.backup import restore_backup, write_backup
from fluentboard.board.blackboard import Blackboard
from fluentboard.board.checking import check_board, compact_board
from fluentboard.board.commands import AssertFluent, CorrectFluent, EndFluent
from fluentboard.errors import InvalidInput, StorageFailed
from fluentboard.model.fluent import Fluent
from fluentboard.model.interval import Interval
from fluentboard_ontology import PREFIXES

CLASSES = """
@prefix owl: <http://www.w3.org/2002/07/owl#> . @prefix race: <https://w3id.org/fluentboard/race#> .
race:Mug a owl:Class . race:Plate a owl:Class .
"""


def opened(data: Path) -> Blackboard:
    ontology = data.parent / "classes.ttl"
    ontology.write_text(CLASSES)
    return Blackboard.open(
        data, durability="process", ontologies=[ontology], builtin_ontologies=False
    )


@pytest.fixture
def data(tmp_path: Path) -> Path:
    """Folder of a stopped board of five commits."""
    folder = tmp_path / "data"
    with opened(folder) as board:
        board.execute([AssertFluent(Fluent("mug1", "Mug"))], "ann", idempotency_key="k1")
        board.execute([EndFluent("mug1", Interval(9.0, 9.0))], "bob")
        board.execute([CorrectFluent(Fluent("mug1", "Plate"), "it was a plate")], "root")
        insert = "INSERT DATA { GRAPH <urn:g> { <urn:a> <urn:b> 1 . <urn:a> <urn:b> [] } }"
        board.graphs.update(insert, "ann").result()
    return folder


class TestBackup:
    def test_restored_board_is_as_it_was(self, data: Path, tmp_path: Path) -> None:
        with opened(data) as board:
            assert board.journal_file is not None
            assert write_backup(board.journal_file, tmp_path / "copy") == 5
            before = board.fluent("mug1"), board.history("mug1")
        assert restore_backup(tmp_path / "copy", tmp_path / "again") == 5
        with opened(tmp_path / "again") as board:
            assert (board.fluent("mug1"), board.history("mug1")) == before
            assert board.query("ASK { GRAPH <urn:g> { <urn:a> <urn:b> 1 } }")
            repeated = board.execute(
                [AssertFluent(Fluent("mug1", "Mug"))], "ann", idempotency_key="k1"
            )
            assert repeated.number == 2

    def test_point_in_time(self, data: Path, tmp_path: Path) -> None:
        write_backup(data / "journal.sqlite", tmp_path / "copy")
        assert restore_backup(tmp_path / "copy", tmp_path / "early", up_to=3) == 3
        with opened(tmp_path / "early") as board:
            assert board.commit == 3
            assert (board.fluent("mug1").class_name, board.fluent("mug1").version) == ("Mug", 3)
            assert board.named_graphs() == []

    def test_backup_up_to_a_commit(self, data: Path, tmp_path: Path) -> None:
        assert write_backup(data / "journal.sqlite", tmp_path / "copy", up_to=2) == 2
        assert restore_backup(tmp_path / "copy", tmp_path / "early") == 2

    def test_a_commit_that_is_not_there_leaves_nothing(self, data: Path, tmp_path: Path) -> None:
        with pytest.raises(InvalidInput, match="commit 99 has not been made"):
            write_backup(data / "journal.sqlite", tmp_path / "copy", up_to=99)
        assert not (tmp_path / "copy").exists()

    def test_a_folder_with_a_board_is_not_overwritten(self, data: Path, tmp_path: Path) -> None:
        write_backup(data / "journal.sqlite", tmp_path / "copy")
        with pytest.raises(InvalidInput, match="holds a board already"):
            restore_backup(tmp_path / "copy", data)

    @pytest.mark.parametrize("content", [b"", b"no database at all, but long enough to be one"])
    def test_what_is_no_backup_is_refused(self, tmp_path: Path, content: bytes) -> None:
        (tmp_path / "copy").write_bytes(content)
        with pytest.raises(InvalidInput):
            restore_backup(tmp_path / "copy", tmp_path / "again")
        assert not (tmp_path / "again" / "journal.sqlite").exists()

    def test_a_backup_with_a_gap_is_refused(self, data: Path, tmp_path: Path) -> None:
        write_backup(data / "journal.sqlite", tmp_path / "copy")
        with closing(sqlite3.connect(tmp_path / "copy", isolation_level=None)) as copy:
            copy.execute("DELETE FROM commits WHERE number = 2")
        with pytest.raises(InvalidInput, match="1 of 5 commits are missing"):
            restore_backup(tmp_path / "copy", tmp_path / "again")


class TestCheck:
    def test_a_stopped_board_is_sound(self, data: Path) -> None:
        report = check_board(data)
        assert (report.faults, report.commit, report.fluents) == ([], 5, 1)
        assert report.replayed == 0

    def test_what_differs_is_told_precisely(self, data: Path) -> None:
        store = ox.Store(str(data / "store"))
        fluent = PREFIXES["fluent"] + "mug1"
        store.update(
            f"DELETE WHERE {{ <{fluent}> a ?c }} ; "
            "INSERT DATA { GRAPH <urn:g> { <urn:a> <urn:b> 2 } }"
        )
        store.flush()
        del store
        report = check_board(data)
        assert report.fault_count == len(report.faults) == 2
        missing, excess = report.faults
        assert missing.startswith("store: fluent 'mug1': the statement")
        assert "race#Plate" in missing
        assert "<urn:a> <urn:b>" in excess
        assert "in graph <urn:g> in excess" in excess

    def test_a_store_that_is_behind_is_no_fault(self, data: Path, tmp_path: Path) -> None:
        early = tmp_path / "early"
        write_backup(data / "journal.sqlite", tmp_path / "copy")
        restore_backup(tmp_path / "copy", early, up_to=3)
        opened(early).close()
        (early / "journal.sqlite").unlink()
        (tmp_path / "copy").rename(early / "journal.sqlite")
        report = check_board(early)
        assert (report.faults, report.replayed) == ([], 2)

    def test_a_store_that_is_ahead_is_told(self, data: Path, tmp_path: Path) -> None:
        write_backup(data / "journal.sqlite", tmp_path / "copy", up_to=3)
        (data / "journal.sqlite").unlink()
        (tmp_path / "copy").rename(data / "journal.sqlite")
        assert "the journal has lost commits" in check_board(data).faults[0]

    def test_a_damaged_journal_is_told(self, data: Path) -> None:
        with closing(sqlite3.connect(data / "journal.sqlite", isolation_level=None)) as journal:
            journal.execute("DELETE FROM commits WHERE number = 3")
        faults = check_board(data).faults
        assert "journal: the commit before 4 is missing" in faults
        assert "journal: 1 changes belong to commit 3, which is gone" in faults

    def test_a_missing_store_is_no_fault(self, tmp_path: Path, data: Path) -> None:
        write_backup(data / "journal.sqlite", tmp_path / "copy")
        restore_backup(tmp_path / "copy", tmp_path / "again")
        report = check_board(tmp_path / "again")
        assert (report.faults, report.replayed) == ([], 5)

    def test_a_board_that_is_served_is_not_touched(self, data: Path) -> None:
        with opened(data), pytest.raises(StorageFailed, match="stop that one"):
            check_board(data)


class TestCompact:
    def test_what_is_there_stays(self, data: Path) -> None:
        # So small a board does not get smaller: RocksDB's own notes outweigh it.
        assert min(compact_board(data)) > 0
        assert check_board(data).is_sound

    def test_there_must_be_a_board(self, tmp_path: Path) -> None:
        with pytest.raises(StorageFailed, match="no journal"):
            compact_board(tmp_path)


class TestAudit:
    def test_who_when_and_what(self, data: Path) -> None:
        with opened(data) as board:
            loaded, *entries = board.audit(AuditFilter())
        assert loaded.statements[0]["ontology"] == "classes"
        assert [(e.commit, e.author, e.reason, e.idempotency_key) for e in entries] == [
            (2, "ann", "", "k1"),
            (3, "bob", "", None),
            (4, "root", "it was a plate", None),
            (5, "ann", "", None),
        ]
        assert entries[1].fluents == [{"event": "ended", "name": "mug1", "class": "Mug"}]
        assert entries[3].statements == [
            {"graph": "urn:g", "ontology": "", "added": 2, "removed": 0}
        ]
        times = [entry.wall_s for entry in entries]
        assert times == sorted(times)

    def test_filters_narrow_it(self, data: Path) -> None:
        with opened(data) as board:
            found = {
                "author": board.audit(AuditFilter(author="ann")),
                "name": board.audit(AuditFilter(name="mug1")),
                "forced": board.audit(AuditFilter(forced=True)),
                "window": board.audit(AuditFilter(after=1, up_to=3)),
                "first": board.audit(AuditFilter(), 1),
            }
        numbers = {key: [entry.commit for entry in entries] for key, entries in found.items()}
        assert numbers == {
            "author": [2, 5],
            "name": [2, 3, 4],
            "forced": [4],
            "window": [2, 3],
            "first": [1],
        }
