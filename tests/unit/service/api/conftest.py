"""A board in memory behind the real application, asked without a network."""

from __future__ import annotations

import asyncio
import itertools
from collections.abc import AsyncIterator, Callable, Iterator, Mapping
from typing import Any

import httpx
import pytest

from fluentboard.api.app import BoardApp, create_app
from fluentboard.board.blackboard import Blackboard
from fluentboard.config import Settings, load_settings

_NUMBERS = itertools.count(1)


class Api:
    """Sends requests to an application; every call is one exchange."""

    def __init__(self, app: BoardApp) -> None:
        self.app = app

    def call(
        self,
        method: str,
        path: str,
        *,
        json: Any = None,
        content: bytes | str | AsyncIterator[bytes] | None = None,
        data: Mapping[str, Any] | None = None,
        params: Mapping[str, Any] | None = None,
        headers: Mapping[str, str] | None = None,
    ) -> httpx.Response:
        async def exchange() -> httpx.Response:
            transport = httpx.ASGITransport(self.app, raise_app_exceptions=False)
            async with httpx.AsyncClient(transport=transport, base_url="http://board") as client:
                return await client.request(
                    method,
                    path,
                    json=json,
                    content=content,
                    data=data,
                    params=params,
                    headers=headers,
                )

        return asyncio.run(exchange())

    def get(self, path: str, **options: Any) -> httpx.Response:
        return self.call("GET", path, **options)

    def post(self, path: str, json: Any = None, **options: Any) -> httpx.Response:
        return self.call("POST", path, json=json, **options)

    def patch(self, path: str, json: Any = None, **options: Any) -> httpx.Response:
        return self.call("PATCH", path, json=json, **options)

    def put(self, path: str, json: Any = None, **options: Any) -> httpx.Response:
        return self.call("PUT", path, json=json, **options)

    def query(self, sparql: str, **options: Any) -> httpx.Response:
        return self.get("/sparql", params={"query": sparql}, **options)


@pytest.fixture(scope="module")
def board() -> Iterator[Blackboard]:
    with Blackboard.open(None) as opened:
        yield opened


@pytest.fixture(scope="module")
def make_api(board: Blackboard) -> Callable[..., Api]:
    """Makes an application around the board with other settings, given by dotted key."""

    def make(**settings: Any) -> Api:
        flags = {key.replace("__", "."): value for key, value in settings.items()}
        return Api(create_app(board, load_settings(flags=flags)))

    return make


@pytest.fixture(scope="module")
def api(board: Blackboard) -> Api:
    return Api(create_app(board, Settings()))


@pytest.fixture
def name() -> str:
    """A name that no other test uses, as they share a board."""
    return f"thing{next(_NUMBERS)}"
