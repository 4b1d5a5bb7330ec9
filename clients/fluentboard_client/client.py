"""Client: read, write, end and query fluents over HTTP, one blocking call each."""

from __future__ import annotations

import time
from collections.abc import Generator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Self

import httpx

from fluentboard_client import exchange
from fluentboard_client.calls import BlockingStreams
from fluentboard_client.conversation import LiveQuery
from fluentboard_client.exchange import Request
from fluentboard_client.fluent_calls import FluentCalls
from fluentboard_client.live_calls import LiveBlocking, LiveCalls
from fluentboard_client.query_calls import QueryCalls
from fluentboard_client.subscriptions import DurableSubscriptions

if TYPE_CHECKING:
    from fluentboard_client.live import Subscription

DEFAULT_BOARD = "http://127.0.0.1:8080"


class Client(FluentCalls, QueryCalls, LiveCalls, LiveBlocking, BlockingStreams):
    """A board, reached over HTTP.

    Every write carries an idempotency key, so a write that is repeated after a broken connection
    takes effect once. Methods raise the errors that the board raised (`UnknownFluent`,
    `FluentExists` and so on), and `BoardUnreachable` when there is no board.

    One client may be used from several threads. As a context manager it closes its connections.

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
        transport: httpx.BaseTransport | None = None,
    ) -> None:
        self.board = exchange.board_address(board)
        self._headers = exchange.headers(author, token)
        self._retries = retries
        self._timeout_s = timeout_s
        self._http = httpx.Client(
            base_url=self.board,
            headers=self._headers,
            timeout=timeout_s,
            transport=transport,
            trust_env=not exchange.is_loopback(self.board),
        )

    @property
    def subscriptions(self) -> DurableSubscriptions:
        """Durable subscriptions, and explanations."""
        return DurableSubscriptions(self.send)

    def ready(self) -> bool:
        """Whether the board answers and has caught up with its journal; False without a board."""
        try:
            return self._http.get("/ready").is_success
        except httpx.TransportError:
            return False

    def close(self) -> None:
        """Closes the connections."""
        self._http.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def live_result(self, query: LiveQuery) -> Subscription:
        """See `LiveCalls.subscribe`."""
        from fluentboard_client.live import Line, Subscription

        line = Line(self.board, self._headers, self._timeout_s, self._retries)
        return Subscription(line, query)

    def send(self, request: Request) -> httpx.Response:
        """The reply to a request; raises the error that it stands for."""
        once = request.pieces is not None
        attempt, retries = 0, 0 if once else self._retries
        while True:
            attempt += 1
            try:
                reply = self._http.request(
                    request.method,
                    request.path,
                    params=dict(request.params) or None,
                    json=request.json,
                    data=request.form,
                    content=request.pieces,
                    headers=dict(request.headers),
                    # What is sent piece by piece takes as long as it takes.
                    timeout=httpx.Timeout(self._timeout_s, read=None if once else self._timeout_s),
                )
            except httpx.TransportError as failure:
                delay_s = exchange.retry_delay_s(failure, attempt, retries)
                if delay_s is None:
                    raise exchange.unreachable(self.board, failure, attempt) from failure
                time.sleep(delay_s)
                continue
            exchange.check(reply, self.board)
            return reply

    @contextmanager
    def streamed(self, request: Request) -> Generator[httpx.Response, None, None]:
        """The reply to a request, whose body is still to be read."""
        try:
            with self._http.stream(
                request.method,
                request.path,
                params=dict(request.params),
                headers=dict(request.headers),
            ) as reply:
                if not reply.is_success:
                    reply.read()
                    exchange.check(reply, self.board)
                yield reply
        except httpx.TransportError as failure:
            raise exchange.unreachable(self.board, failure, 1) from failure
