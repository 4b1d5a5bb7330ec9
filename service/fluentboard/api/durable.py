"""REST routes of subscriptions: durable ones, event streams, and explanations."""

from __future__ import annotations

import asyncio
import re
from collections.abc import Mapping
from typing import Any, cast

import orjson

from fluentboard.api import parameters
from fluentboard.api.event_stream import EventStream
from fluentboard.api.exchange import Call, Reply, json_reply, parsed_json, utf8_text
from fluentboard.api.live import LiveRoutes
from fluentboard.api.live_request import (
    LiveRequest,
    position_from_text,
    request_from_json,
    request_from_parameters,
)
from fluentboard.api.webhooks import Webhooks, check_address, new_secret, signing_key
from fluentboard.board.blackboard import Blackboard
from fluentboard.board.subscriptions.durable import (
    DurableSubscription,
    DurableSubscriptions,
    Position,
)
from fluentboard.board.subscriptions.explain import explained
from fluentboard.board.subscriptions.registry import SubscriptionRegistry
from fluentboard.clock import SystemClock
from fluentboard.config import LimitSettings, SubscriptionSettings
from fluentboard.errors import InvalidInput, InvalidName, TooManySubscriptions, UnknownResource
from fluentboard.model.interval import Certainty

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,99}")
_KEYS = frozenset({"name", "query", "mode", "at", "certainly", "since", "since_at", "webhook"})
_WEBHOOK_KEYS = frozenset({"url", "secret"})
_SPARQL = "application/sparql-query"


