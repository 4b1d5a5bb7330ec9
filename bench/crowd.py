"""A crowd of WebSocket clients, some dead and some slow: what they cost a writer over HTTP."""

from __future__ import annotations

import asyncio
import itertools
import tempfile
import time
from pathlib import Path

import httpx
import orjson
from websockets.asyncio.client import ClientConnection, connect

from bench.measuring import Report, compare
from fluentboard_modules.demo.service_process import ServiceProcess

CLIENTS, DEAD, SLOW = 100, 10, 10
WRITES = 200
_PLATES = "SELECT ?plate WHERE { ?plate a race:Plate }"
_EVERYTHING = "SELECT ?a ?b ?c WHERE { ?a ?b ?c }"


def run() -> list[Report]:
    """The time of a write until every quick listener has heard of it."""
    numbers = itertools.count()
    with (
        tempfile.TemporaryDirectory() as crowded,
        tempfile.TemporaryDirectory() as empty,
        ServiceProcess(Path(crowded)) as full,
        ServiceProcess(Path(empty)) as alone,
    ):
        return [
            compare(
                f"Writes over HTTP among {CLIENTS} WebSocket clients, {DEAD} dead and {SLOW} slow",
                {
                    "with the crowd": lambda: asyncio.run(_write(full, CLIENTS, numbers)),
                    "nobody listens": lambda: asyncio.run(_write(alone, 0, numbers)),
                },
                rounds=5,
                operations=WRITES,
                unit="ms",
                target="a dead or slow subscriber hurts nobody",
                notes=[
                    f"{WRITES} writes one after the other by one client, until each of the quick "
                    f"listeners has heard of all: {WRITES * (CLIENTS - DEAD - SLOW):,} messages. "
                    "The slow ones subscribe to everything on the board and never read; the dead "
                    "ones lost their connection without farewell."
                ],
            )
        ]


async def _write(service: ServiceProcess, clients: int, numbers: itertools.count[int]) -> float:
    address = service.address.replace("http", "ws", 1) + "/subscriptions"
    listeners: list[ClientConnection] = []
    for number in range(clients):
        listener = await connect(address, proxy=None, max_size=None, close_timeout=0.2)
        query = _EVERYTHING if DEAD <= number < DEAD + SLOW else _PLATES
        await listener.send(orjson.dumps({"subscribe": {"id": "a", "query": query}}).decode())
        listeners.append(listener)
    quick = listeners[DEAD + SLOW :]
    for listener in quick:
        await listener.recv()
    for listener in listeners[:DEAD]:
        listener.transport.abort()
    for listener in listeners[DEAD : DEAD + SLOW]:
        listener.transport.pause_reading()
    begin = time.perf_counter()
    hearing = [asyncio.create_task(_hear(listener)) for listener in quick]
    async with httpx.AsyncClient(base_url=service.address, trust_env=False) as board:
        for _ in range(WRITES):
            body = {"name": f"plate{next(numbers)}", "class": "Plate"}
            (await board.post("/fluents", json=body, timeout=60.0)).raise_for_status()
    await asyncio.gather(*hearing)
    spent = time.perf_counter() - begin
    for listener in listeners:
        listener.transport.abort()
    return spent


async def _hear(listener: ClientConnection) -> None:
    heard = 0
    while heard < WRITES:
        heard += len(orjson.loads(await listener.recv())["added"])
