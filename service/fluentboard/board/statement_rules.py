"""Statement rules: what updates may not say or unsay."""

from __future__ import annotations

from collections.abc import Callable

import pyoxigraph as ox

from fluentboard.board.pending_statements import PendingStatements
from fluentboard.board.rdf_store import RdfStore
from fluentboard.board.store import HIDDEN_GRAPHS
from fluentboard.board.triples import fluent_name
from fluentboard.board.vocabulary import (
    PROPER_SUB_CLASS_OF,
    RDF_TYPE,
    SUB_CLASS_OF_OR_SAME,
    declares_class,
)
from fluentboard.errors import FluentboardError, FluentsAreReadOnly, NotAllowed

_CLOSURE = frozenset({PROPER_SUB_CLASS_OF, SUB_CLASS_OF_OR_SAME})
_TYPE = ox.NamedNode(RDF_TYPE)
_DEFAULT = ox.DefaultGraph()


class ProtectedStatement(NotAllowed):
    """An update would change what an ontology says, or the board's own notes."""

    code = "protected-statement"
    http_status = 403


class ClassInUse(FluentboardError):
    """An update would take away the declaration of a class that fluents belong to."""

    code = "class-in-use"
    http_status = 409


class StatementRules:
    """Checks changes before they are made.

    Args:
        store: what is committed.
        is_in_ontology: whether an ontology says a statement of the default graph.
        has_fluent: whether there is a fluent of a name.
    """

    def __init__(
        self,
        store: RdfStore,
        is_in_ontology: Callable[[ox.Quad], bool],
        has_fluent: Callable[[str], bool],
    ) -> None:
        self._store = store
        self._has_fluent = has_fluent
        self.is_in_ontology = is_in_ontology

    def check_added(self, quad: ox.Quad) -> None:
        """Refuses to say what is not an update's to say.

        Raises:
            FluentsAreReadOnly: it is about a fluent.
            ProtectedStatement: it is a note of the board.
        """
        self._check_subject(quad)
        self._check_graph(quad.graph_name)
        if quad.predicate.value in _CLOSURE:
            raise ProtectedStatement(
                f"{quad.predicate} relates classes as the board has worked out; say "
                "rdfs:subClassOf, and it follows",
                predicate=quad.predicate.value,
            )

    def check_removed(
        self, quad: ox.Quad, pending: PendingStatements, *, spares_ontologies: bool = False
    ) -> bool:
        """Whether a statement is an update's to unsay; False if there is nothing to unsay.

        Args:
            quad: the statement.
            pending: what updates say.
            spares_ontologies: what an ontology says is left alone rather than refused.

        Raises:
            FluentsAreReadOnly: it is about a fluent.
            ProtectedStatement: it is a note of the board, or an ontology says it.
        """
        self._check_subject(quad)
        self._check_graph(quad.graph_name)
        if quad in pending:
            return True
        if (
            not spares_ontologies
            and isinstance(quad.graph_name, ox.DefaultGraph)
            and self.is_in_ontology(quad)
        ):
            raise ProtectedStatement(
                f"a loaded ontology says {quad.triple}; change its file and start the board with "
                "it, or restrict what the update deletes",
            )
        # What follows from other statements goes with them.
        return False

    def check_graph(self, graph: ox.NamedNode) -> None:
        """Refuses to make or remove the board's own graphs.

        Raises:
            ProtectedStatement: the graph is one of them.
        """
        self._check_graph(graph)

    def check_classes(self, pending: PendingStatements) -> None:
        """Refuses to leave fluents without their class.

        Raises:
            ClassInUse: a class that fluents belong to would no longer be declared.
        """
        for quad in pending.removed:
            subject = quad.subject
            if (
                not isinstance(quad.graph_name, ox.DefaultGraph)
                or not isinstance(subject, ox.NamedNode)
                or not declares_class(quad.triple)
                or self._is_class(subject, pending)
            ):
                continue
            for member in self._store.matching(None, _TYPE, subject, _DEFAULT):
                name = _fluent(member.subject)
                if name is not None:
                    raise ClassInUse(
                        f"{subject} is the class of fluents such as {name!r}, so its declaration "
                        "stays; remove other statements about it if need be",
                        class_iri=subject.value,
                        fluent=name,
                    )

    def _is_class(self, subject: ox.NamedNode, pending: PendingStatements) -> bool:
        said = pending.matching(subject, _TYPE, None, _DEFAULT)
        if any(declares_class(quad.triple) for quad in said):
            return True
        stored = self._store.matching(subject, _TYPE, None, _DEFAULT)
        return any(declares_class(q.triple) and self.is_in_ontology(q) for q in stored)

    def _check_subject(self, quad: ox.Quad) -> None:
        name = _fluent(quad.subject)
        if name is None:
            return
        if self._has_fluent(name):
            instead = f"refine it with PATCH /fluents/{name}, end it with POST /fluents/{name}/end"
        else:
            instead = "assert it with POST /fluents"
        raise FluentsAreReadOnly(
            f"{quad.triple} is about the fluent {name!r}, and fluents are not changed by SPARQL "
            f"Update, so that their intervals stay consistent and nothing is lost; {instead}, or "
            "do several things at once with POST /commands",
            name=name,
        )

    def _check_graph(self, graph: object) -> None:
        if graph in HIDDEN_GRAPHS:
            raise ProtectedStatement(f"{graph} holds the board's own notes; use another graph")


def _fluent(subject: object) -> str | None:
    return fluent_name(subject.value) if isinstance(subject, ox.NamedNode) else None
