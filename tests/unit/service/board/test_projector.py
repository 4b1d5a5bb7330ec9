"""A store that cannot be written for a while."""

from __future__ import annotations

import threading
from collections.abc import Iterable, Iterator, Sequence

import pyoxigraph as ox
import pytest

from fluentboard.board.events import Commit, FluentAdded, StatementsChanged
from fluentboard.board.intervals import IntervalIndex
from fluentboard.board.journal import KeyedCommit
from fluentboard.board.projections import Projections
from fluentboard.board.projector import Projector
from fluentboard.board.sqlite_journal import SqliteJournal
from fluentboard.board.store import EmbeddedStore
from fluentboard.errors import StorageFailed
from fluentboard.model.fluent import Fluent


class FullStore(EmbeddedStore):
    """Refuses every second write while `is_full`, and all while nothing `may_pass`."""

    is_full = may_pass = False
    writes = 0

    def _look(self) -> None:
        self.writes += 1
        if self.is_full and not (self.may_pass and self.writes % 2):
            raise StorageFailed("the RDF store cannot be written: no space left")

    def apply(self, added: str, removed: str, commit: int) -> None:
        self._look()
        super().apply(added, removed, commit)

    def apply_statements(
        self,
        added: Iterable[ox.Quad],
        removed: Iterable[ox.Quad],
        commit: int,
        *,
        created: Iterable[ox.NamedNode] = (),
        dropped: Iterable[ox.NamedNode] = (),
    ) -> None:
        self._look()
        super().apply_statements(added, removed, commit, created=created, dropped=dropped)


@pytest.fixture
def store() -> FullStore:
    return FullStore(None)


@pytest.fixture
def projections(store: FullStore) -> Iterator[Projections]:
    made = Projections(SqliteJournal(None), store, IntervalIndex(), "disk")
    made.recover()
    yield made
    made.close()


def declaring(number: int, name: str) -> Commit:
    said = StatementsChanged(
        "",
        f"<urn:{name}> <http://www.w3.org/1999/02/22-rdf-syntax-ns#type> "
        "<http://www.w3.org/2002/07/owl#Class> .\n",
        "",
    )
    return Commit(number, float(number), "ann", statements=(said,))


def adding(number: int, name: str, class_name: str) -> Commit:
    fluent = Fluent(name, class_name, version=number, author="ann", created=number)
    return Commit(number, float(number), "ann", (FluentAdded(fluent),))


def test_what_a_full_store_refused_is_applied_once_there_is_room(
    projections: Projections, store: FullStore
) -> None:
    commits = [
        declaring(1, "Cup"),
        adding(2, "cup1", "urn:Cup"),
        declaring(3, "Jug"),
        adding(4, "jug1", "urn:Jug"),
    ]
    projections.journal.append([KeyedCommit(commit) for commit in commits], expected=0)
    projections.remember(commits)
    projector, told = Projector(projections, retry_s=0.001), list[int]()
    heard = threading.Event()

    def hear(group: Sequence[Commit]) -> None:
        told.extend(commit.number for commit in group)
        if told[-1] == 4:
            heard.set()

    projector.listen(hear)
    store.is_full = True
    projector.put(commits)
    with pytest.raises(StorageFailed, match=r"no space left.*tried again every 0.001 s"):
        projector.wait_for(4)
    assert told == []
    store.may_pass = True
    assert heard.wait(10.0)
    assert (told, projector.failure, store.applied) == ([1, 2, 3, 4], None, 4)
    for query in ("ASK { fluent:cup1 a <urn:Cup> }", "ASK { fluent:jug1 a <urn:Jug> }"):
        assert store.query(query)
    projector.close()


def test_a_board_whose_store_stays_full_can_be_closed(
    projections: Projections, store: FullStore
) -> None:
    store.is_full = True
    projector = Projector(projections, retry_s=60.0)
    projector.put([adding(1, "cup1", "urn:Cup")])
    with pytest.raises(StorageFailed):
        projector.wait_for(1)
    projector.close()
