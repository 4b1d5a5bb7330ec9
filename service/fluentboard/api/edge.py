"""Edge: the outermost layer of the service. It finds the route, admits the caller, answers, counts.

One layer instead of a stack of middlewares, because a stack costs more than a point query does.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import time

from fluentboard.api.exchange import (
    Call,
    Disconnected,
    HeaderList,
    Message,
    Receive,
    Reply,
    Scope,
    Send,
    StreamedReply,
)
from fluentboard.api.metrics import Metrics
from fluentboard.api.operations import Operation, Router
from fluentboard.api.problems import internal_error, problem_reply
from fluentboard.api.security import Guard
from fluentboard.errors import FluentboardError, InvalidInput

logger = logging.getLogger(__name__)

_EXPOSED = b"ETag, Link, Location, X-Commit"
_ALLOWED_HEADERS = (
    b"Authorization, Content-Type, Idempotency-Key, If-Match, If-None-Match, Last-Event-ID, "
    b"X-Author"
)
# How much of a refused body is still read, and for how long: a client that has not finished sending
# would otherwise be cut off before it reads why.
_LINGER_BYTES = 4 * 2**20
_LINGER_S = 2.0


class Edge:
    """Answers HTTP requests by the operations of a router.

    Args:
        router: all routes.
        guard: admits callers.
        metrics: counts answers.
    """

    def __init__(self, router: Router, guard: Guard, metrics: Metrics) -> None:
        self._router = router
        self._guard = guard
        self._metrics = metrics

    async def serve(self, scope: Scope, receive: Receive, send: Send, path: str) -> None:
        """Answers one request.

        Args:
            scope: of the request, as ASGI says.
            receive: gives the body.
            send: takes the reply.
            path: decoded, without the root path.
        """
        began = time.perf_counter()
        call = Call(scope, receive, path)
        operation: Operation | None = None
        reply: Reply | StreamedReply
        head = call.method == "HEAD"
        if head:
            call.method = "GET"
        try:
            if call.method == "OPTIONS":
                reply = self._options(call)
            else:
                operation, call.arguments = self._router.find(call.method, path)
                if operation.role is not None:
                    call.principal = self._guard.admit(
                        call.headers, operation.role, changes=operation.role != "read"
                    )
                if operation.is_strict and scope["query_string"]:
                    _check_parameters(call, operation)
                reply = await operation.handler(call)
        except FluentboardError as error:
            reply = problem_reply(error)
            if call.has_long_unread_body:
                await self._refuse_body(call, reply, send)
                self._count(operation, reply.status, began)
                return
        except Disconnected:
            return
        except Exception as failure:
            reply = problem_reply(internal_error(failure, f"{call.method} {path}"))
        if b"origin" in call.headers:
            self._let_pages_read(call, reply)
        try:
            if isinstance(reply, Reply):
                await reply.send(_headers_only(send) if head else send)
            elif head:
                await send(reply.start())
                await send({"type": "http.response.body", "body": b""})
                await reply.drop()
            else:
                await _stream(reply, call, send)
        finally:
            self._count(operation, reply.status, began)

    def _count(self, operation: Operation | None, status: int, began: float) -> None:
        name = "none" if operation is None else operation.identifier
        self._metrics.record(name, status, time.perf_counter() - began)

    def _options(self, call: Call) -> Reply:
        methods = ", ".join(self._router.methods(call.path)).encode()
        headers: HeaderList = [(b"allow", methods)]
        origin = call.headers.get(b"origin", b"")
        if b"access-control-request-method" in call.headers and self._guard.allows_origin(origin):
            headers += [
                (b"access-control-allow-methods", methods),
                (b"access-control-allow-headers", _ALLOWED_HEADERS),
                (b"access-control-max-age", b"600"),
            ]
        return Reply(status=204, headers=headers)

    def _let_pages_read(self, call: Call, reply: Reply | StreamedReply) -> None:
        origin = call.headers[b"origin"]
        reply.headers.append((b"vary", b"Origin"))
        if self._guard.allows_origin(origin):
            reply.headers += [
                (b"access-control-allow-origin", origin),
                (b"access-control-expose-headers", _EXPOSED),
            ]

    async def _refuse_body(self, call: Call, reply: Reply, send: Send) -> None:
        """Sends a reply at once, reads a little more of the body, and closes the connection."""
        reply.headers.append((b"connection", b"close"))
        if b"origin" in call.headers:
            self._let_pages_read(call, reply)
        start = {
            "type": "http.response.start",
            "status": reply.status,
            "headers": reply.headers,
        }
        await send(start)
        await send({"type": "http.response.body", "body": reply.body, "more_body": True})
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(_LINGER_S):
                await call.drain(_LINGER_BYTES)
        await send({"type": "http.response.body", "body": b"", "more_body": False})


def _check_parameters(call: Call, operation: Operation) -> None:
    unknown = call.parameters().keys() - operation.parameter_names
    if unknown:
        known = ", ".join(sorted(operation.parameter_names)) or "none"
        raise InvalidInput(
            f"{operation.method} {operation.path} has no parameter {min(unknown)!r}; "
            f"parameters are: {known}",
            parameter=min(unknown),
        )


async def _stream(reply: StreamedReply, call: Call, send: Send) -> None:
    """Sends a long reply, and notices when nobody takes it any more."""
    leaving = asyncio.create_task(call.gone())
    try:
        if reply.is_endless:
            sending = asyncio.create_task(reply.send(send, leaving.done))
            try:
                await asyncio.wait((leaving, sending), return_when=asyncio.FIRST_COMPLETED)
            finally:
                sending.cancel()
                (ended,) = await asyncio.gather(sending, return_exceptions=True)
            if isinstance(ended, Exception) and not leaving.done():
                raise ended
            return
        await reply.send(send, leaving.done)
    finally:
        leaving.cancel()


def _headers_only(send: Send) -> Send:
    """Passes a reply on without its body: what HEAD asks for."""

    async def send_headers(message: Message) -> None:
        if message["type"] == "http.response.body":
            if message.get("more_body"):
                return
            message = {**message, "body": b""}
        await send(message)

    return send_headers
