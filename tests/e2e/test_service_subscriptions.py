"""Subscriptions against a real process: unmodified SSE clients, a kill, a crowd."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Iterator
from contextlib import AsyncExitStack
from pathlib import Path
from typing import Any

import httpx
import orjson
import pytest
from httpx_sse import connect_sse
from websockets.asyncio.client import ClientConnection
from websockets.asyncio.client import connect as connect_websocket

from fluentboard_client import Client, Delta, Snapshot
from fluentboard_modules.demo.service_process import ServiceProcess

PLATES = "SELECT ?plate WHERE { ?plate a race:Plate }"
TIMEOUT_S = 30.0
CLIENTS, DEAD, SLOW = 100, 10, 10


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServiceProcess]:
    with ServiceProcess(tmp_path_factory.mktemp("subscriptions")) as running:
        yield running


def http(service: ServiceProcess) -> httpx.Client:
    return httpx.Client(base_url=service.address, trust_env=False, timeout=TIMEOUT_S)


def put(board: httpx.Client, name: str, **more: Any) -> int:
    reply = board.post("/fluents", json={"name": name, "class": "Plate", **more})
    assert reply.status_code == 201, reply.text
    return int(reply.json()["commit"])


def test_an_unmodified_sse_client_hears_and_resumes(service: ServiceProcess) -> None:
    with http(service) as board:
        with connect_sse(board, "GET", "/events", params={"query": PLATES}) as source:
            events = source.iter_sse()
            snapshot = next(events)
            assert snapshot.json()["type"] == "snapshot"
            assert snapshot.retry == 1000
            put(board, "plateA")
            delta = next(events)
            assert len(delta.json()["added"]) == 1
        put(board, "plateB")
        headers = {"Last-Event-ID": delta.id}
        params = {"query": PLATES}
        with connect_sse(board, "GET", "/events", params=params, headers=headers) as source:
            resumed, missed = (event.json() for event in (next(e) for e in [source.iter_sse()] * 2))
        assert (resumed["type"], missed["type"]) == ("resumed", "delta")
        assert missed["added"][0]["plate"]["value"].endswith("plateB")
        assert missed["sequence"] == delta.json()["sequence"] + 1
        deadline_s = time.monotonic() + TIMEOUT_S
        while board.get("/subscriptions").json()["subscriptions"]:
            assert time.monotonic() < deadline_s, "a stream outlives its client"


def test_a_durable_subscription_survives_a_kill_and_misses_nothing(tmp_path: Path) -> None:
    joined = "SELECT ?a ?b WHERE { ?a upper:near ?b . ?b a race:Plate }"
    near = [{"property": "near", "type": "Plate", "value": "plate1"}]
    with ServiceProcess(tmp_path) as service, http(service) as board:
        board.post("/subscriptions", json={"name": "near", "query": joined}).raise_for_status()
        put(board, "plate1")
        put(board, "plate2", properties=near)
        with connect_sse(board, "GET", "/subscriptions/near/events") as source:
            snapshot = next(source.iter_sse())
        assert len(snapshot.json()["result"]["results"]["bindings"]) == 1
        position = {"position": snapshot.id}
        board.post("/subscriptions/near/acknowledge", json=position).raise_for_status()
        put(board, "plate3", properties=near)
        service.kill()
    with ServiceProcess(tmp_path) as service, http(service) as board:
        put(board, "plate4", properties=near)
        with connect_sse(board, "GET", "/subscriptions/near/events") as source:
            resumed, missed = (event.json() for event in (next(e) for e in [source.iter_sse()] * 2))
        assert (resumed["type"], missed["type"]) == ("resumed", "delta")
        assert len(missed["added"]) == 2
        board.delete("/subscriptions/near").raise_for_status()


def test_the_client_keeps_explains_and_replays(service: ServiceProcess) -> None:
    with Client(service.address) as client, http(service) as board:
        first = put(board, "plateC")
        client.subscriptions.create("kept", PLATES, mode="both")
        assert client.subscriptions.read("kept")["mode"] == "both"
        explained = client.subscriptions.explain(PLATES, fluent="plateC", at="now")
        assert explained["fluent"]["solutions"] == 1
        put(board, "plateD")
        with client.subscribe(PLATES, from_commit=first, speed=1e6) as replay:
            snapshot, delta = replay.receive(TIMEOUT_S), replay.receive(TIMEOUT_S)
        assert isinstance(snapshot, Snapshot)
        assert isinstance(delta, Delta)
        assert (snapshot.commit, delta.commit) == (first, first + 1)
        with client.subscribe(durable="kept") as durable:
            found = durable.receive(TIMEOUT_S)
        assert isinstance(found, Snapshot)
        client.subscriptions.delete("kept")


async def _crowd(service: ServiceProcess) -> tuple[int, float]:
    """Writes among 100 listeners; how many messages the quick ones heard, and how long it took."""
    address = service.address.replace("http", "ws", 1) + "/subscriptions"
    everything = "SELECT ?a ?b ?c WHERE { ?a ?b ?c }"
    writes = 20
    async with AsyncExitStack() as stack:
        everybody = [
            await stack.enter_async_context(
                connect_websocket(address, proxy=None, max_size=None, close_timeout=0.2)
            )
            for _ in range(CLIENTS)
        ]
        dead, slow, quick = (
            everybody[:DEAD],
            everybody[DEAD : DEAD + SLOW],
            everybody[DEAD + SLOW :],
        )
        for number, connection in enumerate(everybody):
            query = everything if DEAD <= number < DEAD + SLOW else PLATES
            await connection.send(orjson.dumps({"subscribe": {"id": "a", "query": query}}).decode())
        for connection in quick:
            await connection.recv()
        for connection in slow:
            # It never reads again, though its network stays up.
            connection.transport.pause_reading()
        for connection in dead:
            # No farewell: the network just ends.
            connection.transport.abort()
        began_s = time.monotonic()
        async with httpx.AsyncClient(base_url=service.address, trust_env=False) as board:
            for number in range(writes):
                body = {"name": f"crowd{number}", "class": "Plate"}
                reply = await board.post("/fluents", json=body, timeout=TIMEOUT_S)
                assert reply.status_code == 201
        told = await asyncio.gather(*(_told(connection, writes) for connection in quick))
        took_s = time.monotonic() - began_s
        for connection in slow:
            connection.transport.abort()
    return sum(told), took_s


async def _told(connection: ClientConnection, count: int) -> int:
    heard = 0
    async with asyncio.timeout(TIMEOUT_S):
        while heard < count:
            message = orjson.loads(await connection.recv())
            heard += len(message["added"])
    return heard


def test_a_crowd_with_dead_and_slow_listeners_is_served(service: ServiceProcess) -> None:
    told, _ = asyncio.run(_crowd(service))
    assert told == (CLIENTS - DEAD - SLOW) * 20
    with http(service) as board:
        assert board.get("/ready").json()["status"] == "ready"
        deadline_s = time.monotonic() + TIMEOUT_S
        while board.get("/subscriptions").json()["subscriptions"]:
            assert time.monotonic() < deadline_s, "dead listeners leave subscriptions behind"
            time.sleep(0.02)
