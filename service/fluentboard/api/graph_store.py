"""The Graph Store HTTP Protocol: whole graphs read, replaced, extended and removed."""

from __future__ import annotations

import hashlib
import re
import uuid
from collections.abc import Sequence
from urllib.parse import quote, urljoin

import pyoxigraph as ox

from fluentboard.api import parameters
from fluentboard.api.answering import GRAPH_OFFERS, Question, result_content
from fluentboard.api.evaluation import Evaluator
from fluentboard.api.exchange import Call, HeaderList, Reply, StreamedReply, json_reply
from fluentboard.api.operations import Answer, Content, Operation, Parameter
from fluentboard.api.rdf4j_parameters import check_repository
from fluentboard.api.rdf_bodies import MULTIPART, PROPER_FORMATS, InvalidRdf, triples_in
from fluentboard.api.sparql import own_address, result_reply, update_receipt
from fluentboard.api.updating import Updater
from fluentboard.api.writing import commit_header
from fluentboard.board.blackboard import Blackboard
from fluentboard.board.events import Commit
from fluentboard.board.graphs import CHANGES_MAX
from fluentboard.board.statement_rules import ClassInUse, ProtectedStatement
from fluentboard.board.update_operations import (
    Clear,
    Create,
    Graph,
    InsertStatements,
    in_graph,
)
from fluentboard.board.update_operations import Operation as Change
from fluentboard.config import LimitSettings
from fluentboard.errors import (
    FluentsAreReadOnly,
    IdempotencyConflict,
    InvalidInput,
    NotAcceptable,
    QueryTimeout,
    StorageFailed,
    TooLarge,
    UnknownResource,
    UnsupportedMediaType,
)

PATH = "/rdf-graph-store"

_SCHEME = re.compile(r"[A-Za-z][A-Za-z0-9+.-]*:")
_DEFAULT = ox.DefaultGraph()
_EVERYTHING = "CONSTRUCT { ?s ?p ?o } WHERE { ?s ?p ?o }"
_WRITE_ERRORS = (
    InvalidInput,
    InvalidRdf,
    FluentsAreReadOnly,
    ProtectedStatement,
    ClassInUse,
    IdempotencyConflict,
    TooLarge,
    UnsupportedMediaType,
    QueryTimeout,
    StorageFailed,
)


class GraphStoreRoutes:
    """Graphs by `?graph=IRI` or `?default`, or by addresses of their own below the store's.

    Args:
        board: what is served.
        evaluator: answers queries.
        updater: carries out changes.
        limits: on the length of a request.
    """

    def __init__(
        self, board: Blackboard, evaluator: Evaluator, updater: Updater, limits: LimitSettings
    ) -> None:
        self._board = board
        self._evaluator = evaluator
        self._updater = updater
        self._limits = limits

    async def get(self, call: Call) -> Reply | StreamedReply:
        """All that a graph says."""
        graph = _named(_target(call))
        if isinstance(graph, ox.NamedNode):
            if not self._board.graphs.has_graph(graph):
                raise _no_graph(graph)
            question = Question(_EVERYTHING, call.header(b"accept"), (graph.value,))
        else:
            question = Question(_EVERYTHING, call.header(b"accept"))
        return result_reply(await self._evaluator.evaluate(question, call))

    async def put(self, call: Call) -> Reply:
        """Has a graph say what the body says, and nothing else."""
        graph = _named(_target(call))
        body = await call.body(self._limits.body_max_bytes)

        def changes() -> Sequence[Change]:
            return [Clear(graph, is_silent=True), *_made(graph), _said(call, graph, body)]

        commit = await self._updater.change(call, changes, _fingerprint(call, graph, body))
        headers: HeaderList = [commit_header(commit.number)]
        if _is_new(commit, graph):
            return json_reply(update_receipt(commit), 201, headers)
        return Reply(status=204, headers=headers)

    async def post(self, call: Call) -> Reply:
        """Has a graph say what the body says, too; without a graph, a new one."""
        target = _target(call)
        is_new = target is None
        graph = target or ox.NamedNode(own_address(call, f"{call.path}/{uuid.uuid4()}"))
        body = await call.body(self._limits.body_max_bytes)

        def changes() -> Sequence[Change]:
            return [*_made(graph), _said(call, graph, body)]

        fingerprint = _fingerprint(call, None if is_new else graph, body)
        commit = await self._updater.change(call, changes, fingerprint)
        if is_new:
            # With an idempotency key it may have been made by an earlier request.
            made = [change.graph for change in commit.statements if change.graph]
            graph = ox.NamedNode(made[0]) if made else graph
        headers: HeaderList = [commit_header(commit.number)]
        if is_new and isinstance(graph, ox.NamedNode):
            headers.append((b"location", graph.value.encode()))
        status = 201 if is_new or _is_new(commit, graph) else 200
        return json_reply(update_receipt(commit), status, headers)

    async def delete(self, call: Call) -> Reply:
        """Removes a graph; of the default graph, what updates have said."""
        graph = _named(_target(call))

        def changes() -> Sequence[Change]:
            return [Clear(graph, drops=True)]

        commit = await self._updater.change(call, changes, _fingerprint(call, graph, b""))
        return json_reply(update_receipt(commit), 200, [commit_header(commit.number)])

    def operations(self) -> list[Operation]:
        """The routes, documented."""
        by_parameter = self.routes(PATH, "", with_parameters=True)
        by_address = self.routes(PATH + "/{graph}", "ByAddress", with_parameters=False)
        return [*by_parameter, *by_address]

    def routes(
        self,
        path: str,
        suffix: str,
        *,
        with_parameters: bool,
        tag: str = "graphs",
    ) -> list[Operation]:
        """The four methods of a path.

        Args:
            path: where they are served.
            suffix: makes their identifiers unique.
            with_parameters: whether parameters name the graph, or the path does.
            tag: the group they belong to.
        """
        graph = {offer.media_type: result_content(offer.media_type) for offer in GRAPH_OFFERS}
        body = {media_type: Content({"type": "string"}) for media_type in PROPER_FORMATS}
        body[MULTIPART] = Content({"type": "string"})
        receipt = Content({"type": "object"}, {"commit": 12, "added": 3, "removed": 0})
        commit = {"X-Commit": "Number of the commit."}
        made = Answer("The graph is new.", {"application/json": receipt}, commit)
        replaced = Answer("The graph was there before.", headers=commit)
        there = Answer("The graph was there before.", {"application/json": receipt}, commit)
        gone = Answer("It is gone.", {"application/json": receipt}, commit)
        query_parameters = (_GRAPH, _DEFAULT_GRAPH) if with_parameters else ()
        spans = not with_parameters
        return [
            Operation(
                "GET",
                path,
                self.get,
                f"readGraph{suffix}",
                "Read a graph",
                tag=tag,
                parameters=query_parameters,
                answers={200: Answer("All that the graph says.", graph)},
                errors=(UnknownResource, NotAcceptable, TooLarge, QueryTimeout),
                spans=spans,
            ),
            Operation(
                "PUT",
                path,
                self.put,
                f"replaceGraph{suffix}",
                "Replace a graph",
                tag=tag,
                role="write",
                parameters=query_parameters,
                body=body,
                body_description="What the graph is to say.",
                answers={201: made, 204: replaced},
                errors=_WRITE_ERRORS,
                spans=spans,
            ),
            Operation(
                "POST",
                path,
                self.post,
                f"extendGraph{suffix}",
                "Add to a graph",
                tag=tag,
                role="write",
                parameters=query_parameters,
                body=body,
                body_description="What the graph is to say as well.",
                answers={200: there, 201: made},
                errors=_WRITE_ERRORS,
                spans=spans,
            ),
            Operation(
                "DELETE",
                path,
                self.delete,
                f"removeGraph{suffix}",
                "Remove a graph",
                tag=tag,
                role="write",
                parameters=query_parameters,
                answers={200: gone},
                errors=(UnknownResource, *_WRITE_ERRORS),
                spans=spans,
            ),
        ]


