"""The documentation of the subscription routes: parameters, bodies, replies and examples."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel

from fluentboard.api.durable import DurableRoutes
from fluentboard.api.operations import Answer, Content, Operation, Parameter
from fluentboard.api.schemas.subscriptions import (
    DeadLetters,
    Discarded,
    DurableBody,
    DurableSubscriptionJson,
    Explanation,
    PositionBody,
    Subscriptions,
)
from fluentboard.errors import (
    InvalidInput,
    InvalidName,
    InvalidQuery,
    NotAllowed,
    SubscriptionExists,
    TooLarge,
    TooManySubscriptions,
    UnknownFluent,
    UnknownResource,
)

_MUGS = "SELECT ?mug WHERE { ?mug a race:Mug }"
_EVENTS = (
    "retry: 1000\n"
    'id: 1:17\ndata: {"type":"snapshot","id":"query","sequence":0,"commit":17,"result":'
    '{"head":{"vars":["mug"]},"results":{"bindings":[]}}}\n\n'
)

_QUERY = Parameter("query", "SPARQL SELECT, ASK or CONSTRUCT.", example=_MUGS)
_AT = Parameter(
    "at",
    "`now` sees only the fluents that hold now, and the clock changes the result, too.",
    {"type": "string", "enum": ["now"]},
)
_CERTAINLY = Parameter(
    "certainly", "With at: only the fluents that certainly hold.", {"type": "boolean"}
)
_POSSIBLY = Parameter(
    "possibly", "With at: all fluents that may hold; the default.", {"type": "boolean"}
)
_LAST_EVENT_ID = Parameter(
    "Last-Event-ID",
    "The `id` of the last event heard: what came after it is sent, or a gap and a snapshot.",
    example="4:17",
    place="header",
)
_STREAM = (
    Parameter("id", "What the messages call the subscription.", example="mugs"),
    Parameter(
        "mode",
        "What a delta carries.",
        {"type": "string", "enum": ["bindings", "fluents", "both"], "default": "bindings"},
    ),
    _AT,
    _CERTAINLY,
    Parameter("since", "A commit, or the id of an event, seen already.", example="17"),
    Parameter(
        "from-commit",
        "Replay: begin after this commit, and go through the later ones as they were made.",
        {"type": "integer", "minimum": 0},
    ),
    Parameter("from-time", "Replay: begin at this time in seconds.", {"type": "number"}),
    Parameter("speed", "Of a replay: seconds of the past per second.", {"type": "number"}),
    _LAST_EVENT_ID,
)
_STREAMED = {
    200: Answer(
        "Messages as server-sent events, until the client goes.",
        {"text/event-stream": Content(example=_EVENTS)},
    )
}
_STREAM_ERRORS = (InvalidQuery, InvalidInput, TooManySubscriptions)


def subscription_operations(routes: DurableRoutes) -> list[Operation]:
    """The routes of subscriptions, documented."""
    return [*_kept(routes), *_streamed(routes)]


def _kept(routes: DurableRoutes) -> list[Operation]:
    one = "/subscriptions/{name}"
    return [
        Operation(
            "GET",
            "/subscriptions",
            routes.list_all,
            "listSubscriptions",
            "List subscriptions",
            "Those that are being sent to clients, and the durable ones. With `Upgrade: websocket` "
            "the same address opens a WebSocket, on which a client subscribes to queries; the "
            "messages are described in the documentation of live queries.",
            tag="live",
            answers=_json(200, "What is subscribed to.", Subscriptions),
        ),
        Operation(
            "POST",
            "/subscriptions",
            routes.create,
            "createSubscription",
            "Make a durable subscription",
            "It has a name and survives restarts. With a webhook the board posts its messages; "
            "otherwise its subscriber fetches them, by WebSocket or as events.",
            tag="live",
            role="write",
            body={
                "application/json": Content(
                    DurableBody, {"name": "mugs", "query": _MUGS, "mode": "both"}
                )
            },
            body_description="The query, and where its messages go.",
            answers=_json(201, "It is kept.", DurableSubscriptionJson),
            errors=(
                InvalidQuery,
                InvalidInput,
                InvalidName,
                NotAllowed,
                SubscriptionExists,
                TooManySubscriptions,
                TooLarge,
            ),
        ),
        Operation(
            "GET",
            one,
            routes.read,
            "readSubscription",
            "Read a durable subscription",
            tag="live",
            answers=_json(200, "The subscription.", DurableSubscriptionJson),
            errors=(UnknownResource,),
        ),
        Operation(
            "DELETE",
            one,
            routes.delete,
            "deleteSubscription",
            "Delete a durable subscription",
            "Its dead letters go, too.",
            tag="live",
            role="write",
            answers={204: Answer("It is gone.")},
            errors=(UnknownResource,),
        ),
        Operation(
            "POST",
            one + "/acknowledge",
            routes.acknowledge,
            "acknowledgeSubscription",
            "Note what was seen",
            "Where a subscriber that comes without a position of its own goes on from.",
            tag="live",
            role="read",
            body={"application/json": Content(PositionBody, {"position": "4:17"})},
            body_description="The commit or the id of the last event that was handled.",
            answers=_json(200, "The subscription.", DurableSubscriptionJson),
            errors=(InvalidInput, UnknownResource, TooLarge),
        ),
        Operation(
            "POST",
            one + "/resume",
            routes.resume,
            "resumeSubscription",
            "Post again",
            "Begins to post again after the address had said 410, or at once while the board waits "
            "between two tries.",
            tag="live",
            role="write",
            answers=_json(200, "The subscription.", DurableSubscriptionJson),
            errors=(UnknownResource,),
        ),
        Operation(
            "GET",
            one + "/dead-letters",
            routes.dead_letters,
            "listDeadLetters",
            "List posts that were given up",
            tag="live",
            answers=_json(200, "The oldest first.", DeadLetters),
            errors=(UnknownResource,),
        ),
        Operation(
            "DELETE",
            one + "/dead-letters",
            routes.discard,
            "discardDeadLetters",
            "Forget posts that were given up",
            tag="live",
            role="write",
            parameters=(
                Parameter(
                    "number", "Only this one; without it, all.", {"type": "integer", "minimum": 0}
                ),
            ),
            answers=_json(200, "How many were forgotten.", Discarded),
            errors=(InvalidInput, UnknownResource),
        ),
    ]


def _streamed(routes: DurableRoutes) -> list[Operation]:
    return [
        Operation(
            "GET",
            "/events",
            routes.stream,
            "streamEvents",
            "Subscribe by server-sent events",
            "The messages are those of the WebSocket, each with an `id` to come back with.",
            tag="live",
            parameters=(_QUERY, *_STREAM),
            answers=_STREAMED,
            errors=_STREAM_ERRORS,
        ),
        Operation(
            "POST",
            "/events",
            routes.stream_posted,
            "streamEventsOfPostedQuery",
            "Subscribe by server-sent events, with a long query",
            "Like `GET /events`; the query is the body.",
            tag="live",
            parameters=_STREAM,
            body={"application/sparql-query": Content(example=_MUGS)},
            body_description="SPARQL SELECT, ASK or CONSTRUCT.",
            answers=_STREAMED,
            errors=(*_STREAM_ERRORS, TooLarge),
        ),
        Operation(
            "GET",
            "/subscriptions/{name}/events",
            routes.stream_durable,
            "streamSubscription",
            "Fetch a durable subscription by server-sent events",
            "It goes on from `Last-Event-ID`, which also counts as acknowledged, or from what was "
            "acknowledged before.",
            tag="live",
            parameters=(_LAST_EVENT_ID,),
            answers=_STREAMED,
            errors=(*_STREAM_ERRORS, UnknownResource),
        ),
        Operation(
            "GET",
            "/explain",
            routes.explain,
            "explainSubscription",
            "Explain a subscription",
            "How the query would be evaluated, why not more cheaply, and, given a fluent, why that "
            "is or is not in the result.",
            tag="live",
            parameters=(
                _QUERY,
                Parameter("fluent", "Name of a fluent.", example="mug1"),
                _AT,
                _CERTAINLY,
                _POSSIBLY,
            ),
            answers=_json(200, "The explanation.", Explanation),
            errors=(InvalidQuery, InvalidInput, UnknownFluent),
        ),
    ]


def _json(status: int, description: str, schema: type[BaseModel]) -> Mapping[int, Answer]:
    content: dict[str, Any] = {"application/json": Content(schema)}
    return {status: Answer(description, content)}
