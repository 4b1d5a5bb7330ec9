"""Live: who is sent subscription results at present, over WebSockets and event streams."""

from __future__ import annotations

import asyncio
from typing import Any

from fluentboard.api.connection import Connection
from fluentboard.api.event_stream import EventStream
from fluentboard.api.exchange import Call, Receive, Reply, Scope, Send
from fluentboard.api.problems import problem_reply
from fluentboard.api.security import Guard
from fluentboard.board.subscriptions.durable import DurableSubscriptions
from fluentboard.board.subscriptions.registry import SubscriptionRegistry
from fluentboard.board.subscriptions.subscription import Subscription
from fluentboard.config import SubscriptionSettings
from fluentboard.errors import FluentboardError, TooManySubscriptions

_GOING_AWAY = 1001
_POLICY_VIOLATION = 1008


class LiveRoutes:
    """`/subscriptions`: WebSockets, and the list of what is subscribed to.

    Args:
        registry: evaluates the queries.
        guard: admits callers.
        settings: limits per connection.
        durable: the subscriptions with a name.
    """

    def __init__(
        self,
        registry: SubscriptionRegistry,
        guard: Guard,
        settings: SubscriptionSettings,
        durable: DurableSubscriptions,
    ) -> None:
        self._registry = registry
        self._guard = guard
        self._settings = settings
        self._durable = durable
        self._connections: dict[Connection, None] = {}
        self._streams: dict[EventStream, None] = {}
        self._is_closing = False

    @property
    def connections(self) -> int:
        """WebSockets that are open."""
        return len(self._connections)

    @property
    def subscriptions(self) -> int:
        """Subscriptions that are open."""
        of_sockets = sum(len(connection.subscriptions) for connection in self._connections)
        return of_sockets + len(self._streams)

    @property
    def streams(self) -> int:
        """Event streams that are open."""
        return len(self._streams)

    def check_streams(self) -> None:
        """Refuses one more event stream if there are too many, or the board is stopping.

        Raises:
            TooManySubscriptions: there are as many as there may be.
        """
        if self._is_closing or len(self._streams) >= self._settings.streams_max:
            raise TooManySubscriptions(
                f"{len(self._streams)} event streams are open, as many as may be; come back "
                "later, or raise subscriptions.streams_max",
                limit=self._settings.streams_max,
            )

    def check_connections(self) -> None:
        """Refuses one more WebSocket if there are too many.

        Raises:
            TooManySubscriptions: there are as many as there may be.
        """
        if len(self._connections) >= self._settings.connections_max:
            raise TooManySubscriptions(
                f"{len(self._connections)} WebSockets are open, as many as may be; subscribe to "
                "several queries over one, come back later, or raise subscriptions.connections_max",
                limit=self._settings.connections_max,
            )

    def stream_began(self, stream: EventStream) -> None:
        """Counts an event stream, and has it end when the board stops."""
        self._streams[stream] = None

    def stream_ended(self, stream: EventStream) -> None:
        """Counts it no more."""
        self._streams.pop(stream, None)

    async def serve(self, scope: Scope, receive: Receive, send: Send, path: str) -> None:
        """Serves one WebSocket until either side closes it."""
        call = Call(scope, receive, path)
        await receive()
        try:
            call.principal = self._guard.admit(call.headers, "read", changes=True)
            self.check_connections()
        except FluentboardError as problem:
            await refuse(scope, send, problem_reply(problem))
            return
        client = client_of(scope)
        connection = Connection(
            self._registry, self._settings, receive, send, client, self._durable
        )
        await self.hold(connection, send)

    async def hold(self, connection: Connection, send: Send) -> None:
        """Accepts the WebSocket of a connection, and runs it until either side closes it."""
        if self._is_closing:
            await send({"type": "websocket.close", "code": _GOING_AWAY})
            return
        # Before it is accepted: `close` may be called meanwhile, and is to find it.
        self._connections[connection] = None
        try:
            await send({"type": "websocket.accept"})
            await connection.run()
        finally:
            del self._connections[connection]

    async def close(self) -> None:
        """Closes all WebSockets with 1001, "going away"; clients come back after a restart."""
        self._is_closing = True
        for connection in list(self._connections):
            connection.close(_GOING_AWAY)
        for stream in list(self._streams):
            stream.close()
        while self._connections or self._streams:
            await asyncio.sleep(0.01)

    def listed(self) -> list[dict[str, Any]]:
        """What is being sent to clients at present, as JSON."""
        found = [
            _listed(name, connection.client, "websocket", subscription)
            for connection in self._connections
            for name, subscription in connection.subscriptions.items()
        ]
        found += [
            _listed(stream.name, "", "event-stream", stream.subscription)
            for stream in self._streams
        ]
        return found


def _listed(name: str, client: str, transport: str, one: Subscription) -> dict[str, Any]:
    return {
        "id": name,
        "client": client,
        "transport": transport,
        "query": one.request.query,
        "mode": one.request.mode,
        "at": None if one.request.at is None else "now",
        "waiting": one.waiting,
        "evaluation": one.explanation,
    }


def client_of(scope: Scope) -> str:
    """The address of who opened a WebSocket."""
    host, port = scope.get("client") or ("unknown", 0)
    return f"{host}:{port}"


async def refuse(scope: Scope, send: Send, reply: Reply) -> None:
    """Answers the handshake with a problem, where the server can, else with a close."""
    if "websocket.http.response" not in scope.get("extensions", {}):
        await send({"type": "websocket.close", "code": _POLICY_VIOLATION})
        return
    start = {
        "type": "websocket.http.response.start",
        "status": reply.status,
        "headers": reply.headers,
    }
    await send(start)
    await send({"type": "websocket.http.response.body", "body": reply.body})
