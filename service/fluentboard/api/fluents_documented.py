"""The documentation of the fluent routes: parameters, bodies, replies and examples."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel

from fluentboard.api.exchange import Handler
from fluentboard.api.operations import Answer, Content, Operation, Parameter
from fluentboard.api.parameters import RELATIONS
from fluentboard.api.schemas.fluents import (
    AssertReceipt,
    ChangeReceipt,
    CommandBatch,
    CommandsReceipt,
    EndingBody,
    FluentBody,
    FluentJson,
    FluentPage,
    History,
    RefinementBody,
)
from fluentboard.errors import (
    FluentExists,
    IdempotencyConflict,
    IntervalReversed,
    InvalidInput,
    InvalidName,
    InvalidTime,
    InvalidValue,
    InvalidYaml,
    NotAcceptable,
    NotARefinement,
    ShapeViolation,
    StorageFailed,
    TooLarge,
    UnknownClass,
    UnknownFluent,
    UnsupportedMediaType,
    VersionMismatch,
)

MERGE_PATCH = "application/merge-patch+json"

_MUG: dict[str, Any] = {
    "name": "on4",
    "class": "On",
    "start": [None, None],
    "finish": [119.621, 161.817],
    "properties": [
        {"property": "hasPhysicalEntity", "type": "Mug", "value": "mug1"},
        {"property": "isInitialKnowledge", "type": "xsd:boolean", "value": True},
    ],
}
_MUG_TOLD = {**_MUG, "version": 7, "author": "mapping", "created": 3}
_YAML = """!Fluent
Class_Instance: [On, on4]
StartTime: [0.0, 0.0]
FinishTime: [119.621, 161.817]
Properties:
  - [hasPhysicalEntity, Mug, mug1]
