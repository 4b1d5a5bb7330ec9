"""Operations: the routes of the board, each with what its documentation needs."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from pydantic import BaseModel

from fluentboard.api.exchange import Handler
from fluentboard.api.problems import method_not_allowed
from fluentboard.config import Role
from fluentboard.errors import FluentboardError, UnknownResource

Schema = type[BaseModel] | Mapping[str, Any]
"""A pydantic model, or a JSON schema as it stands."""

_PART = re.compile(r"\{(\w+)\}")
_NOTHING: Mapping[str, str] = {}


@dataclass(frozen=True)
class Parameter:
    """A parameter of the query string, or a request header.

    Attributes:
        name: as it is written.
        description: one sentence.
        schema: JSON schema of its value.
        example: a value.
        place: `query` or `header`.
    """

    name: str
    description: str
    schema: Mapping[str, Any] = field(default_factory=lambda: {"type": "string"})
    example: Any = None
    place: Literal["query", "header"] = "query"


@dataclass(frozen=True)
class Content:
    """A body in one media type.

    Attributes:
        schema: of the body; None where it is text in a format of its own.
        example: a body.
    """

    schema: Schema | None = None
    example: Any = None


@dataclass(frozen=True)
class Answer:
    """A reply that is not a problem.

    Attributes:
        description: one sentence.
        content: by media type.
        headers: name to description.
    """

    description: str
    content: Mapping[str, Content] = field(default_factory=dict[str, Content])
    headers: Mapping[str, str] = field(default_factory=dict[str, str])


@dataclass(frozen=True)
class Operation:
    """One method of one path.

    Attributes:
        method: `GET` also answers `HEAD`.
        path: with `{name}` for a part that the handler gets as an argument.
        handler: answers.
        summary: one short sentence.
        description: what else there is to know, in Markdown.
        tag: the group it belongs to.
        role: what a token must permit; None for routes that need none even on a closed board.
        parameters: of the query string, and request headers beyond the ones of all routes.
        body: by media type; empty if there is none.
        body_description: one sentence.
        answers: by status.
        errors: what it raises beyond what every route can.
        is_strict: a parameter that is not listed is an error, so that a typing mistake in a filter
            does not silently list everything.
        identifier: unique; names the operation in OpenAPI and in the metrics.
        spans: the last variable part of the path may contain slashes.
    """

    method: str
    path: str
    handler: Handler
    identifier: str
    summary: str
    description: str = ""
    tag: str = "board"
    role: Role | None = "read"
    parameters: tuple[Parameter, ...] = ()
    body: Mapping[str, Content] = field(default_factory=dict[str, Content])
    body_description: str = ""
    answers: Mapping[int, Answer] = field(default_factory=dict[int, Answer])
    errors: tuple[type[FluentboardError], ...] = ()
    is_strict: bool = True
    spans: bool = False

    @property
    def parameter_names(self) -> frozenset[str]:
        """Names of the parameters in the query string."""
        return frozenset(p.name for p in self.parameters if p.place == "query")

    @property
    def path_names(self) -> tuple[str, ...]:
        """Names of the variable parts of the path."""
        return tuple(_PART.findall(self.path))


class Router:
    """Finds the operation of a method and path: one dictionary look-up for a fixed path.

    Args:
        operations: all of them.
    """

    def __init__(self, operations: Iterable[Operation]) -> None:
        self._fixed: dict[str, dict[str, Operation]] = {}
        self._patterns: list[tuple[re.Pattern[str], dict[str, Operation]]] = []
        variable: dict[str, dict[str, Operation]] = {}
        for operation in operations:
            table = variable if _PART.search(operation.path) else self._fixed
            table.setdefault(operation.path, {})[operation.method] = operation
        for path, methods in variable.items():
            pattern = _PART.sub(r"(?P<\1>[^/]+)", path)
            if any(operation.spans for operation in methods.values()):
                pattern = pattern.removesuffix("[^/]+)") + ".+)"
            self._patterns.append((re.compile(pattern), methods))
        # `/a/{x}/b` is found before `/a/{y}` with a y that spans slashes.
        self._patterns.sort(key=lambda entry: entry[0].pattern.endswith(".+)"))

    def knows(self, path: str) -> bool:
        """Some method is served on that path."""
        return self._methods(path) is not None

    def methods(self, path: str) -> list[str]:
        """What a path takes, `HEAD` and `OPTIONS` included.

        Raises:
            UnknownResource: nothing is served there.
        """
        found = self._methods(path)
        if found is None:
            raise no_such_path(path)
        return _allowed(found[0])

    def find(self, method: str, path: str) -> tuple[Operation, Mapping[str, str]]:
        """The operation, and the values of the variable parts of its path.

        Raises:
            UnknownResource: nothing is served on the path.
            MethodNotAllowed: something is, but not for this method.
        """
        found = self._methods(path)
        if found is None:
            raise no_such_path(path)
        methods, arguments = found
        operation = methods.get(method)
        if operation is None:
            raise method_not_allowed(method, path, _allowed(methods))
        return operation, arguments

    def _methods(self, path: str) -> tuple[dict[str, Operation], Mapping[str, str]] | None:
        methods = self._fixed.get(path)
        if methods is not None:
            return methods, _NOTHING
        for pattern, found in self._patterns:
            match = pattern.fullmatch(path)
            if match is not None:
                return found, match.groupdict()
        return None


def no_such_path(path: str) -> UnknownResource:
    """The refusal of a path."""
    return UnknownResource(f"nothing is served at {path}; GET / lists what is", path=path)


def _allowed(methods: Iterable[str]) -> list[str]:
    found = {*methods, "OPTIONS"}
    if "GET" in found:
        found.add("HEAD")
    return sorted(found)
