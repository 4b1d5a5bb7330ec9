"""OpenAPI: the 3.1 document of all operations."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, cast

from pydantic.json_schema import models_json_schema

from fluentboard.api.operations import Answer, Content, Operation, Parameter
from fluentboard.api.schemas import fluents, subscriptions, trajectories, upkeep
from fluentboard.api.schemas.fluents import Schema
from fluentboard.api.schemas.upkeep import ProblemJson
from fluentboard.errors import (
    FluentboardError,
    InvalidInput,
    NotAllowed,
    NotAuthenticated,
)

_REFERENCE = "#/components/schemas/{model}"
_PROBLEM = "application/problem+json"
_TAGS = {
    "fluents": "Facts with uncertain intervals: assert, list, read, refine, end.",
    "sparql": "The SPARQL 1.1 protocol.",
    "transfer": "Everything in, everything out.",
    "live": "Queries that tell what changes.",
    "frames": "Images of sensors on their way to the workers; they never become fluents.",
    "vocabulary": "What the loaded ontologies declare.",
    "operation": "Running the service.",
}


def openapi_document(
    operations: Sequence[Operation], version: str, *, is_open: bool
) -> dict[str, Any]:
    """The document.

    Args:
        operations: all routes.
        version: of the service.
        is_open: no token is needed.
    """
    paths: dict[str, dict[str, Any]] = {}
    for operation in operations:
        item = paths.setdefault(operation.path, {})
        item[operation.method.lower()] = _operation(operation, is_open=is_open)
    used = {operation.tag for operation in operations}
    return {
        "openapi": "3.1.0",
        "info": {
            "title": "fluentboard",
            "version": version,
            "summary": "A robot's long-term memory.",
            "description": "A blackboard of facts with uncertain validity intervals. Every reply "
            "that is not what was asked for is an RFC 9457 problem with a stable `code`.",
            "license": {"name": "Apache-2.0", "identifier": "Apache-2.0"},
        },
        "tags": [{"name": n, "description": d} for n, d in _TAGS.items() if n in used],
        "paths": paths,
        "components": {
            "schemas": _schemas(),
            "securitySchemes": {
                "token": {
                    "type": "http",
                    "scheme": "bearer",
                    "description": "Needed if the board has tokens.",
                }
            },
        },
    }


def _operation(operation: Operation, *, is_open: bool) -> dict[str, Any]:
    found: dict[str, Any] = {
        "operationId": operation.identifier,
        "summary": operation.summary,
        "tags": [operation.tag],
        "parameters": [
            *(
                {"name": name, "in": "path", "required": True, "schema": {"type": "string"}}
                for name in operation.path_names
            ),
            *(_parameter(parameter) for parameter in operation.parameters),
        ],
        "responses": {
            **{str(status): _answer(answer) for status, answer in operation.answers.items()},
            **_problems(operation),
        },
    }
    if operation.description:
        found["description"] = operation.description
    if operation.body:
        found["requestBody"] = {
            "description": operation.body_description or operation.summary + ".",
            "required": operation.identifier != "endFluent",
            "content": _contents(operation.body),
        }
    if operation.role is not None:
        found["x-role"] = operation.role
        found["security"] = [{}, {"token": []}] if is_open else [{"token": []}]
    else:
        found["security"] = []
    return found


def _parameter(parameter: Parameter) -> dict[str, Any]:
    found: dict[str, Any] = {
        "name": parameter.name,
        "in": parameter.place,
        "description": parameter.description,
        "schema": dict(parameter.schema),
    }
    if parameter.example is not None:
        found["example"] = parameter.example
    return found


def _answer(answer: Answer) -> dict[str, Any]:
    found: dict[str, Any] = {"description": answer.description}
    if answer.content:
        found["content"] = _contents(answer.content)
    if answer.headers:
        found["headers"] = {
            name: {"description": description, "schema": {"type": "string"}}
            for name, description in answer.headers.items()
        }
    return found


def _problems(operation: Operation) -> dict[str, Any]:
    errors: list[type[FluentboardError]] = list(operation.errors)
    if operation.is_strict and InvalidInput not in errors:
        errors.append(InvalidInput)
    if operation.role is not None:
        errors += [NotAuthenticated, NotAllowed]
    by_status: dict[int, list[type[FluentboardError]]] = {}
    for error in errors:
        by_status.setdefault(error.http_status, []).append(error)
    return {
        **{
            str(status): _problem([f"`{e.code}`: {_summary(e)}" for e in dict.fromkeys(found)])
            for status, found in sorted(by_status.items())
        },
        "default": _problem(["Any other problem."]),
    }


def _problem(lines: Iterable[str]) -> dict[str, Any]:
    return {
        "description": "\n\n".join(lines),
        "content": {_PROBLEM: {"schema": {"$ref": _REFERENCE.format(model="ProblemJson")}}},
    }


def _contents(contents: Mapping[str, Content]) -> dict[str, Any]:
    return {media_type: _content(content) for media_type, content in contents.items()}


def _content(content: Content) -> dict[str, Any]:
    found: dict[str, Any] = {}
    schema = content.schema
    if isinstance(schema, type):
        found["schema"] = {"$ref": _REFERENCE.format(model=schema.__name__)}
    elif schema is not None:
        found["schema"] = dict(schema)
    if content.example is not None:
        found["example"] = content.example
    return found


def _schemas() -> dict[str, Any]:
    models = [
        value
        for module in (fluents, trajectories, upkeep, subscriptions)
        for value in vars(module).values()
        if isinstance(value, type)
        and issubclass(value, Schema | ProblemJson)
        and value.__module__ == module.__name__
        and value is not Schema
    ]
    _, document = models_json_schema(
        [(model, "validation") for model in models], ref_template=_REFERENCE
    )
    return cast("dict[str, Any]", document["$defs"])


def _summary(error: type[FluentboardError]) -> str:
    return (error.__doc__ or "").strip().splitlines()[0]