class DurableRoutes:
    """`/subscriptions` beyond the WebSocket, `/events` and `/explain`.

    Args:
        board: is asked to explain.
        registry: evaluates the queries.
        durable: the subscriptions with a name.
        webhooks: posts their messages.
        live: counts the streams.
        settings: limits.
        limits: of bodies.
    """

    def __init__(
        self,
        board: Blackboard,
        registry: SubscriptionRegistry,
        durable: DurableSubscriptions,
        webhooks: Webhooks,
        live: LiveRoutes,
        settings: SubscriptionSettings,
        limits: LimitSettings,
    ) -> None:
        self._board = board
        self._registry = registry
        self._durable = durable
        self._webhooks = webhooks
        self._live = live
        self._settings = settings
        self._limits = limits

    async def list_all(self, call: Call) -> Reply:
        """`GET /subscriptions`."""
        kept = await asyncio.to_thread(self._durable.all)
        return json_reply(
            {
                "subscriptions": self._live.listed(),
                "durable": [self._shown(one) for one in kept],
            }
        )

    async def create(self, call: Call) -> Reply:
        """`POST /subscriptions`."""
        body = await self._object(call, _KEYS)
        name = body.get("name")
        if not isinstance(name, str) or not _NAME.fullmatch(name):
            raise InvalidName(
                f"the name is {name!r}; give 1 to 100 letters, digits, dots, dashes and underscores"
            )
        asked = request_from_json(
            {key: body[key] for key in body if key not in ("name", "webhook")}
        )
        url, secret = self._webhook(body.get("webhook"))
        # A query that cannot be subscribed to is refused now, not when its subscriber comes.
        await asyncio.to_thread(self._registry.explain, asked.query)
        kept = await asyncio.to_thread(self._durable.all)
        if len(kept) >= self._settings.durable_max:
            raise TooManySubscriptions(
                f"there are {len(kept)} durable subscriptions, as many as there may be; delete "
                "some, or raise subscriptions.durable_max",
                limit=self._settings.durable_max,
            )
        one = DurableSubscription(
            name,
            asked.query,
            asked.mode,
            asked.at,
            url,
            secret,
            call.author,
            SystemClock().now_s(),
            asked.since,
        )
        await asyncio.to_thread(self._durable.add, one)
        self._webhooks.begin(one)
        shown = self._shown(one)
        if secret is not None:
            # Told once, to whoever made it.
            shown["webhook"]["secret"] = secret
        return json_reply(shown, 201, [(b"location", f"/subscriptions/{name}".encode())])

    async def read(self, call: Call) -> Reply:
        """`GET /subscriptions/{name}`."""
        one = await asyncio.to_thread(self._durable.get, call.arguments["name"])
        return json_reply(self._shown(one))

    async def delete(self, call: Call) -> Reply:
        """`DELETE /subscriptions/{name}`."""
        name = call.arguments["name"]
        # First: a post that is given up now would leave its dead letter to the next of that name.
        await asyncio.to_thread(self._durable.get, name)
        await self._webhooks.stop(name)
        await asyncio.to_thread(self._durable.remove, name)
        return Reply(status=204)

    async def acknowledge(self, call: Call) -> Reply:
        """`POST /subscriptions/{name}/acknowledge`."""
        one = await asyncio.to_thread(self._durable.get, call.arguments["name"])
        body = await self._object(call, frozenset({"position"}))
        position = body.get("position")
        text = str(position) if isinstance(position, int) else position
        seen = position_from_text(text if isinstance(text, str) else None)
        if seen is None:
            raise InvalidInput(
                f"the position is {position!r}; give a commit number, or the id of an event"
            )
        await asyncio.to_thread(self._durable.advance, one.name, seen)
        return json_reply(self._shown(await asyncio.to_thread(self._durable.get, one.name)))

    async def resume(self, call: Call) -> Reply:
        """`POST /subscriptions/{name}/resume`."""
        name = call.arguments["name"]
        await asyncio.to_thread(self._durable.get, name)
        await asyncio.to_thread(self._durable.pause, name, is_paused=False)
        await self._webhooks.stop(name)
        one = await asyncio.to_thread(self._durable.get, name)
        self._webhooks.begin(one)
        return json_reply(self._shown(one))

    async def dead_letters(self, call: Call) -> Reply:
        """`GET /subscriptions/{name}/dead-letters`."""
        letters = await asyncio.to_thread(self._durable.dead_letters, call.arguments["name"])
        return json_reply(
            {
                "dead_letters": [
                    {
                        "number": letter.number,
                        "delivery": letter.delivery,
                        "attempts": letter.attempts,
                        "reason": letter.reason,
                        "failed_s": letter.failed_s,
                        "body": orjson.loads(letter.body),
                    }
                    for letter in letters
                ]
            }
        )

    async def discard(self, call: Call) -> Reply:
        """`DELETE /subscriptions/{name}/dead-letters`."""
        name = call.arguments["name"]
        await asyncio.to_thread(self._durable.get, name)
        number = parameters.optional_number(call.parameters(), "number")
        gone = await asyncio.to_thread(self._durable.discard, name, number)
        if number is not None and not gone:
            raise UnknownResource(f"{name!r} has no dead letter {number}", number=number)
        return json_reply({"discarded": gone})

    async def stream(self, call: Call) -> EventStream:
        """`GET /events`: the query is a parameter."""
        values = call.parameters()
        query = parameters.text(values, "query")
        if query is None:
            raise InvalidInput("the parameter query is missing; give SPARQL text")
        return await self._stream(call, query, values, "query")

    async def stream_posted(self, call: Call) -> EventStream:
        """`POST /events`: the query is the body."""
        if call.media_type != _SPARQL:
            raise InvalidInput(f"the body is {call.media_type or 'untyped'}; send {_SPARQL}")
        query = utf8_text(await call.body(self._limits.body_max_bytes))
        return await self._stream(call, query, call.parameters(), "query")

    async def stream_durable(self, call: Call) -> EventStream:
        """`GET /subscriptions/{name}/events`."""
        one = await asyncio.to_thread(self._durable.get, call.arguments["name"])
        seen = position_from_text(call.header(b"last-event-id"))
        if seen is not None:
            # Who comes back with the id of an event has handled that event.
            await asyncio.to_thread(self._durable.advance, one.name, seen)
        asked = LiveRequest(one.query, one.mode, one.at, seen or one.seen)
        return await self._opened(asked, one.name)

    async def explain(self, call: Call) -> Reply:
        """`GET /explain`."""
        values = call.parameters()
        query = parameters.text(values, "query")
        if query is None:
            raise InvalidInput("the parameter query is missing; give SPARQL text")
        at = parameters.text(values, "at")
        if at not in (None, "now"):
            raise InvalidInput(f"the parameter at is {at!r}; give now, or leave it out")
        certainty = parameters.certainty(values) if at else None
        fluent = parameters.text(values, "fluent")
        found = await asyncio.to_thread(
            explained, self._board, self._registry, query, fluent, certainty
        )
        return json_reply(found)

    async def _stream(
        self, call: Call, query: str, values: parameters.Values, name: str
    ) -> EventStream:
        asked = request_from_parameters(query, values, call.header(b"last-event-id"))
        return await self._opened(asked, parameters.text(values, "id") or name)

    async def _opened(self, asked: LiveRequest, name: str) -> EventStream:
        self._live.check_streams()
        subscription = await asyncio.to_thread(asked.open, self._registry)
        try:
            self._live.check_streams()
        except TooManySubscriptions:  # others were faster, or the board stops
            subscription.close()
            raise
        stream = EventStream(
            subscription,
            name,
            heartbeat_s=self._settings.heartbeat_s,
            retry_s=self._settings.retry_s,
            on_end=self._live.stream_ended,
        )
        self._live.stream_began(stream)
        return stream

    async def _object(self, call: Call, keys: frozenset[str]) -> Mapping[str, Any]:
        document = parsed_json(await call.body(self._limits.body_max_bytes))
        if not isinstance(document, dict):
            raise InvalidInput("the body is not a JSON object")
        members = cast("dict[str, Any]", document)
        unknown = members.keys() - keys
        if unknown:
            raise InvalidInput(
                f"the body has the unknown key {min(unknown)!r}; keys are {', '.join(sorted(keys))}"
            )
        return members

    def _webhook(self, given: Any) -> tuple[str | None, str | None]:
        if given is None:
            return None, None
        members = cast("dict[str, Any]", given if isinstance(given, dict) else {"url": given})
        unknown = members.keys() - _WEBHOOK_KEYS
        url, secret = members.get("url"), members.get("secret")
        if unknown or not isinstance(url, str) or not isinstance(secret, str | None):
            raise InvalidInput("the webhook is an object with url, and perhaps secret")
        check_address(url, self._settings)
        if secret is None:
            secret = new_secret()
        signing_key(secret)
        return url, secret

    def _shown(self, one: DurableSubscription) -> dict[str, Any]:
        shown: dict[str, Any] = {
            "name": one.name,
            "query": one.query,
            "mode": one.mode,
            "at": None if one.at is None else "now",
            "certainly": one.at is Certainty.CERTAIN,
            "author": one.author,
            "created_s": one.created_s,
            "seen": _position_json(one.seen),
        }
        if one.url is not None:
            shown["webhook"] = {
                "url": one.url,
                "is_paused": one.is_paused,
                "is_delivering": self._webhooks.is_delivering(one.name),
            }
        return shown


def _position_json(seen: Position | None) -> dict[str, Any] | None:
    if seen is None:
        return None
    shown: dict[str, Any] = {"commit": seen.commit}
    return shown if seen.at_s is None else {**shown, "at": seen.at_s}
