"""Fluents in the words of OWL-Time, for tools that know nothing of this board (pure).

The interval of a fluent is an individual of its own, with its two ends as instants. An end that is
known exactly has a position on the board's time axis; of one that is not, it is said inside which
interval it lies. An end of which nothing is known is not mentioned.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from decimal import Decimal
from typing import Final

from fluentboard.board.triples import timeless_lines
from fluentboard.board.vocabulary import RDF_TYPE, XSD, Vocabulary
from fluentboard.model.fluent import Fluent
from fluentboard.model.interval import Certainty, Interval
from fluentboard.model.relations import ALLEN, bounds_of, relation_certainty
from fluentboard_ontology import FB, FLUENT

TIME: Final = "http://www.w3.org/2006/time#"
"""The namespace of OWL-Time."""

TIME_AXIS: Final = FB + "timeAxis"
"""The reference system of positions: seconds on the board's time axis."""


def owl_time_lines(fluent: Fluent, vocabulary: Vocabulary) -> list[str]:
    """All N-Triples lines of a fluent, with OWL-Time in place of the four end points."""
    subject = FLUENT + fluent.name
    interval = subject + "#time"
    _, s2, f1, _ = bounds_of(fluent)
    kind = "ProperInterval" if s2 < f1 else "Interval"
    lines = [
        *timeless_lines(fluent, vocabulary),
        _line(subject, TIME + "hasTime", interval),
        _line(interval, RDF_TYPE, TIME + kind),
    ]
    lines += _end(interval, "hasBeginning", subject + "#start", fluent.start)
    lines += _end(interval, "hasEnd", subject + "#finish", fluent.finish)
    return lines


def relation_lines(fluents: Sequence[Fluent]) -> Iterator[str]:
    """The N-Triples lines of Allen's relations that certainly hold between the intervals.

    A fluent of whose ends nothing is known certainly stands in no relation to any other.
    """
    known = [(FLUENT + fluent.name + "#time", bounds_of(fluent)) for fluent in fluents]
    for number, (one, bounds) in enumerate(known):
        for other, others in known[number + 1 :]:
            for relation in ALLEN:
                if relation_certainty(relation, bounds, others) is Certainty.CERTAIN:
                    yield _line(one, TIME + (relation.owl_time or ""), other)
                    yield _line(other, TIME + (relation.inverse.owl_time or ""), one)
                    break  # the thirteen exclude each other


def _end(interval: str, predicate: str, instant: str, known: Interval) -> Iterator[str]:
    earliest, latest = known.earliest, known.latest
    if earliest is None and latest is None:
        return
    yield _line(interval, TIME + predicate, instant)
    if earliest is not None and earliest == latest:
        yield from _instant(instant, earliest)
        return
    bounds = instant + "-bounds"
    yield _line(instant, RDF_TYPE, TIME + "Instant")
    yield _line(bounds, RDF_TYPE, TIME + "Interval")
    yield _line(bounds, TIME + "inside", instant)
    for name, side, time_s in (
        ("hasBeginning", "-earliest", earliest),
        ("hasEnd", "-latest", latest),
    ):
        if time_s is not None:
            yield _line(bounds, TIME + name, instant + side)
            yield from _instant(instant + side, time_s)


def _instant(instant: str, time_s: float) -> Iterator[str]:
    position = instant + "-position"
    number = format(Decimal(repr(time_s)), "f")
    yield _line(instant, RDF_TYPE, TIME + "Instant")
    yield _line(instant, TIME + "inTimePosition", position)
    yield _line(position, RDF_TYPE, TIME + "TimePosition")
    yield _line(position, TIME + "hasTRS", TIME_AXIS)
    yield f'<{position}> <{TIME}numericPosition> "{number}"^^<{XSD}decimal> .\n'


def _line(subject: str, predicate: str, target: str) -> str:
    return f"<{subject}> <{predicate}> <{target}> .\n"
