"""What a subscriber and the board say to each other, without a network.

A `Conversation` turns the board's messages into events and remembers the last commit it heard of,
so that a new connection can resume where the old one broke off.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, cast
from urllib.parse import urlsplit, urlunsplit

from fluentboard.errors import FluentboardError, InvalidInput
from fluentboard_client.problems import error_from_problem
from fluentboard_client.replies import FluentChange, change_from_json
from fluentboard_client.results import Row, row_text, rows

Mode = Literal["bindings", "fluents", "both"]
"""What a delta carries: solutions, whole fluents that changed, or both."""

_MODES = ("bindings", "fluents", "both")
_ID = "1"  # one conversation per connection, so the board's multiplexing is not needed


@dataclass(frozen=True, slots=True)
class Snapshot:
    """The whole result of the query.

    Attributes:
        commit: the commit it is exact at.
        rows: the solutions; for CONSTRUCT rows of subject, predicate and object, for ASK none.
        boolean: the answer of an ASK, None for other forms.
        at_s: of a subscription at now: the time it is exact at, in seconds.
    """

    commit: int
    rows: tuple[Row, ...] = ()
    boolean: bool | None = None
    at_s: float | None = None

    def __str__(self) -> str:
        shown = [("=", row_text(row)) for row in self.rows]
        return _lines(self.commit, self.at_s, self.boolean, shown)


@dataclass(frozen=True, slots=True)
class Delta:
    """How the result changed; a row is listed as often as its multiplicity changed.

    Attributes:
        commit: the commit that changed it.
        since: the commit that the change is relative to.
        added: solutions that came.
        removed: solutions that went.
        fluents: the fluents that changed, in the modes `fluents` and `both`.
        boolean: the new answer of an ASK, None for other forms.
        at_s: of a subscription at now: the time it is exact at, in seconds.
    """

    commit: int
    since: int
    added: tuple[Row, ...] = ()
    removed: tuple[Row, ...] = ()
    fluents: tuple[FluentChange, ...] = ()
    boolean: bool | None = None
    at_s: float | None = None

    def __str__(self) -> str:
        changes = [("-", row_text(row)) for row in self.removed]
        changes += [("+", row_text(row)) for row in self.added]
        changes += [(c.kind, f"{c.fluent.name} ({c.fluent.class_name})") for c in self.fluents]
        return _lines(self.commit, self.at_s, self.boolean, changes)


@dataclass(frozen=True, slots=True)
class Gap:
    """The board no longer knows what was missed while away; a snapshot follows.

    Attributes:
        since: the last commit heard of before.
        commit: the commit that the board is at.
    """

    since: int
    commit: int

    def __str__(self) -> str:
        return f"commit {self.commit}: what happened since commit {self.since} is not known"


@dataclass(frozen=True, slots=True)
class Lagged:
    """The subscriber was too slow and the board dropped changes for it; a snapshot follows."""

    def __str__(self) -> str:
        return "too slow: changes were dropped"


Event = Snapshot | Delta | Gap | Lagged


@dataclass(frozen=True, slots=True)
class LiveQuery:
    """A subscription that is asked for.

    Attributes:
        sparql: the query; empty for a durable subscription.
        mode: what its deltas carry.
        since: the commit to go on after; None to start with a snapshot.
        options: what the board is told besides.
    """

    sparql: str
    mode: Mode
    since: int | None
    options: Mapping[str, Any] = field(default_factory=dict[str, Any])


class Conversation:
    """One subscription across as many connections as it takes."""

    def __init__(self, query: LiveQuery, address: str) -> None:
        if query.mode not in _MODES:
            raise InvalidInput(f"mode is {query.mode!r}; give one of {', '.join(_MODES)}")
        self._query = query.sparql
        self._mode = query.mode
        self._address = address
        self._options = dict(query.options)
        self._variables: Sequence[str] = ()
        self.at_s: float | None = self._options.pop("since_at", None)
        """Of a subscription at now: the last time heard of, in seconds."""
        self.commit = query.since
        """The last commit heard of; None before the first message."""

    def opening(self) -> str:
        """The message to send on a new connection: subscribe, or resume after the last commit."""
        wanted: dict[str, Any] = {"id": _ID, **self._options}
        if "durable" not in wanted:
            wanted |= {"query": self._query, "mode": self._mode}
        if self.commit is not None:
            # A replay that broke off goes on live.
            wanted.pop("replay", None)
            wanted["since"] = self.commit
            if self.at_s is not None:
                wanted["since_at"] = self.at_s
        return json.dumps({"subscribe": wanted})

    def hear(self, text: str | bytes) -> Event | None:
        """The event in a message, or None if the message carries none.

        Raises:
            FluentboardError: the board refused the subscription; it is the error it names.
        """
        message = cast("dict[str, Any]", json.loads(text))
        kind = message.get("type")
        if kind == "snapshot":
            return self._snapshot(message)
        if kind == "delta":
            return self._delta(message)
        if kind == "resumed":
            self.commit = max(self.commit or 0, int(message.get("since", self.commit or 0)))
        elif kind == "gap":
            return Gap(int(message["since"]), int(message["commit"]))
        elif kind == "lagged":
            return Lagged()
        elif kind == "error":
            problem = cast("dict[str, Any]", message.get("problem") or {})
            raise error_from_problem(problem, int(problem.get("status", 500)), self._address)
        return None  # messages that later versions add must not end a subscription

    def _snapshot(self, message: Mapping[str, Any]) -> Snapshot:
        result = message["result"]
        self.commit, self.at_s = int(message["commit"]), message.get("at")
        if "boolean" in result:
            return Snapshot(self.commit, boolean=bool(result["boolean"]), at_s=self.at_s)
        self._variables = tuple(result["head"].get("vars", ()))
        found = tuple(rows(result["results"]["bindings"], self._variables))
        return Snapshot(self.commit, found, at_s=self.at_s)

    def _delta(self, message: Mapping[str, Any]) -> Delta:
        self.commit, self.at_s = int(message["commit"]), message.get("at")
        return Delta(
            self.commit,
            int(message["since"]),
            tuple(rows(message.get("added", ()), self._variables)),
            tuple(rows(message.get("removed", ()), self._variables)),
            tuple(change_from_json(change) for change in message.get("events") or ()),
            message.get("boolean"),
            self.at_s,
        )


def live_address(address: str) -> str:
    """The WebSocket address of a board's subscriptions."""
    parts = urlsplit(address)
    scheme = "wss" if parts.scheme == "https" else "ws"
    return urlunsplit((scheme, parts.netloc, parts.path + "/subscriptions", "", ""))


def refusal(status: int, body: bytes, address: str) -> FluentboardError:
    """The error that a refused WebSocket handshake stands for."""
    try:
        problem = json.loads(body)
    except ValueError:
        problem = None
    return error_from_problem(problem, status, address)


def _lines(
    commit: int, at_s: float | None, boolean: bool | None, changes: Sequence[tuple[str, str]]
) -> str:
    head = f"commit {commit}" if at_s is None else f"commit {commit}, at {at_s:.3f} s"
    if boolean is not None:
        return f"{head}: {str(boolean).lower()}"
    if not changes:
        return f"{head}: no rows"
    return "\n".join(f"{head}: {sign} {text}" for sign, text in changes)
