"""Fluents to RDF triples and back (pure).

A fluent is an individual with its `rdf:type`, its properties as plain triples, and four
`xsd:double` endpoints. An unknown start is `-INF`, an unknown finish `INF`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from contextlib import suppress

import pyoxigraph as ox

from fluentboard.board.events import FluentAdded, FluentCorrected, FluentEvent
from fluentboard.board.vocabulary import RDF_TYPE, XSD, Vocabulary
from fluentboard.errors import InvalidInput
from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.interval import UNKNOWN, Interval
from fluentboard.model.literals import XSD_TYPES, Value
from fluentboard_ontology import FLUENT, UPPER

ENDPOINTS = tuple(
    UPPER + name
    for name in (
        "hasStartEarliest",
        "hasStartLatest",
        "hasFinishEarliest",
        "hasFinishLatest",
    )
)
"""IRIs of the four endpoint properties, in the order s1, s2, f1, f2."""

_TYPE = f"<{RDF_TYPE}>"
_DOUBLE = f'"^^<{XSD}double>'
_ESCAPES = str.maketrans({"\\": "\\\\", '"': '\\"', "\n": "\\n", "\r": "\\r", "\t": "\\t"})


def fluent_iri(name: str) -> str:
    """The IRI of the individual that a fluent's name stands for."""
    return FLUENT + name


def fluent_name(iri: str) -> str | None:
    """The fluent that an IRI stands for, or None if it is no fluent's."""
    return iri[len(FLUENT) :] if iri.startswith(FLUENT) else None


def term(statement: Property, vocabulary: Vocabulary) -> str:
    """A property's value in N-Triples syntax."""
    kind, value = statement.type, statement.value
    if not kind.startswith("xsd:"):
        return f"<{FLUENT}{value}>"
    if isinstance(value, bool):
        return f'"{"true" if value else "false"}"^^<{XSD}boolean>'
    if isinstance(value, str):
        text = value.translate(_ESCAPES)
        return f'"{text}"' if kind == "xsd:string" else f'"{text}"^^<{XSD}{kind[4:]}>'
    return f'"{value!r}"^^<{XSD}{kind[4:]}>'


def is_written(value: Value, text: str) -> bool:
    """Whether text, such as that of a query parameter, is a way to write a property's value."""
    if isinstance(value, bool):
        return text in (("true", "1") if value else ("false", "0"))
    if isinstance(value, str):
        return text == value
    try:
        # Python also reads 1_000; XSD does not.
        return "_" not in text and type(value)(text) == value
    except (ValueError, OverflowError):
        return False


def terms_written(text: str) -> list[ox.NamedNode | ox.Literal]:
    """All RDF terms that a property value may have of which `is_written` is true."""
    found: list[ox.NamedNode | ox.Literal] = [
        ox.Literal(text, datatype=ox.NamedNode(XSD + local)) for local in sorted(XSD_TYPES)
    ]
    with suppress(ValueError):  # the text has characters that no IRI has
        found.append(ox.NamedNode(fluent_iri(text)))
    return found


def fluent_lines(fluent: Fluent, vocabulary: Vocabulary) -> list[str]:
    """All N-Triples lines of a fluent, each with its line end."""
    subject = f"<{FLUENT}{fluent.name}>"
    lines = [f"{subject} {_TYPE} <{vocabulary.class_iri(fluent.class_name)}> .\n"]
    lines += _endpoint_lines(subject, fluent)
    lines += _property_lines(subject, fluent.properties, vocabulary)
    return lines


def timeless_lines(fluent: Fluent, vocabulary: Vocabulary) -> list[str]:
    """The N-Triples lines of a fluent without its end points: its class and its properties."""
    subject = f"<{FLUENT}{fluent.name}>"
    first = f"{subject} {_TYPE} <{vocabulary.class_iri(fluent.class_name)}> .\n"
    return [first, *_property_lines(subject, fluent.properties, vocabulary)]


