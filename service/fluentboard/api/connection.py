"""Connection: one WebSocket, and the subscriptions that it carries.

One connection carries any number of subscriptions. The registry's queues are bounded, so a client
that does not read costs a fixed amount of memory and slows nobody down.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import replace
from typing import Any, cast

import orjson

from fluentboard.api.exchange import Receive, Send
from fluentboard.api.live_request import LiveRequest, request_from_json
from fluentboard.api.problems import internal_error, problem_document
from fluentboard.board.subscriptions.durable import DurableSubscriptions
from fluentboard.board.subscriptions.messages import Failed, Message, Snapshot
from fluentboard.board.subscriptions.registry import SubscriptionRegistry
from fluentboard.board.subscriptions.subscription import Subscription
from fluentboard.config import SubscriptionSettings
from fluentboard.errors import FluentboardError, InvalidInput, TooManySubscriptions

LONG_SNAPSHOT = 2_000
"""A snapshot with more solutions than this is written down in another thread."""

# Messages of one subscription sent before the next one has its turn.
_TURN = 32
# Replies to what the client says, waiting to be sent; then it is not listened to any more.
_REPLIES_MAX = 64
_ID_MAX_CHARACTERS = 200
# A commit that no board comes to: nobody can go on after it.
_NEVER = 2**53 - 1
_SUBSCRIBE_KEYS = frozenset(
    {"id", "query", "mode", "at", "certainly", "since", "since_at", "replay", "durable"}
)
_DURABLE_KEYS = frozenset({"id", "durable", "since", "since_at"})


class Connection:
    """One WebSocket.

    Args:
        registry: evaluates the queries.
        settings: limits.
        receive: gives what the client sends.
        send: takes what it is sent; waits while the client does not read.
        client: its address.
        durable: the subscriptions with a name; None if it has no words for them.
    """

    def __init__(
        self,
        registry: SubscriptionRegistry,
        settings: SubscriptionSettings,
        receive: Receive,
        send: Send,
        client: str,
        durable: DurableSubscriptions | None = None,
    ) -> None:
        self._registry = registry
        self._settings = settings
        self._durable = durable or DurableSubscriptions(None)
        self._receive = receive
        self._send = send
        self._loop = asyncio.get_running_loop()
        self._replies: asyncio.Queue[dict[str, Any]] = asyncio.Queue(_REPLIES_MAX)
        self._ready: dict[str, None] = {}
        self._something = asyncio.Event()
        self._closing: int | None = None
        self.client = client
        self.subscriptions: dict[str, Subscription] = {}

    async def run(self) -> None:
        """Listens and talks until the connection ends; then all its subscriptions do."""
        listening = asyncio.create_task(self._listen())
        talking = asyncio.create_task(self._talk())
        try:
            await asyncio.wait((listening, talking), return_when=asyncio.FIRST_COMPLETED)
        finally:
            for task in (listening, talking):
                task.cancel()
            ended = await asyncio.gather(listening, talking, return_exceptions=True)
            for subscription in self.subscriptions.values():
                subscription.close()
            self.subscriptions.clear()
        for failure in ended:
            # A client that is gone while it is being sent something is the ordinary end.
            if isinstance(failure, Exception) and not isinstance(failure, OSError):
                internal_error(failure, f"WebSocket of {self.client}")

    def close(self, code: int) -> None:
        """Has the connection closed once what is being sent is sent."""
        self._closing = code
        self._something.set()

    async def _listen(self) -> None:
        while True:
            message = await self._receive()
            if message["type"] != "websocket.receive":
                return
            reply = await self._heard(message.get("text") or message.get("bytes") or b"")
            if reply is not None:
                await self._replies.put(reply)
                self._something.set()

    async def _heard(self, text: str | bytes) -> dict[str, Any] | None:
        """Does what a client says; the reply, if there is one before the first result."""
        name: Any = None
        try:
            request = _request(text)
            name = request[1].get("id")
            return await self._answer(*request)
        except FluentboardError as problem:
            return _error(name, problem)

    async def _answer(self, kind: str, body: dict[str, Any]) -> dict[str, Any] | None:
        name = body.get("id")
        if not isinstance(name, str) or not 1 <= len(name) <= _ID_MAX_CHARACTERS:
            raise InvalidInput(
                f"the id is {name!r}; give a text of 1 to {_ID_MAX_CHARACTERS} characters"
            )
        if kind == "unsubscribe":
            subscription = self.subscriptions.pop(name, None)
            if subscription is None:
                raise InvalidInput(f"there is no subscription {name!r} on this connection")
            self._ready.pop(name, None)
            subscription.close()
            return {"type": "unsubscribed", "id": name}
        if kind == "acknowledge":
            return await self._acknowledge(name, body)
        await self._subscribe(name, body)
        return None

    async def _subscribe(self, name: str, body: dict[str, Any]) -> None:
        unknown = body.keys() - _SUBSCRIBE_KEYS
        if unknown:
            raise InvalidInput(
                f"subscribe has the unknown key {min(unknown)!r}; keys are "
                f"{', '.join(sorted(_SUBSCRIBE_KEYS))}"
            )
        if name in self.subscriptions:
            raise InvalidInput(
                f"there is a subscription {name!r} on this connection already; unsubscribe it, or "
                "choose another id"
            )
        await self._open(name, await self._asked(body))

    async def _open(self, name: str, asked: LiveRequest) -> None:
        """Opens a subscription under a name that is not in use.

        Raises:
            InvalidQuery, InvalidInput: as `SubscriptionRegistry.open` says.
            TooManySubscriptions: the connection has as many as it may.
        """
        if len(self.subscriptions) >= self._settings.per_client_max:
            raise TooManySubscriptions(
                f"this connection has {len(self.subscriptions)} subscriptions, as many as it may; "
                "unsubscribe some, or raise subscriptions.per_client_max",
                limit=self._settings.per_client_max,
            )
        # Parsing a query takes milliseconds; other clients need not wait for that.
        opening = self._loop.run_in_executor(None, asked.open, self._registry, self._marker(name))
        try:
            self.subscriptions[name] = await asyncio.shield(opening)
        except asyncio.CancelledError:
            # The client went away meanwhile, but the thread goes on and opens it.
            opening.add_done_callback(_close_opened)
            raise
        self._mark(name)

    async def _asked(self, body: dict[str, Any]) -> LiveRequest:
        if body.get("durable") is None:
            return request_from_json(body)
        unknown = body.keys() - _DURABLE_KEYS
        if unknown:
            raise InvalidInput(
                f"a durable subscription has a {min(unknown)!r} already; give only "
                f"{', '.join(sorted(_DURABLE_KEYS))}"
            )
        one = await asyncio.to_thread(self._durable.get, str(body["durable"]))
        since = request_from_json({**body, "query": one.query}).since
        since = since or one.seen
        if one.is_broken and since is not None:
            since = replace(since, commit=_NEVER)
        return LiveRequest(one.query, one.mode, one.at, since)

    async def _acknowledge(self, name: str, body: dict[str, Any]) -> dict[str, Any]:
        """Notes how far the subscriber of a durable subscription has come."""
        seen = request_from_json({"query": "", **body, "id": name}).since
        durable = body.get("durable")
        if not isinstance(durable, str) or seen is None:
            raise InvalidInput(
                "acknowledge names the durable subscription and says since (the commit of the "
                "last message handled), and since_at for one at now"
            )
        await asyncio.to_thread(self._durable.get, durable)
        await asyncio.to_thread(self._durable.advance, durable, seen)
        return {"type": "acknowledged", "id": name, "commit": seen.commit}

    def _marker(self, name: str) -> Callable[[], None]:
        def mark() -> None:
            try:
                self._loop.call_soon_threadsafe(self._mark, name)
            except RuntimeError:
                # The loop is closed: the service stops, and nobody is left to be told.
                return

        return mark

    def _mark(self, name: str) -> None:
        self._ready[name] = None
        self._something.set()

    async def _talk(self) -> None:
        while True:
            await self._something.wait()
            self._something.clear()
            while self._ready or not self._replies.empty():
                while not self._replies.empty():
                    await self._say(self._replies.get_nowait())
                if self._closing is not None:
                    break
                await self._send_turn()
            if self._closing is not None:
                await self._send({"type": "websocket.close", "code": self._closing})
                return

    async def _send_turn(self) -> None:
        """Sends what waits of the subscription that has waited longest."""
        if not self._ready:
            return
        name = next(iter(self._ready))
        del self._ready[name]
        subscription = self.subscriptions.get(name)
        if subscription is None:
            return
        for message in subscription.poll(_TURN):
            if isinstance(message, Failed):
                self.subscriptions.pop(name, None)
                subscription.close()
                await self._say(self._failed(name, message.problem))
                return
            text = await self._told(message, name)
            if text is not None:
                await self._send({"type": "websocket.send", "text": text})
        if subscription.waiting:
            self._ready[name] = None

    def _failed(self, name: str, problem: FluentboardError) -> dict[str, Any]:
        """What is said when the query of a subscription can no longer be evaluated."""
        return _error(name, problem)

    async def _told(self, message: Message, name: str) -> str | None:
        """A message as text; None if there is nothing to say."""
        if isinstance(message, Snapshot) and len(message.answer.bag) > LONG_SNAPSHOT:
            return await asyncio.to_thread(_json_text, message, name)
        return _json_text(message, name)

    async def _say(self, message: dict[str, Any]) -> None:
        text = orjson.dumps(message, default=str).decode()
        await self._send({"type": "websocket.send", "text": text})


def _json_text(message: Message, name: str) -> str:
    return orjson.dumps(message.to_json(name)).decode()


def _request(text: str | bytes) -> tuple[str, dict[str, Any]]:
    """Kind and body of what a client says: `{"subscribe": {...}}` or `{"unsubscribe": {...}}`."""
    try:
        message: Any = orjson.loads(text)
    except orjson.JSONDecodeError as problem:
        raise InvalidInput(f"the message is not JSON: {problem}") from None
    if isinstance(message, dict) and len(cast("dict[Any, Any]", message)) == 1:
        (kind, body) = next(iter(cast("dict[str, Any]", message).items()))
        if kind in ("subscribe", "unsubscribe", "acknowledge") and isinstance(body, dict):
            return kind, cast("dict[str, Any]", body)
    raise InvalidInput(
        'the message is neither {"subscribe": {"id": ..., "query": ...}} nor '
        '{"unsubscribe": {"id": ...}}'
    )


def _error(name: Any, problem: FluentboardError) -> dict[str, Any]:
    message: dict[str, Any] = {"type": "error", "problem": problem_document(problem)}
    return {**message, "id": name} if isinstance(name, str) else message


def _close_opened(opening: asyncio.Future[Subscription]) -> None:
    if not opening.cancelled() and opening.exception() is None:
        opening.result().close()
