"""AsyncClient: read, write, end and query fluents over HTTP from an event loop."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncGenerator
from contextlib import asynccontextmanager
from typing import TYPE_CHECKING, Self

import httpx

from fluentboard_client import exchange
from fluentboard_client.calls import AwaitingStreams
from fluentboard_client.client import DEFAULT_BOARD
from fluentboard_client.conversation import LiveQuery
from fluentboard_client.exchange import Request
from fluentboard_client.fluent_calls import FluentCalls
from fluentboard_client.live_calls import LiveAwaiting, LiveCalls
from fluentboard_client.query_calls import QueryCalls
from fluentboard_client.streams import stream_async
from fluentboard_client.subscriptions import AsyncDurableSubscriptions

if TYPE_CHECKING:
    from fluentboard_client.live import AsyncSubscription


class AsyncClient(FluentCalls, QueryCalls, LiveCalls, LiveAwaiting, AwaitingStreams):
    """A board, reached over HTTP.

    Every write carries an idempotency key, so a write that is repeated after a broken connection
    takes effect once. Methods raise the errors that the board raised (`UnknownFluent`,
    `FluentExists` and so on), and `BoardUnreachable` when there is no board.

    Its methods are those of `Client`, to be awaited. As a context manager it closes its
    connections.

    Args:
        board: address of the board.
        author: who writes; the journal keeps it.
        token: bearer token, where the board asks for one.
        timeout_s: how long to wait for a reply.
        retries: how often a request is repeated when the connection fails.
        transport: replaces the network, in tests.
    """

    def __init__(
        self,
        board: str = DEFAULT_BOARD,
        *,
        author: str = "",
        token: str | None = None,
        timeout_s: float = 30.0,
        retries: int = 3,
        transport: httpx.AsyncBaseTransport | None = None,
    ) -> None:
        self.board = exchange.board_address(board)
        self._headers = exchange.headers(author, token)
        self._retries = retries
        self._timeout_s = timeout_s
        self._http = httpx.AsyncClient(
            base_url=self.board,
            headers=self._headers,
            timeout=timeout_s,
            transport=transport,
            trust_env=not exchange.is_loopback(self.board),
        )

    @property
    def subscriptions(self) -> AsyncDurableSubscriptions:
        """Durable subscriptions, and explanations."""
        return AsyncDurableSubscriptions(self.send)

    async def ready(self) -> bool:
        """See `Client.ready`."""
        try:
            return (await self._http.get("/ready")).is_success
        except httpx.TransportError:
            return False

    async def aclose(self) -> None:
        """Closes the connections."""
        await self._http.aclose()

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.aclose()

    def live_result(self, query: LiveQuery) -> AsyncSubscription:
        """See `LiveCalls.subscribe`."""
        from fluentboard_client.live import AsyncSubscription, Line

        line = Line(self.board, self._headers, self._timeout_s, self._retries)
        return AsyncSubscription(line, query)

    async def send(self, request: Request) -> httpx.Response:
        """The reply to a request; raises the error that it stands for."""
        once = request.pieces is not None
        attempt, retries = 0, 0 if once else self._retries
        while True:
            attempt += 1
            try:
                reply = await self._http.request(
                    request.method,
                    request.path,
                    params=dict(request.params) or None,
                    json=request.json,
                    data=request.form,
                    content=None if request.pieces is None else stream_async(request.pieces),
                    headers=dict(request.headers),
                    # What is sent piece by piece takes as long as it takes.
                    timeout=httpx.Timeout(self._timeout_s, read=None if once else self._timeout_s),
                )
            except httpx.TransportError as failure:
                delay_s = exchange.retry_delay_s(failure, attempt, retries)
                if delay_s is None:
                    raise exchange.unreachable(self.board, failure, attempt) from failure
                await asyncio.sleep(delay_s)
                continue
            exchange.check(reply, self.board)
            return reply

    @asynccontextmanager
    async def streamed(self, request: Request) -> AsyncGenerator[httpx.Response, None]:
        """The reply to a request, whose body is still to be read."""
        try:
            async with self._http.stream(
                request.method,
                request.path,
                params=dict(request.params),
                headers=dict(request.headers),
            ) as reply:
                if not reply.is_success:
                    await reply.aread()
                    exchange.check(reply, self.board)
                yield reply
        except httpx.TransportError as failure:
            raise exchange.unreachable(self.board, failure, 1) from failure
