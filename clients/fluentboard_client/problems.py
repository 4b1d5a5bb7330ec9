"""Problem documents of the board, turned back into the errors they were."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import Any, cast

from fluentboard.errors import FluentboardError

# RFC 9457's own members and the two that repeat them; every other member is a particular.
_STANDARD_MEMBERS = frozenset({"type", "title", "status", "detail", "instance", "code", "message"})


def error_from_problem(problem: Any, status: int, board: str) -> FluentboardError:
    """The error that a reply stands for, of the same class as the board raised.

    A code that this version of the client does not know gives a subclass of FluentboardError with
    that code, so callers can still tell errors apart by `code`.

    Args:
        problem: the parsed body of the reply, or None if it was not JSON.
        status: HTTP status of the reply.
        board: address of the board, for the message when the body explains nothing.
    """
    if not isinstance(problem, dict):
        return _class_of(f"http-{status}", status)(
            f"{board} answered {status} without saying why; is a board behind that address?"
        )
    members = cast("dict[str, Any]", problem)
    code = members.get("code") or str(members.get("type", "")).rpartition("#")[2]
    message = members.get("message") or members.get("detail") or members.get("title")
    particulars = {key: value for key, value in members.items() if key not in _STANDARD_MEMBERS}
    raised = _class_of(str(code or f"http-{status}"), status)(
        str(message or f"{board} answered {status}")
    )
    raised.detail.update(particulars)
    return raised


@cache
def _class_of(code: str, status: int) -> type[FluentboardError]:
    for known in _all_errors(FluentboardError):
        if known.code == code:
            return known
    return type("UnknownProblem", (FluentboardError,), {"code": code, "http_status": status})


def _all_errors(parent: type[FluentboardError]) -> Iterator[type[FluentboardError]]:
    yield parent
    for child in parent.__subclasses__():
        if child.__module__ == FluentboardError.__module__:
            yield from _all_errors(child)
