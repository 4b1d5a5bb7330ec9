"""Subscriptions that the board keeps: durable ones, and explanations."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Mapping
from typing import Any, Literal

import httpx

from fluentboard_client import replies
from fluentboard_client.calls import Ask, Awaiting, Blocking, call
from fluentboard_client.exchange import Request, segment


class DurableCalls:
    """What can be done about durable subscriptions."""

    @call
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
    ) -> Ask[dict[str, Any]]:
        """Makes a durable subscription; with a webhook its secret is in this reply alone.

        Raises:
            SubscriptionExists: there is one of that name.
            InvalidQuery, NotAllowed: the query or the webhook is refused.
        """
        asked = _creation(name, sparql, mode, at, webhook, secret, certainly=certainly)
        return Ask(asked, replies.json_of)

    @call
    def list(self) -> Ask[dict[str, Any]]:
        """What is being sent (`subscriptions`), and what is kept (`durable`)."""
        return Ask(Request("GET", "/subscriptions"), replies.json_of)

    @call
    def read(self, name: str) -> Ask[dict[str, Any]]:
        """A durable subscription.

        Raises:
            UnknownResource: there is none of that name.
        """
        return Ask(_about(name), replies.json_of)

    @call
    def delete(self, name: str) -> Ask[None]:
        """Forgets a durable subscription.

        Raises:
            UnknownResource: there is none of that name.
        """
        return Ask(_about(name, method="DELETE"), replies.nothing_of)

    @call
    def acknowledge(self, name: str, position: int | str) -> Ask[dict[str, Any]]:
        """Notes how far the subscriber has come: a commit, or the id of an event."""
        return Ask(_about(name, "/acknowledge", "POST", {"position": position}), replies.json_of)

    @call
    def resume(self, name: str) -> Ask[dict[str, Any]]:
        """Has the board post again."""
        return Ask(_about(name, "/resume", "POST"), replies.json_of)

    @call
    def dead_letters(self, name: str) -> Ask[Any]:
        """The posts that were given up, the oldest first."""
        return Ask(_about(name, "/dead-letters"), _letters_of)

    @call
    def discard_dead_letters(self, name: str) -> Ask[int]:
        """Forgets them; how many they were."""
        return Ask(_about(name, "/dead-letters", "DELETE"), _discarded_of)

    @call
    def explain(
        self,
        sparql: str,
        *,
        fluent: str | None = None,
        at: Literal["now"] | None = None,
        certainly: bool = False,
    ) -> Ask[dict[str, Any]]:
        """How a query would be evaluated as a subscription, and why it has a fluent or has not."""
        return Ask(_explanation(sparql, fluent, at, certainly=certainly), replies.json_of)


class DurableSubscriptions(DurableCalls, Blocking):
    """The durable subscriptions of a board, and explanations; `Client.subscriptions` has one.

    Args:
        send: sends a request, and raises the board's errors.
    """

    def __init__(self, send: Callable[[Request], httpx.Response]) -> None:
        self._by = send

    def send(self, request: Request) -> httpx.Response:
        """The reply to a request; raises the error that it stands for."""
        return self._by(request)


class AsyncDurableSubscriptions(DurableCalls, Awaiting):
    """As `DurableSubscriptions`, to be awaited.

    Args:
        send: sends a request, and raises the board's errors.
    """

    def __init__(self, send: Callable[[Request], Awaitable[httpx.Response]]) -> None:
        self._by = send

    async def send(self, request: Request) -> httpx.Response:
        """The reply to a request; raises the error that it stands for."""
        return await self._by(request)


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
    return Request(method, f"/subscriptions/{segment(name)}{rest}", json=body)


def _explanation(sparql: str, fluent: str | None, at: str | None, *, certainly: bool) -> Request:
    given = {"query": sparql, "fluent": fluent, "at": at}
    params = {key: value for key, value in given.items() if value is not None}
    if certainly:
        params["certainly"] = "true"
    return Request("GET", "/explain", params=params)


def _letters_of(reply: httpx.Response) -> Any:
    return replies.json_of(reply)["dead_letters"]


def _discarded_of(reply: httpx.Response) -> int:
    return int(replies.json_of(reply)["discarded"])
