"""Graphs: everything outside fluents, read and changed by statements."""

from __future__ import annotations

import hashlib
import math
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future

import pyoxigraph as ox

from fluentboard.board.events import Commit, StatementsChanged
from fluentboard.board.projections import Projections
from fluentboard.board.projector import Projector
from fluentboard.board.query_reach import reach_of
from fluentboard.board.statement_rules import StatementRules
from fluentboard.board.store import HIDDEN_GRAPHS, QueryResults
from fluentboard.board.update_operations import (
    Graph,
    InsertStatements,
    Load,
    Modify,
    Operation,
    Term,
)
from fluentboard.board.update_syntax import parse_update
from fluentboard.board.updates import Abandoned, UpdateEvaluation, depends_on_store, loads_resolved
from fluentboard.board.writer import Request, Writer
from fluentboard.errors import QueryTimeout

CHANGES_MAX = 1_000_000
"""How many statements one request may add and remove."""

Reader = Callable[[Load], InsertStatements | None]
"""Gets a document from the web; None if it cannot and need not."""


class Graphs:
    """Statements of the default graph and of named graphs. Safe to use from any thread.

    Of the default graph, everything can be read, and what updates said can be changed; fluents,
    ontologies and the class hierarchy are changed in other ways.

    Args:
        projections: of the journal.
        projector: brings the RDF store up.
        writer: commits.
        rewritten: a query with its class paths replaced.

    Example:
        >>> from fluentboard.board.blackboard import Blackboard
        >>> board = Blackboard.open(None)
        >>> update = "INSERT DATA { GRAPH <urn:notes> { <urn:a> <urn:b> 1 } }"
        >>> board.graphs.update(update, "example").result().number == board.commit
        True
        >>> len(list(board.graphs.statements(graphs=[ox.NamedNode("urn:notes")])))
        1
        >>> board.close()
    """

    def __init__(
        self,
        projections: Projections,
        projector: Projector,
        writer: Writer,
    ) -> None:
        self._projections = projections
        self._store = projections.store
        self._projector = projector
        self._writer = writer

    def update(
        self,
        text: str,
        author: str,
        *,
        base_iri: str | None = None,
        using_graphs: Sequence[str] = (),
        using_named_graphs: Sequence[str] = (),
        idempotency_key: str | None = None,
        read: Reader | None = None,
        stop: threading.Event | None = None,
        patience_s: float = math.inf,
    ) -> Future[Commit]:
        """Carries out a SPARQL 1.1 Update request, all or nothing.

        It is evaluated in the caller's thread first, so that one that takes for ever holds nobody
        else up; when something was committed meanwhile, it is evaluated again before it is
        committed, so that nothing is lost.

        Args:
            text: the request.
            author: whom the commit is attributed to.
            base_iri: what relative IRIs are relative to.
            using_graphs: as if every WHERE had `USING` these.
            using_named_graphs: as if every WHERE had `USING NAMED` these.
            idempotency_key: the same key gives the first answer again.
            read: gets documents for LOAD; None to refuse it.
            stop: once set, nobody waits for the outcome any more.
            patience_s: how long it may take to evaluate it again.

        Raises:
            InvalidQuery: it does not parse, or cannot be evaluated.
            FluentsAreReadOnly: it touches fluents; the message says what to call instead.
            NotAllowed: it touches what an ontology says or the board's notes, or may not LOAD.
            ClassInUse: a class that fluents belong to would no longer be declared.
            UnknownResource: there is no such graph.
            TooLarge: it changes too much.
            QueryTimeout: to evaluate it again took longer than that.
            Abandoned: nobody waits any more.
        """
        operations = parse_update(
            text,
            base_iri=base_iri,
            using_graphs=using_graphs,
            using_named_graphs=using_named_graphs,
        )
        parts = (author, text, *using_graphs, "", *using_named_graphs)
        return self._submit(
            loads_resolved(operations, read),
            author,
            idempotency_key,
            "\0".join(parts),
            stop,
            patience_s,
        )

    def change(
        self,
        operations: Sequence[Operation],
        author: str,
        *,
        idempotency_key: str | None = None,
        fingerprint: str = "",
        stop: threading.Event | None = None,
        patience_s: float = math.inf,
    ) -> Future[Commit]:
        """Carries out operations, all or nothing; otherwise like `update`.

        Args:
            operations: in order.
            author: whom the commit is attributed to.
            idempotency_key: the same key gives the first answer again.
            fingerprint: what another request with the same key is recognised by.
            stop: once set, nobody waits for the outcome any more.
            patience_s: how long it may take to evaluate them again.
        """
        told = f"{author}\0{fingerprint}"
        return self._submit(operations, author, idempotency_key, told, stop, patience_s)

    def statements(
        self,
        subject: ox.NamedNode | ox.BlankNode | None = None,
        predicate: ox.NamedNode | None = None,
        target: Term | None = None,
        *,
        graphs: Sequence[Graph] | None = None,
    ) -> Iterator[ox.Quad]:
        """The statements that match; None matches any term.

        Args:
            subject: a subject or None.
            predicate: a predicate or None.
            target: an object or None.
            graphs: in these graphs; None for all.
        """
        self._projector.wait_for(self._projections.remembered)
        pattern = (subject, predicate, target)
        if graphs is None:
            graphs = (ox.DefaultGraph(), *self._store.named_graphs())
        for graph in graphs:
            if graph not in HIDDEN_GRAPHS:
                yield from self._store.matching(*pattern, graph)

    def named_graphs(self) -> list[ox.NamedNode]:
        """Names of all named graphs, the empty ones included."""
        self._projector.wait_for(self._projections.remembered)
        return self._store.named_graphs()

    def has_graph(self, graph: ox.NamedNode) -> bool:
        """There is a named graph of that name."""
        self._projector.wait_for(self._projections.remembered)
        return graph not in HIDDEN_GRAPHS and self._store.has_graph(graph)

    def was_said(self, quad: ox.Quad) -> bool:
        """An update has said the statement, so an update can unsay it."""
        if isinstance(quad.graph_name, ox.DefaultGraph):
            return self._store.says(quad)
        return quad.graph_name not in HIDDEN_GRAPHS and quad in self._store

    def preview(
        self, operations: Sequence[Operation], query: str | None = None
    ) -> tuple[ox.Store, list[ox.NamedNode]]:
        """What the board would say after operations that are not carried out.

        Args:
            operations: in order.
            query: the store need only be right for this one; None for everything.

        Returns:
            A store in memory, and the named graphs that are seen by default.

        Raises:
            FluentboardError: the operations are refused.
        """
        self._projector.wait_for(self._projections.remembered)
        return previewed(self._projections, operations, query)

    def _submit(
        self,
        operations: Sequence[Operation],
        author: str,
        key: str | None,
        fingerprint: str,
        stop: threading.Event | None,
        patience_s: float,
    ) -> Future[Commit]:
        def is_abandoned() -> bool:
            return stop is not None and stop.is_set()

        digest = hashlib.sha256(fingerprint.encode()).hexdigest() if key else None
        known: tuple[int, tuple[StatementsChanged, ...]] | None = None
        if depends_on_store(operations):
            self._projector.wait_for(self._projections.remembered)
            moment = self._store.moment
            changes = evaluation_on(self._projections, is_abandoned).changes(operations)
            if moment is not None and self._store.moment == moment:
                known = moment, changes

        def derive() -> tuple[StatementsChanged, ...]:
            # Called by the writer, when the store has all commits and nobody else writes.
            if known is not None and self._store.moment == known[0]:
                return known[1]
            end_s = time.monotonic() + patience_s

            def is_over() -> bool:
                return is_abandoned() or time.monotonic() > end_s

            try:
                return evaluation_on(self._projections, is_over).changes(operations)
            except Abandoned:
                if is_abandoned():
                    return ()
                raise QueryTimeout(
                    "the board changed while the update was evaluated, and to evaluate it again "
                    f"took longer than {patience_s:g} s; nothing was changed. Send it again, or "
                    "narrow its WHERE",
                    timeout_s=patience_s,
                ) from None

        return self._writer.submit(Request((), author, key, digest, derive=derive))


def evaluation_on(
    projections: Projections, is_over: Callable[[], bool] = lambda: False
) -> UpdateEvaluation:
    """What evaluates one request on the statements of a board.

    Args:
        projections: of the board; the RDF store must not change meanwhile.
        is_over: once true, nobody waits for the outcome any more.
    """
    store = projections.store

    def ask_store(operation: Modify) -> QueryResults:
        query = operation.query
        if operation.default_graphs is None:
            query = projections.prepared.rewritten(query, projections.vocabulary)
        return store.query(
            query, operation.default_graphs, operation.named_graphs, base_iri=operation.base_iri
        )

    rules = StatementRules(
        store, projections.is_in_ontology, lambda name: name in projections.index
    )
    return UpdateEvaluation(store, ask_store, rules, CHANGES_MAX, is_over)


def previewed(
    projections: Projections, operations: Sequence[Operation], query: str | None
) -> tuple[ox.Store, list[ox.NamedNode]]:
    """As `Graphs.preview`, of projections that have all commits."""
    evaluation = evaluation_on(projections)
    evaluation.changes(operations)
    reach = None if query is None else reach_of(query)
    return evaluation.view(Modify(query or "", (), (), reach=reach))