"""
_TEXT = {"type": "string"}
_NUMBER = {"type": "integer", "minimum": 0}
_FLAG = {"type": "boolean"}

_AUTHOR = Parameter(
    "X-Author",
    "Whom the commit is attributed to, on a board without tokens; else it is the token's name.",
    example="mapping",
    place="header",
)
_KEY = Parameter(
    "Idempotency-Key",
    "Unique per request, such as a UUID: sending the request again with the same key gives the "
    "first answer again and changes nothing.",
    place="header",
)
_IF_MATCH = Parameter(
    "If-Match",
    "ETag of the fluent as it was read; 412 if somebody changed it since.",
    example='"7"',
    place="header",
)
_AS_OF = Parameter(
    "asof",
    "As the board believed after this commit, or at a time: 2026-05-01T12:00:00Z, or seconds with "
    "a decimal point.",
    example="17",
)
_COMMIT = {"X-Commit": "Number of the commit."}
_VERSION = {"ETag": "Version of the fluent, for If-Match."}

_FLUENT_ERRORS = (
    InvalidInput,
    InvalidName,
    InvalidTime,
    InvalidValue,
    IntervalReversed,
    UnknownClass,
    TooLarge,
    UnsupportedMediaType,
    StorageFailed,
    IdempotencyConflict,
    ShapeViolation,
)


def operations(handlers: Mapping[str, Handler]) -> list[Operation]:
    """The fluent routes.

    Args:
        handlers: by identifier of the operation.
    """
    return [
        Operation(
            "POST",
            "/fluents",
            handlers["assertFluents"],
            "assertFluents",
            "Assert fluents",
            "All of them or none. Asserting what the board holds already changes nothing. With "
            "`merge=true` a fluent that exists is refined by what is said of it.",
            tag="fluents",
            role="write",
            parameters=(
                Parameter("merge", "Refine fluents that exist, instead of 409.", _FLAG, True),
                _AUTHOR,
                _KEY,
            ),
            body={
                "application/json": Content(_any_of_fluents(), {"fluents": [_MUG]}),
                "application/yaml": Content(_TEXT, _YAML),
                "application/x-ndjson": Content(_TEXT),
            },
            body_description='One fluent, a list, `{"fluents": [...]}`, `!Fluent` documents, or '
            "one JSON object per line.",
            answers={
                201: Answer(
                    "At least one fluent is new.",
                    _json(
                        AssertReceipt,
                        {
                            "commit": 3,
                            "fluents": [{"name": "on4", "version": 3, "created": 3}],
                            "warnings": ["'on4' refers to 'mug1', which is not on the board"],
                        },
                    ),
                    {**_COMMIT, **_VERSION, "Location": "Address of a single asserted fluent."},
                ),
                200: Answer("None is new.", _json(AssertReceipt), _COMMIT),
            },
            errors=(*_FLUENT_ERRORS, InvalidYaml, FluentExists, NotARefinement),
        ),
        Operation(
            "POST",
            "/commands",
            handlers["runCommands"],
            "runCommands",
            "Run a mixed batch",
            "Asserts, refines and ends, all of it or nothing, as one commit.",
            tag="fluents",
            role="write",
            parameters=(_AUTHOR, _KEY),
            body=_json(
                CommandBatch,
                {
                    "commands": [
                        {"op": "end", "name": "on4", "finish": [119.6, 161.8], "version": 3},
                        {"op": "assert", "fluent": {**_MUG, "name": "on5"}},
                        {
                            "op": "refine",
                            "name": "mug1",
                            "properties": [["hasPose", "Pose", "pose7"]],
                        },
                    ]
                },
            ),
            answers={200: Answer("What happened.", _json(CommandsReceipt), _COMMIT)},
            errors=(
                *_FLUENT_ERRORS,
                FluentExists,
                NotARefinement,
                UnknownFluent,
                VersionMismatch,
            ),
        ),
        Operation(
            "GET",
            "/fluents",
            handlers["listFluents"],
            "listFluents",
            "List fluents",
            "In the order of their first assertion, page by page. All filters that are given must "
            "hold. Without a time, ended fluents are listed too.",
            tag="fluents",
            parameters=_filters(),
            answers={
                200: Answer(
                    "A page.",
                    {
                        **_json(
                            FluentPage,
                            {"fluents": [_MUG_TOLD], "next": None, "commit": 9},
                        ),
                        "application/yaml": Content(_TEXT, _YAML),
                        "application/x-ndjson": Content(_TEXT),
                    },
                    {
                        "X-Commit": "All of the page is as believed after this commit.",
                        "Link": 'Address of the next page, with `rel="next"`.',
                    },
                )
            },
            errors=(
                InvalidInput,
                InvalidTime,
                IntervalReversed,
                UnknownClass,
                UnknownFluent,
                NotAcceptable,
            ),
        ),
        Operation(
            "GET",
            "/fluents/{name}",
            handlers["readFluent"],
            "readFluent",
            "Read a fluent",
            tag="fluents",
            parameters=(
                _AS_OF,
                Parameter(
                    "If-None-Match",
                    "ETag that is held already; 304 if it is current.",
                    place="header",
                ),
            ),
            answers={
                200: Answer(
                    "The fluent.",
                    {
                        **_json(FluentJson, _MUG_TOLD),
                        "application/yaml": Content(_TEXT, _YAML),
                    },
                    _VERSION,
                ),
                304: Answer("It has not changed.", headers=_VERSION),
            },
            errors=(UnknownFluent, InvalidInput, NotAcceptable),
        ),
        Operation(
            "PATCH",
            "/fluents/{name}",
            handlers["refineFluent"],
            "refineFluent",
            "Refine a fluent",
            "Narrows an interval or adds property values. What is left out stays.",
            tag="fluents",
            role="write",
            parameters=(_IF_MATCH, _AUTHOR, _KEY),
            body=_json(RefinementBody, {"finish": [119.621, 121.0]}),
            answers={200: _change()},
            errors=(*_FLUENT_ERRORS, UnknownFluent, NotARefinement, VersionMismatch),
        ),
        Operation(
            "POST",
            "/fluents/{name}/end",
            handlers["endFluent"],
            "endFluent",
            "End a fluent",
            "Says when it ceased to hold. It stays on the board.",
            tag="fluents",
            role="write",
            parameters=(_IF_MATCH, _AUTHOR, _KEY),
            body=_json(EndingBody, {"at": [119.621, 161.817]}),
            body_description="May be empty: the fluent ends now.",
            answers={200: _change()},
            errors=(*_FLUENT_ERRORS, UnknownFluent, NotARefinement, VersionMismatch),
        ),
        Operation(
            "PUT",
            "/fluents/{name}",
            handlers["correctFluent"],
            "correctFluent",
            "Correct a fluent by force",
            "Replaces class, intervals and properties against the rules. For admins, with a reason "
            "that the journal keeps.",
            tag="fluents",
            role="admin",
            parameters=(
                Parameter("reason", "Why.", example="wrong calibration until 12:30"),
                _IF_MATCH,
                _AUTHOR,
                _KEY,
            ),
            body=_json(FluentBody, _MUG),
            answers={200: _change()},
            errors=(*_FLUENT_ERRORS, UnknownFluent, VersionMismatch),
        ),
        Operation(
            "GET",
            "/fluents/{name}/history",
            handlers["readHistory"],
            "readHistory",
            "Read all changes of a fluent",
            tag="fluents",
            answers={
                200: Answer(
                    "Its changes, oldest first.",
                    _json(
                        History,
                        {
                            "name": "on4",
                            "history": [
                                {
                                    "event": "added",
                                    "fluent": {**_MUG_TOLD, "version": 3},
                                    "commit": 3,
                                    "author": "mapping",
                                    "wall_s": 1760000000.25,
                                    "reason": "",
                                }
                            ],
                        },
                    ),
                )
            },
            errors=(UnknownFluent,),
        ),
    ]


def _filters() -> tuple[Parameter, ...]:
    return (
        Parameter("class", "Of this class or a subclass of it.", _TEXT, "Mug"),
        Parameter(
            "at", "Holds at this time in seconds; `now` is the board's present.", _TEXT, "now"
        ),
        Parameter("during", "Holds at some moment of the window [from, to).", _TEXT, "100.0,160.5"),
        Parameter(
            "relation",
            "Stands in this relation to what `to` names.",
            {"type": "string", "enum": list(RELATIONS)},
            "during",
        ),
        Parameter("to", "A fluent's name, a time, or a window from,to.", _TEXT, "100.0,160.5"),
        Parameter("certainly", "Only what surely holds then.", _FLAG, True),
        Parameter("possibly", "Also what may hold then; the default.", _FLAG, True),
        Parameter("property", "Has a value of this property.", _TEXT, "hasPassiveObject"),
        Parameter("value", "Has this value of `property`.", _TEXT, "mug1"),
        Parameter("open", "Nothing is known about its finish, or something is.", _FLAG, True),
        _AS_OF,
        Parameter("limit", "Fluents per page; 100 if not given.", {**_NUMBER, "minimum": 1}, 100),
        Parameter("cursor", "`next` of the page before.", _NUMBER, 100),
    )


def _change() -> Answer:
    return Answer(
        "The fluent as it stands now.",
        _json(ChangeReceipt, {"commit": 7, "fluent": _MUG_TOLD, "warnings": list[str]()}),
        {**_COMMIT, **_VERSION},
    )


def _any_of_fluents() -> dict[str, Any]:
    one = {"$ref": "#/components/schemas/FluentBody"}
    batch = {"$ref": "#/components/schemas/FluentBatch"}
    return {"anyOf": [batch, one, {"type": "array", "items": one}]}


def _json(schema: type[BaseModel], example: Any = None) -> dict[str, Content]:
    return {"application/json": Content(schema, example)}
