"""A board in memory behind the real application, asked without a network."""

from __future__ import annotations

import asyncio
import itertools
from collections.abc import Callable, Iterator
from typing import Any

import httpx
import pytest

from fluentboard.api.app import BoardApp, create_app
from fluentboard.board.blackboard import Blackboard
from fluentboard.config import Settings, load_settings

_NUMBERS = itertools.count(1)


class _InProcess(httpx.BaseTransport):
    """Hands requests to an application; every call is one exchange."""

    def __init__(self, app: BoardApp) -> None:
        self._transport = httpx.ASGITransport(app, raise_app_exceptions=False)

    def handle_request(self, request: httpx.Request) -> httpx.Response:
        async def exchange() -> httpx.Response:
            reply = await self._transport.handle_async_request(request)
            content = await reply.aread()
            return httpx.Response(reply.status_code, headers=reply.headers, content=content)

        return asyncio.run(exchange())


def client(app: BoardApp) -> httpx.Client:
    return httpx.Client(transport=_InProcess(app), base_url="http://board", trust_env=False)


@pytest.fixture(scope="module")
def board() -> Iterator[Blackboard]:
    with Blackboard.open(None) as opened:
        yield opened


@pytest.fixture(scope="module")
def client_of() -> Callable[[BoardApp], httpx.Client]:
    """Makes a client of an application."""
    return client


@pytest.fixture(scope="module")
def make_api(board: Blackboard) -> Callable[..., httpx.Client]:
    """Makes a client of the board with other settings, given as `section__key`."""

    def make(**settings: Any) -> httpx.Client:
        flags = {key.replace("__", "."): value for key, value in settings.items()}
        return client(create_app(board, load_settings(flags=flags)))

    return make


@pytest.fixture(scope="module")
def api(board: Blackboard) -> httpx.Client:
    return client(create_app(board, Settings()))


@pytest.fixture
def name() -> str:
    """A name that no other test uses, as they share a board."""
    return f"thing{next(_NUMBERS)}"
