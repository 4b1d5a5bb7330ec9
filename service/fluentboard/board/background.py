"""Background: what is said outside fluents (ontologies, other graphs), as of a commit."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import pyoxigraph as ox

from fluentboard.board.declarations import quads_of
from fluentboard.board.events import StatementsChanged
from fluentboard.board.statement_layers import StatementLayers
from fluentboard.board.store import SAID, in_hidden_graph
from fluentboard.board.triples import fluent_name
from fluentboard.board.vocabulary import Vocabulary


class Background:
    """All statements outside fluents, the materialised class hierarchy included.

    It starts empty and follows the journal commit by commit, as the RDF store does.
    """

    def __init__(self) -> None:
        # Stores rather than sets, because they take 1.0 and 1.00 for the same literal.
        self._quads = ox.Store()
        self._said = ox.Store()
        self._layers = StatementLayers(lambda quad: in_hidden_graph(quad) in self._said)

    @property
    def vocabulary(self) -> Vocabulary:
        """What is declared among the statements."""
        return self._layers.vocabulary

    def __contains__(self, quad: ox.Quad) -> bool:
        return quad in self._quads

    def __iter__(self) -> Iterator[ox.Quad]:
        return iter(self._quads)

    def apply(
        self, changes: Iterable[tuple[int, StatementsChanged]]
    ) -> tuple[list[ox.Quad], list[ox.Quad]]:
        """Takes over what commits changed, given in order with their numbers.

        Returns:
            The statements that are there now and were not before, and the other way round.
        """
        by_commit: dict[int, list[StatementsChanged]] = {}
        for number, change in changes:
            by_commit.setdefault(number, []).append(change)
        was_there: dict[ox.Quad, bool] = {}
        for of_commit in by_commit.values():
            step = self._layers.step(of_commit)
            hidden, removed = _sorted_out(step.removed)
            for quad in hidden:
                self._said.remove(quad)
            hidden, added = _sorted_out(step.added)
            self._said.extend(hidden)
            for graph in step.dropped:
                removed += self._quads.quads_for_pattern(None, None, None, graph)
            for quad in (*added, *removed):
                was_there.setdefault(quad, quad in self._quads)
            for quad in removed:
                self._quads.remove(quad)
            self._quads.extend(added)
        return (
            [quad for quad, before in was_there.items() if not before and quad in self._quads],
            [quad for quad, before in was_there.items() if before and quad not in self._quads],
        )


def fluents_spoken_of(changes: Iterable[tuple[int, StatementsChanged]]) -> set[str]:
    """Names of the fluents about which something is said outside fluents, in the default graph."""
    subjects = (
        quad.subject
        for _, change in changes
        if not change.graph
        for quad in quads_of(change.added, "")
    )
    names = (fluent_name(s.value) for s in subjects if isinstance(s, ox.NamedNode))
    return {name for name in names if name is not None}


def _sorted_out(quads: Iterable[ox.Quad]) -> tuple[list[ox.Quad], list[ox.Quad]]:
    """The statements of the hidden graph, and the others."""
    hidden: list[ox.Quad] = []
    others: list[ox.Quad] = []
    for quad in quads:
        (hidden if quad.graph_name == SAID else others).append(quad)
    return hidden, others
