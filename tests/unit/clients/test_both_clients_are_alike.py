"""Blocking and awaiting clients: the same calls, from one description each."""

from __future__ import annotations

import asyncio
import inspect
from collections.abc import Callable

import httpx

from fluentboard_client import AsyncClient, Client

_OWN_ENDING = {"close", "aclose"}


def _calls(of: type) -> set[str]:
    return {name for name in dir(of) if not name.startswith("_")} - _OWN_ENDING


def audit_of_two_pages(request: httpx.Request) -> httpx.Response:
    if "after" in request.url.params:
        assert request.url.params["after"] == "1"
        return httpx.Response(200, json={"commits": [{"commit": 2}], "next": None})
    return httpx.Response(200, json={"commits": [{"commit": 1}], "next": 1})


def test_both_clients_have_the_same_calls() -> None:
    assert _calls(Client) == _calls(AsyncClient)


def test_a_call_keeps_its_parameters_and_its_explanation() -> None:
    client = Client("http://board")

    assert [*inspect.signature(client.fluent).parameters] == ["name", "as_of"]
    assert [*inspect.signature(Client.fluent).parameters] == ["self", "name", "as_of"]
    assert client.fluent.__doc__ == Client.fluent.__doc__
    assert "as it stood after commit" in (client.fluent.__doc__ or "")


def test_pages_are_followed_by_both_clients() -> None:
    blocking = Client("http://board", transport=httpx.MockTransport(audit_of_two_pages))

    async def awaited() -> list[int]:
        transport = httpx.MockTransport(audit_of_two_pages)
        async with AsyncClient("http://board", transport=transport) as client:
            return [entry["commit"] async for entry in client.audit()]

    assert [entry["commit"] for entry in blocking.audit()] == [1, 2]
    assert asyncio.run(awaited()) == [1, 2]


def test_import_is_sent_once_by_both_clients() -> None:
    seen: list[bytes] = []

    def board(request: httpx.Request) -> httpx.Response:
        seen.append(request.read())
        return httpx.Response(200, json={"fluents": 0})

    async def board_async(request: httpx.Request) -> httpx.Response:
        seen.append(await request.aread())
        return httpx.Response(200, json={"fluents": 0})

    def blocking() -> None:
        with Client("http://board", transport=httpx.MockTransport(board)) as client:
            client.import_fluents([b"a", b"b"])

    async def awaiting() -> None:
        transport = httpx.MockTransport(board_async)
        async with AsyncClient("http://board", transport=transport) as client:
            await client.import_fluents([b"a", b"b"])

    both: tuple[Callable[[], None], ...] = (blocking, lambda: asyncio.run(awaiting()))
    for send in both:
        send()
    assert seen == [b"ab", b"ab"]
