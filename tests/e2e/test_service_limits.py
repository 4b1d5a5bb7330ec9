"""What no client must be able to do: fill the memory, hold up others, write by web page."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from pathlib import Path

import httpx
import psutil
import pytest

from fluentboard_modules.demo.service_process import ServiceProcess

GIGABYTE = 2**30
CHUNK = b" " * 2**20
MEMORY_MARGIN_BYTES = 64 * 2**20


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServiceProcess]:
    with ServiceProcess(tmp_path_factory.mktemp("limits")) as running:
        yield running


@pytest.fixture
def board(service: ServiceProcess) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=service.address, trust_env=False, timeout=60.0) as client:
        yield client


def memory_bytes(board: httpx.Client) -> int:
    """Resident memory of the service process that listens where the client sends."""
    (listening,) = (
        child
        for child in psutil.Process().children()
        for connection in child.net_connections("tcp")
        if connection.status == psutil.CONN_LISTEN and connection.laddr.port == board.base_url.port
    )
    return listening.memory_info().rss


class Body:
    """A body made while it is sent, which knows how much of it was taken."""

    def __init__(self, size: int) -> None:
        self._size = size
        self.taken = 0

    def __iter__(self) -> Iterator[bytes]:
        while self.taken < self._size:
            self.taken += len(CHUNK)
            yield CHUNK


@pytest.mark.parametrize("path", ["/fluents", "/commands", "/import", "/sparql", "/nowhere"])
def test_a_gigabyte_is_refused_before_it_is_sent(board: httpx.Client, path: str) -> None:
    body = Body(GIGABYTE)
    types = {"/sparql": "application/sparql-query", "/import": "application/yaml"}
    headers = {"Content-Type": types.get(path, "application/json")}
    headers["Content-Length"] = str(GIGABYTE)
    before, began_s = memory_bytes(board), time.monotonic()

    reply = board.post(path, content=body, headers=headers)

    assert reply.status_code == (404 if path == "/nowhere" else 413)
    assert reply.headers["content-type"] == "application/problem+json"
    assert body.taken < GIGABYTE / 10
    assert time.monotonic() - began_s < 5.0
    assert memory_bytes(board) - before < MEMORY_MARGIN_BYTES


def test_a_gigabyte_of_unknown_length_is_refused_at_the_limit(board: httpx.Client) -> None:
    body = Body(GIGABYTE)
    before = memory_bytes(board)

    reply = board.post("/fluents", content=body, headers={"Content-Type": "application/json"})

    assert (reply.status_code, reply.json()["code"]) == (413, "too-large")
    assert body.taken < GIGABYTE / 10
    assert memory_bytes(board) - before < MEMORY_MARGIN_BYTES


def test_the_connection_of_a_refused_body_is_not_used_again(board: httpx.Client) -> None:
    headers = {"Content-Type": "application/json", "Content-Length": str(GIGABYTE)}
    reply = board.post("/fluents", content=Body(GIGABYTE), headers=headers)
    assert reply.headers["connection"] == "close"
    assert board.get("/health").status_code == 200


def test_a_long_import_needs_no_more_memory_than_a_short_one(board: httpx.Client) -> None:
    # Both say the same of the same fluents, so what the board has to remember afterwards is equal:
    # it keeps more than 2 kB for every fluent (index, latest state, RocksDB's tables), which is no
    # matter of how long an import is.
    def spoons(times: int, padding: str) -> Iterator[bytes]:
        for number in range(2_000 * times):
            name = f"spoon{number % 2_000}"
            yield f'{{"name": "{name}", {padding}"class": "Spoon", "start": [1.0, 2.0]}}\n'.encode()

    headers = {"Content-Type": "application/x-ndjson"}
    short = board.post("/import", content=spoons(1, ""), headers=headers)
    assert short.json()["changed"] == 2_000
    before = memory_bytes(board)
    padding = " " * (3 * MEMORY_MARGIN_BYTES // 20_000)
    long = board.post("/import", content=spoons(10, padding), headers=headers)
    assert (long.json()["fluents"], long.json()["changed"]) == (20_000, 0)
    assert memory_bytes(board) - before < MEMORY_MARGIN_BYTES


def test_a_runaway_query_holds_up_neither_reads_nor_writes_nor_the_stop(tmp_path: Path) -> None:
    endless = "SELECT (COUNT(*) AS ?n) WHERE { ?a ?b ?c . ?d ?e ?f . ?g ?h ?i FILTER(?c = ?i) }"
    settings = tmp_path / "board.yaml"
    settings.write_text("limits: {query_timeout_s: 0.5}\n")
    with ServiceProcess(tmp_path / "data", arguments=("--config", str(settings))) as service:
        replies: list[httpx.Response] = []

        def ask() -> None:
            address, params = service.address + "/sparql", {"query": endless}
            replies.append(httpx.get(address, params=params, trust_env=False, timeout=60.0))

        asking = threading.Thread(target=ask)
        asking.start()
        with httpx.Client(base_url=service.address, trust_env=False) as board:
            for number in range(20):
                mug = {"name": f"mug{number}", "class": "Mug"}
                assert board.post("/fluents", json=mug).status_code == 201
                point = {"query": f"SELECT ?p ?o WHERE {{ fluent:mug{number} ?p ?o }}"}
                assert board.get("/sparql", params=point).status_code == 200
        asking.join()
        assert replies[0].status_code == 503
        assert replies[0].json()["code"] == "query-timeout"
        assert service.stop() == 0


def test_a_web_page_cannot_write(board: httpx.Client) -> None:
    headers = {"Origin": "https://evil.example"}
    reply = board.post("/fluents/mug1/end", headers=headers)
    assert (reply.status_code, reply.json()["code"]) == (403, "not-allowed")


def test_a_foreign_host_name_is_not_answered(board: httpx.Client) -> None:
    reply = board.get("/fluents", headers={"Host": "evil.example"})
    assert (reply.status_code, reply.json()["code"]) == (403, "not-allowed")
