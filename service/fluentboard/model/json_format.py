"""Fluents as JSON objects, the form that REST, the journal and JSON Lines share."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, cast

from fluentboard.errors import FluentboardError, IntervalReversed, InvalidInput
from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.interval import UNKNOWN, Interval

_FLUENT_KEYS = frozenset(
    {"name", "class", "start", "finish", "properties", "version", "author", "created"}
)
_PROPERTY_KEYS = frozenset({"property", "type", "value"})


def fluent_to_json(fluent: Fluent) -> dict[str, Any]:
    """The fluent as a JSON object; unknown times are null."""
    return {
        "name": fluent.name,
        "class": fluent.class_name,
        "start": [fluent.start.earliest, fluent.start.latest],
        "finish": [fluent.finish.earliest, fluent.finish.latest],
        "properties": [
            {"property": p.name, "type": p.type, "value": p.value} for p in fluent.properties
        ],
        "version": fluent.version,
        "author": fluent.author,
        "created": fluent.created,
    }


def fluent_from_json(document: Any, where: str = "fluent") -> Fluent:
    """The fluent that a JSON object describes.

    `version`, `author` and `created` are read if present; a board sets its own.

    Args:
        document: parsed JSON: `name` and `class`, optionally `start` and `finish` as
            `[earliest, latest]` with null for unknown, and `properties` as objects
            `{"property", "type", "value"}` or triples `[property, type, value]`.
        where: names the document in errors, for example "fluent 3 of the batch".

    Raises:
        InvalidInput: or one of its subclasses, with what is wrong and where.
    """
    body = _mapping(document, where)
    unknown = body.keys() - _FLUENT_KEYS
    if unknown:
        raise InvalidInput(
            f"{where} has the unknown key {min(unknown)!r}; keys are "
            + ", ".join(sorted(_FLUENT_KEYS))
        )
    for key in ("name", "class"):
        if key not in body:
            raise InvalidInput(f"{where} has no {key!r}")
    name = body["name"]
    try:
        return Fluent(
            name,
            body["class"],
            interval_from_json(body.get("start"), "start"),
            interval_from_json(body.get("finish"), "finish"),
            properties_from_json(body.get("properties", ())),
            _count(body, "version"),
            str(body.get("author", "")),
            _count(body, "created"),
        )
    except FluentboardError as problem:
        raise type(problem)(f"{where} ({name!r}): {problem.message}", **problem.detail) from None


def interval_from_json(value: Any, what: str) -> Interval:
    """The interval that null, a number or `[earliest, latest]` stands for.

    Raises:
        InvalidInput: another shape; InvalidTime or IntervalReversed for the values themselves.
    """
    if value is None:
        return UNKNOWN
    try:
        if isinstance(value, (list, tuple)):
            pair = cast("Sequence[Any]", value)
            if len(pair) == 2:
                if pair[0] is None and pair[1] is None:
                    return UNKNOWN
                return Interval(pair[0], pair[1])
        elif isinstance(value, (int, float)) and not isinstance(value, bool):
            return Interval(value, value)
    except IntervalReversed as problem:
        raise IntervalReversed(f"{what}: {problem.message}") from None
    except FluentboardError as problem:
        raise type(problem)(f"{what}.{problem.message}") from None
    raise InvalidInput(
        f"{what} is {value!r}; give [earliest, latest] in seconds with null for unknown, or one "
        "number"
    )


def properties_from_json(value: Any) -> tuple[Property, ...]:
    """The properties that a JSON list describes.

    Raises:
        InvalidInput: an entry is neither `{"property", "type", "value"}` nor a list of three.
    """
    if not isinstance(value, (list, tuple)):
        raise InvalidInput(f"properties is {value!r}; give a list")
    found: list[Property] = []
    for entry in cast("Sequence[Any]", value):
        if isinstance(entry, dict):
            item = cast("dict[str, Any]", entry)
            if item.keys() == _PROPERTY_KEYS:
                found.append(Property(item["property"], item["type"], item["value"]))
                continue
        elif isinstance(entry, (list, tuple)):
            triple = cast("Sequence[Any]", entry)
            if len(triple) == 3:
                found.append(Property(triple[0], triple[1], triple[2]))
                continue
        raise InvalidInput(
            f'property {entry!r}: give {{"property": ..., "type": ..., "value": ...}} or '
            "[property, type, value]"
        )
    return tuple(found)


def _mapping(document: Any, where: str) -> Mapping[str, Any]:
    if not isinstance(document, dict):
        raise InvalidInput(f"{where} is {document!r}; give a JSON object with name and class")
    return cast("dict[str, Any]", document)


def _count(body: Mapping[str, Any], key: str) -> int:
    value = body.get(key, 0)
    if isinstance(value, bool) or not isinstance(value, int) or value < 0:
        raise InvalidInput(f"{key} is {value!r}; give a commit number")
    return value
