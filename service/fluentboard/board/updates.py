"""Updates: operations on statements outside fluents, evaluated to what they change.

The journal is the truth, so an update is not carried out on the store. It is evaluated: each
operation sees what the ones before it have done, and in the end there is a list of statements to
add and to remove, which is checked, journalled and projected like any other commit.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence

import pyoxigraph as ox

from fluentboard.board.events import StatementsChanged
from fluentboard.board.oxigraph_query import QueryResults, ask
from fluentboard.board.pending_statements import PendingStatements
from fluentboard.board.rdf_store import RdfStore
from fluentboard.board.statement_rules import StatementRules
from fluentboard.board.update_operations import (
    Clear,
    Create,
    DeleteMatching,
    DeleteStatements,
    Graph,
    InsertStatements,
    Load,
    Modify,
    Operation,
    Position,
    TemplateQuad,
    Term,
    Transfer,
)
from fluentboard.board.update_view import view_for
from fluentboard.errors import InvalidQuery, NotAllowed, UnknownResource

_DEFAULT = ox.DefaultGraph()
# How many solutions are taken between two looks at whether anybody still waits.
_SOLUTIONS_BETWEEN_LOOKS = 100

AskStore = Callable[[Modify], QueryResults]
"""Evaluates an operation's query on what is committed."""


class Abandoned(Exception):
    """Nobody waits for the update any more."""


class UpdateEvaluation:
    """Evaluates one request.

    Args:
        store: what is committed; it must not change meanwhile.
        ask_store: evaluates a query on it.
        rules: what may not be said or unsaid.
        changes_max: how many statements may be added and removed.
        is_over: once true, nobody waits for the outcome any more.
    """

    def __init__(
        self,
        store: RdfStore,
        ask_store: AskStore,
        rules: StatementRules,
        changes_max: int,
        is_over: Callable[[], bool] = lambda: False,
    ) -> None:
        self._store = store
        self._ask_store = ask_store
        self._rules = rules
        self._is_over = is_over
        self._pending = PendingStatements(store, changes_max)

    def changes(self, operations: Sequence[Operation]) -> tuple[StatementsChanged, ...]:
        """What the operations change, all together.

        Raises:
            FluentsAreReadOnly: one of them touches fluents.
            NotAllowed: one touches what an ontology says or the board's notes, or loads from the
                web although nobody allowed it.
            ClassInUse: a class that fluents belong to would no longer be declared.
            UnknownResource: there is no such graph.
            InvalidQuery: a graph is there already, or a WHERE cannot be evaluated.
            TooLarge: they change too much.
            Abandoned: nobody waits any more.
        """
        for operation in operations:
            self._look()
            self._apply(operation)
        self._rules.check_classes(self._pending)
        return self._pending.changes()

    def view(self, operation: Modify) -> tuple[ox.Store, list[ox.NamedNode]]:
        """A store in which the operation's query has the answer of this moment, and its graphs."""
        view = view_for(operation, self._store, self._pending, self._rules.is_in_ontology)
        return view, self._pending.named_graphs()

    def _apply(self, operation: Operation) -> None:
        match operation:
            case InsertStatements():
                for quad in operation.quads:
                    if not (operation.tolerates and quad in self._store):
                        self._add(quad)
            case DeleteStatements():
                for quad in operation.quads:
                    self._remove(quad)
            case DeleteMatching():
                self._delete_matching(operation)
            case Modify():
                self._modify(operation)
            case Clear():
                self._clear(operation)
            case Create():
                self._create(operation)
            case Transfer():
                self._transfer(operation)
            case Load():
                raise _no_loading(operation.address)

    def _add(self, quad: ox.Quad) -> None:
        self._rules.check_added(quad)
        self._pending.add(quad)

    def _remove(self, quad: ox.Quad, *, spares_ontologies: bool = False) -> None:
        if self._rules.check_removed(quad, self._pending, spares_ontologies=spares_ontologies):
            self._pending.remove(quad)

    def _modify(self, operation: Modify) -> None:
        removed: dict[ox.Quad, None] = {}
        swept: dict[ox.Quad, None] = {}
        added: dict[ox.Quad, None] = {}
        sweeping = [quad for quad in operation.delete if _is_open(quad)]
        aimed = [quad for quad in operation.delete if not _is_open(quad)]
        # All solutions are found before anything is changed.
        for solution in self._solutions(operation):
            removed.update(dict.fromkeys(_filled(aimed, solution)))
            swept.update(dict.fromkeys(_filled(sweeping, solution)))
            added.update(dict.fromkeys(_filled(operation.insert, solution)))
        for quad in removed:
            self._remove(quad)
        for quad in swept:
            # `DELETE WHERE { ?s ?p ?o }` means: away with all that was said here.
            self._remove(quad, spares_ontologies=True)
        for quad in added:
            self._add(quad)

    def _solutions(self, operation: Modify) -> Iterator[ox.QuerySolution]:
        results: QueryResults | None
        if self._pending.is_unchanged:
            results = self._ask_store(operation)
        else:
            view = view_for(operation, self._store, self._pending, self._rules.is_in_ontology)
            results = _asked(view, operation)
        assert isinstance(results, ox.QuerySolutions)
        try:
            for count, solution in enumerate(results):
                if count % _SOLUTIONS_BETWEEN_LOOKS == 0:
                    self._look()
                yield solution
        except (ValueError, OSError, RuntimeError) as problem:
            raise InvalidQuery(f"the WHERE cannot be evaluated: {problem}") from None
        finally:
            # Oxigraph's iterators must die in the thread that made them, but the traceback of an
            # error would take this one along to another.
            results = None

    def _delete_matching(self, operation: DeleteMatching) -> None:
        graphs: Iterable[Graph] = operation.graphs or (_DEFAULT, *self._pending.named_graphs())
        pattern = (operation.subject, operation.predicate, operation.object)
        for graph in graphs:
            stored = self._store.matching(*pattern, graph)
            for quad in {*stored, *self._pending.matching(*pattern, graph)}:
                self._remove(quad)

    def _clear(self, operation: Clear) -> None:
        target = operation.target
        graphs: list[Graph] = []
        if target in ("named", "all"):
            graphs += self._pending.named_graphs()
        else:
            assert not isinstance(target, str)
            graphs.append(target)
        if target == "all":
            graphs.append(_DEFAULT)
        for graph in graphs:
            if isinstance(graph, ox.DefaultGraph):
                self._pending.clear(graph)
                continue
            self._rules.check_graph(graph)
            if self._pending.has_graph(graph):
                if operation.drops:
                    self._pending.drop(graph)
                else:
                    self._pending.clear(graph)
            elif not operation.is_silent:
                raise _no_graph(graph)

    def _create(self, operation: Create) -> None:
        self._rules.check_graph(operation.graph)
        if not self._pending.has_graph(operation.graph):
            self._pending.create(operation.graph)
        elif not operation.is_silent:
            raise InvalidQuery(
                f"there is a graph {operation.graph} already; use CREATE SILENT if that is fine",
                graph=operation.graph.value,
            )

    def _transfer(self, operation: Transfer) -> None:
        source, target = operation.source, operation.target
        for graph in (source, target):
            if isinstance(graph, ox.NamedNode):
                self._rules.check_graph(graph)
        if isinstance(source, ox.NamedNode) and not self._pending.has_graph(source):
            if operation.is_silent:
                return
            raise _no_graph(source)
        if source == target:
            return
        brought = list(self._pending.matching(None, None, None, source))
        if operation.kind != "add":
            self._pending.clear(target)
        if isinstance(target, ox.NamedNode):
            self._pending.create(target)
        for quad in brought:
            self._add(ox.Quad(quad.subject, quad.predicate, quad.object, target))
        if operation.kind == "move":
            if isinstance(source, ox.DefaultGraph):
                self._pending.clear(source)
            else:
                self._pending.drop(source)

    def _look(self) -> None:
        if self._is_over():
            raise Abandoned


