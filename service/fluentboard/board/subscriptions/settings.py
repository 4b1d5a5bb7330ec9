"""Settings of the subscriptions, each with its default and unit."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field


class SubscriptionSettings(BaseModel):
    """How much is kept for subscribers, and how much work is done for them."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    queue_messages: int = Field(
        default=1_000,
        ge=2,
        description="messages that wait for one subscriber before it counts as lagging",
    )
    queue_solutions: int = Field(
        default=200_000,
        ge=1,
        description="solutions in the deltas that wait for one subscriber, likewise",
    )
    result_solutions: int = Field(
        default=1_000_000, ge=1, description="largest result that a standing query may have"
    )
    ring_deltas: int = Field(
        default=1_000,
        ge=1,
        description="past deltas kept per standing query, for clients that reconnect",
    )
    ring_solutions: int = Field(
        default=100_000, ge=1, description="solutions and events in those past deltas, all together"
    )
    linger_s: float = Field(
        default=60.0,
        ge=0.0,
        description="seconds a standing query lives on after its last subscriber",
    )
    replay_commits: int = Field(
        default=2_000,
        ge=0,
        description="journal commits read at most to resume a query that does not live any more",
    )
    replays_max: int = Field(
        default=4, ge=0, description="most replays of the past at once; each has a view of its own"
    )
    first_tier: int = Field(
        default=1,
        ge=1,
        le=4,
        description="cheapest evaluation tier to use; 4 evaluates every query again as a whole",
    )
    reevaluation_share: float = Field(
        default=0.5,
        gt=0.0,
        le=1.0,
        description="share of the time that full re-evaluations may take; writers need the rest",
    )