def event_lines(event: FluentEvent, vocabulary: Vocabulary) -> tuple[list[str], list[str]]:
    """The N-Triples lines that an event adds and removes."""
    after = event.after
    if isinstance(event, FluentAdded):
        return fluent_lines(after, vocabulary), []
    before = event.before
    if isinstance(event, FluentCorrected):
        old, new = fluent_lines(before, vocabulary), fluent_lines(after, vocabulary)
        gone, come = set(old) - set(new), set(new) - set(old)
        return [line for line in new if line in come], [line for line in old if line in gone]
    subject = f"<{FLUENT}{after.name}>"
    added = _property_lines(subject, after.properties[len(before.properties) :], vocabulary)
    removed: list[str] = []
    if before.start != after.start or before.finish != after.finish:
        for old, new in zip(
            _endpoint_lines(subject, before), _endpoint_lines(subject, after), strict=True
        ):
            if old != new:
                removed.append(old)
                added.append(new)
    return added, removed


def fluent_from_triples(
    triples: Iterable[ox.Triple], vocabulary: Vocabulary, class_of: Callable[[str], str]
) -> Fluent:
    """The fluent that the triples of one subject describe.

    Args:
        triples: all triples of the fluent, in any order.
        vocabulary: gives IRIs their short names.
        class_of: class of the fluent that a reference names (RDF does not say it here).

    Raises:
        InvalidInput: there is no type, or an object that the data model cannot hold.
    """
    name = class_name = ""
    endpoints: dict[str, float] = {}
    properties: list[Property] = []
    for triple in triples:
        name = fluent_name(getattr(triple.subject, "value", "")) or ""
        predicate, target = triple.predicate.value, triple.object
        if predicate == RDF_TYPE and isinstance(target, ox.NamedNode):
            class_name = vocabulary.class_name(target.value)
        elif predicate in ENDPOINTS and isinstance(target, ox.Literal):
            endpoints[predicate] = float(target.value)
        else:
            properties.append(_property(vocabulary.short(predicate), target, class_of))
    if not name or not class_name:
        raise InvalidInput(
            f"triples of {name or 'an unnamed subject'!r} lack a class; add rdf:type"
        )
    s1, s2, f1, f2 = (endpoints.get(iri) for iri in ENDPOINTS)
    return Fluent(
        name, class_name, _interval(s1, s2), _interval(f1, f2), tuple(sorted(properties, key=repr))
    )


def _endpoint_lines(subject: str, fluent: Fluent) -> list[str]:
    bounds = (*fluent.start_bounds, *fluent.finish_bounds)
    return [
        f'{subject} <{iri}> "{_double(bound)}{_DOUBLE} .\n'
        for iri, bound in zip(ENDPOINTS, bounds, strict=True)
    ]


def _property_lines(
    subject: str, properties: Iterable[Property], vocabulary: Vocabulary
) -> list[str]:
    return [
        f"{subject} <{vocabulary.property_iri(p.name)}> {term(p, vocabulary)} .\n"
        for p in properties
    ]


def _double(value: float) -> str:
    # Python writes inf, which is no lexical form of xsd:double.
    if math.isinf(value):
        return "INF" if value > 0 else "-INF"
    return repr(value)


def _interval(earliest: float | None, latest: float | None) -> Interval:
    known = [None if v is None or math.isinf(v) else v for v in (earliest, latest)]
    return UNKNOWN if known == [None, None] else Interval(*known)


def _property(name: str, target: object, class_of: Callable[[str], str]) -> Property:
    if isinstance(target, ox.NamedNode):
        referred = fluent_name(target.value)
        if referred is not None:
            return Property(name, class_of(referred), referred)
    elif isinstance(target, ox.Literal) and target.datatype.value.startswith(XSD):
        return Property(name, "xsd:" + target.datatype.value[len(XSD) :], target.value)
    raise InvalidInput(
        f"property {name} has the object {target}; a fluent's values are XSD literals or fluents"
    )
