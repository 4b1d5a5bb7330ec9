"""Statement layers: how what is said outside fluents becomes the statements of the RDF store.

The default graph is the union of what the ontologies say, what updates say, the materialised class
hierarchy, and the fluents. A statement goes from it only when no layer says it any more. Named
graphs are what updates say.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

import pyoxigraph as ox

from fluentboard.board.declarations import Declarations, quads_of
from fluentboard.board.events import StatementsChanged
from fluentboard.board.store import in_hidden_graph
from fluentboard.board.vocabulary import Statement, Vocabulary


@dataclass(frozen=True, slots=True)
class Step:
    """What a commit changes in the store.

    Attributes:
        added: statements; those in the hidden graph too.
        removed: likewise; to be removed before the others are added.
        created: named graphs that are there from now on.
        dropped: named graphs that are not there any more, with all that they said.
    """

    added: list[ox.Quad] = field(default_factory=list[ox.Quad])
    removed: list[ox.Quad] = field(default_factory=list[ox.Quad])
    created: list[ox.NamedNode] = field(default_factory=list[ox.NamedNode])
    dropped: list[ox.NamedNode] = field(default_factory=list[ox.NamedNode])


class StatementLayers:
    """Turns changes into steps, commit by commit.

    Args:
        says: whether an update has said a statement of the default graph.
    """

    def __init__(self, says: Callable[[ox.Quad], bool]) -> None:
        self._says = says
        self._declarations = Declarations()
        # A store rather than a set, because it takes 1.0 and 1.00 for the same literal.
        self._ontology = ox.Store()
        self._closure: set[Statement] = set()

    @property
    def vocabulary(self) -> Vocabulary:
        """What is declared after the last step."""
        return self._declarations.vocabulary

    def is_in_ontology(self, quad: ox.Quad) -> bool:
        """An ontology that is loaded says the statement."""
        return quad in self._ontology

    def skip(self, changes: Sequence[StatementsChanged]) -> None:
        """Takes over a commit that the store has applied already."""
        if self._declarations.apply(changes):
            self._closure = self.vocabulary.closure()
            self._note_ontologies()

    def step(self, changes: Sequence[StatementsChanged]) -> Step:
        """What the changes of one commit mean for the store."""
        step = Step()
        # Changes of ontologies replace what they said before, whole.
        is_new = self._declarations.apply(changes)
        if is_new:
            self._note_ontologies()
        for change in changes:
            if change.ontology:
                self._load(change, step)
            elif change.graph:
                step.added.extend(quads_of(change.added, change.graph))
                if change.graph_event == "dropped":
                    step.dropped.append(ox.NamedNode(change.graph))
                else:
                    step.removed.extend(quads_of(change.removed, change.graph))
                if change.graph_event == "created":
                    step.created.append(ox.NamedNode(change.graph))
            else:
                self._say(change, step)
        if is_new:
            closure = self.vocabulary.closure()
            step.added.extend(quads_of(_text(closure - self._closure), ""))
            step.removed.extend(quads_of(_text(self._closure - closure), ""))
            self._closure = closure
        return step

    def _load(self, change: StatementsChanged, step: Step) -> None:
        step.added.extend(quads_of(change.added, ""))
        step.removed.extend(
            quad
            for quad in quads_of(change.removed, "")
            if quad not in self._ontology and not self._says(quad)
        )

    def _say(self, change: StatementsChanged, step: Step) -> None:
        added = quads_of(change.added, "")
        step.added.extend(added)
        step.added.extend(in_hidden_graph(quad) for quad in added)
        for quad in quads_of(change.removed, ""):
            step.removed.append(in_hidden_graph(quad))
            if quad not in self._ontology:
                step.removed.append(quad)

    def _note_ontologies(self) -> None:
        self._ontology = ox.Store()
        for change in self._declarations.ontologies.values():
            self._ontology.extend(quads_of(change.added, ""))


def _text(statements: Iterable[Statement]) -> str:
    return "".join(f"{s} {p} {o} .\n" for s, p, o in statements)
