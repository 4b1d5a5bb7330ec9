"""Problems: RFC 9457 replies from FluentboardErrors."""

from __future__ import annotations

import logging
import uuid
from collections.abc import Sequence
from typing import Any

import orjson

from fluentboard.api.exchange import HeaderList, Reply
from fluentboard.errors import FluentboardError

logger = logging.getLogger(__name__)

PROBLEM_TYPE = "https://w3id.org/fluentboard/errors#"
"""What the `type` of every problem begins with; the code follows."""

MEDIA_TYPE = b"application/problem+json"


class MethodNotAllowed(FluentboardError):
    """The route exists, but not for this method."""

    code = "method-not-allowed"
    http_status = 405


def problem_document(error: FluentboardError) -> dict[str, Any]:
    """The error as an RFC 9457 problem.

    `detail` and `message` are the same text: the first is the standard's, the second the one that
    errors have in every other place. Particulars are members of their own.
    """
    return {
        **error.detail,
        "type": PROBLEM_TYPE + error.code,
        "title": (type(error).__doc__ or "").strip().splitlines()[0],
        "status": error.http_status,
        "detail": error.message,
        "code": error.code,
        "message": error.message,
    }


def problem_reply(error: FluentboardError, headers: HeaderList | None = None) -> Reply:
    """The reply that an error leads to."""
    extra: HeaderList = list(headers or [])
    if error.http_status == 401:
        extra.append((b"www-authenticate", b'Bearer realm="fluentboard"'))
    if isinstance(error, MethodNotAllowed):
        extra.append((b"allow", ", ".join(error.detail["allowed"]).encode()))
    if error.http_status == 503:
        extra.append((b"retry-after", b"1"))
    body = orjson.dumps(problem_document(error), default=str)
    return Reply(body, MEDIA_TYPE, error.http_status, extra)


def method_not_allowed(method: str, path: str, allowed: Sequence[str]) -> MethodNotAllowed:
    """The refusal of a method."""
    return MethodNotAllowed(
        f"{path} does not take {method}; it takes {', '.join(allowed)}", allowed=list(allowed)
    )


def internal_error(failure: BaseException, what: str) -> FluentboardError:
    """What the client is told of a failure that nobody foresaw: nothing but where to look.

    Args:
        failure: goes to the log with its traceback, never to the client.
        what: the request, for the log.
    """
    incident = uuid.uuid4().hex[:12]
    logger.error("incident %s: %s failed", incident, what, exc_info=failure)
    return FluentboardError(
        f"the board failed unexpectedly; its log has the cause under incident {incident}",
        incident=incident,
    )
