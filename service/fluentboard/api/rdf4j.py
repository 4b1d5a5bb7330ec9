"""The RDF4J protocol: the board as a repository for clients of RDF4J, Sesame and GraphDB.

`/protocol` and `/repositories` are served at the root and below `/rdf4j-server`.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Sequence

import orjson
import pyoxigraph as ox

from fluentboard.api import parameters, rdf4j_parameters
from fluentboard.api.answering import DEFAULT_GRAPH, SOLUTION_OFFERS, UNION_GRAPH, Question
from fluentboard.api.evaluation import Evaluator
from fluentboard.api.exchange import Call, Reply, StreamedReply, utf8_text
from fluentboard.api.graph_store import GraphStoreRoutes
from fluentboard.api.negotiation import content_type, negotiated
from fluentboard.api.operations import Operation
from fluentboard.api.rdf4j_documented import rdf4j_operations
from fluentboard.api.rdf4j_namespaces import clearing, namespaces, removal, setting
from fluentboard.api.rdf4j_parameters import REPOSITORY, check_repository
from fluentboard.api.rdf4j_transactions import Transactions
from fluentboard.api.rdf_bodies import quads_in
from fluentboard.api.sparql import own_address, posted_values, result_reply
from fluentboard.api.statement_replies import statements_reply
from fluentboard.api.updating import Updater
from fluentboard.api.writing import commit_header
from fluentboard.board.blackboard import Blackboard
from fluentboard.board.events import Commit
from fluentboard.board.graphs import CHANGES_MAX
from fluentboard.board.sparql_tokens import has_word, tokens_of
from fluentboard.board.update_operations import (
    Clear,
    DeleteMatching,
    Graph,
    InsertStatements,
)
from fluentboard.board.update_operations import Operation as Change
from fluentboard.board.vocabulary import PROPER_SUB_CLASS_OF, SUB_CLASS_OF_OR_SAME
from fluentboard.config import LimitSettings
from fluentboard.errors import InvalidQuery, NotAllowed, UnknownResource

_PROTOCOL_VERSION = b"12"
_UPDATES = ("application/sparql-update", "application/x-www-form-urlencoded")
_INFERRED = frozenset({PROPER_SUB_CLASS_OF, SUB_CLASS_OF_OR_SAME})
_TEXT = b"text/plain; charset=utf-8"
_XSD_BOOLEAN = "http://www.w3.org/2001/XMLSchema#boolean"


class Rdf4jRoutes:
    """The repository.

    Attributes:
        graph_store: serves whole graphs.
        transactions: what is collected until it is committed.

    Args:
        board: what is served.
        evaluator: answers queries.
        updater: carries out changes.
        graph_store: serves whole graphs.
        limits: on requests and results.
    """

    def __init__(
        self,
        board: Blackboard,
        evaluator: Evaluator,
        updater: Updater,
        graph_store: GraphStoreRoutes,
        limits: LimitSettings,
    ) -> None:
        self._board = board
        self._evaluator = evaluator
        self._updater = updater
        self.graph_store = graph_store
        self._limits = limits
        self.transactions = Transactions(board, updater, limits)

    async def protocol(self, call: Call) -> Reply:
        """`GET /protocol`: the version of the protocol."""
        return Reply(_PROTOCOL_VERSION, _TEXT)

    async def repositories(self, call: Call) -> Reply:
        """`GET /repositories`: the one that there is."""
        address = own_address(call, f"/repositories/{REPOSITORY}")
        true = f'"true"^^<{_XSD_BOOLEAN}>'
        row = (f"<{address}>", f'"{REPOSITORY}"', '"The blackboard"', true, true)
        return _table(call, ("uri", "id", "title", "readable", "writable"), [row])

    async def make_repository(self, call: Call) -> Reply:
        """`PUT /repositories/{repository}`: refused, as there is one and stays one."""
        raise NotAllowed(f"the board is the one repository {REPOSITORY!r}; there are no others")

    async def query(self, call: Call) -> Reply | StreamedReply:
        """`GET /repositories/{repository}`: a query."""
        check_repository(call)
        return await self._answer(call, call.parameters())

    async def query_by_post(self, call: Call) -> Reply | StreamedReply:
        """`POST /repositories/{repository}`: a query, as a form or as the body."""
        check_repository(call)
        return await self._answer(call, await posted_values(call, self._limits.body_max_bytes))

    async def size(self, call: Call) -> Reply:
        """`GET .../size`: how many statements there are."""
        check_repository(call)
        counts: list[str] = []
        for graph in rdf4j_parameters.contexts(call.parameters()) or (None,):
            if graph is None:
                counts += ["{ ?s ?p ?o }", "{ GRAPH ?g { ?s ?p ?o } }"]
            elif isinstance(graph, ox.NamedNode):
                counts.append(f"{{ GRAPH {graph} {{ ?s ?p ?o }} }}")
            else:
                counts.append("{ ?s ?p ?o }")
        text = f"SELECT (COUNT(*) AS ?n) WHERE {{ {' UNION '.join(counts)} }}"
        result = await self._evaluator.evaluate(Question(text))
        assert result.text is not None, "one number is short"
        (row,) = orjson.loads(result.text)["results"]["bindings"]
        return Reply(row["n"]["value"].encode(), _TEXT)

    async def contexts(self, call: Call) -> Reply:
        """`GET .../contexts`: the named graphs that say something."""
        check_repository(call)
        graphs = self._board.graphs
        said = [
            g for g in graphs.named_graphs() if any(True for _ in graphs.statements(graphs=[g]))
        ]
        return _table(call, ("contextID",), [(str(graph),) for graph in said])

    async def namespaces(self, call: Call) -> Reply:
        """`GET .../namespaces`: prefixes and what they stand for."""
        check_repository(call)
        known = namespaces(self._board.graphs)
        rows = [(str(ox.Literal(p)), str(ox.Literal(iri))) for p, iri in sorted(known.items())]
        return _table(call, ("prefix", "namespace"), rows)

    async def forget_namespaces(self, call: Call) -> Reply:
        """`DELETE .../namespaces`: forgets those that are not the board's own."""
        check_repository(call)
        return _done(await self._updater.change(call, lambda: clearing(self._board.graphs)))

    async def namespace(self, call: Call) -> Reply:
        """`GET .../namespaces/{prefix}`: what a prefix stands for."""
        check_repository(call)
        prefix = call.arguments["prefix"]
        iri = namespaces(self._board.graphs).get(prefix)
        if iri is None:
            raise UnknownResource(f"there is no prefix {prefix!r}", prefix=prefix)
        return Reply(iri.encode(), _TEXT)

    async def set_namespace(self, call: Call) -> Reply:
        """`PUT .../namespaces/{prefix}`: has a prefix stand for the IRI in the body."""
        check_repository(call)
        iri = utf8_text(await call.body(self._limits.body_max_bytes)).strip()
        prefix = call.arguments["prefix"]
        changes = setting(self._board.graphs, prefix, iri)
        return _done(await self._updater.change(call, lambda: changes, f"{prefix} {iri}"))

    async def forget_namespace(self, call: Call) -> Reply:
        """`DELETE .../namespaces/{prefix}`: forgets a prefix."""
        check_repository(call)
        changes = removal(self._board.graphs, call.arguments["prefix"])
        return _done(await self._updater.change(call, lambda: changes))

    async def statements(self, call: Call) -> Reply | StreamedReply:
        """`GET .../statements`: those that match."""
        check_repository(call)
        values = call.parameters()
        subject, predicate = rdf4j_parameters.subject(values), rdf4j_parameters.predicate(values)
        target = rdf4j_parameters.term(values, "obj")
        graphs = rdf4j_parameters.contexts(values) or None
        infer = parameters.flag(values, "infer") is not False

        def found() -> Iterator[ox.Quad]:
            for quad in self._board.graphs.statements(subject, predicate, target, graphs=graphs):
                if infer or quad.predicate.value not in _INFERRED:
                    yield quad

        return await statements_reply(call, found, self._limits)

    async def add_statements(self, call: Call) -> Reply:
        """`POST .../statements`: statements to add, or a SPARQL update."""
        check_repository(call)
        if call.media_type in _UPDATES:
            values = await posted_values(call, self._limits.body_max_bytes)
            texts = values.get("update", ())
            if len(texts) != 1:
                raise InvalidQuery(f"the request has {len(texts)} updates; send one")
            return _done(
                await self._updater.update(
                    call,
                    texts[0],
                    own_address(call, call.path),
                    values.get("using-graph-uri", ()),
                    values.get("using-named-graph-uri", ()),
                )
            )
        return await self._put(call, _nothing)

    async def replace_statements(self, call: Call) -> Reply:
        """`PUT .../statements`: has the contexts, or everything, say what the body says."""
        check_repository(call)
        return await self._put(call, _clearing)

    async def delete_statements(self, call: Call) -> Reply:
        """`DELETE .../statements`: removes those that match."""
        check_repository(call)
        values = call.parameters()
        subject, predicate = rdf4j_parameters.subject(values), rdf4j_parameters.predicate(values)
        target, graphs = rdf4j_parameters.term(values, "obj"), rdf4j_parameters.contexts(values)
        changes: Sequence[Change] = [DeleteMatching(subject, predicate, target, graphs)]
        if subject is None and predicate is None and target is None:
            # Everything: what fluents and ontologies say is not meant.
            changes = _clearing(graphs)
        return _done(
            await self._updater.change(call, lambda: changes, call.query_string.decode("latin-1"))
        )

    def operations(self) -> list[Operation]:
        """The routes, documented."""
        return rdf4j_operations(self)

    async def _answer(self, call: Call, values: parameters.Values) -> Reply | StreamedReply:
        queries = values.get("query", ())
        if len(queries) != 1:
            raise InvalidQuery(f"the request has {len(queries)} queries; send one")
        defaults = tuple(values.get("default-graph-uri", ()))
        named = tuple(values.get("named-graph-uri", ()))
        names_dataset = defaults or named or has_word(tokens_of(queries[0]), "FROM")
        if not names_dataset and self._board.graphs.named_graphs():
            # In RDF4J a query without a dataset sees all contexts at once.
            defaults, named = (DEFAULT_GRAPH, UNION_GRAPH), (UNION_GRAPH,)
        question = Question(queries[0], call.header(b"accept"), defaults, named)
        return result_reply(await self._evaluator.evaluate(question, call))

    async def _put(self, call: Call, first: Callable[[Sequence[Graph]], list[Change]]) -> Reply:
        values = call.parameters()
        graphs = rdf4j_parameters.contexts(values)
        base = rdf4j_parameters.base_iri(values, own_address(call, call.path))
        body = await call.body(self._limits.body_max_bytes)
        form = call.header(b"content-type") or ""

        def changes() -> Sequence[Change]:
            quads = tuple(quads_in(body, form, base, CHANGES_MAX, graphs))
            return [*first(graphs), InsertStatements(quads, tolerates=True)]

        digest = hashlib.sha256(body).hexdigest()
        fingerprint = f"{call.method} {call.query_string!r} {digest}"
        return _done(await self._updater.change(call, changes, fingerprint))


def _clearing(graphs: Sequence[Graph]) -> list[Change]:
    if not graphs:
        return [Clear("all", drops=True)]
    return [Clear(graph, drops=True, is_silent=True) for graph in graphs]


def _nothing(_: Sequence[Graph]) -> list[Change]:
    return []


def _done(commit: Commit) -> Reply:
    return Reply(status=204, headers=[commit_header(commit.number)])


def _table(call: Call, variables: Sequence[str], rows: Sequence[Sequence[str]]) -> Reply:
    """Terms in N-Triples syntax as the result of a query would be."""
    media_type, form = negotiated(call.header(b"accept"), SOLUTION_OFFERS)
    columns = " ".join(f"?{variable}" for variable in variables)
    lines = " ".join(f"({' '.join(row)})" for row in rows)
    results = ox.Store().query(f"SELECT {columns} {{ VALUES ({columns}) {{ {lines} }} }}")
    assert isinstance(results, ox.QuerySolutions)
    text = results.serialize(format=form)
    assert text is not None
    return Reply(text, content_type(media_type), 200, [(b"vary", b"Accept")])