_GRAPH = Parameter(
    "graph",
    "IRI of a named graph.",
    {"type": "string", "format": "iri"},
    "urn:notes",
)
_DEFAULT_GRAPH = Parameter("default", "The default graph; without a value.", {"type": "string"})


def _target(call: Call) -> Graph | None:
    """The graph that a request is about; None if it names none.

    Raises:
        InvalidInput: it names two, or one by something that is no IRI.
    """
    if "repository" in call.arguments:
        check_repository(call)
    if "graph" in call.arguments:
        path = quote(call.path, safe="/:@!$&'()*+,;=~-._")
        return ox.NamedNode(own_address(call, path))
    values = call.parameters()
    graph = parameters.text(values, "graph")
    if "default" in values:
        if graph is not None:
            raise InvalidInput("the request names both ?default and ?graph; give one of them")
        return _DEFAULT
    if graph is None:
        return None
    try:
        is_absolute = _SCHEME.match(graph) is not None
        return ox.NamedNode(graph if is_absolute else urljoin(own_address(call, call.path), graph))
    except ValueError as problem:
        raise InvalidInput(f"the graph {graph!r} is no IRI: {problem}", parameter="graph") from None


def _named(graph: Graph | None) -> Graph:
    if graph is None:
        raise InvalidInput("the request names no graph; add ?graph=IRI or ?default")
    return graph


def _made(graph: Graph) -> list[Change]:
    return [Create(graph, is_silent=True)] if isinstance(graph, ox.NamedNode) else []


def _said(call: Call, graph: Graph, body: bytes) -> InsertStatements:
    """What the body says, said in the graph."""
    base_iri = graph.value if isinstance(graph, ox.NamedNode) else own_address(call, call.path)
    triples = triples_in(body, call.header(b"content-type") or "", base_iri, CHANGES_MAX)
    # What was read from the default graph, fluents included, can be sent back.
    is_default = isinstance(graph, ox.DefaultGraph)
    return InsertStatements(
        tuple(in_graph(triple, graph) for triple in triples), tolerates=is_default
    )


def _fingerprint(call: Call, graph: Graph | None, body: bytes) -> str:
    return f"{call.method} {graph} {call.media_type} {hashlib.sha256(body).hexdigest()}"


def _is_new(commit: Commit, graph: Graph) -> bool:
    """There was no such graph before; of the default graph, updates had said nothing there."""
    if isinstance(graph, ox.NamedNode):
        made = [change for change in commit.statements if change.graph == graph.value]
        return any(change.graph_event == "created" for change in made)
    return any(change.added and not change.removed for change in commit.statements)


def _no_graph(graph: ox.NamedNode) -> UnknownResource:
    return UnknownResource(f"there is no graph {graph}; make it with PUT", graph=graph.value)
