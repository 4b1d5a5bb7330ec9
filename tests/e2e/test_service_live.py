"""Live queries over real WebSockets: lost connections, resumption, restart and farewell."""

from __future__ import annotations

import socket
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import orjson
import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

from fluentboard_modules.demo.service_process import ServiceProcess

PLATES = "SELECT ?plate WHERE { ?plate a race:Plate }"
FLUENT = "https://w3id.org/fluentboard/fluent/"
TIMEOUT_S = 20.0


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServiceProcess]:
    with ServiceProcess(tmp_path_factory.mktemp("live")) as running:
        yield running


@pytest.fixture
def board(service: ServiceProcess) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=service.address, trust_env=False) as client:
        yield client


def listen(service: ServiceProcess) -> ClientConnection:
    address = service.address.replace("http", "ws", 1) + "/subscriptions"
    return connect(address, proxy=None, open_timeout=TIMEOUT_S, max_size=None)


def subscribe(connection: ClientConnection, **more: Any) -> None:
    connection.send(orjson.dumps({"subscribe": {"id": "a", "query": PLATES, **more}}).decode())


def heard(connection: ClientConnection) -> dict[str, Any]:
    return orjson.loads(connection.recv(timeout=TIMEOUT_S))


def names(bindings: Any) -> list[str]:
    return sorted(row["plate"]["value"].removeprefix(FLUENT) for row in bindings)


def put(board: httpx.Client, name: str) -> int:
    reply = board.post("/fluents", json={"name": name, "class": "Plate"})
    assert reply.status_code == 201, reply.text
    return int(reply.json()["commit"])


def open_subscriptions(board: httpx.Client) -> int:
    return len(board.get("/subscriptions").json()["subscriptions"])


def wait_for_subscriptions(board: httpx.Client, count: int) -> None:
    deadline_s = time.monotonic() + TIMEOUT_S
    while open_subscriptions(board) != count:
        assert time.monotonic() < deadline_s, "a lost connection still has its subscriptions"
        time.sleep(0.02)


def test_a_write_reaches_a_listener(service: ServiceProcess, board: httpx.Client) -> None:
    with listen(service) as connection:
        subscribe(connection, mode="both")
        snapshot = heard(connection)
        commit = put(board, "plateA")
        delta = heard(connection)
    assert (snapshot["type"], delta["type"]) == ("snapshot", "delta")
    assert (delta["commit"], names(delta["added"])) == (commit, ["plateA"])
    assert delta["events"][0]["fluent"]["name"] == "plateA"


def test_a_lost_connection_leaves_nothing_behind(
    service: ServiceProcess, board: httpx.Client
) -> None:
    wait_for_subscriptions(board, 0)
    with listen(service) as connection:
        subscribe(connection)
        heard(connection)
        assert open_subscriptions(board) == 1
        # No farewell: the network just ends.
        connection.socket.shutdown(socket.SHUT_RDWR)
        wait_for_subscriptions(board, 0)
        put(board, "plateB")


def test_who_comes_back_gets_exactly_what_was_missed(
    service: ServiceProcess, board: httpx.Client
) -> None:
    with listen(service) as connection:
        subscribe(connection)
        since = heard(connection)["commit"]
    commits = [put(board, f"plateC{number}") for number in range(3)]
    with listen(service) as connection:
        subscribe(connection, since=since)
        assert heard(connection)["type"] == "resumed"
        missed: list[str] = []
        commit = since
        while commit < commits[-1]:
            delta = heard(connection)
            assert delta["removed"] == []
            missed += names(delta["added"])
            commit = delta["commit"]
    assert sorted(missed) == ["plateC0", "plateC1", "plateC2"]


def test_a_listener_that_does_not_read_slows_nobody_down(
    service: ServiceProcess, board: httpx.Client
) -> None:
    # Everything on the board after every write: more than any buffer holds.
    everything = "SELECT ?a ?b ?c WHERE { ?a ?b ?c }"
    with listen(service) as deaf, listen(service) as connection:
        deaf.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        deaf.send(orjson.dumps({"subscribe": {"id": "all", "query": everything}}).decode())
        subscribe(connection)
        heard(connection)
        began_s = time.monotonic()
        for number in range(50):
            put(board, f"plateD{number}")
        told: list[str] = []
        while len(told) < 50:
            told += names(heard(connection)["added"])
        assert time.monotonic() - began_s < 15.0
        deaf.socket.shutdown(socket.SHUT_RDWR)


def test_a_message_that_is_too_long_closes_the_connection(service: ServiceProcess) -> None:
    with listen(service) as connection:
        connection.send("x" * (2**20 + 1))
        with pytest.raises(ConnectionClosed) as closing:
            connection.recv(timeout=TIMEOUT_S)
    assert closing.value.rcvd is not None
    assert closing.value.rcvd.code == 1009


def test_listeners_survive_a_restart_without_missing_anything(tmp_path: Path) -> None:
    with ServiceProcess(tmp_path) as service:
        with httpx.Client(base_url=service.address, trust_env=False) as client:
            put(client, "plate1")
        with listen(service) as connection:
            subscribe(connection)
            since = heard(connection)["commit"]
            assert service.stop() == 0
            with pytest.raises(ConnectionClosed) as closing:
                connection.recv(timeout=TIMEOUT_S)
        assert closing.value.rcvd is not None
        assert closing.value.rcvd.code == 1001

    with ServiceProcess(tmp_path) as service:
        with httpx.Client(base_url=service.address, trust_env=False) as client:
            put(client, "plate2")
        with listen(service) as connection:
            subscribe(connection, since=since)
            assert heard(connection)["type"] == "resumed"
            assert names(heard(connection)["added"]) == ["plate2"]
