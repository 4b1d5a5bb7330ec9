"""Whatever Schemathesis makes of the OpenAPI document, the service answers as the document says."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
import schemathesis
from hypothesis import HealthCheck, Phase, given
from hypothesis import settings as example_settings
from schemathesis import checks
from schemathesis.specs.openapi import checks as openapi_checks

from fluentboard.api.app import create_app
from fluentboard.api.exchange import Receive, Scope, Send
from fluentboard.board.blackboard import Blackboard
from fluentboard.config import load_settings

# What no schema can say (a name that exists, a time that is after another) may be refused, and
# parameters that mean nothing together are not looked at, so acceptance and rejection are not
# checked here.
_CHECKS: Any = checks
_OPENAPI: Any = openapi_checks
CHECKS: list[Any] = [
    _CHECKS.not_a_server_error,
    _OPENAPI.status_code_conformance,
    _OPENAPI.content_type_conformance,
    _OPENAPI.response_schema_conformance,
    _OPENAPI.response_headers_conformance,
    _OPENAPI.allow_header_conformance,
]
# They answer when something happens.
WAITING = ("GET /frames/{sensor}", "GET /subscriptions")
TEXTS = (
    "application/sparql-query",
    "application/sparql-update",
    "application/trig",
    "application/n-triples",
    "application/n-quads",
    "application/rdf+xml",
    "application/ld+json",
    "application/x-ndjson",
    "application/x-rdftransaction",
    "text/turtle",
    "text/n3",
)


def _as_it_is(_: object, value: Any) -> bytes:
    return value if isinstance(value, bytes) else str(value).encode("utf-8", "replace")


for media_type in TEXTS:
    register: Any = schemathesis.serializer(media_type)
    register(_as_it_is)


@pytest.fixture(scope="module")
def document() -> Iterator[Any]:
    with Blackboard.open(None) as board:
        settings = load_settings(flags={"limits.body_max_bytes": 100_000})
        nowhere = settings.storage.model_copy(update={"data": None})
        app = create_app(board, settings.model_copy(update={"storage": nowhere}))

        async def without_lifespan(scope: Scope, receive: Receive, send: Send) -> None:
            # Schemathesis starts and stops an application for every request.
            if scope["type"] != "lifespan":
                await app(scope, receive, send)
                return
            for kind in ("startup", "shutdown"):
                await receive()
                await send({"type": f"lifespan.{kind}.complete"})

        load: Any = schemathesis.openapi.from_asgi
        yield load("/openapi.json", without_lifespan)


def test_every_reply_is_as_documented(document: Any) -> None:
    failures: list[str] = []
    for found in document.get_all_operations():
        operation = found.ok()
        if operation.label in WAITING:
            continue

        @example_settings(
            max_examples=4,
            deadline=None,
            database=None,
            suppress_health_check=[HealthCheck.too_slow, HealthCheck.filter_too_much],
            phases=[Phase.explicit, Phase.generate],
        )
        @given(case=operation.as_strategy())
        def check(case: Any) -> None:
            case.call_and_validate(checks=CHECKS)

        try:
            check()
        except (Exception, BaseExceptionGroup) as failure:
            failures.append(f"{operation.label}: {failure}")
    assert not failures, "\n\n".join(failures)
