"""What a client that subscribes asks for, the same on every transport."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, cast

from fluentboard.api import parameters
from fluentboard.api.parameters import NUMBER_MAX
from fluentboard.board.subscriptions.durable import Position
from fluentboard.board.subscriptions.messages import (
    Delta,
    Message,
    Mode,
    Resumed,
    Snapshot,
)
from fluentboard.board.subscriptions.past import ReplayRequest
from fluentboard.board.subscriptions.registry import SubscriptionRegistry
from fluentboard.board.subscriptions.subscription import Subscription
from fluentboard.errors import InvalidInput
from fluentboard.model.interval import Certainty

MODES = ("bindings", "fluents", "both")

_REPLAY_KEYS = frozenset({"commit", "time", "speed"})


@dataclass(frozen=True, slots=True)
class LiveRequest:
    """A subscription that a client asks for.

    Attributes:
        query: SPARQL text.
        mode: whether deltas carry bindings, fluents, or both.
        at: with which certainty a fluent must hold now to be seen; None sees the whole history.
        since: what the client has seen already; None for a new client.
        replay: begin in the past, and go on in its rhythm; None begins at the present.
    """

    query: str
    mode: Mode = "bindings"
    at: Certainty | None = None
    since: Position | None = None
    replay: ReplayRequest | None = None

    def open(
        self, registry: SubscriptionRegistry, on_ready: Callable[[], None] | None = None
    ) -> Subscription:
        """Opens it. It parses the query, which takes milliseconds.

        Raises:
            InvalidQuery, InvalidInput: it cannot be subscribed to.
        """
        at = None if self.at is None else "now"
        certainty = self.at or Certainty.POSSIBLE
        if self.replay is not None:
            return registry.replay(
                self.query, self.replay, self.mode, on_ready, at=at, certainty=certainty
            )
        seen = self.since
        return registry.open(
            self.query,
            self.mode,
            None if seen is None else seen.commit,
            on_ready,
            at=at,
            certainty=certainty,
            since_s=None if seen is None else seen.at_s,
            sequence=0 if seen is None else seen.sequence,
        )


def request_from_json(body: Mapping[str, Any]) -> LiveRequest:
    """The request in a JSON object with the keys `query`, `mode`, `at`, `since` and so on.

    Raises:
        InvalidInput: a value is not what its key asks for.
    """
    query, since, since_s = body.get("query"), body.get("since"), body.get("since_at")
    if not isinstance(query, str):
        raise InvalidInput(f"the query is {query!r}; give SPARQL text")
    if since is not None and not _is_commit(since):
        raise InvalidInput(f"since is {since!r}; give a commit number")
    if since_s is not None and not _is_time(since_s):
        raise InvalidInput(f"since_at is {since_s!r}; give a time in seconds")
    if since_s is not None and since is None:
        raise InvalidInput("since_at is given without since; give the commit, too")
    certainly = body.get("certainly", False)
    if not isinstance(certainly, bool):
        raise InvalidInput(f"certainly is {certainly!r}; give true or false")
    replay = body.get("replay")
    if replay is not None and since is not None:
        raise InvalidInput("since and replay exclude each other; give one of them")
    return LiveRequest(
        query,
        mode_of(body.get("mode", "bindings")),
        certainty_of(body.get("at"), certainly=certainly),
        None if since is None else Position(since, since_s, 1),
        None if replay is None else _replay_from_json(replay),
    )


def request_from_parameters(
    query: str, values: parameters.Values, last_event_id: str | None
) -> LiveRequest:
    """The request in the parameters of a query string.

    Args:
        query: SPARQL text.
        values: the parameters.
        last_event_id: the header with which a client comes back; it counts before `since`.

    Raises:
        InvalidInput: a value is not what its parameter asks for.
    """
    mode = mode_of(parameters.text(values, "mode") or "bindings")
    at = certainty_of(
        parameters.text(values, "at"), certainly=bool(parameters.flag(values, "certainly"))
    )
    since = position_from_text(last_event_id or parameters.text(values, "since"))
    commit = parameters.optional_number(values, "from-commit")
    time = parameters.text(values, "from-time")
    replay = None
    if commit is not None or time is not None:
        speed = parameters.text(values, "speed")
        replay = ReplayRequest(
            commit,
            None if time is None else parameters.seconds(time, "from-time"),
            1.0 if speed is None else parameters.seconds(speed, "speed"),
        )
        # A client that comes back in the middle of a replay goes on live from there.
        replay = replay if since is None else None
    return LiveRequest(query, mode, at, since, replay)


def mode_of(value: Any) -> Mode:
    """A delivery mode.

    Raises:
        InvalidInput: it is none.
    """
    if value not in MODES:
        raise InvalidInput(f"mode is {value!r}; use {', '.join(MODES)}", mode=value)
    return value


def certainty_of(at: Any, *, certainly: bool) -> Certainty | None:
    """With which certainty a fluent must hold now to be seen; None sees the whole history.

    Raises:
        InvalidInput: `at` is given and not `now`.
    """
    if at is None:
        if certainly:
            raise InvalidInput("certainly is given without at; give at: now, too")
        return None
    if at != "now":
        raise InvalidInput(
            f"at is {at!r}; a subscription sees what holds `now`, or the whole history", at=at
        )
    return Certainty.CERTAIN if certainly else Certainty.POSSIBLE


def position_of(message: Message) -> Position | None:
    """What a client has seen when it has handled a message; None if that does not change."""
    if isinstance(message, Snapshot):
        return Position(message.commit, message.at_s, message.sequence + 1)
    if isinstance(message, Delta):
        return Position(message.commit, message.at_s, message.sequence + 1)
    if isinstance(message, Resumed):
        return Position(message.commit, message.at_s, 1)
    return None


def position_text(seen: Position) -> str:
    """A position as the `id:` of an event has it: sequence, commit, and for a query at now a time.

    Example:
        >>> position_text(Position(17, 1423.5, 4))
        '4:17@1423.5'
    """
    time = "" if seen.at_s is None else f"@{seen.at_s!r}"
    return f"{seen.sequence}:{seen.commit}{time}"


def position_from_text(text: str | None) -> Position | None:
    """The position that `position_text` wrote, or a plain commit number.

    Raises:
        InvalidInput: it is neither.
    """
    if not text:
        return None
    try:
        before, _, time = text.partition("@")
        sequence, _, commit = before.rpartition(":")
        at_s = float(time) if time else None
        if at_s is not None and not math.isfinite(at_s):
            raise ValueError
        found = Position(int(commit), at_s, int(sequence) if sequence else 1)
        if not (0 <= found.commit <= NUMBER_MAX and 0 <= found.sequence <= NUMBER_MAX):
            raise ValueError
    except ValueError:
        raise InvalidInput(
            f"{text!r} is no position; give a commit number, or the id of the last event heard"
        ) from None
    return found


def _replay_from_json(value: Any) -> ReplayRequest:
    if not isinstance(value, dict):
        raise InvalidInput(f"replay is {value!r}; give an object with commit or time, and speed")
    members = cast("dict[str, Any]", value)
    unknown = members.keys() - _REPLAY_KEYS
    if unknown:
        raise InvalidInput(
            f"replay has the unknown key {min(unknown)!r}; keys are commit, time, speed"
        )
    commit, time, speed = members.get("commit"), members.get("time"), members.get("speed", 1.0)
    if commit is not None and not _is_commit(commit):
        raise InvalidInput(f"replay.commit is {commit!r}; give a commit number")
    if time is not None and not _is_time(time):
        raise InvalidInput(f"replay.time is {time!r}; give a time in seconds")
    if not _is_time(speed):
        raise InvalidInput(f"replay.speed is {speed!r}; give a number above 0")
    return ReplayRequest(commit, time, float(speed))


def _is_commit(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value <= NUMBER_MAX


def _is_time(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
