"""Queries run in processes that can be killed, and see every write that was acknowledged."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path

import httpx
import psutil
import pytest

from fluentboard_modules.demo.service_process import ServiceProcess

ENDLESS = "SELECT (COUNT(*) AS ?n) WHERE { ?a ?b ?c . ?d ?e ?f . ?g ?h ?i FILTER(?c = ?i) }"
GREEDY = "SELECT * WHERE { ?a ?b ?c . ?d ?e ?f . ?g ?h ?i } ORDER BY ?c ?f ?i"
COUNT = "SELECT (COUNT(*) AS ?n) { ?s a race:Mug }"
SETTINGS = """
limits:
  query_timeout_s: 1.0
  query_memory_max_bytes: 67108864
  result_memory_max_bytes: 1000
"""


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServiceProcess]:
    folder = tmp_path_factory.mktemp("readers")
    (folder / "board.yaml").write_text(SETTINGS)
    arguments = ("--config", str(folder / "board.yaml"))
    with ServiceProcess(folder / "data", arguments=arguments) as running:
        yield running


@pytest.fixture
def board(service: ServiceProcess) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=service.address, trust_env=False, timeout=60.0) as client:
        yield client


def readers(board: httpx.Client) -> set[int]:
    """Process ids of the readers of the service that listens where the client sends."""
    for child in psutil.Process().children():
        ports = [c.laddr.port for c in child.net_connections("tcp") if c.laddr]
        if board.base_url.port in ports:
            return {reader.pid for reader in child.children()}
    return set()


def mugs(board: httpx.Client) -> int:
    reply = board.get("/sparql", params={"query": COUNT})
    assert reply.status_code == 200, reply.text
    return int(reply.json()["results"]["bindings"][0]["n"]["value"])


def test_every_acknowledged_write_is_seen(board: httpx.Client) -> None:
    for number in range(20):
        written = board.post("/fluents", json={"name": f"seen{number}", "class": "Mug"})
        reply = board.get("/sparql", params={"query": COUNT})
        assert int(reply.headers["x-commit"]) >= int(written.headers["x-commit"])
        assert reply.json()["results"]["bindings"][0]["n"]["value"] == str(number + 1)


def test_an_endless_query_is_ended_while_writes_flow(board: httpx.Client) -> None:
    before = mugs(board)
    busy = readers(board)
    replies: list[httpx.Response] = []
    params = {"query": ENDLESS}
    address = str(board.base_url.join("/sparql"))
    asking = threading.Thread(
        target=lambda: replies.append(httpx.get(address, params=params, trust_env=False))
    )
    asking.start()
    for number in range(20):
        assert board.post("/fluents", json={"name": f"w{number}", "class": "Mug"}).is_success
    asking.join()
    assert (replies[0].status_code, replies[0].json()["code"]) == (503, "query-timeout")
    # The one that evaluated it is gone, and whoever answers now has what was written meanwhile.
    assert mugs(board) == before + 20
    assert busy - readers(board)


def test_an_update_that_would_never_end_does_not_reach_the_writer(board: httpx.Client) -> None:
    update = f"INSERT {{ GRAPH <urn:g> {{ <urn:a> <urn:b> ?n }} }} WHERE {{ {ENDLESS} }}"
    reply = board.post("/sparql", data={"update": update})
    assert (reply.status_code, reply.json()["code"]) == (503, "query-timeout")
    counted = f"INSERT {{ GRAPH <urn:g> {{ <urn:a> <urn:b> ?n }} }} WHERE {{ {COUNT} }}"
    reply = board.post("/sparql", data={"update": counted})
    assert reply.json()["added"] == 1


# By its time or by its memory, whichever is over first.
STOPPED = ("query-timeout", "too-large")
MANY = " ".join(f"<urn:a> <urn:b> {number} ." for number in range(300))
PATTERNS = "?a ?b ?c . ?d ?e ?f . ?g ?h ?i . ?j ?k ?l FILTER(?c + ?f = ?i + ?l)"
ENDLESS_AMONG_MANY = f"SELECT (COUNT(*) AS ?n) {{ {PATTERNS} }}"


def test_an_update_that_never_ends_because_of_what_it_did_first_is_ended(
    board: httpx.Client,
) -> None:
    query = ENDLESS_AMONG_MANY.replace("{", "{ GRAPH <urn:many> {") + " }"
    where = f"INSERT {{ GRAPH <urn:g> {{ <urn:a> <urn:c> ?n }} }} WHERE {{ {{ {query} }} }}"
    update = f"INSERT DATA {{ GRAPH <urn:many> {{ {MANY} }} }} ; {where}"
    for _ in range(3):  # more than there are threads for updates
        reply = board.post("/sparql", data={"update": update})
        assert reply.json()["code"] in STOPPED
    few = update.replace(MANY, "<urn:a> <urn:b> 1 .")
    done = board.post("/sparql", data={"update": few})
    assert done.is_success, done.text
    assert done.json()["added"] == 2


def test_a_query_of_a_transaction_that_never_ends_is_ended(board: httpx.Client) -> None:
    begun = board.post("/repositories/fluentboard/transactions")
    at = begun.headers["location"]
    turtle = {"Content-Type": "text/turtle"}
    context = {"action": "ADD", "context": "null"}
    assert board.put(at, params=context, content=MANY, headers=turtle).is_success
    sparql = {"Content-Type": "application/sparql-query"}
    told = [
        board.put(at, params={"action": "QUERY"}, content=query, headers=sparql)
        for query in (ENDLESS_AMONG_MANY, "SELECT (COUNT(*) AS ?n) { <urn:a> ?p ?o }")
    ]
    assert told[0].json()["code"] in STOPPED
    assert told[1].is_success, told[1].text
    assert told[1].json()["results"]["bindings"][0]["n"]["value"] == "300"
    assert board.delete(at).status_code == 204


def test_a_query_that_nobody_waits_for_any_more_is_ended(tmp_path: Path) -> None:
    (tmp_path / "board.yaml").write_text("limits: {query_timeout_s: 3600, queries_at_once: 1}")
    arguments = ("--config", str(tmp_path / "board.yaml"))
    with (
        ServiceProcess(tmp_path / "data", arguments=arguments) as patient,
        httpx.Client(base_url=patient.address, trust_env=False, timeout=120.0) as board,
    ):
        for _ in range(2):  # more than are evaluated at once, and each would take an hour
            with pytest.raises(httpx.ReadTimeout):
                board.get("/sparql", params={"query": ENDLESS}, timeout=0.2)
        assert mugs(board) == 0


def test_a_query_that_takes_too_much_memory_ends_alone(board: httpx.Client) -> None:
    reply = board.get("/sparql", params={"query": GREEDY})
    # On a slow machine the time may be over first.
    assert reply.json()["code"] in ("too-large", "query-timeout")
    assert mugs(board) >= 0


def test_a_long_result_comes_whole(board: httpx.Client) -> None:
    board.post("/fluents", json={"name": "long1", "class": "Mug"})
    rows = board.get("/sparql", params={"query": "SELECT ?s ?p ?o { ?s ?p ?o }"}).json()
    count = board.get("/sparql", params={"query": "SELECT (COUNT(*) AS ?n) { ?s ?p ?o }"}).json()
    expected = int(count["results"]["bindings"][0]["n"]["value"])
    assert len(rows["results"]["bindings"]) == expected > 100


def test_an_error_in_a_query_is_told_as_ever(board: httpx.Client) -> None:
    reply = board.get("/sparql", params={"query": "SELECT ?s { ?s a race:Mug "})
    assert (reply.status_code, reply.json()["code"]) == (400, "invalid-query")
    assert reply.json()["line"] == 1


def test_readers_end_with_a_service_that_is_killed(tmp_path: Path) -> None:
    with ServiceProcess(tmp_path / "data") as running:
        with httpx.Client(base_url=running.address, trust_env=False, timeout=60.0) as board:
            assert mugs(board) == 0
            left = [psutil.Process(pid) for pid in readers(board)]
        assert left
        running.kill()
        gone, alive = psutil.wait_procs(left, timeout=10.0)
        assert (len(gone), alive) == (len(left), [])
