"""System: health, readiness, classes, and the index of the service."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from pydantic import BaseModel

from fluentboard import __version__
from fluentboard.api.exchange import Call, Reply, json_reply
from fluentboard.api.negotiation import Offer, negotiated
from fluentboard.api.operations import Answer, Content, Operation
from fluentboard.api.schemas.upkeep import Classes, Health, Readiness
from fluentboard.board.blackboard import Blackboard
from fluentboard_ontology import PREFIXES

_INDEX_OFFERS = (Offer("application/json", "json"), Offer("text/html", "html"))


class SystemRoutes:
    """`/`, `/health`, `/ready` and `/classes`.

    Args:
        board: whose state is told.
    """

    def __init__(self, board: Blackboard) -> None:
        self._board = board
        self._listed: Sequence[Operation] = ()
        self._classes: tuple[object, Reply] | None = None

    def list_routes(self, operations: Sequence[Operation]) -> None:
        """Says what the index lists: all routes of the service."""
        self._listed = operations

    async def index(self, call: Call) -> Reply:
        """`GET /`."""
        offer = negotiated(call.header(b"accept"), _INDEX_OFFERS)
        if offer.format == "html":
            page = self._index_page(call.root_path)
            return Reply(page.encode(), b"text/html; charset=utf-8", 200, list(_PAGE_HEADERS))
        routes = [{"method": o.method, "path": o.path, "summary": o.summary} for o in self._listed]
        return json_reply(
            {
                "name": "fluentboard",
                "version": __version__,
                "commit": self._board.commit,
                "documentation": call.root_path + "/openapi.json",
                "routes": routes,
            }
        )

    async def health(self, call: Call) -> Reply:
        """`GET /health`."""
        return json_reply({"status": "up", "version": __version__})

    async def ready(self, call: Call) -> Reply:
        """`GET /ready`."""
        failure = self._board.failure
        return json_reply(
            {
                "status": "ready" if failure is None else "failed",
                "commit": self._board.commit,
                "fluents": len(self._board),
                "failure": failure,
            },
            200 if failure is None else 503,
        )

    async def classes(self, call: Call) -> Reply:
        """`GET /classes`."""
        vocabulary = self._board.vocabulary
        # A vocabulary never changes: a new ontology makes a new one.
        if self._classes is None or self._classes[0] is not vocabulary:
            found = [
                {
                    "name": vocabulary.short(iri),
                    "iri": iri,
                    "label": vocabulary.label(iri),
                    "superclasses": sorted(
                        vocabulary.short(above)
                        for above in vocabulary.superclasses(iri)
                        if above != iri
                    ),
                }
                for iri in vocabulary.classes()
            ]
            reply = json_reply({"classes": found, "prefixes": dict(PREFIXES)})
            self._classes = (vocabulary, reply)
        return Reply(self._classes[1].body)

    def operations(self) -> list[Operation]:
        """The routes, documented."""
        return [
            Operation(
                "GET",
                "/",
                self.index,
                "getIndex",
                "What is served here",
                tag="operation",
                role=None,
                answers={
                    200: Answer(
                        "All routes.",
                        {
                            "application/json": Content({"type": "object"}),
                            "text/html": Content({"type": "string"}),
                        },
                    )
                },
                is_strict=False,
            ),
            Operation(
                "GET",
                "/health",
                self.health,
                "getHealth",
                "The process is up",
                tag="operation",
                role=None,
                answers={200: Answer("It is.", _json(Health))},
            ),
            Operation(
                "GET",
                "/ready",
                self.ready,
                "getReadiness",
                "The board takes reads and writes",
                tag="operation",
                role=None,
                answers={
                    200: Answer("It does.", _json(Readiness)),
                    503: Answer("It does not; `failure` says why.", _json(Readiness)),
                },
            ),
            Operation(
                "GET",
                "/classes",
                self.classes,
                "listClasses",
                "All classes that a fluent may have",
                "From the built-in ontologies and those that the service was started with.",
                tag="vocabulary",
                answers={200: Answer("The classes.", _json(Classes))},
            ),
        ]

    def _index_page(self, root_path: str) -> str:
        rows = "".join(
            f"<tr><td>{o.method}<td><code>{escape(o.path)}</code><td>{escape(o.summary)}"
            for o in self._listed
        )
        return (
            "<!doctype html><html lang=en><meta charset=utf-8><title>fluentboard</title>"
            "<style>body{font-family:sans-serif;margin:2em}td{padding:.2em 1em .2em 0}</style>"
            f"<h1>fluentboard {escape(__version__)}</h1>"
            f"<p>{len(self._board):,} fluents at commit {self._board.commit:,}. The routes are "
            f"described in <a href='{escape(root_path)}/openapi.json'>openapi.json</a>; queries "
            f"are asked in the <a href='{escape(root_path)}/editor'>editor</a>.</p>"
            f"<table>{rows}</table>"
        )


_PAGE_HEADERS = (
    (b"content-security-policy", b"default-src 'none'; style-src 'unsafe-inline'"),
    (b"vary", b"Accept"),
)


def _json(schema: type[BaseModel]) -> dict[str, Content]:
    return {"application/json": Content(schema)}
