"""Live results of a query: iterators of events that reconnect and resume by themselves."""

from __future__ import annotations

import asyncio
import logging
import math
import threading
import time
from collections.abc import AsyncIterator, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self, cast

from fluentboard.errors import FluentboardError
from fluentboard_client.conversation import (
    Conversation,
    Event,
    LiveQuery,
    live_address,
    refusal,
)
from fluentboard_client.exchange import backoff_s, is_loopback, unreachable

if TYPE_CHECKING:
    from websockets.asyncio.client import ClientConnection as AsyncConnection
    from websockets.sync.client import ClientConnection

logger = logging.getLogger(__name__)

_LARGEST_MESSAGE_BYTES = 256 * 2**20  # a snapshot is one message, whatever its size
_CLOSE_TIMEOUT_S = 1.0
_TOO_MANY = 429  # passes when another client leaves


class _Reconnection:
    """When to try again and when to give up; the same for both iterators.

    The first connection must succeed within a few attempts, because a wrong address is the likely
    reason for a failure. A subscription that was live once keeps trying until it is closed.
    """

    def __init__(self, address: str, retries: int) -> None:
        self._address = address
        self._retries = retries
        self._was_live = False
        self._failures = 0

    def succeeded(self) -> None:
        """A message arrived."""
        self._was_live = True
        self._failures = 0

    def delay_s(self, failure: Exception) -> float:
        """Seconds to wait before the next attempt; raises the error if there is to be none."""
        from websockets.exceptions import ConnectionClosed, InvalidStatus, InvalidURI

        if isinstance(failure, InvalidURI):
            raise unreachable(self._address, failure, 1)
        self._failures += 1
        is_last = not self._was_live and self._failures > self._retries
        if isinstance(failure, InvalidStatus):
            status, body = failure.response.status_code, bytes(failure.response.body)
            if status < 500 and (is_last or status != _TOO_MANY):
                raise refusal(status, body, self._address)
        if is_last:
            raise unreachable(self._address, failure, self._failures) from failure
        delay_s = backoff_s(self._failures)
        lost = "lost" if isinstance(failure, ConnectionClosed) else "failed"
        logger.info(
            "connection to %s %s (%s); again in %.1f s", self._address, lost, failure, delay_s
        )
        return delay_s


def _connection_options(line: Line) -> Any:
    options: dict[str, Any] = {
        # Who listens writes nothing, and `websockets` sends no names beyond Latin-1.
        "additional_headers": {k: v for k, v in line.headers.items() if k.lower() != "x-author"},
        "open_timeout": line.timeout_s,
        "close_timeout": _CLOSE_TIMEOUT_S,
        "max_size": _LARGEST_MESSAGE_BYTES,
        "compression": None,  # costs more time than it saves between processes of one robot
    }
    if is_loopback(line.address):
        options["proxy"] = None
    return options


@dataclass(frozen=True, slots=True)
class Line:
    """How to reach a board.

    Attributes:
        address: of the board.
        headers: that every request carries.
        timeout_s: how long to wait for a connection.
        retries: how often the first connection is tried again.
    """

    address: str
    headers: Mapping[str, str]
    timeout_s: float
    retries: int


class _Listener:
    """What both iterators know of their subscription."""

    def __init__(self, line: Line, query: LiveQuery) -> None:
        self._conversation = Conversation(query, line.address)
        self._reconnection = _Reconnection(line.address, line.retries)
        self._address = line.address
        self._options = _connection_options(line)

    @property
    def commit(self) -> int | None:
        """The last commit heard of: what to pass as `since` to go on from here later."""
        return self._conversation.commit

    @property
    def at_s(self) -> float | None:
        """Of a subscription at now: the last time heard of, to pass as `since_at`."""
        return self._conversation.at_s


