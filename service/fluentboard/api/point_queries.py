"""Point queries: the ones so cheap that handing them to another thread would cost more (pure).

The event loop must never wait for a query, and whether a query is cheap cannot be told in general.
It can for one shape: a SELECT or ASK over patterns that share one constant subject, with distinct
constant predicates and distinct variables as objects. There, every step of the evaluation yields
a part of a solution and nothing is ever searched in vain, so the time is bounded by the length of
the result; and whoever writes the result down can stop after a few kilobytes.

    >>> point_query("SELECT ?p ?o WHERE { fluent:mug1 ?p ?o }")
    <PointQuery.PREFIXED: 'prefixed'>
    >>> point_query("SELECT ?s WHERE { ?s a race:Mug }") is None
    True
"""

from __future__ import annotations

import re
from enum import Enum

_LONGEST_CHARACTERS = 2_000

_SPACE = r"[ \t\r\n]"
# An absolute one.
_IRI = r"<[A-Za-z][A-Za-z0-9+.-]*:[^<>\"{}|^`\\\x00-\x20]*>"
# Without the escapes and colons that a local name may have: such a query takes the usual way.
_CONSTANT = rf"(?:{_IRI}|[A-Za-z][A-Za-z0-9_-]*:[A-Za-z0-9_][A-Za-z0-9_-]*)"
_VARIABLE = r"[?$][A-Za-z_][A-Za-z0-9_]*"
_PAIR = rf"(?:{_CONSTANT}|{_VARIABLE}|a){_SPACE}+{_VARIABLE}"


class PointQuery(Enum):
    """A point query, by what there is to know of it."""

    PLAIN = "plain"
    PREFIXED = "prefixed"
    """It may use prefixes that it does not declare."""


_POINT_QUERY = re.compile(
    rf"{_SPACE}*"
    rf"(?:PREFIX{_SPACE}+[A-Za-z][A-Za-z0-9_-]*:{_SPACE}*{_IRI}{_SPACE}*)*"
    rf"(?:ASK|SELECT{_SPACE}+(?:\*|{_VARIABLE}(?:{_SPACE}+{_VARIABLE})*)){_SPACE}*"
    rf"(?:WHERE{_SPACE}*)?"
    rf"\{{{_SPACE}*(?P<subject>{_CONSTANT}){_SPACE}+"
    rf"(?P<pairs>{_PAIR}(?:{_SPACE}*;{_SPACE}*{_PAIR})*)"
    rf"{_SPACE}*(?:\.{_SPACE}*)?\}}{_SPACE}*",
    re.IGNORECASE,
)


def point_query(text: str) -> PointQuery | None:
    """What kind of point query it is: one that surely takes no longer than its result is long.

    None says nothing: the query may still be cheap.
    """
    if len(text) > _LONGEST_CHARACTERS:
        return None
    match = _POINT_QUERY.fullmatch(text)
    if match is None:
        return None
    subject, pairs = match.group("subject", "pairs")
    if ";" in pairs:
        return PointQuery.PREFIXED if _are_distinct(pairs) else None
    predicate, target = pairs.split()
    if predicate == target:
        return None  # a variable that is predicate and object at once makes the engine search
    is_plain = subject[0] == "<" and (predicate[0] in "<?$" or predicate == "a")
    return PointQuery.PLAIN if is_plain else PointQuery.PREFIXED


def _are_distinct(pairs: str) -> bool:
    """The predicates are constants, and no two of them or of the objects are the same."""
    predicates: set[str] = set()
    objects: set[str] = set()
    words = pairs.replace(";", " ").split()
    for predicate, target in zip(words[::2], words[1::2], strict=True):
        if predicate[0] in "?$" or predicate in predicates or target[1:] in objects:
            return False
        predicates.add(predicate)
        objects.add(target[1:])
    return True
