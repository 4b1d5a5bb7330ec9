"""The application: `create_app` wires board, settings and routes together, and nothing else."""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncGenerator
from contextlib import asynccontextmanager
from typing import Any

from fastapi import FastAPI, Request
from starlette.exceptions import HTTPException
from starlette.responses import Response
from starlette.routing import Match

from fluentboard import __version__
from fluentboard.api import query_editor
from fluentboard.api.changes import ChangeRoutes
from fluentboard.api.durable import DurableRoutes
from fluentboard.api.edge import Edge
from fluentboard.api.evaluation import Evaluator
from fluentboard.api.exchange import FORESEEN, Foreseen, Receive, Reply, Scope, Send
from fluentboard.api.fluents import FluentRoutes
from fluentboard.api.frames import FrameRoutes
from fluentboard.api.graph_store import GraphStoreRoutes
from fluentboard.api.keeping import KeepingRoutes
from fluentboard.api.live import LiveRoutes
from fluentboard.api.loading import reader_for
from fluentboard.api.metrics import Metrics
from fluentboard.api.objects import ObjectRoutes
from fluentboard.api.openapi import openapi_document
from fluentboard.api.operations import Operation, Router, no_such_path
from fluentboard.api.problems import internal_error, method_not_allowed, problem_reply
from fluentboard.api.rdf4j import Rdf4jRoutes
from fluentboard.api.security import Guard
from fluentboard.api.sepa import PATH as SEPA_PATH
from fluentboard.api.sepa import SepaRoutes
from fluentboard.api.sparql import SparqlRoutes
from fluentboard.api.subscriptions_documented import subscription_operations
from fluentboard.api.system import SystemRoutes
from fluentboard.api.transfer import TransferRoutes
from fluentboard.api.updating import Updater
from fluentboard.api.webhooks import Webhooks
from fluentboard.board.backup import SUBSCRIPTIONS
from fluentboard.board.blackboard import Blackboard
from fluentboard.board.subscriptions.durable import DurableSubscriptions
from fluentboard.board.subscriptions.registry import SubscriptionRegistry
from fluentboard.config import Settings
from fluentboard.errors import FluentboardError

# Not at once: a service that has just been started has more urgent things to do.
_WARM_UP_AFTER_S = 2.0


