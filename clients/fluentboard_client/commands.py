"""What a batch may contain: assert, refine and end."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.interval import Interval
from fluentboard.model.json_format import fluent_to_json


@dataclass(frozen=True, slots=True)
class AssertFluent:
    """Put a new fluent on the board; with `merge`, refine the one of that name if there is one."""

    fluent: Fluent
    merge: bool = False

    def to_json(self) -> dict[str, Any]:
        """The command as `POST /commands` takes it."""
        return {"op": "assert", "fluent": statement_json(self.fluent), "merge": self.merge}


@dataclass(frozen=True, slots=True)
class RefineFluent:
    """Narrow the intervals of a fluent or add property values; None leaves an interval alone."""

    name: str
    start: Interval | None = None
    finish: Interval | None = None
    properties: tuple[Property, ...] = ()
    version: int | None = None

    def to_json(self) -> dict[str, Any]:
        """The command as `POST /commands` takes it."""
        return {"op": "refine", "name": self.name, **_version(self.version), **self.changes_json()}

    def changes_json(self) -> dict[str, Any]:
        """What changes, as `PATCH /fluents/{name}` takes it."""
        changes: dict[str, Any] = {}
        if self.start is not None:
            changes["start"] = interval_json(self.start)
        if self.finish is not None:
            changes["finish"] = interval_json(self.finish)
        if self.properties:
            changes["properties"] = properties_json(self.properties)
        return changes


@dataclass(frozen=True, slots=True)
class EndFluent:
    """Say when a fluent ceased to hold: a time in seconds, or the interval it lies in."""

    name: str
    finish: Interval | float
    version: int | None = None

    def to_json(self) -> dict[str, Any]:
        """The command as `POST /commands` takes it."""
        finish = self.finish
        return {
            "op": "end",
            "name": self.name,
            "finish": interval_json(finish) if isinstance(finish, Interval) else finish,
            **_version(self.version),
        }


Command = AssertFluent | RefineFluent | EndFluent


def statement_json(fluent: Fluent) -> dict[str, Any]:
    """What a fluent says, without the version, author and commit that the board sets itself."""
    statement = fluent_to_json(fluent)
    for provenance in ("version", "author", "created"):
        del statement[provenance]
    return statement


def interval_json(interval: Interval) -> list[float | None]:
    """`[earliest, latest]`, with None for unknown."""
    return [interval.earliest, interval.latest]


def properties_json(properties: Iterable[Property]) -> list[dict[str, Any]]:
    """Properties as JSON objects."""
    return [{"property": p.name, "type": p.type, "value": p.value} for p in properties]


def _version(version: int | None) -> dict[str, int]:
    return {} if version is None else {"version": version}
