"""A board whose RDF store is a real SPARQL endpoint answers as one that keeps its own."""

from __future__ import annotations

import socket
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import httpx
import pyoxigraph as ox
import pytest

from fluentboard.board.blackboard import Blackboard
from fluentboard.board.commands import AssertFluent, Command, CorrectFluent, EndFluent, RefineFluent
from fluentboard.board.endpoint import Endpoint
from fluentboard.clock import ReplayClock
from fluentboard.errors import (
    FluentsAreReadOnly,
    InvalidConfiguration,
    InvalidQuery,
    StorageFailed,
)
from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.interval import Interval
from fluentboard_modules.demo.service_process import ServiceProcess

COMMANDS: tuple[Command | str, ...] = (
    AssertFluent(Fluent("mug1", "Mug", Interval(1.0, 2.0))),
    AssertFluent(Fluent("mug2", "Mug", Interval(3.0, 3.0), Interval(9.0, 9.5))),
    RefineFluent("mug1", None, None, (Property("hasX", "xsd:float", 1.5),)),
    EndFluent("mug1", Interval(4.0, 5.0)),
    CorrectFluent(
        Fluent("mug2", "Plate", properties=(Property("note", "xsd:string", 'a "b"\n'),)), "x"
    ),
    "INSERT DATA { GRAPH <urn:g> { <urn:a> <urn:b> 1 . <urn:a> <urn:c> [ <urn:d> 'e'@en ] } }",
    "INSERT DATA { <urn:kitchen> <urn:has> <urn:oven> . <urn:kitchen> <urn:has> <urn:sink> }",
    "DELETE { <urn:kitchen> <urn:has> ?x } "
    "WHERE { <urn:kitchen> <urn:has> ?x FILTER(?x = <urn:sink>) }",
    "INSERT { GRAPH <urn:g> { <urn:a> <urn:n> ?n } } "
    "WHERE { SELECT (COUNT(*) AS ?n) { ?s a race:Mug } }",
)
QUERIES = (
    "SELECT * { ?s ?p ?o }",
    "SELECT * { GRAPH <urn:g> { ?s ?p ?o } }",
    "SELECT ?s { ?s rdf:type/rdfs:subClassOf* race:Tableware }",
    "SELECT ?s (COUNT(*) AS ?n) { ?s a ?c } GROUP BY ?s HAVING (COUNT(*) > 1)",
    "SELECT ?s { ?s a race:Mug FILTER(fb:holdsAt(?s, 3.5)) }",
    "ASK { fluent:mug1 a race:Mug }",
    "CONSTRUCT { ?s a ?c } WHERE { ?s a ?c ; upper:hasStartEarliest ?t }",
)


