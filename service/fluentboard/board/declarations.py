"""Declarations: the vocabulary that ontologies and updates add up to, followed commit by commit."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import pyoxigraph as ox

from fluentboard.board.events import StatementsChanged
from fluentboard.board.vocabulary import Vocabulary, is_declaration


class Declarations:
    """What is declared, layer by layer: each ontology as loaded last, then what updates said.

    Attributes:
        vocabulary: what the layers declare together.
    """

    def __init__(self) -> None:
        self._ontologies: dict[str, StatementsChanged] = {}
        self._loaded: list[ox.Triple] = []
        # In the order in which they were said, so that the same history gives the same names.
        self._said: dict[ox.Triple, None] = {}
        self.vocabulary = Vocabulary()

    @property
    def ontologies(self) -> Mapping[str, StatementsChanged]:
        """By name, what loaded each ontology last."""
        return self._ontologies

    def apply(self, changes: Iterable[StatementsChanged]) -> bool:
        """Takes over what was said and unsaid; True if there is a new vocabulary."""
        loaded: dict[str, StatementsChanged] = {}
        is_new = False
        for change in changes:
            if change.ontology:
                loaded[change.ontology] = change
            elif change.may_declare:
                for triple in _declarations(change.removed):
                    self._said.pop(triple, None)
                    is_new = True
                for triple in _declarations(change.added):
                    self._said[triple] = None
                    is_new = True
        if loaded:
            # Replaced as a whole: others read it from their threads.
            self._ontologies = {**self._ontologies, **loaded}
            self._loaded = [
                triple
                for change in self._ontologies.values()
                for triple in triples_of(change.added)
            ]
        if loaded or is_new:
            self.vocabulary = Vocabulary(self._loaded, self._said)
        return bool(loaded) or is_new


def triples_of(text: str) -> list[ox.Triple]:
    """The triples of N-Triples text; blank nodes keep their names."""
    return [quad.triple for quad in ox.parse(text, format=ox.RdfFormat.N_TRIPLES)]


def quads_of(text: str, graph: str) -> list[ox.Quad]:
    """The statements of N-Triples text in a graph, "" being the default graph."""
    quads = list(ox.parse(text, format=ox.RdfFormat.N_TRIPLES))
    if not graph:
        return quads
    name = ox.NamedNode(graph)
    return [ox.Quad(quad.subject, quad.predicate, quad.object, name) for quad in quads]


def _declarations(text: str) -> list[ox.Triple]:
    return [triple for triple in triples_of(text) if is_declaration(triple)]