class Subscription(_Listener, Iterator[Event]):
    """The live result of a query as a blocking iterator; it ends when it is closed.

    `close` may be called from another thread. As a context manager it closes itself.

    Raises (from the iteration):
        BoardUnreachable: the first connection failed, several times.
        InvalidQuery: or whatever else the board answers to the query.
    """

    def __init__(self, line: Line, query: LiveQuery) -> None:
        super().__init__(line, query)
        self._connection: ClientConnection | None = None
        self._lock = threading.Lock()  # guards _connection against a close in mid-connect
        self._closed = threading.Event()

    def __iter__(self) -> Self:
        return self

    def __next__(self) -> Event:
        event = self.receive()
        if event is None:
            raise StopIteration
        return event

    def receive(self, timeout_s: float | None = None) -> Event | None:
        """The next event, or None once closed.

        Args:
            timeout_s: how long to wait for it, reconnections included; None waits for ever.

        Raises:
            TimeoutError: no message within that time.
            FluentboardError: as the class says.
        """
        from websockets.exceptions import ConnectionClosed, InvalidHandshake, InvalidURI

        deadline = math.inf if timeout_s is None else time.monotonic() + timeout_s
        while not self._closed.is_set():
            left_s = max(deadline - time.monotonic(), 0.0)
            try:
                message = self._next_message(None if math.isinf(left_s) else left_s)
            except _NoMessage:
                raise TimeoutError(f"no message within {timeout_s} s") from None
            except (OSError, ConnectionClosed, InvalidHandshake, InvalidURI) as failure:
                self._drop()
                if not self._closed.is_set():
                    self._closed.wait(min(self._reconnection.delay_s(failure), left_s))
                continue
            if message is None:
                return None
            self._reconnection.succeeded()
            try:
                event = self._conversation.hear(message)
            except FluentboardError:
                self.close()
                raise
            if event is not None:
                return event
        return None

    def close(self) -> None:
        """Ends the iteration, here or in whatever thread is waiting for an event."""
        self._closed.set()
        self._drop()

    def _next_message(self, timeout_s: float | None) -> str | bytes | None:
        connection = self._connected()
        if connection is None:
            return None
        try:
            return connection.recv(timeout=timeout_s)
        except TimeoutError:
            raise _NoMessage from None

    def _connected(self) -> ClientConnection | None:
        from websockets.sync import client

        if self._connection is None:
            connected = cast(
                "ClientConnection", client.connect(live_address(self._address), **self._options)
            )
            # Entered and never left, because another thread may be the one that closes it.
            connection = connected.__enter__()
            with self._lock:
                if not self._closed.is_set():
                    self._connection = connection
            if self._connection is None:
                connection.close()
                return None
            connection.send(self._conversation.opening())
        return self._connection

    def _drop(self) -> None:
        with self._lock:
            connection, self._connection = self._connection, None
        if connection is not None:
            connection.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class _NoMessage(Exception):
    """Keeps a wait that timed out apart from a connection that did: both raise TimeoutError."""


class AsyncSubscription(_Listener, AsyncIterator[Event]):
    """The live result of a query as an asynchronous iterator; it ends when it is closed.

    Raises (from the iteration):
        BoardUnreachable: the first connection failed, several times.
        InvalidQuery: or whatever else the board answers to the query.
    """

    def __init__(self, line: Line, query: LiveQuery) -> None:
        super().__init__(line, query)
        self._connection: AsyncConnection | None = None
        self._closed = asyncio.Event()

    def __aiter__(self) -> Self:
        return self

    async def __anext__(self) -> Event:
        from websockets.exceptions import ConnectionClosed, InvalidHandshake, InvalidURI

        while not self._closed.is_set():
            try:
                message = await (await self._connected()).recv()
            except (OSError, ConnectionClosed, InvalidHandshake, InvalidURI) as failure:
                await self._drop()
                if self._closed.is_set():
                    break
                delay_s = self._reconnection.delay_s(failure)
                try:
                    await asyncio.wait_for(self._closed.wait(), delay_s)
                except TimeoutError:
                    continue
                break
            self._reconnection.succeeded()
            try:
                event = self._conversation.hear(message)
            except FluentboardError:
                await self.aclose()
                raise
            if event is not None:
                return event
        raise StopAsyncIteration

    async def aclose(self) -> None:
        """Ends the iteration, here or in whatever task is waiting for an event."""
        self._closed.set()
        await self._drop()

    async def _connected(self) -> AsyncConnection:
        from websockets.asyncio.client import connect

        if self._connection is None:
            self._connection = await connect(live_address(self._address), **self._options)
            await self._connection.send(self._conversation.opening())
        return self._connection

    async def _drop(self) -> None:
        connection, self._connection = self._connection, None
        if connection is not None:
            await connection.close()

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.aclose()
