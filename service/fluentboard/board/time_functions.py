"""Time in SPARQL: extension functions in the namespace `fb:` over the end points of fluents.

A function looks up what was believed of a fluent at the commit that the query sees, so it agrees
with the statements of the query's snapshot however late it is called.

An argument is a fluent's IRI or a number of seconds. A relation takes two sides, each of which is a
fluent, a number (an instant) or two numbers (a window). Anything else is an error of the
expression: a filter drops the solution and BIND leaves the variable unbound.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Final

import pyoxigraph as ox

from fluentboard.board.intervals import IntervalIndex
from fluentboard.board.triples import fluent_name
from fluentboard.clock import Clock
from fluentboard.model.interval import Certainty
from fluentboard.model.relations import (
    Bounds,
    Relation,
    duration_bounds,
    holding_certainty,
    own_certainty,
    relation_certainty,
)
from fluentboard_ontology import FB, XSD

BoundsOf = Callable[[str], Bounds | None]
"""What is believed of a fluent, by name; None if there is no such fluent."""

Term = ox.NamedNode | ox.BlankNode | ox.Literal | ox.Triple
Function = Callable[..., ox.Literal | None]

_TRUE: Final = ox.Literal(True)
_FALSE: Final = ox.Literal(False)
_DOUBLE: Final = ox.NamedNode(XSD + "double")
_CERTAINTIES: Final = {certainty: ox.Literal(certainty.name.lower()) for certainty in Certainty}
_NUMERIC: Final = frozenset(
    XSD + local
    for local in (
        *("double", "float", "decimal", "integer", "long", "int", "short", "byte"),
        *("nonNegativeInteger", "positiveInteger", "nonPositiveInteger", "negativeInteger"),
        *("unsignedLong", "unsignedInt", "unsignedShort", "unsignedByte"),
    )
)
# Python's float() reads more than XSD allows, NaN among it, which is no time.
_NUMBER: Final = re.compile(r"\s*[+-]?(?:(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?|INF)\s*", re.A)
# Every way to write an IRI of the namespace, and some more: a false alarm costs microseconds.
_MENTION: Final = re.compile(r"fb:|board[#>]|\\[uU]")

_PREFIX = {Certainty.POSSIBLE: "possibly", Certainty.CERTAIN: "certainly"}


def mentions_functions(sparql: str) -> bool:
    """Whether a query may call one of the functions; a false alarm is possible, a miss is not."""
    return _MENTION.search(sparql) is not None


def _functions() -> dict[str, str]:
    found = {
        "now": "The time of the board's clock, the same all through a query.",
        "holdsAt": "The same as `possiblyHoldsAt`, as in `?at=`.",
        "possiblyHoldsAt": "Whether the fluent holds at a time, possibly.",
        "certainlyHoldsAt": "Whether the fluent holds at a time, certainly.",
        "certaintyAt": 'Whether it holds at a time: "certain", "possible" or "impossible".',
        "durationMin": "The least time in seconds for which the fluent can have held.",
        "durationMax": "The greatest time in seconds for which the fluent can have held.",
    }
    for relation in Relation:
        for certainty, amount in ((Certainty.POSSIBLE, "some"), (Certainty.CERTAIN, "every")):
            found[_PREFIX[certainty] + relation.camel] = (
                f"`{relation.value}`, for {amount} choice of the actual end points."
            )
    return found


FUNCTIONS: Final[Mapping[str, str]] = MappingProxyType(_functions())
"""Local names of all functions, with what each gives."""


def time_functions(sparql: str, bounds_of: BoundsOf, now_s: float) -> dict[ox.NamedNode, Function]:
    """The functions that a query may call.

    Args:
        sparql: the query.
        bounds_of: what is believed of a fluent at the commit that the query sees.
        now_s: the time of the board's clock, in seconds.
    """

    def fluent(term: Term) -> Bounds | None:
        if not isinstance(term, ox.NamedNode):
            return None
        name = fluent_name(term.value)
        return None if name is None else bounds_of(name)

    def holding(subject: Term, time: Term) -> Certainty | None:
        bounds, time_s = fluent(subject), _number(time)
        if bounds is None or time_s is None:
            return None
        return holding_certainty(bounds, time_s)

    def holds(least: Certainty) -> Function:
        def function(subject: Term, time: Term) -> ox.Literal | None:
            found = holding(subject, time)
            if found is None:
                return None
            return _TRUE if found >= least else _FALSE

        return function

    def certainty_at(subject: Term, time: Term) -> ox.Literal | None:
        found = holding(subject, time)
        return None if found is None else _CERTAINTIES[found]

    def duration(end: int) -> Function:
        def function(subject: Term) -> ox.Literal | None:
            bounds = fluent(subject)
            return None if bounds is None else _double(duration_bounds(bounds)[end])

        return function

    def side(terms: tuple[Term, ...]) -> Bounds | None:
        if len(terms) == 1:
            if isinstance(terms[0], ox.NamedNode):
                return fluent(terms[0])
            time_s = _number(terms[0])
            return None if time_s is None else (time_s, time_s, time_s, time_s)
        begin_s, end_s = _number(terms[0]), _number(terms[1])
        if begin_s is None or end_s is None or begin_s > end_s:
            return None
        return begin_s, begin_s, end_s, end_s

    def relates(relation: Relation, least: Certainty) -> Function:
        def function(*terms: Term) -> ox.Literal | None:
            split = _left_terms(terms)
            if split is None:
                return None
            left, right = terms[:split], terms[split:]
            one = side(left)
            if one is None:
                return None
            if left == right:
                # Two windows or instants that are written alike are equal anyway.
                found = own_certainty(relation, one)
            else:
                other = side(right)
                if other is None:
                    return None
                found = relation_certainty(relation, one, other)
            return _TRUE if found >= least else _FALSE

        return function

    functions: dict[str, Function] = {
        "now": lambda: _double(now_s),
        "holdsAt": holds(Certainty.POSSIBLE),
        "possiblyHoldsAt": holds(Certainty.POSSIBLE),
        "certainlyHoldsAt": holds(Certainty.CERTAIN),
        "certaintyAt": certainty_at,
        "durationMin": duration(0),
        "durationMax": duration(1),
    }
    is_escaped = "\\" in sparql
    return {
        iri: relates(*_RELATIONS[name]) if name in _RELATIONS else functions[name]
        for name, iri in _IRIS.items()
        if is_escaped or name in sparql
    }


def functions_for(
    sparql: str, index: IntervalIndex, clock: Clock
) -> Callable[[int], dict[ox.NamedNode, Function]] | None:
    """Gives the functions that a query calls for the commit it is evaluated at; None for none."""
    if not mentions_functions(sparql):
        return None
    now_s = clock.now_s()

    def functions_at(commit: int) -> dict[ox.NamedNode, Function]:
        def bounds_of(name: str) -> Bounds | None:
            row = index.row(name)
            return None if row is None else index.bounds(row, commit)

        return time_functions(sparql, bounds_of, now_s)

    return functions_at


_RELATIONS: Final = {
    prefix + relation.camel: (relation, least)
    for relation in Relation
    for least, prefix in _PREFIX.items()
}
_IRIS: Final = {name: ox.NamedNode(FB + name) for name in FUNCTIONS}


def _left_terms(terms: tuple[Term, ...]) -> int | None:
    """How many of the arguments make up the left side of a relation."""
    if len(terms) == 2:
        return 1
    if len(terms) == 3:
        return 1 if isinstance(terms[0], ox.NamedNode) else 2
    return 2 if len(terms) == 4 else None


def _number(term: Term) -> float | None:
    if not isinstance(term, ox.Literal) or term.datatype.value not in _NUMERIC:
        return None
    return float(term.value) if _NUMBER.fullmatch(term.value) else None


def _double(value: float) -> ox.Literal:
    # Python writes inf, which is no lexical form of xsd:double.
    if math.isinf(value):
        return ox.Literal("INF" if value > 0 else "-INF", datatype=_DOUBLE)
    return ox.Literal(repr(value), datatype=_DOUBLE)
