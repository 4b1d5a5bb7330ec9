"""What a subscriber is sent; docs/reference/subscriptions.md shows the JSON of each message."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

from fluentboard.board.subscriptions.changes import ToldEvent
from fluentboard.board.subscriptions.query import Form
from fluentboard.board.subscriptions.results import Difference, Solution, bindings_to_json
from fluentboard.errors import FluentboardError
from fluentboard.model.json_format import fluent_to_json

Mode = Literal["bindings", "fluents", "both"]


@dataclass(frozen=True)
class Answer:
    """The whole result of a standing query, shared by all who are sent it.

    Attributes:
        form: of the query.
        variables: names of the columns.
        bag: the solutions; nobody changes this mapping.
    """

    form: Form
    variables: tuple[str, ...]
    bag: Mapping[Solution, int]

    @cached_property
    def json(self) -> dict[str, Any]:
        """SPARQL 1.1 Query Results JSON; CONSTRUCT as bindings of subject, predicate, object."""
        if self.form == "ask":
            return {"head": {}, "boolean": bool(self.bag)}
        return {
            "head": {"vars": list(self.variables)},
            "results": {"bindings": bindings_to_json(self.variables, self.bag)},
        }


@dataclass(frozen=True)
class Change:
    """How the result changed from one commit to another, shared by all who are sent it.

    Attributes:
        form: of the query.
        variables: names of the columns.
        since: a commit at which the result was still the one before.
        commit: the last commit covered; the result is exact at it.
        difference: solutions that came and went.
        events: (commit, event) of the fluents concerned, in commit order; for a query at now also
            that a fluent began or ceased to hold.
        boolean: the new answer of an ASK query.
        since_s: of a query at now: a time at which the result was still the one before.
        at_s: of a query at now: the time that the result is exact at.
    """

    form: Form
    variables: tuple[str, ...]
    since: int
    commit: int
    difference: Difference
    events: tuple[tuple[int, ToldEvent], ...]
    boolean: bool | None
    since_s: float | None = None
    at_s: float | None = None

    def __len__(self) -> int:
        return len(self.difference) + len(self.events)

    @cached_property
    def added_json(self) -> list[dict[str, Any]]:
        """The added solutions as bindings; empty for ASK."""
        if self.form == "ask":
            return []
        return bindings_to_json(self.variables, self.difference.added)

    @cached_property
    def removed_json(self) -> list[dict[str, Any]]:
        """The removed solutions as bindings; empty for ASK."""
        if self.form == "ask":
            return []
        return bindings_to_json(self.variables, self.difference.removed)

    @cached_property
    def events_json(self) -> list[dict[str, Any]]:
        """The events, each with the whole fluent as it stood after."""
        return [
            {"event": event.kind, "commit": commit, "fluent": fluent_to_json(event.after)}
            for commit, event in self.events
        ]


@dataclass(frozen=True, slots=True)
class Snapshot:
    """The whole result: first of all, and again where deltas were lost.

    Attributes:
        sequence: 0 for the first, then one more for every snapshot and delta.
        commit: the commit that the result is exact at.
        answer: the result.
        at_s: of a query at now: the time that the result is exact at.
    """

    sequence: int
    commit: int
    answer: Answer
    at_s: float | None = None

    def to_json(self, subscription: str) -> dict[str, Any]:
        """The message as JSON; `subscription` is the name the client gave."""
        message: dict[str, Any] = {
            "type": "snapshot",
            "id": subscription,
            "sequence": self.sequence,
            "commit": self.commit,
            "result": self.answer.json,
        }
        if self.at_s is not None:
            message["at"] = self.at_s
        return message


@dataclass(frozen=True, slots=True)
class Delta:
    """A change of the result, of the fluents concerned, or both."""

    sequence: int
    change: Change
    mode: Mode

    @property
    def commit(self) -> int:
        """The last commit covered."""
        return self.change.commit

    @property
    def since(self) -> int:
        """A commit at which the result was still the one before."""
        return self.change.since

    @property
    def at_s(self) -> float | None:
        """Of a query at now: the time that the result is exact at."""
        return self.change.at_s

    def to_json(self, subscription: str) -> dict[str, Any]:
        """The message as JSON; `subscription` is the name the client gave."""
        message: dict[str, Any] = {
            "type": "delta",
            "id": subscription,
            "sequence": self.sequence,
            "commit": self.commit,
            "since": self.since,
        }
        if self.at_s is not None:
            message["at"] = self.at_s
        if self.mode != "fluents":
            message["added"] = self.change.added_json
            message["removed"] = self.change.removed_json
            if self.change.boolean is not None:
                message["boolean"] = self.change.boolean
        if self.mode != "bindings":
            message["events"] = self.change.events_json
        return message


@dataclass(frozen=True, slots=True)
class Resumed:
    """The client's `since` is honoured: what follows is exactly what it missed.

    Attributes:
        commit: what the client had seen.
        at_s: of a query at now: the time that the client had seen.
    """

    commit: int
    at_s: float | None = None

    def to_json(self, subscription: str) -> dict[str, Any]:
        """The message as JSON; `subscription` is the name the client gave."""
        message = {"type": "resumed", "id": subscription, "commit": self.commit}
        return message if self.at_s is None else {**message, "at": self.at_s}


@dataclass(frozen=True, slots=True)
class Gap:
    """The client's `since` cannot be honoured; a snapshot follows.

    Attributes:
        since: what the client had seen.
        commit: where the board stands.
    """

    since: int
    commit: int

    def to_json(self, subscription: str) -> dict[str, Any]:
        """The message as JSON; `subscription` is the name the client gave."""
        return {"type": "gap", "id": subscription, "since": self.since, "commit": self.commit}


@dataclass(frozen=True, slots=True)
class Lagged:
    """The client took its messages too slowly and some were dropped; a snapshot follows."""

    def to_json(self, subscription: str) -> dict[str, Any]:
        """The message as JSON; `subscription` is the name the client gave."""
        return {"type": "lagged", "id": subscription}


@dataclass(frozen=True, slots=True)
class Live:
    """A replay has come to the present; from here on it goes on live."""

    commit: int

    def to_json(self, subscription: str) -> dict[str, Any]:
        """The message as JSON; `subscription` is the name the client gave."""
        return {"type": "live", "id": subscription, "commit": self.commit}


@dataclass(frozen=True, slots=True)
class Failed:
    """The query can no longer be evaluated; nothing follows."""

    problem: FluentboardError

    def __post_init__(self) -> None:
        # Oxigraph's results must die in the thread that made them, and the frames of a traceback
        # would take them along to whoever hears of this.
        error: BaseException | None = self.problem
        while error is not None:
            error.__traceback__ = None
            error = error.__context__

    def to_json(self, subscription: str) -> dict[str, Any]:
        """The message as JSON; `subscription` is the name the client gave."""
        return {
            "type": "error",
            "id": subscription,
            "problem": {"code": self.problem.code, "message": self.problem.message},
        }


Message = Snapshot | Delta | Resumed | Gap | Lagged | Live | Failed
