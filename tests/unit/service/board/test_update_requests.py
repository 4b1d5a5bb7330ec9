"""Requests to update: what they may look like, how often and how long they are carried out."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import pyoxigraph as ox
import pytest

from fluentboard.board.blackboard import Blackboard
from fluentboard.board.update_operations import InsertStatements, Load
from fluentboard.errors import (
    IdempotencyConflict,
    InvalidQuery,
    NotAllowed,
    QueryTimeout,
    TooLarge,
)

NAMESPACE = "PREFIX ex: <http://ex/> "


@pytest.fixture
def board() -> Iterator[Blackboard]:
    with Blackboard.open(None, builtin_ontologies=False) as opened:
        yield opened


def update(board: Blackboard, text: str) -> None:
    board.graphs.update(NAMESPACE + text, "tests").result()


def rows(board: Blackboard, pattern: str) -> set[tuple[str, ...]]:
    results = board.query(f"{NAMESPACE} SELECT * {{ {pattern} }}")
    assert isinstance(results, ox.QuerySolutions)
    return {tuple(str(value) for value in row) for row in results}


def test_prefixes_may_be_declared_between_operations(board: Blackboard) -> None:
    update(
        board,
        "INSERT DATA { ex:a ex:p 1 } ; PREFIX e: <http://ex/> INSERT DATA { e:b ex:p 1 } ;"
        " PREFIX ex: <urn:other:> INSERT DATA { ex:c <http://ex/p> 1 }",
    )
    assert {row[0] for row in rows(board, "?s ex:p 1")} == {
        "<http://ex/a>",
        "<http://ex/b>",
        "<urn:other:c>",
    }


@pytest.mark.parametrize(
    "text",
    [
        "PREFIX ex: <http://ex/>\nINSERT DATA { ex:a ex:p 1 } ;\nCLEAR XYZ ; CLEAR ALL",
        "CLEAR ALL ; CLEAR XYZ",
        "CLEAR XYZ",
        "PREFIX ex: <http://ex/> INSERT DATA { ex:a ex:p",
        "# nothing\n",
        "DELETE DATA { ?s ?p ?o }",
        "INSERT DATA { _:a <urn:p> 1 } ; INSERT DATA { _:a <urn:p> 1 }",
    ],
)
def test_mistake_is_shown_where_the_engine_sees_it(board: Blackboard, text: str) -> None:
    expected = engines_complaint(text)
    if expected is None:
        board.graphs.update(text, "tests").result()
        return
    with pytest.raises(InvalidQuery) as refusal:
        board.graphs.update(text, "tests")
    assert expected[:20] in refusal.value.message


def engines_complaint(text: str) -> str | None:
    try:
        ox.Store().update(text)
    except SyntaxError as problem:
        return str(problem)
    return None


def test_mistake_behind_a_second_prologue_is_shown_where_it_stands(board: Blackboard) -> None:
    text = "CLEAR ALL ;\nPREFIX a: <urn:a> CLEAR ALL ;\nPREFIX a: <urn:b>\n   CLEAR XYZ"
    with pytest.raises(InvalidQuery, match="error at 4:13"):
        board.graphs.update(text, "tests")
    with pytest.raises(InvalidQuery, match="error at 4:13"):
        board.graphs.update(text.replace("urn:b", "urn:a"), "tests")


def test_relative_iris_are_resolved(board: Blackboard) -> None:
    board.graphs.update(
        "INSERT DATA { <a> <p> <b> } ; INSERT { ?x <q> <c> } WHERE { <a> <p> ?x }",
        "tests",
        base_iri="http://ex/",
    ).result()
    assert rows(board, "ex:b ex:q ?c") == {("<http://ex/c>",)}


def test_loading_from_the_web_is_refused_unless_allowed(board: Blackboard) -> None:
    with pytest.raises(NotAllowed, match="LOAD"):
        update(board, "LOAD <http://ex/data>")
    update(board, "LOAD SILENT <file:///etc/passwd>")

    def read(load: Load) -> InsertStatements:
        node = ox.NamedNode(load.address)
        return InsertStatements((ox.Quad(node, node, node, load.target),))

    board.graphs.update("LOAD <urn:x> INTO GRAPH <http://ex/g>", "tests", read=read).result()
    assert len(rows(board, "GRAPH ex:g { ?s ?p ?o }")) == 1


def test_other_endpoints_are_not_asked(board: Blackboard) -> None:
    with pytest.raises(InvalidQuery, match="SERVICE"):
        update(board, "INSERT { ?s ?p ?o } WHERE { SERVICE <http://ex/> { ?s ?p ?o } }")


def test_same_key_updates_once(board: Blackboard) -> None:
    text = "INSERT { [] <urn:p> 1 } WHERE {}"
    first = board.graphs.update(text, "tests", idempotency_key="k").result()
    again = board.graphs.update(text, "tests", idempotency_key="k").result()
    assert (first.number, len(rows(board, "?s <urn:p> 1"))) == (again.number, 1)
    with pytest.raises(IdempotencyConflict):
        board.graphs.update("CLEAR ALL", "tests", idempotency_key="k").result()


def test_no_update_is_lost_between_threads(board: Blackboard) -> None:
    update(board, "INSERT DATA { ex:counter ex:is 0 }")
    step = "DELETE { ?c ex:is ?n } INSERT { ?c ex:is ?m } WHERE { ?c ex:is ?n BIND(?n + 1 AS ?m) }"
    threads = [threading.Thread(target=update, args=(board, step)) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert [row[0][:3] for row in rows(board, "ex:counter ex:is ?n")] == ['"8"']


class SomebodyElseWrites(threading.Event):
    """Commits something in the middle of an evaluation, the first time that it is asked."""

    def __init__(self, board: Blackboard) -> None:
        super().__init__()
        self._board = board
        self._has_written = False

    def is_set(self) -> bool:
        if not self._has_written:
            self._has_written = True
            update(self._board, "INSERT DATA { ex:else ex:p 1 }")
        return super().is_set()


def test_evaluating_an_update_again_takes_no_longer_than_it_may(board: Blackboard) -> None:
    text = NAMESPACE + "INSERT { ?s ex:q 1 } WHERE { ?s ex:p 1 }"
    late = board.graphs.update(text, "tests", stop=SomebodyElseWrites(board), patience_s=-1.0)
    with pytest.raises(QueryTimeout, match="evaluate it again"):
        late.result()
    assert not rows(board, "?s ex:q 1")

    board.graphs.update(text, "tests", stop=SomebodyElseWrites(board), patience_s=60.0).result()
    assert len(rows(board, "?s ex:q 1")) == 1


def test_request_cannot_change_more_than_the_limit(
    board: Blackboard, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("fluentboard.board.graphs.CHANGES_MAX", 3)
    with pytest.raises(TooLarge):
        update(board, "INSERT DATA { ex:a ex:p 1, 2, 3, 4 }")
