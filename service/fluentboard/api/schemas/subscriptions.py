"""Bodies and replies about subscriptions."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field

from fluentboard.api.schemas.fluents import Schema


class LiveSubscriptionJson(Schema):
    """A subscription whose messages are being sent to a client."""

    id: str = Field(description="What the client calls it.")
    client: str = Field(description="Address of the client, if it holds a WebSocket.")
    transport: Literal["websocket", "event-stream"]
    query: str
    mode: Literal["bindings", "fluents", "both"]
    at: Literal["now"] | None = Field(description="now: it sees what holds; null: all times.")
    waiting: int = Field(description="Messages that wait to be sent.")
    evaluation: str = Field(description="How it is evaluated, and why.")


class SeenJson(Schema):
    """What a subscriber has seen."""

    commit: int
    at: float | None = Field(default=None, description="Of a query at now: the time.")


class WebhookJson(Schema):
    """Where messages are posted."""

    url: str
    is_paused: bool = Field(description="The address said 410; POST .../resume begins again.")
    is_delivering: bool
    secret: str | None = Field(default=None, description="Told once, when it is made.")


class DurableSubscriptionJson(Schema):
    """A subscription with a name of its own."""

    name: str
    query: str
    mode: Literal["bindings", "fluents", "both"]
    at: Literal["now"] | None
    certainly: bool
    author: str
    created_s: float = Field(description="In seconds since the Unix epoch.")
    seen: SeenJson | None = Field(description="What its subscriber has acknowledged.")
    webhook: WebhookJson | None = None


class Subscriptions(Schema):
    """All subscriptions."""

    subscriptions: list[LiveSubscriptionJson]
    durable: list[DurableSubscriptionJson]


class WebhookBody(Schema):
    """Where to post messages."""

    url: str = Field(examples=["http://127.0.0.1:9000/mugs"])
    secret: str | None = Field(
        default=None, description="`whsec_` and 24 to 64 bytes in base64; made if left out."
    )


class DurableBody(Schema):
    """A durable subscription as it is asked for."""

    name: str = Field(pattern="^[A-Za-z0-9][A-Za-z0-9._-]{0,99}$", examples=["mugs"])
    query: str = Field(examples=["SELECT ?mug WHERE { ?mug a race:Mug }"])
    mode: Literal["bindings", "fluents", "both"] = "bindings"
    at: Literal["now"] | None = None
    certainly: bool = False
    since: int | None = Field(default=None, ge=0, description="Begin after this commit.")
    since_at: float | None = Field(default=None, description="With at: the time seen last.")
    webhook: WebhookBody | None = None


class PositionBody(Schema):
    """How far a subscriber has come."""

    position: int | str = Field(description="A commit number, or the id of an event.")


class DeadLetterJson(Schema):
    """A post that was given up."""

    number: int
    delivery: str = Field(description="The webhook-id that all tries had in common.")
    attempts: int
    reason: str
    failed_s: float
    body: dict[str, Any] = Field(description="What was to be posted.")


class DeadLetters(Schema):
    """All posts that were given up, the oldest first."""

    dead_letters: list[DeadLetterJson]


class Discarded(Schema):
    """How many dead letters were forgotten."""

    discarded: int


class RefusedTier(Schema):
    """A cheaper way to evaluate a query, and what is against it."""

    tier: int
    reason: str


class ConditionJson(Schema):
    """One pattern of a query, tried on a fluent."""

    pattern: str
    met: bool
    why: str = Field(description="What the fluent says instead; empty if it is met.")


class LastChangeJson(Schema):
    """The last change of a fluent."""

    commit: int
    event: str
    touched: bool = Field(description="It touched something that the query depends on.")


class FluentExplanation(Schema):
    """Why a fluent is, or is not, in a result."""

    name: str
    solutions: int = Field(description="Solutions that have it.")
    conditions: list[ConditionJson]
    holds: bool | None = Field(description="It holds now; null if the query sees all times.")
    last_change: LastChangeJson
    verdict: str


class Explanation(Schema):
    """How a query is evaluated, and why."""

    tier: int = Field(ge=1, le=4)
    reason: str
    concerned_by: str
    refused: list[RefusedTier]
    shapes: list[str] = Field(description="Statements that the query is concerned by.")
    shapes_left_out: int
    changes_with_the_clock: bool
    explanation: str
    fluent: FluentExplanation | None = None