class BoardApp(FastAPI):
    """The board's routes; FastAPI behind them serves the OpenAPI document and routes of others.

    Attributes:
        operations: all routes of the board.
        guard: admits callers.
        metrics: counts requests.
        live: all WebSockets; whoever runs the app closes them before it stops.
        frames: requests that wait for a frame, likewise.
        changes: feeds that wait for commits, likewise.
        sepa: the WebSockets that speak SEPA's dialect; `live` holds them.
        sparql: queries, some of which the server answers without a call of the app.
    """

    def __init__(
        self,
        operations: list[Operation],
        guard: Guard,
        metrics: Metrics,
        live: LiveRoutes,
        frames: FrameRoutes,
        changes: ChangeRoutes,
        sepa: SepaRoutes,
        sparql: SparqlRoutes,
        **options: Any,
    ) -> None:
        super().__init__(
            title="fluentboard",
            version=__version__,
            docs_url=None,
            redoc_url=None,
            **options,
        )
        self.operations = operations
        self.guard = guard
        self.metrics = metrics
        self.live = live
        self.frames = frames
        self.changes = changes
        self.sepa = sepa
        self.sparql = sparql
        self._router = Router(operations)
        self._edge = Edge(self._router, guard, metrics)
        self._is_open = guard.is_open

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serves one request, WebSocket or lifespan."""
        kind = scope["type"]
        if kind == "lifespan":
            await super().__call__(scope, receive, send)
            return
        path: str = scope["path"]
        root: str = scope.get("root_path", "")
        if root and path.startswith(root):
            path = path[len(root) :]
        if path.startswith("/rdf4j-server/"):
            path = path.removeprefix("/rdf4j-server")
        if kind == "websocket" and path == "/subscriptions":
            await self.live.serve(scope, receive, send, path)
        elif kind == "websocket" and path == SEPA_PATH:
            await self.sepa.serve(scope, receive, send, path)
        elif kind == "http" and (self._router.knows(path) or not self._is_known_to_others(scope)):
            await self._edge.serve(scope, receive, send, path)
        else:
            await super().__call__(scope, receive, send)

    def at_once(
        self, query_string: bytes, headers: dict[bytes, bytes], scope: Scope
    ) -> Reply | None:
        """The reply to `GET /sparql` if it takes no waiting, and nothing is wrong with it.

        Args:
            query_string: of the request, still encoded.
            headers: by lower-case name.
            scope: takes what was found out, if there is no reply.
        """
        began = time.perf_counter()
        try:
            self.guard.admit(headers, "read", changes=False)
            reply = self.sparql.at_once(query_string, headers)
        except Exception:
            return None  # the usual way comes to the same point again, and tells what is wrong
        if isinstance(reply, Foreseen):
            scope[FORESEEN] = reply
            return None
        if reply is not None:
            self.metrics.record("query", reply.status, time.perf_counter() - began)
        return reply

    def _is_known_to_others(self, scope: Scope) -> bool:
        """FastAPI has a route for the path, if only for another method."""
        return any(route.matches(scope)[0] is not Match.NONE for route in self.router.routes)

    def openapi(self) -> dict[str, Any]:
        """The OpenAPI 3.1 document of the board, with routes added to this app by others."""
        if self.openapi_schema is None:
            document = openapi_document(self.operations, __version__, is_open=self._is_open)
            document["paths"].update(super().openapi().get("paths", {}))
            self.openapi_schema = document
        return self.openapi_schema


def create_app(blackboard: Blackboard, settings: Settings) -> BoardApp:
    """The service around a board. Whoever opened the board closes it, after the app has stopped.

    Args:
        blackboard: what is served.
        settings: of the service.
    """
    guard = Guard(settings)
    metrics = Metrics()
    data = settings.storage.data
    evaluator = Evaluator(
        blackboard,
        settings.limits,
        settings.security.service_endpoints,
        None if data is None else data / "readers",
    )
    read = reader_for(settings.security.load_hosts, settings.limits.body_max_bytes)
    updater = Updater(blackboard, settings.limits, guard, read, evaluator.try_out)
    registry = SubscriptionRegistry(
        blackboard, settings.subscriptions, outside=blackboard.statements()
    )
    durable = DurableSubscriptions(
        None if data is None else data / SUBSCRIPTIONS,
        settings.subscriptions.dead_letters_max,
    )
    webhooks = Webhooks(registry, durable, settings.subscriptions)
    live = LiveRoutes(registry, guard, settings.subscriptions, durable)
    sepa = SepaRoutes(registry, guard, settings.subscriptions, live)
    subscribing = DurableRoutes(
        blackboard, registry, durable, webhooks, live, settings.subscriptions, settings.limits
    )
    frames = FrameRoutes(None if data is None else data / "frames", settings.frames)
    changes = ChangeRoutes(blackboard)
    system = SystemRoutes(blackboard)
    graph_store = GraphStoreRoutes(blackboard, evaluator, updater, settings.limits)
    rdf4j = Rdf4jRoutes(blackboard, evaluator, updater, graph_store, settings.limits)
    sparql = SparqlRoutes(blackboard, evaluator, updater, settings.limits)
    operations = [
        *sparql.operations(),
        *graph_store.operations(),
        *rdf4j.operations(),
        *FluentRoutes(blackboard, settings.limits).operations(),
        *ObjectRoutes(blackboard).operations(),
        *TransferRoutes(blackboard, settings.limits).operations(),
        *changes.operations(),
        *subscription_operations(subscribing),
        *sepa.operations(),
        *frames.operations(),
        *KeepingRoutes(blackboard).operations(),
        *system.operations(),
        *query_editor.operations(),
        *metrics.operations(),
    ]
    system.list_routes(operations)
    metrics.gauge("commit", "The last commit that can be read.", lambda: blackboard.commit)
    metrics.gauge("fluents", "Fluents on the board.", lambda: len(blackboard))
    metrics.gauge("ready", "1 as `/ready` says, else 0.", lambda: blackboard.failure is None)
    metrics.gauge("websockets", "Open WebSockets.", lambda: live.connections)
    metrics.gauge("subscriptions", "Open subscriptions.", lambda: live.subscriptions)
    metrics.gauge("event_streams", "Open event streams.", lambda: live.streams)
    metrics.counter("webhook_posts", "Posts that were taken.", lambda: webhooks.delivered)
    metrics.counter("webhook_failures", "Posts that failed.", lambda: webhooks.failed)
    metrics.gauge("frame_bytes", "Size of the live frames kept.", lambda: frames.size_bytes)
    metrics.gauge("queries_running", "Queries being evaluated.", lambda: evaluator.running)
    metrics.counter("frames_dropped", "Frames that made room.", lambda: frames.dropped)
    metrics.gauge("query_processes", "Processes for queries.", lambda: evaluator.processes)
    metrics.counter("query_timeouts", "Queries that took too long.", lambda: evaluator.timeouts)

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncGenerator[None]:
        asyncio.get_running_loop().call_later(_WARM_UP_AFTER_S, evaluator.warm_up)
        await webhooks.start()
        yield
        await webhooks.close()
        frames.wake()
        changes.wake()
        await live.close()
        frames.close()
        registry.close()
        durable.close()
        updater.close()
        evaluator.close()

    app = BoardApp(
        operations, guard, metrics, live, frames, changes, sepa, sparql, lifespan=lifespan
    )
    app.add_exception_handler(HTTPException, _http_problem)
    app.add_exception_handler(Exception, _unforeseen_problem)
    return app


async def _http_problem(request: Request, failure: Exception) -> Response:
    """What Starlette itself refuses: paths nobody serves, methods that FastAPI's routes lack."""
    assert isinstance(failure, HTTPException)
    path = request.url.path
    if failure.status_code == 405:
        allowed = (failure.headers or {}).get("Allow", "").split(", ")
        return _response(method_not_allowed(request.method, path, allowed))
    if failure.status_code == 404:
        return _response(no_such_path(path))
    return _response(internal_error(failure, f"{request.method} {path}"))


async def _unforeseen_problem(request: Request, failure: Exception) -> Response:
    return _response(internal_error(failure, f"{request.method} {request.url.path}"))


def _response(error: FluentboardError) -> Response:
    reply = problem_reply(error)
    response = Response(reply.body, reply.status)
    response.raw_headers = reply.headers
    return response
