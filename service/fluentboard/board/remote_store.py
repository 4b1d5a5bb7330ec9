"""The RDF store at a SPARQL 1.1 endpoint: the same projection, kept by another server.

The endpoint is the board's alone: what else writes there is not seen by the journal. A named graph
notes which commit the endpoint is at, in the same request that brings it there, so a start knows
what it has missed, and builds it anew when it is empty.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import islice
from typing import Any

import pyoxigraph as ox

from fluentboard.board.declarations import quads_of
from fluentboard.board.endpoint import BLANK, Endpoint
from fluentboard.board.events import StatementsChanged
from fluentboard.board.oxigraph_query import GraphName, QueryResults
from fluentboard.board.rdf_store import RdfStore
from fluentboard.board.store import HIDDEN_GRAPHS, META, SAID, in_hidden_graph
from fluentboard.errors import InvalidConfiguration, InvalidQuery, StorageFailed
from fluentboard_ontology import FB

_APPLIED, _STATE, _JOURNAL = f"<{FB}appliedCommit>", f"<{FB}state>", f"<{FB}journal>"
_LINES_AT_ONCE = 5_000

Term = ox.NamedNode | ox.BlankNode | ox.Literal | ox.Triple


class RemoteStore(RdfStore):
    """Statements at an endpoint.

    Args:
        endpoint: whose default graph is a graph of its own, not the union of the others.
        journal: gives what the board's journal is recognised by; None while it has no commits.

    Raises:
        InvalidConfiguration: the endpoint holds what this board did not put there.
        StorageFailed: the endpoint cannot be reached.
    """

    has_functions = False

    def __init__(self, endpoint: Endpoint, journal: Callable[[], str | None]) -> None:
        super().__init__()
        self._endpoint = endpoint
        self._journal = journal
        self._state = ""
        # What updates have said in the default graph; known from the journal, so it is kept here.
        self._said = ox.Store()
        self._was_lost = False
        noted = self._noted()
        self._check_owner(noted)
        self._applied = int(noted.get(_APPLIED, "0"))
        self._state = noted.get(_STATE, "")

    @property
    def may_be_ahead(self) -> bool:
        """See `RdfStore.may_be_ahead`."""
        return self._state == "process"

    def apply(self, added: str, removed: str, commit: int) -> None:
        """See `RdfStore.apply`."""
        steps = [f"DELETE DATA {{ {removed} }}"] if removed else []
        steps += [f"INSERT DATA {{ {added} }}"] if added else []
        self._carry_out(steps, commit)

    def apply_statements(
        self,
        added: Iterable[ox.Quad],
        removed: Iterable[ox.Quad],
        commit: int,
        *,
        created: Iterable[ox.NamedNode] = (),
        dropped: Iterable[ox.NamedNode] = (),
    ) -> None:
        """See `RdfStore.apply_statements`."""
        gone, new = list(removed), list(added)
        steps = [f"DROP SILENT GRAPH {graph}" for graph in dropped]
        steps += [f"CREATE SILENT GRAPH {graph}" for graph in created]
        for verb, quads in (("DELETE", gone), ("INSERT", new)):
            lines = [_line(quad) for quad in quads if quad.graph_name != SAID]
            steps += [f"{verb} DATA {{ {''.join(lines)} }}"] if lines else []
        self._carry_out(steps, commit)
        for quad in gone:
            if quad.graph_name == SAID:
                self._said.remove(quad)
        self._said.extend(quad for quad in new if quad.graph_name == SAID)

    def bulk_load(self, lines: Sequence[str]) -> None:
        """See `RdfStore.bulk_load`."""
        waiting = iter(lines)
        while some := list(islice(waiting, _LINES_AT_ONCE)):
            self._endpoint.update(f"INSERT DATA {{ {''.join(some)} }}")

    def clear(self) -> None:
        """See `RdfStore.clear`; the endpoint was found to be empty or the board's own."""
        self._endpoint.update("CLEAR ALL")
        self._said = ox.Store()
        self._applied = 0

    def mark(self, *, state: str) -> None:
        """See `RdfStore.mark`; what an endpoint has that was lost is not known."""
        if self._was_lost:
            return
        self._state = state
        self._endpoint.update(self._marking(self._applied))

    def note_said(self, changes: Sequence[StatementsChanged]) -> None:
        """See `RdfStore.note_said`."""
        for change in changes:
            if not change.ontology and not change.graph:
                for quad in quads_of(change.removed, ""):
                    self._said.remove(in_hidden_graph(quad))
                self._said.extend(in_hidden_graph(quad) for quad in quads_of(change.added, ""))

    def query(
        self,
        sparql: str,
        default_graphs: Sequence[GraphName] | None = None,
        named_graphs: Sequence[ox.NamedNode | ox.BlankNode] | None = None,
        **extra: Any,
    ) -> QueryResults:
        """See `RdfStore.query`. Extension functions are what the endpoint has."""
        if any(isinstance(graph, ox.DefaultGraph) for graph in default_graphs or ()):
            raise InvalidQuery(
                "the default graph cannot be combined with others in a query's dataset where the "
                "store is a SPARQL endpoint; leave default-graph-uri out"
            )
        return self._endpoint.query(
            sparql,
            base_iri=extra.get("base_iri"),
            default_graphs=[
                graph.value
                for graph in default_graphs or ()
                if not isinstance(graph, ox.DefaultGraph)
            ],
            named_graphs=[graph.value for graph in named_graphs or ()],
        )

    def subjects(
        self, predicate: str, value: ox.NamedNode | ox.Literal | None = None, *, limit: int
    ) -> list[str]:
        """See `RdfStore.subjects`."""
        target = "?o" if value is None else str(value)
        rows = self._select(
            f"SELECT DISTINCT ?s {{ ?s <{predicate}> {target} FILTER(ISIRI(?s)) }} LIMIT {limit}"
        )
        return [row["s"].value for row in rows if isinstance(row["s"], ox.NamedNode)]

    def named_graphs(self) -> list[ox.NamedNode]:
        """See `RdfStore.named_graphs`; an endpoint may forget graphs that are empty."""
        rows = self._select("SELECT DISTINCT ?g { GRAPH ?g { } }")
        found = [row["g"] for row in rows if isinstance(row["g"], ox.NamedNode)]
        return [graph for graph in found if graph not in HIDDEN_GRAPHS]

    def has_graph(self, graph: ox.NamedNode) -> bool:
        """See `RdfStore.has_graph`."""
        return graph in self.named_graphs()

    def __contains__(self, quad: ox.Quad) -> bool:
        if quad.graph_name == SAID:
            return quad in self._said
        return bool(self._endpoint.query(f"ASK {{ {_line(quad)} }}"))

    def says(self, quad: ox.Quad) -> bool:
        """See `RdfStore.says`."""
        return in_hidden_graph(quad) in self._said

    def matching(
        self,
        subject: ox.NamedNode | ox.BlankNode | None,
        predicate: ox.NamedNode | None,
        target: ox.NamedNode | ox.BlankNode | ox.Literal | ox.Triple | None,
        graph: GraphName | None,
    ) -> Iterator[ox.Quad]:
        """See `RdfStore.matching`."""
        if graph is None:
            yield from self.matching(subject, predicate, target, ox.DefaultGraph())
            for one in self.named_graphs():
                yield from self.matching(subject, predicate, target, one)
            return
        if graph == SAID:
            yield from self._said.quads_for_pattern(subject, predicate, target, graph)
            return
        asked = [("?s", subject), ("?p", predicate), ("?o", target)]
        pattern = " ".join(name if term is None else _text(term) for name, term in asked)
        is_default = isinstance(graph, ox.DefaultGraph)
        group = f"{{ {pattern} }}" if is_default else f"{{ GRAPH {graph} {{ {pattern} }} }}"
        if subject is not None and predicate is not None and target is not None:
            if self._endpoint.query(f"ASK {group}"):
                yield ox.Quad(subject, predicate, target, graph)
            return
        for row in self._select(f"SELECT * {group}"):
            s, p = subject or row["s"], predicate or row["p"]
            o = target if target is not None else row["o"]
            if isinstance(s, ox.NamedNode | ox.BlankNode) and isinstance(p, ox.NamedNode):
                assert o is not None
                yield ox.Quad(s, p, o, graph)

    def about(self, iri: str) -> list[ox.Quad] | None:
        """None: one request for each fluent takes longer than to read the journal."""
        return None

    def everything(self) -> Iterator[ox.Quad]:
        """See `RdfStore.everything`."""
        return self.matching(None, None, None, None)

    def close(self) -> None:
        """See `RdfStore.close`."""
        self.mark(state="closed")
        self._endpoint.close()

    def _check_owner(self, noted: dict[str, str]) -> None:
        if noted:
            owner, own = noted.get(_JOURNAL, ""), self._journal()
            if owner in ("", own):
                return
            whose = "a journal that is not in the data folder" if own is None else "another journal"
            raise InvalidConfiguration(
                f"the store at {self._endpoint.address} was written from {whose}; give the data "
                "folder that belongs to it, or empty it, for example with the update CLEAR ALL"
            )
        if self._endpoint.query("ASK { { ?s ?p ?o } UNION { GRAPH ?g { ?s ?p ?o } } }"):
            raise InvalidConfiguration(
                f"the store at {self._endpoint.address} holds statements that are not this "
                "board's; it would have to remove them. Give an empty store"
            )

    def _carry_out(self, steps: Sequence[str], commit: int) -> None:
        with self._applying:
            self._sequence += 1
            try:
                if self._was_lost:
                    self._check_return(commit)
                self._was_lost = True
                self._endpoint.update(" ;\n".join([*steps, self._marking(commit)]))
                self._was_lost = False
                self._applied = commit
            finally:
                self._sequence += 1

    def _check_return(self, commit: int) -> None:
        """Makes sure that an endpoint that was lost has come back as it was.

        It may have carried out the update whose answer was lost; to repeat that does no harm.
        """
        noted = self._noted()
        at, owner = int(noted.get(_APPLIED, "0")), noted.get(_JOURNAL)
        if at not in (self._applied, commit) or owner not in (None, self._journal()):
            raise StorageFailed(
                f"the store at {self._endpoint.address} came back at commit {at}, but was at "
                f"{self._applied}: it has lost statements, or somebody else writes there. Restart "
                "the board, which sees to it"
            )

    def _noted(self) -> dict[str, str]:
        """The board's own notes."""
        return {
            str(row["p"]): str(getattr(row["o"], "value", ""))
            for row in self._select(f"SELECT ?p ?o {{ GRAPH {META} {{ {META} ?p ?o }} }}")
        }

    def _marking(self, commit: int) -> str:
        notes = f'{META} {_APPLIED} {commit} ; {_STATE} "{self._state}" '
        journal = self._journal()
        if journal is not None:
            notes += f'; {_JOURNAL} "{journal}" '
        return (
            f"DELETE WHERE {{ GRAPH {META} {{ {META} ?p ?o }} }} ;\n"
            f"INSERT DATA {{ GRAPH {META} {{ {notes} }} }}"
        )

    def _select(self, sparql: str) -> ox.QuerySolutions:
        results = self._endpoint.query(sparql)
        assert isinstance(results, ox.QuerySolutions)
        return results


def _line(quad: ox.Quad) -> str:
    """A quad for DATA and for ASK, with IRIs for blank nodes."""
    triple = f"{_text(quad.subject)} {quad.predicate} {_text(quad.object)} "
    if isinstance(quad.graph_name, ox.DefaultGraph):
        return triple + ".\n"
    return f"GRAPH {quad.graph_name} {{ {triple} }}\n"


def _text(term: Term) -> str:
    return f"<{BLANK}{term.value}>" if isinstance(term, ox.BlankNode) else str(term)
