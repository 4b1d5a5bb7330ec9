"""Mistakes: where in a query the engine stumbled, in words that fit on a line (pure)."""

from __future__ import annotations

import re

from fluentboard.errors import InvalidQuery

# How much of a query is shown on either side of a mistake, and how many alternatives.
_CONTEXT = 30
_EXPECTED_MAX = 8

_POSITION = re.compile(r"error at (\d+):(\d+)")


def located(problem: InvalidQuery, query: str, offset: int = 0) -> InvalidQuery:
    """The problem with the place in the query, instead of all that could have stood there.

    Args:
        problem: what the engine says.
        query: as the client sent it.
        offset: how many characters the engine saw before it.
    """
    position = _POSITION.search(problem.message)
    if position is None:
        return problem
    line, column = int(position[1]), int(position[2])
    if line == 1:
        column = max(1, column - offset)
    # A mistake at the end may be behind the last line break.
    text = [*query.split("\n"), ""][min(line - 1, query.count("\n") + 1)]
    before, _, expected = problem.message.partition("expected one of")
    few = expected.count(",") < _EXPECTED_MAX
    begin = max(0, column - 1 - _CONTEXT)
    near = text[begin : column - 1 + _CONTEXT]
    message = problem.message if few else before.rstrip(": ")
    message = _POSITION.sub(f"error at {line}:{column}", message)
    return InvalidQuery(
        f"{message} (line {line}, column {column}, near {near!r})",
        **{**problem.detail, "line": line, "column": column},
    )