@pytest.fixture(scope="module")
def server() -> Iterator[str]:
    """Address of a running `oxigraph serve`."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    program = Path(sys.executable).with_name("oxigraph")
    with subprocess.Popen(
        [program, "serve", "--bind", f"127.0.0.1:{port}"], stderr=subprocess.DEVNULL
    ) as process:
        address = f"http://127.0.0.1:{port}"
        deadline = time.monotonic() + 30.0
        while time.monotonic() < deadline:
            try:
                httpx.get(address, trust_env=False)
                break
            except httpx.TransportError:
                time.sleep(0.05)
        yield address
        process.kill()


@pytest.fixture
def endpoint(server: str) -> str:
    """The same server, emptied."""
    httpx.post(server + "/update", data={"update": "CLEAR ALL"}, trust_env=False)
    return server


def opened(data: Path, address: str | None) -> Blackboard:
    return Blackboard.open(
        data,
        durability="process",
        clock=ReplayClock(3.5),
        endpoint=None if address is None else Endpoint(address),
    )


def write(board: Blackboard, commands: tuple[Command | str, ...] = COMMANDS) -> None:
    for command in commands:
        if isinstance(command, str):
            board.graphs.update(command, "test").result()
        else:
            board.execute([command], "test")


def rows(results: object) -> Counter[str]:
    def text(term: object) -> str:
        return "_" if isinstance(term, ox.BlankNode) else str(term)

    if isinstance(results, ox.QueryBoolean):
        return Counter([str(bool(results))])
    assert isinstance(results, ox.QuerySolutions | ox.QueryTriples)
    return Counter(" ".join(text(term) for term in row) for row in results)


def answers(board: Blackboard) -> list[Counter[str]]:
    found = [rows(board.query(sparql)) for sparql in QUERIES]
    found += [rows(board.query(sparql, at="now")) for sparql in QUERIES]
    return [*found, *(rows(board.query(sparql, as_of=3)) for sparql in QUERIES)]


def test_it_answers_as_a_board_with_a_store_of_its_own(endpoint: str, tmp_path: Path) -> None:
    with opened(tmp_path / "own", None) as own, opened(tmp_path / "remote", endpoint) as remote:
        write(own)
        write(remote)
        assert answers(remote) == answers(own)
        assert remote.named_graphs() == own.named_graphs()
        commit, results = remote.snapshot_query("SELECT ?s { ?s a race:Mug }")
        assert (commit, len(list(results))) == (remote.commit, 1)  # type: ignore[arg-type]
        with pytest.raises(FluentsAreReadOnly):
            remote.graphs.update("DELETE WHERE { fluent:mug1 ?p ?o }", "test").result()
        with pytest.raises(InvalidQuery):
            remote.query("SELECT ?s { ?s a ")


def test_an_endpoint_that_was_emptied_is_filled_again(endpoint: str, tmp_path: Path) -> None:
    with opened(tmp_path, endpoint) as board:
        write(board)
        before = answers(board)
    httpx.post(endpoint + "/update", data={"update": "CLEAR ALL"}, trust_env=False)
    with opened(tmp_path, endpoint) as board:
        assert answers(board) == before


def test_an_endpoint_that_is_behind_catches_up(endpoint: str, tmp_path: Path) -> None:
    with opened(tmp_path, endpoint) as board:
        write(board, COMMANDS[:5])
    with opened(tmp_path, None) as board:
        write(board, COMMANDS[5:])
        before = answers(board)
    with opened(tmp_path, endpoint) as board:
        assert answers(board) == before
        # What updates have said is known after the catching up, so it can be unsaid.
        board.graphs.update("DELETE DATA { <urn:kitchen> <urn:has> <urn:oven> }", "test").result()
        assert not board.query("ASK { <urn:kitchen> ?p ?o }")


def test_an_endpoint_with_other_statements_is_not_touched(endpoint: str, tmp_path: Path) -> None:
    insert = {"update": "INSERT DATA { <urn:theirs> <urn:p> 1 }"}
    httpx.post(endpoint + "/update", data=insert, trust_env=False)
    with pytest.raises(InvalidConfiguration, match="not this board's"):
        opened(tmp_path, endpoint)


def test_an_endpoint_of_another_board_is_not_touched(endpoint: str, tmp_path: Path) -> None:
    opened(tmp_path / "one", endpoint).close()
    with pytest.raises(InvalidConfiguration, match="journal that is not in the data folder"):
        opened(tmp_path / "other", endpoint)


def test_an_endpoint_that_does_not_answer_is_told(tmp_path: Path) -> None:
    with pytest.raises(StorageFailed, match="does not answer"):
        opened(tmp_path, "http://127.0.0.1:9")


class Moody(Endpoint):
    """An endpoint that does not answer while it `is_away`."""

    is_away = False

    def update(self, sparql: str) -> None:
        if self.is_away:
            raise StorageFailed("the store does not answer")
        super().update(sparql)


@pytest.mark.parametrize("is_emptied", [False, True])
def test_an_endpoint_that_comes_back_is_gone_on_with_only_if_it_is_as_it_was(
    endpoint: str, tmp_path: Path, *, is_emptied: bool
) -> None:
    moody = Moody(endpoint)
    with Blackboard.open(tmp_path, durability="process", endpoint=moody) as board:
        board.execute([AssertFluent(Fluent("mug1", "Mug"))], "test")
        assert board.query("ASK { fluent:mug1 a race:Mug }")
        moody.is_away = True
        board.execute([AssertFluent(Fluent("mug2", "Mug"))], "test")
        with pytest.raises(StorageFailed, match="does not answer"):
            board.query("ASK { fluent:mug2 a race:Mug }")
        if is_emptied:
            httpx.post(endpoint + "/update", data={"update": "CLEAR ALL"}, trust_env=False)
        moody.is_away = False
        expected = "lost statements" if is_emptied else None
        deadline = time.monotonic() + 20.0
        while expected not in (board.failure or "") if expected else board.failure is not None:
            assert time.monotonic() < deadline, board.failure
            time.sleep(0.05)
        if not is_emptied:
            assert board.query("ASK { fluent:mug1 a race:Mug . fluent:mug2 a race:Mug }")
    with opened(tmp_path, endpoint) as again:
        assert again.query("ASK { fluent:mug1 a race:Mug . fluent:mug2 a race:Mug }")


def test_the_service_runs_over_an_endpoint(endpoint: str, tmp_path: Path) -> None:
    with (
        ServiceProcess(tmp_path / "data", arguments=("--store", endpoint)) as service,
        httpx.Client(base_url=service.address, trust_env=False, timeout=60.0) as board,
    ):
        assert board.post("/fluents", json={"name": "mug1", "class": "Mug"}).status_code == 201
        reply = board.get("/sparql", params={"query": "SELECT ?s { ?s a race:Mug }"})
        assert len(reply.json()["results"]["bindings"]) == 1
        direct = {"query": "SELECT ?s { ?s a <https://w3id.org/fluentboard/race#Mug> }"}
        headers = {"Accept": "application/sparql-results+json"}
        held = httpx.get(endpoint + "/query", params=direct, headers=headers, trust_env=False)
        assert held.json()["results"] == reply.json()["results"]
        assert service.stop() == 0
