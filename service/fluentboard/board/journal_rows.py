"""Rows of the journal: a fluent's change as a row of the table `changes`, and back (pure).

A row holds what a commit added to one fluent, so the fluent is the fold of its rows.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

import orjson

from fluentboard.board.events import (
    FluentAdded,
    FluentCorrected,
    FluentEnded,
    FluentEvent,
    FluentRefined,
)
from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.interval import UNKNOWN, Interval

Row = tuple[int, str, str, str, Any, Any, Any, Any, bytes, str]
"""Commit number, kind, name, class, s1, s2, f1, f2, packed properties, author."""


def encoded(number: int, position: int, event: FluentEvent) -> tuple[Any, ...]:
    """The row of what a commit did to one fluent."""
    fluent = event.after
    new = fluent.properties
    if isinstance(event, FluentRefined | FluentEnded):
        new = new[len(event.before.properties) :]
    return (
        number,
        position,
        event.kind,
        fluent.name,
        fluent.class_name,
        fluent.start.earliest,
        fluent.start.latest,
        fluent.finish.earliest,
        fluent.finish.latest,
        orjson.dumps([(p.name, p.type, p.value) for p in new]),
    )


def folded(rows: Iterable[Row]) -> Iterator[FluentEvent]:
    """The events of one fluent from its rows, oldest first."""
    fluent: Fluent | None = None
    for row in rows:
        event = event_of(row, fluent)
        fluent = event.after
        yield event


def event_of(row: Row, before: Fluent | None) -> FluentEvent:
    """What a row says happened to a fluent, given how the fluent was before."""
    number, kind, name, class_name, s1, s2, f1, f2, packed, author = row
    new = tuple(Property(*entry) for entry in orjson.loads(packed))
    old = () if before is None or kind == FluentCorrected.kind else before.properties
    after = Fluent(
        name,
        class_name,
        UNKNOWN if s1 is None and s2 is None else Interval(s1, s2),
        UNKNOWN if f1 is None and f2 is None else Interval(f1, f2),
        (*old, *new),
        number,
        author,
        number if before is None else before.created,
    )
    if before is None:
        return FluentAdded(after)
    if kind == FluentRefined.kind:
        return FluentRefined(before, after)
    return (
        FluentEnded(before, after) if kind == FluentEnded.kind else FluentCorrected(before, after)
    )
