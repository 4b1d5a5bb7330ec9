"""Background: what is said outside fluents (ontologies, other graphs), as of a commit."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import pyoxigraph as ox

from fluentboard.board.events import StatementsChanged
from fluentboard.board.triples import fluent_name
from fluentboard.board.vocabulary import Statement, Vocabulary

_DEFAULT = ox.DefaultGraph()


class Background:
    """All statements outside fluents, the materialised class hierarchy included.

    It starts empty and follows the journal commit by commit, as the RDF store does.

    Attributes:
        vocabulary: what the ontologies among the statements declare.
    """

    def __init__(self) -> None:
        # A store rather than a set, because it takes 1.0 and 1.00 for the same literal.
        self._quads = ox.Store()
        self.vocabulary = Vocabulary()
        self._ontologies: dict[str, StatementsChanged] = {}
        self._closure: set[Statement] = set()

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
            added, removed = self._step(of_commit)
            for quad in (*added, *removed):
                was_there.setdefault(quad, quad in self._quads)
            self._quads.extend(added)
            for quad in removed:
                self._quads.remove(quad)
        return (
            [quad for quad, before in was_there.items() if not before and quad in self._quads],
            [quad for quad, before in was_there.items() if before and quad not in self._quads],
        )

    def _step(self, changes: list[StatementsChanged]) -> tuple[list[ox.Quad], list[ox.Quad]]:
        """What one commit adds, and what it removes thereafter."""
        loaded = {change.ontology: change for change in changes if change.ontology}
        if loaded:
            self._ontologies.update(loaded)
            self.vocabulary = Vocabulary(
                quad.triple
                for change in self._ontologies.values()
                for quad in _quads(change.added, "")
            )
        closure = self.vocabulary.closure()
        added = _quads(_text(closure - self._closure), "")
        removed = _quads(_text(self._closure - closure), "")
        self._closure = closure
        for change in changes:
            added += _quads(change.added, change.graph)
            removed += _quads(change.removed, change.graph)
        # An ontology that stays may say some of what another one no longer says.
        kept = {
            quad
            for change in (self._ontologies.values() if removed else ())
            for quad in _quads(change.added, "")
        }
        return added, [quad for quad in removed if quad not in kept]


def fluents_spoken_of(changes: Iterable[tuple[int, StatementsChanged]]) -> set[str]:
    """Names of the fluents about which something is said outside fluents, in the default graph."""
    subjects = (
        quad.subject
        for _, change in changes
        if not change.graph
        for quad in _quads(change.added, "")
    )
    names = (fluent_name(s.value) for s in subjects if isinstance(s, ox.NamedNode))
    return {name for name in names if name is not None}


def _text(statements: Iterable[Statement]) -> str:
    return "".join(f"{s} {p} {o} .\n" for s, p, o in statements)


def _quads(text: str, graph: str) -> list[ox.Quad]:
    name = ox.NamedNode(graph) if graph else _DEFAULT
    if not graph:
        return list(ox.parse(text, format=ox.RdfFormat.N_TRIPLES))
    return [
        ox.Quad(quad.subject, quad.predicate, quad.object, name)
        for quad in ox.parse(text, format=ox.RdfFormat.N_TRIPLES)
    ]
