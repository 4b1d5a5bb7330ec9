"""What every log of commits promises, checked on each of them by the same tests."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest

from fluentboard.board.blackboard import Blackboard
from fluentboard.board.commands import AssertFluent, EndFluent
from fluentboard.board.events import Commit, FluentAdded, FluentEnded, StatementsChanged
from fluentboard.board.intervals import IntervalIndex
from fluentboard.board.journal import CommitLog, KeyedCommit
from fluentboard.board.memory_log import MemoryLog
from fluentboard.board.mirrored_journal import MirroredJournal
from fluentboard.board.projections import Projections
from fluentboard.board.sqlite_journal import SqliteJournal
from fluentboard.board.store import EmbeddedStore
from fluentboard.clock import ReplayClock
from fluentboard.errors import StorageFailed, UnexpectedCommit
from fluentboard.model.fluent import Fluent
from fluentboard.model.interval import Interval


def entry(number: int, key: str | None = None) -> KeyedCommit:
    """Commit n asserts the fluent mug<n> and says a statement."""
    fluent = Fluent(f"mug{number}", "Mug", Interval(1.0, 2.0), version=number, author="ann")
    event = FluentAdded(
        Fluent(fluent.name, "Mug", fluent.start, fluent.finish, (), number, "ann", number)
    )
    said = StatementsChanged("urn:g", f"<urn:a> <urn:b> {number} .\n", "")
    return KeyedCommit(
        Commit(number, 100.0 + number, "ann", (event,), (said,), "why"), key, key and f"of {key}"
    )


def numbers(entries: Iterator[KeyedCommit]) -> list[int]:
    return [one.commit.number for one in entries]


class TestEveryLog:
    """The contract of `CommitLog`. A new implementation joins the parameters of `log`."""

    @pytest.fixture(params=["sqlite file", "sqlite in memory", "list", "mirrored list"])
    def log(self, request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[CommitLog]:
        made: dict[str, CommitLog] = {}
        if request.param == "sqlite file":
            made["log"] = SqliteJournal(tmp_path / "journal.sqlite", "process")
        elif request.param == "sqlite in memory":
            made["log"] = SqliteJournal(None)
        elif request.param == "list":
            made["log"] = MemoryLog()
        else:
            made["log"] = MirroredJournal(MemoryLog(), SqliteJournal(None))
        yield made["log"]
        made["log"].close()

    def test_a_new_log_is_at_commit_0(self, log: CommitLog) -> None:
        assert (log.last, numbers(log.read(0))) == (0, [])

    def test_what_was_appended_is_read_as_it_was(self, log: CommitLog) -> None:
        log.append([entry(1, "k"), entry(2)], expected=0)
        assert list(log.read(0)) == [entry(1, "k"), entry(2)]
        assert log.last == 2

    def test_a_refinement_is_read_with_its_before(self, log: CommitLog) -> None:
        added = entry(1).commit.events[0].after
        ended = Fluent("mug1", "Mug", added.start, Interval(5.0, 5.0), (), 2, "bob", 1)
        log.append([entry(1)], expected=0)
        end = KeyedCommit(Commit(2, 103.0, "bob", (FluentEnded(added, ended),)))
        log.append([end], expected=1)
        assert list(log.read(1)) == [end]

    def test_reading_begins_after_a_commit_and_ends_with_one(self, log: CommitLog) -> None:
        log.append([entry(n) for n in range(1, 6)], expected=0)
        assert numbers(log.read(2)) == [3, 4, 5]
        assert numbers(log.read(1, 3)) == [2, 3]
        assert numbers(log.read(5)) == []

    @pytest.mark.parametrize("expected", [0, 1, 3])
    def test_an_append_to_another_commit_stores_nothing(
        self, log: CommitLog, expected: int
    ) -> None:
        log.append([entry(1), entry(2)], expected=0)
        with pytest.raises(UnexpectedCommit) as refused:
            log.append([entry(expected + 1)], expected=expected)
        assert refused.value.detail == {"expected": expected, "last": 2}
        assert numbers(log.read(0)) == [1, 2]

    def test_a_gap_in_the_numbers_stores_nothing(self, log: CommitLog) -> None:
        with pytest.raises(UnexpectedCommit):
            log.append([entry(1), entry(3)], expected=0)
        assert log.last == 0

    def test_one_of_two_writers_wins(self, log: CommitLog) -> None:
        start, won = threading.Barrier(2), list[str]()

        def write(author: str) -> None:
            start.wait()
            try:
                log.append([entry(1)], expected=0)
                won.append(author)
            except UnexpectedCommit:
                pass

        writers = [threading.Thread(target=write, args=(name,)) for name in ("ann", "bob")]
        for writer in writers:
            writer.start()
        for writer in writers:
            writer.join()
        assert (len(won), numbers(log.read(0))) == (1, [1])

    def test_a_tail_gives_what_is_there_and_what_comes(self, log: CommitLog) -> None:
        log.append([entry(1), entry(2)], expected=0)
        tail = log.tail(1)
        assert next(tail).commit.number == 2
        later = threading.Timer(0.02, lambda: log.append([entry(3)], expected=2))
        later.start()
        assert next(tail).commit.number == 3
        later.join()

    def test_a_tail_ends_when_its_patience_does(self, log: CommitLog) -> None:
        log.append([entry(1)], expected=0)
        assert numbers(log.tail(0, patience_s=0.01)) == [1]

    def test_closing_ends_a_tail(self, log: CommitLog) -> None:
        later = threading.Timer(0.02, log.close)
        later.start()
        assert numbers(log.tail(0)) == []
        later.join()


def test_a_reader_in_another_connection_follows_the_file(tmp_path: Path) -> None:
    file = tmp_path / "journal.sqlite"
    writing = SqliteJournal(file, "process")
    reading = SqliteJournal(file, read_only=True)
    writing.append([entry(1)], expected=0)
    assert (reading.last, numbers(reading.tail(0, patience_s=0.01))) == (1, [1])
    with pytest.raises(StorageFailed):
        reading.append([entry(2)], expected=1)
    reading.close()
    writing.close()


def test_a_board_over_any_log_is_there_again_when_its_mirror_is_lost() -> None:
    log = MemoryLog()
    with Blackboard.open(None, log=log) as board:
        board.execute([AssertFluent(Fluent("mug1", "Mug"))], "ann", idempotency_key="once")
        board.execute([EndFluent("mug1", Interval(9.0, 9.0))], "bob")
        last = board.commit
    copy = MemoryLog()
    copy.append(list(log.read(0)), expected=0)
    with Blackboard.open(None, log=copy) as again:
        assert again.commit == last
        assert [commit.author for commit in again.history("mug1")] == ["ann", "bob"]
        first = again.execute([AssertFluent(Fluent("mug1", "Mug"))], "ann", idempotency_key="once")
        assert first.number == last - 1


class FullDisk(SqliteJournal):
    """A mirror that cannot be written while `is_full`."""

    is_full = False

    def append(self, entries: Sequence[KeyedCommit], *, expected: int) -> None:
        if self.is_full:
            raise StorageFailed("the disk is full; nothing was stored")
        super().append(entries, expected=expected)


def test_a_mirror_that_can_be_written_again_is_caught_up_with() -> None:
    mirror = FullDisk(None)
    journal = MirroredJournal(MemoryLog(), mirror)
    projections = Projections(journal, EmbeddedStore(None), IntervalIndex(), "disk")
    projections.recover()
    with Blackboard(projections, ReplayClock(5.0)) as board:
        board.load_ontologies([], builtin=True)
        mirror.is_full = True
        for _ in range(2):
            with pytest.raises(StorageFailed, match="disk is full"):
                board.execute([AssertFluent(Fluent("mug2", "Mug"))], "ann", idempotency_key="two")
            assert "up to 2, but the local mirror only up to 1" in (board.failure or "")
            assert (board.commit, "mug2" in board) == (1, False)
        mirror.is_full = False
        again = board.execute([AssertFluent(Fluent("mug2", "Mug"))], "ann", idempotency_key="two")
        assert (again.number, board.commit, board.failure) == (2, 2, None)
        assert board.query("ASK { fluent:mug2 a race:Mug }")
        assert board.execute([AssertFluent(Fluent("mug3", "Mug"))], "ann").number == 3


class SlowLog(MemoryLog):
    """A log that keeps nothing before it may."""

    def __init__(self) -> None:
        super().__init__()
        self.may_go_on = threading.Event()

    def append(self, entries: Sequence[KeyedCommit], *, expected: int) -> None:
        self.may_go_on.wait()
        super().append(entries, expected=expected)


def test_a_request_that_somebody_gives_up_does_not_disturb_those_that_share_its_group() -> None:
    log = SlowLog()
    log.may_go_on.set()
    with Blackboard.open(None, log=log) as board:
        log.may_go_on.clear()
        asked = [board.submit([AssertFluent(Fluent(f"mug{n}", "Mug"))], "ann") for n in range(3)]
        assert not any(future.cancel() for future in asked)
        log.may_go_on.set()
        assert [future.result().number for future in asked] == [2, 3, 4]


def test_a_mirror_of_another_log_is_refused() -> None:
    mirror = SqliteJournal(None)
    mirror.append([entry(1)], expected=0)
    with pytest.raises(StorageFailed, match="do not belong together"):
        MirroredJournal(MemoryLog(), mirror)
    mirror.close()