def loads_resolved(
    operations: Iterable[Operation], read: Callable[[Load], InsertStatements | None] | None
) -> list[Operation]:
    """The operations with what is to be loaded in the place of LOAD.

    Args:
        operations: of one request.
        read: gets a document from the web, None if it cannot and need not; None to refuse.

    Raises:
        NotAllowed: there is something to load, and nobody to do it.
    """
    found: list[Operation] = []
    for operation in operations:
        if not isinstance(operation, Load):
            found.append(operation)
        elif read is not None:
            loaded = read(operation)
            if loaded is not None:
                found.append(loaded)
        elif not operation.is_silent:
            raise _no_loading(operation.address)
    return found


def depends_on_store(operations: Iterable[Operation]) -> bool:
    """Some operation looks for what it is to change, which may take long."""
    return any(not isinstance(o, InsertStatements | DeleteStatements) for o in operations)


def _asked(view: ox.Store, operation: Modify) -> QueryResults:
    def graphs() -> list[ox.NamedNode]:
        return [graph for graph in view.named_graphs() if isinstance(graph, ox.NamedNode)]

    return ask(
        view,
        operation.query,
        operation.default_graphs,
        operation.named_graphs,
        graphs,
        base_iri=operation.base_iri,
    )


def _is_open(quad: TemplateQuad) -> bool:
    return all(isinstance(p, ox.Variable) for p in (quad.subject, quad.predicate, quad.object))


def _filled(template: Sequence[TemplateQuad], solution: ox.QuerySolution) -> Iterator[ox.Quad]:
    """The statements that a solution makes of a template; what makes none is left out."""
    fresh: dict[ox.BlankNode, ox.BlankNode] = {}
    for quad in template:
        subject = _value(quad.subject, solution, fresh)
        predicate = _value(quad.predicate, solution, fresh)
        target = _value(quad.object, solution, fresh)
        graph = quad.graph
        if isinstance(graph, ox.Variable):
            graph = _value(graph, solution, fresh)
        if (
            isinstance(subject, ox.NamedNode | ox.BlankNode)
            and isinstance(predicate, ox.NamedNode)
            and target is not None
            and isinstance(graph, ox.NamedNode | ox.DefaultGraph)
        ):
            yield ox.Quad(subject, predicate, target, graph)


def _value(
    position: Position, solution: ox.QuerySolution, fresh: dict[ox.BlankNode, ox.BlankNode]
) -> Term | None:
    if isinstance(position, ox.Variable):
        return solution[position]
    if isinstance(position, ox.BlankNode):
        found = fresh.get(position)
        if found is None:
            found = fresh[position] = ox.BlankNode()
        return found
    return position


def _no_graph(graph: ox.NamedNode) -> UnknownResource:
    return UnknownResource(
        f"there is no graph {graph}; use SILENT if that is fine", graph=graph.value
    )


def _no_loading(address: str) -> NotAllowed:
    return NotAllowed(
        f"this board does not load <{address}>: LOAD would make it fetch whatever address a client "
        "names; fetch the document yourself and send it with INSERT DATA or PUT "
        "/rdf-graph-store?graph=..., or name the host in security.load_hosts",
        address=address,
    )
