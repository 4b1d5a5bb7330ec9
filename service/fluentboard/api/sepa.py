"""SEPA: standing queries in the words of the SPARQL 1.1 Subscribe Language, for SEPA's clients.

The same subscriptions as in `live`, told differently. What SEPA's protocol has no words for, such
as a client that lagged behind, is told as the difference to what the client was told last.
"""

from __future__ import annotations

import asyncio
import uuid
from collections.abc import Mapping
from typing import Any, cast

import orjson

from fluentboard.api.connection import LONG_SNAPSHOT, Connection
from fluentboard.api.exchange import Call, Receive, Reply, Scope, Send, json_reply
from fluentboard.api.live import LiveRoutes, client_of, refuse
from fluentboard.api.live_request import LiveRequest
from fluentboard.api.operations import Answer, Content, Operation
from fluentboard.api.parameters import whole_number
from fluentboard.api.problems import problem_reply
from fluentboard.api.security import Guard
from fluentboard.board.subscriptions.messages import Answer as Result
from fluentboard.board.subscriptions.messages import Delta, Message, Snapshot
from fluentboard.board.subscriptions.registry import SubscriptionRegistry
from fluentboard.board.subscriptions.results import (
    Bag,
    Difference,
    apply,
    bindings_to_json,
    difference,
)
from fluentboard.board.subscriptions.sparql_text import over_dataset
from fluentboard.config import SubscriptionSettings
from fluentboard.errors import FluentboardError, InvalidInput, NotAuthenticated
from fluentboard_ontology import PREFIXES

PATH = "/subscribe"

_SPUID = "sepa://spuid/"
_ALIAS_MAX_CHARACTERS = 200


class SepaRoutes:
    """`/subscribe`: WebSockets for SEPA's clients, and the document that configures them.

    Args:
        registry: evaluates the queries.
        guard: admits callers.
        settings: limits per connection.
        live: holds the connections.
    """

    def __init__(
        self,
        registry: SubscriptionRegistry,
        guard: Guard,
        settings: SubscriptionSettings,
        live: LiveRoutes,
    ) -> None:
        self._registry = registry
        self._guard = guard
        self._settings = settings
        self._live = live

    async def serve(self, scope: Scope, receive: Receive, send: Send, path: str) -> None:
        """Serves one WebSocket until either side closes it."""
        call = Call(scope, receive, path)
        await receive()
        is_admitted = True
        try:
            self._live.check_connections()
            self._guard.admit(call.headers, "read", changes=True)
        except NotAuthenticated:
            # SEPA's clients send their token with every message instead.
            is_admitted = b"authorization" in call.headers
            if is_admitted:
                await refuse(scope, send, problem_reply(_bad_token()))
                return
        except FluentboardError as problem:
            await refuse(scope, send, problem_reply(problem))
            return
        guard = None if is_admitted else self._guard
        connection = SepaConnection(
            self._registry, self._settings, receive, send, client_of(scope), guard, call.headers
        )
        await self._live.hold(connection, send)

    async def configuration(self, call: Call) -> Reply:
        """`GET /subscribe`."""
        address = (call.header(b"host") or "localhost").rpartition("@")[2]
        host, colon, port = address.rpartition(":")
        if not colon or "]" in port:
            host, port = address, ""
        is_safe = call.scheme == "https"
        socket = {
            "port": whole_number(port) or (443 if is_safe else 80),
            "path": call.root_path + PATH,
        }
        sparql = {"path": f"{call.root_path}/sparql", "method": "POST", "format": "JSON"}
        return json_reply(
            {
                "host": host,
                "sparql11protocol": {
                    "protocol": "https" if is_safe else "http",
                    "port": socket["port"],
                    "query": sparql,
                    "update": sparql,
                },
                "sparql11seprotocol": {
                    "protocol": "wss" if is_safe else "ws",
                    "availableProtocols": {"wss" if is_safe else "ws": socket},
                },
                "namespaces": dict(PREFIXES),
                "queries": {},
                "updates": {},
            }
        )

    def operations(self) -> list[Operation]:
        """The routes, documented."""
        return [
            Operation(
                "GET",
                PATH,
                self.configuration,
                "configureSepa",
                "Configure a SEPA client",
                "A JSAP document that says where queries, updates and subscriptions go. With "
                "`Upgrade: websocket` the same address speaks SEPA's SPARQL 1.1 Subscribe "
                "protocol.",
                tag="live",
                role=None,
                answers={200: Answer("The JSAP.", {"application/json": Content(_OBJECT)})},
            )
        ]


