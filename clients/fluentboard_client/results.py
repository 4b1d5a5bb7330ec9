"""SPARQL 1.1 JSON results as Python values."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any
from urllib.parse import unquote

_XSD = "http://www.w3.org/2001/XMLSchema#"
_INTEGERS = frozenset(
    _XSD + local
    for local in (
        "integer",
        "long",
        "int",
        "short",
        "byte",
        "nonNegativeInteger",
        "positiveInteger",
        "nonPositiveInteger",
        "negativeInteger",
        "unsignedLong",
        "unsignedInt",
        "unsignedShort",
        "unsignedByte",
    )
)
_NUMBERS = frozenset(_XSD + local for local in ("float", "double", "decimal"))
_SPECIAL_NUMBERS = {"INF": math.inf, "+INF": math.inf, "-INF": -math.inf, "NaN": math.nan}


class Iri(str):
    """An IRI; a string that knows its last part.

    >>> Iri("https://example.org/fluent/mug1").name
    'mug1'
    """

    __slots__ = ()

    @property
    def name(self) -> str:
        """What follows the last `#` or `/`: the name of a fluent, class or property."""
        return unquote(self[max(self.rfind("#"), self.rfind("/")) + 1 :])


class BlankNode(str):
    """A blank node's label, which means something within one result only."""

    __slots__ = ()


Term = Iri | BlankNode | str | int | float | bool
"""A bound value: literals become numbers, booleans or strings."""

Row = dict[str, Term | None]
"""One solution; a variable that the solution leaves unbound is None."""


def term(json_term: Mapping[str, Any]) -> Term:
    """The Python value of an RDF term in SPARQL 1.1 JSON results format.

    A literal that does not fit its type stays a string, as do dates and language-tagged text.

    >>> term({"type": "literal", "value": "0.71", "datatype": _XSD + "float"})
    0.71
    """
    kind, value = json_term["type"], str(json_term["value"])
    if kind == "uri":
        return Iri(value)
    if kind == "bnode":
        return BlankNode(value)
    datatype = json_term.get("datatype", "")
    try:
        if datatype in _INTEGERS:
            return int(value)
        if datatype in _NUMBERS:
            return _SPECIAL_NUMBERS[value] if value in _SPECIAL_NUMBERS else float(value)
    except ValueError:
        return value
    if datatype == _XSD + "boolean" and value in ("true", "1", "false", "0"):
        return value in ("true", "1")
    return value


def rows(bindings: Iterable[Mapping[str, Any]], variables: Sequence[str] = ()) -> list[Row]:
    """The solutions as dictionaries.

    Args:
        bindings: of the results document.
        variables: its head; every row gets all of them.
    """
    return [
        {
            **dict.fromkeys(variables),
            **{name: term(value) for name, value in binding.items()},
        }
        for binding in bindings
    ]


def row_text(row: Row) -> str:
    """A row in one line, IRIs by their last part: `table=table1 height=0.74`."""
    return " ".join(f"{name}={term_text(value)}" for name, value in row.items())


def term_text(value: Term | None) -> str:
    """A value as people read it: IRIs by their last part, numbers without noise."""
    if value is None:
        return "-"
    if isinstance(value, Iri):
        return value.name
    if isinstance(value, bool):
        return "true" if value else "false"
    if not isinstance(value, float):
        return str(value)
    # Six digits are enough of a length, not of a time in seconds since 1970.
    if 1e5 <= abs(value) < 1e13:
        return f"{value:.3f}".rstrip("0").rstrip(".")
    return f"{value:.6g}"
