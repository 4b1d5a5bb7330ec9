"""Pending statements: what the store would say after operations that are not committed yet."""

from __future__ import annotations

from collections.abc import Iterator

import pyoxigraph as ox

from fluentboard.board.events import GraphEvent, StatementsChanged
from fluentboard.board.rdf_store import RdfStore
from fluentboard.board.store import SAID
from fluentboard.board.update_operations import Graph, Term
from fluentboard.errors import TooLarge

_DEFAULT = ox.DefaultGraph()


class PendingStatements:
    """The statements that updates say, with changes on top that nobody else sees.

    Of the default graph this is the layer of updates alone: fluents, ontologies and the class
    hierarchy are not in it.

    Args:
        store: what is committed; it must not change meanwhile.
        changes_max: how many statements may be added and removed together.
    """

    def __init__(self, store: RdfStore, changes_max: int) -> None:
        self._store = store
        self._changes_max = changes_max
        self._added: dict[ox.Quad, None] = {}
        self._removed: dict[ox.Quad, None] = {}
        self._graphs: dict[ox.NamedNode, bool] = {}

    @property
    def is_unchanged(self) -> bool:
        """Nothing is pending."""
        return not (self._added or self._removed or self._graphs)

    @property
    def added(self) -> Iterator[ox.Quad]:
        """The statements that are to be added."""
        return iter(self._added)

    @property
    def removed(self) -> Iterator[ox.Quad]:
        """The statements that are to be removed."""
        return iter(self._removed)

    def __contains__(self, quad: ox.Quad) -> bool:
        if quad in self._added:
            return True
        return quad not in self._removed and self._is_stored(quad)

    def add(self, quad: ox.Quad) -> None:
        """Says a statement; its graph is made if need be.

        Raises:
            TooLarge: too much is pending.
        """
        graph = quad.graph_name
        if isinstance(graph, ox.NamedNode) and not self.has_graph(graph):
            self._graphs[graph] = True
        if quad in self._removed:
            del self._removed[quad]
        elif not self._is_stored(quad):
            self._added[quad] = None
            self._check_size()

    def remove(self, quad: ox.Quad) -> None:
        """No longer says a statement.

        Raises:
            TooLarge: too much is pending.
        """
        if quad in self._added:
            del self._added[quad]
        elif self._is_stored(quad):
            self._removed[quad] = None
            self._check_size()

    def has_graph(self, graph: ox.NamedNode) -> bool:
        """There is a named graph of that name."""
        is_there = self._graphs.get(graph)
        return self._store.has_graph(graph) if is_there is None else is_there

    def create(self, graph: ox.NamedNode) -> None:
        """Makes an empty named graph."""
        self._graphs[graph] = True

    def clear(self, graph: Graph) -> None:
        """Removes all statements of a graph."""
        for quad in list(self.matching(None, None, None, graph)):
            self.remove(quad)

    def drop(self, graph: ox.NamedNode) -> None:
        """Removes a named graph with its statements."""
        self.clear(graph)
        self._graphs[graph] = False

    def named_graphs(self) -> list[ox.NamedNode]:
        """Names of all named graphs."""
        stored = [graph for graph in self._store.named_graphs() if self.has_graph(graph)]
        known = set(stored)
        return stored + [
            graph for graph, is_there in self._graphs.items() if is_there and graph not in known
        ]

    def matching(
        self,
        subject: ox.NamedNode | ox.BlankNode | None,
        predicate: ox.NamedNode | None,
        target: Term | None,
        graph: Graph,
    ) -> Iterator[ox.Quad]:
        """The statements of a graph that match; None matches any term."""
        stored = SAID if isinstance(graph, ox.DefaultGraph) else graph
        for quad in self._store.matching(subject, predicate, target, stored):
            here = ox.Quad(quad.subject, quad.predicate, quad.object, graph)
            if here not in self._removed:
                yield here
        for quad in self._added:
            if (
                quad.graph_name == graph
                and subject in (None, quad.subject)
                and predicate in (None, quad.predicate)
                and target in (None, quad.object)
            ):
                yield quad

    def changes(self) -> tuple[StatementsChanged, ...]:
        """What is pending, one change for each graph."""
        by_graph: dict[Graph, tuple[list[str], list[str]]] = {
            graph: ([], []) for graph in self._graphs if self._event(graph)
        }
        for column, quads in enumerate((self._added, self._removed)):
            for quad in quads:
                graph = quad.graph_name
                assert not isinstance(graph, ox.BlankNode)
                lines = by_graph.setdefault(graph, ([], []))[column]
                lines.append(f"{quad.triple} .\n")
        return tuple(
            StatementsChanged(
                "" if isinstance(graph, ox.DefaultGraph) else graph.value,
                "".join(added),
                "".join(removed),
                graph_event="" if isinstance(graph, ox.DefaultGraph) else self._event(graph),
            )
            for graph, (added, removed) in by_graph.items()
        )

    def _event(self, graph: ox.NamedNode) -> GraphEvent:
        was_there, is_there = self._store.has_graph(graph), self.has_graph(graph)
        if was_there == is_there:
            return ""
        return "created" if is_there else "dropped"

    def _is_stored(self, quad: ox.Quad) -> bool:
        if isinstance(quad.graph_name, ox.DefaultGraph):
            return self._store.says(quad)
        return quad in self._store

    def _check_size(self) -> None:
        if len(self._added) + len(self._removed) > self._changes_max:
            raise TooLarge(
                f"the update changes more than {self._changes_max:,} statements; split it into "
                "several, or restrict its WHERE",
                limit=self._changes_max,
            )