class SepaConnection(Connection):
    """One WebSocket that speaks SEPA's dialect.

    Args:
        registry: evaluates the queries.
        settings: limits.
        receive: gives what the client sends.
        send: takes what it is sent; waits while the client does not read.
        client: its address.
        guard: checks the token of every message; None if the connection was admitted as a whole.
        headers: of the handshake.
    """

    def __init__(
        self,
        registry: SubscriptionRegistry,
        settings: SubscriptionSettings,
        receive: Receive,
        send: Send,
        client: str,
        guard: Guard | None,
        headers: Mapping[bytes, bytes],
    ) -> None:
        super().__init__(registry, settings, receive, send, client)
        self._guard = guard
        self._headers = headers
        self._told_so_far: dict[str, _Told] = {}

    async def _heard(self, text: str | bytes) -> dict[str, Any] | None:
        alias: str | None = None
        try:
            kind, body, token = _request(text)
            alias = _text(body, "alias")
            self._check_token(token)
            if kind == "subscribe":
                await self._subscribed(body, alias)
                return None
            spuid = _text(body, "spuid") or ""
            subscription = self.subscriptions.pop(spuid, None)
            if subscription is None:
                raise InvalidInput(f"there is no subscription {spuid!r} on this connection")
            subscription.close()
            told = self._told_so_far.pop(spuid)
            return {"unsubscribed": {"spuid": spuid, **_alias(told.alias)}}
        except FluentboardError as problem:
            return _error(problem, alias)

    async def _subscribed(self, body: Mapping[str, Any], alias: str | None) -> None:
        query = _text(body, "sparql")
        if query is None:
            raise InvalidInput('a subscription needs its query: {"subscribe": {"sparql": "..."}}')
        default = _graphs(body, "default-graph-uri")
        named = _graphs(body, "named-graph-uri")
        if default or named:
            query = over_dataset(query, default, named)
        spuid = _SPUID + str(uuid.uuid4())
        # The first message may be sent as soon as the subscription is open.
        self._told_so_far[spuid] = _Told(alias)
        try:
            await self._open(spuid, LiveRequest(query))
        except BaseException:
            del self._told_so_far[spuid]
            raise

    def _check_token(self, token: str | None) -> None:
        if self._guard is None:
            return
        value = "" if token is None else token if " " in token else f"Bearer {token}"
        headers = {**self._headers, b"authorization": value.encode("utf-8", "replace")}
        self._guard.admit(headers, "read", changes=True)

    def _failed(self, name: str, problem: FluentboardError) -> dict[str, Any]:
        told = self._told_so_far.pop(name, None)
        return {**_error(problem, told and told.alias), "spuid": name}

    async def _told(self, message: Message, name: str) -> str | None:
        told = self._told_so_far.get(name)
        if told is None:
            return None
        if isinstance(message, Snapshot) and len(message.answer.bag) > LONG_SNAPSHOT:
            return await asyncio.to_thread(told.told, message, name)
        return told.told(message, name)


class _Told:
    """What a client has been told of one subscription.

    Args:
        alias: the client's name for it.
    """

    def __init__(self, alias: str | None) -> None:
        self.alias = alias
        self._bag: Bag = {}
        self._sequence = 0

    def told(self, message: Message, spuid: str) -> str | None:
        """The notification of a message, or None if it changes nothing for the client."""
        if isinstance(message, Snapshot):
            result, bag = message.answer, dict(message.answer.bag)
            change = difference(self._bag, bag)
            self._bag = bag
        elif isinstance(message, Delta):
            said = message.change
            result, change = Result(said.form, said.variables, {}), said.difference
            if not apply(self._bag, change):
                raise AssertionError(f"a delta of {spuid} takes away what was not there")
        else:
            return None  # a snapshot follows
        if self._sequence and not change:
            return None
        notification = {
            "spuid": spuid,
            **_alias(self.alias),
            "sequence": self._sequence,
            "addedResults": self._added(result, change),
            "removedResults": self._removed(result, change),
        }
        self._sequence += 1
        return orjson.dumps({"notification": notification}).decode()

    def _added(self, result: Result, change: Difference) -> dict[str, Any]:
        if result.form == "ask":
            return {"head": {}, "boolean": bool(self._bag)}
        # An object without members is how SEPA says that there are none; not so at first.
        if self._sequence and not change.added:
            return {}
        return _results(result, change.added)

    def _removed(self, result: Result, change: Difference) -> dict[str, Any]:
        if result.form == "ask" or not change.removed:
            return {}
        return _results(result, change.removed)


def _results(result: Result, bag: Mapping[Any, int]) -> dict[str, Any]:
    return {
        "head": {"vars": list(result.variables)},
        "results": {"bindings": bindings_to_json(result.variables, bag)},
    }


def _request(text: str | bytes) -> tuple[str, Mapping[str, Any], str | None]:
    """Kind and body of what a client says, and its token.

    Clients put all sorts of settings of their own into the body; what is not known is passed over.
    """
    try:
        message: Any = orjson.loads(text)
    except orjson.JSONDecodeError as problem:
        raise InvalidInput(f"the message is not JSON: {problem}") from None
    if isinstance(message, dict):
        said = cast("dict[str, Any]", message)
        for kind in ("subscribe", "unsubscribe"):
            body = said.get(kind)
            if isinstance(body, dict):
                found = cast("dict[str, Any]", body)
                return kind, found, _text(found, "authorization") or _text(said, "authorization")
    raise InvalidInput(
        'the message is neither {"subscribe": {"sparql": ..., "alias": ...}} nor '
        '{"unsubscribe": {"spuid": ...}}'
    )


def _text(body: Mapping[str, Any], key: str) -> str | None:
    value = body.get(key)
    if value is None:
        return None
    if not isinstance(value, str) or (key == "alias" and len(value) > _ALIAS_MAX_CHARACTERS):
        raise InvalidInput(f"{key} is {value!r}; give a text of at most 200 characters")
    return value


def _graphs(body: Mapping[str, Any], key: str) -> list[str]:
    value = body.get(key)
    found = cast("list[Any]", value) if isinstance(value, list) else [value] if value else []
    if not all(isinstance(iri, str) for iri in found):
        raise InvalidInput(f"{key} is {value!r}; give the IRI of a graph, or several in a list")
    return found


def _alias(alias: str | None) -> dict[str, str]:
    return {} if alias is None else {"alias": alias}


def _error(problem: FluentboardError, alias: str | None) -> dict[str, Any]:
    return {
        "error": problem.code,
        "error_description": problem.message,
        "status_code": problem.http_status,
        **_alias(alias),
    }


def _bad_token() -> NotAuthenticated:
    return NotAuthenticated("the token is not one of this board's; ask its operator")


_OBJECT: Mapping[str, Any] = {"type": "object"}
