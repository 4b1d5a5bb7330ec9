"""Subscriptions beyond the plain live query: at now, replayed, durable, explained."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Mapping
from typing import Any, Literal, cast
from urllib.parse import quote

import httpx

from fluentboard.errors import InvalidInput
from fluentboard_client.exchange import Request

Send = Callable[[Request], httpx.Response]
AsyncSend = Callable[[Request], Awaitable[httpx.Response]]


def options(
    *,
    at: Literal["now"] | None = None,
    certainly: bool = False,
    since_at: float | None = None,
    from_commit: int | None = None,
    from_time: float | None = None,
    speed: float = 1.0,
    durable: str | None = None,
) -> dict[str, Any]:
    """What `subscribe` is told besides query, mode and since.

    Raises:
        InvalidInput: a replay is to begin both at a commit and at a time.
    """
    found: dict[str, Any] = {}
    if durable is not None:
        found["durable"] = durable
    if at is not None:
        found["at"] = at
    if certainly:
        found["certainly"] = True
    if since_at is not None:
        found["since_at"] = since_at
    if from_commit is not None and from_time is not None:
        raise InvalidInput("a replay begins at a commit or at a time; give one of the two")
    if from_commit is not None:
        found["replay"] = {"commit": from_commit, "speed": speed}
    elif from_time is not None:
        found["replay"] = {"time": from_time, "speed": speed}
    return found


class DurableSubscriptions:
    """The durable subscriptions of a board, and explanations; `Client.subscriptions` has one.

    Args:
        send: sends a request, and raises the board's errors.
    """

    def __init__(self, send: Send) -> None:
        self._send = send

    def create(
        self,
        name: str,
        sparql: str,
        *,
        mode: str = "bindings",
        at: Literal["now"] | None = None,
        certainly: bool = False,
        webhook: str | None = None,
        secret: str | None = None,
    ) -> dict[str, Any]:
        """Makes a durable subscription; with a webhook its secret is in this reply alone.

        Raises:
            SubscriptionExists: there is one of that name.
            InvalidQuery, NotAllowed: the query or the webhook is refused.
        """
        asked = _creation(name, sparql, mode, at, webhook, secret, certainly=certainly)
        return _json(self._send(asked))

    def list(self) -> dict[str, Any]:
        """What is being sent (`subscriptions`), and what is kept (`durable`)."""
        return _json(self._send(Request("GET", "/subscriptions")))

    def read(self, name: str) -> dict[str, Any]:
        """A durable subscription.

        Raises:
            UnknownResource: there is none of that name.
        """
        return _json(self._send(_about(name)))

    def delete(self, name: str) -> None:
        """Forgets a durable subscription.

        Raises:
            UnknownResource: there is none of that name.
        """
        self._send(_about(name, method="DELETE"))

    def acknowledge(self, name: str, position: int | str) -> dict[str, Any]:
        """Notes how far the subscriber has come: a commit, or the id of an event."""
        return _json(self._send(_about(name, "/acknowledge", "POST", {"position": position})))

    def resume(self, name: str) -> dict[str, Any]:
        """Has the board post again."""
        return _json(self._send(_about(name, "/resume", "POST")))

    def dead_letters(self, name: str) -> Any:
        """The posts that were given up, the oldest first."""
        return _json(self._send(_about(name, "/dead-letters")))["dead_letters"]

    def discard_dead_letters(self, name: str) -> int:
        """Forgets them; how many they were."""
        return int(_json(self._send(_about(name, "/dead-letters", "DELETE")))["discarded"])

    def explain(
        self,
        sparql: str,
        *,
        fluent: str | None = None,
        at: Literal["now"] | None = None,
        certainly: bool = False,
    ) -> dict[str, Any]:
        """How a query would be evaluated as a subscription, and why it has a fluent or has not."""
        return _json(self._send(_explanation(sparql, fluent, at, certainly=certainly)))


class AsyncDurableSubscriptions:
    """As `DurableSubscriptions`, to be awaited.

    Args:
        send: sends a request, and raises the board's errors.
    """

    def __init__(self, send: AsyncSend) -> None:
        self._send = send

    async def create(
        self,
        name: str,
        sparql: str,
        *,
        mode: str = "bindings",
        at: Literal["now"] | None = None,
        certainly: bool = False,
        webhook: str | None = None,
        secret: str | None = None,
    ) -> dict[str, Any]:
        """See `DurableSubscriptions.create`."""
        asked = _creation(name, sparql, mode, at, webhook, secret, certainly=certainly)
        return _json(await self._send(asked))

    async def list(self) -> dict[str, Any]:
        """See `DurableSubscriptions.list`."""
        return _json(await self._send(Request("GET", "/subscriptions")))

    async def read(self, name: str) -> dict[str, Any]:
        """See `DurableSubscriptions.read`."""
        return _json(await self._send(_about(name)))

    async def delete(self, name: str) -> None:
        """See `DurableSubscriptions.delete`."""
        await self._send(_about(name, method="DELETE"))

    async def acknowledge(self, name: str, position: int | str) -> dict[str, Any]:
        """See `DurableSubscriptions.acknowledge`."""
        return _json(await self._send(_about(name, "/acknowledge", "POST", {"position": position})))

    async def resume(self, name: str) -> dict[str, Any]:
        """See `DurableSubscriptions.resume`."""
        return _json(await self._send(_about(name, "/resume", "POST")))

    async def dead_letters(self, name: str) -> Any:
        """See `DurableSubscriptions.dead_letters`."""
        return _json(await self._send(_about(name, "/dead-letters")))["dead_letters"]

    async def discard_dead_letters(self, name: str) -> int:
        """See `DurableSubscriptions.discard_dead_letters`."""
        return int(_json(await self._send(_about(name, "/dead-letters", "DELETE")))["discarded"])

    async def explain(
        self,
        sparql: str,
        *,
        fluent: str | None = None,
        at: Literal["now"] | None = None,
        certainly: bool = False,
    ) -> dict[str, Any]:
        """See `DurableSubscriptions.explain`."""
        return _json(await self._send(_explanation(sparql, fluent, at, certainly=certainly)))


def _creation(
    name: str,
    sparql: str,
    mode: str,
    at: str | None,
    webhook: str | None,
    secret: str | None,
    *,
    certainly: bool,
) -> Request:
    body: dict[str, Any] = {"name": name, "query": sparql, "mode": mode}
    if at is not None:
        body["at"] = at
    if certainly:
        body["certainly"] = True
    if webhook is not None:
        body["webhook"] = {"url": webhook} if secret is None else {"url": webhook, "secret": secret}
    return Request("POST", "/subscriptions", json=body)


def _about(
    name: str, rest: str = "", method: str = "GET", body: Mapping[str, Any] | None = None
) -> Request:
    return Request(method, f"/subscriptions/{quote(name, safe='')}{rest}", json=body)


def _explanation(sparql: str, fluent: str | None, at: str | None, *, certainly: bool) -> Request:
    given = {"query": sparql, "fluent": fluent, "at": at}
    params = {key: value for key, value in given.items() if value is not None}
    if certainly:
        params["certainly"] = "true"
    return Request("GET", "/explain", params=params)


def _json(reply: httpx.Response) -> dict[str, Any]:
    return cast("dict[str, Any]", reply.json())
