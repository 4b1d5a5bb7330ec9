"""Server-sent events: a subscription as an HTTP reply that does not end."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable

import orjson

from fluentboard.api.exchange import Send, StreamedReply
from fluentboard.api.live_request import position_of, position_text
from fluentboard.api.problems import problem_document
from fluentboard.board.subscriptions.durable import Position
from fluentboard.board.subscriptions.messages import Failed, Message
from fluentboard.board.subscriptions.subscription import Subscription

MEDIA_TYPE = b"text/event-stream"

_TURN = 32
_STILL_HERE = b": still here\n\n"


class EventStream(StreamedReply):
    """A subscription as `text/event-stream`; it ends with the client, or when the board stops.

    Args:
        subscription: its messages are sent as they come.
        name: what the messages call it.
        heartbeat_s: how often a comment shows that the connection lives, in seconds.
        retry_s: how soon a client should come back after it lost the connection, in seconds.
        on_end: called when the stream has ended.
    """

    is_endless = True

    def __init__(
        self,
        subscription: Subscription,
        name: str,
        *,
        heartbeat_s: float,
        retry_s: float,
        on_end: Callable[[EventStream], None],
    ) -> None:
        super().__init__(
            self._events(),
            MEDIA_TYPE,
            headers=[(b"cache-control", b"no-store"), (b"x-accel-buffering", b"no")],
        )
        self.subscription = subscription
        self.name = name
        self._heartbeat_s = heartbeat_s
        self._retry_ms = round(retry_s * 1_000)
        self._on_end = on_end
        self._something = asyncio.Event()
        self._is_closing = False

    async def send(self, send: Send, is_gone: Callable[[], bool] = lambda: False) -> None:
        """Sends events until the subscription ends or the task is cancelled."""
        loop = asyncio.get_running_loop()

        def mark() -> None:
            try:
                loop.call_soon_threadsafe(self._something.set)
            except RuntimeError:
                return  # The loop is closed: the service stops.

        try:
            self.subscription.set_on_ready(mark)
            await super().send(send, is_gone)
        finally:
            self.end()

    async def drop(self) -> None:
        """Ends the subscription: only the headers were wanted."""
        self.end()

    def end(self) -> None:
        """Closes the subscription."""
        self.subscription.close()
        self._on_end(self)

    def close(self) -> None:
        """Ends the stream once what is being sent is sent."""
        self._is_closing = True
        self._something.set()

    async def _events(self) -> AsyncIterator[bytes]:
        # Part of the first event: some clients take a block without data for an event.
        retry = b"retry: %d\n" % self._retry_ms
        while not self._is_closing:
            self._something.clear()
            messages = self.subscription.poll(_TURN)
            if messages:
                for message in messages:
                    yield retry + event_text(message, self.name)
                    retry = b""
                    if isinstance(message, Failed):
                        return
                continue
            try:
                async with asyncio.timeout(self._heartbeat_s):
                    await self._something.wait()
            except TimeoutError:
                yield _STILL_HERE


def event_text(message: Message, name: str, seen: Position | None = None) -> bytes:
    """One event: the message as JSON, and where to go on from."""
    if isinstance(message, Failed):
        content = {"type": "error", "id": name, "problem": problem_document(message.problem)}
        return b"data: %b\n\n" % orjson.dumps(content, default=str)
    seen = seen or position_of(message)
    head = b"" if seen is None else f"id: {position_text(seen)}\n".encode()
    return b"%bdata: %b\n\n" % (head, orjson.dumps(message.to_json(name)))
