"""The formats of an import, each as a stream of fluents from an open file."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Mapping
from typing import IO

import pyoxigraph as ox

from fluentboard.api.bodies import NDJSON, YAML, json_lines
from fluentboard.board.blackboard import Blackboard
from fluentboard.board.triples import fluent_from_triples, fluent_name
from fluentboard.board.vocabulary import RDF_TYPE
from fluentboard.errors import InvalidInput, UnknownFluent
from fluentboard.model.fluent import Fluent
from fluentboard.model.yaml_format import read_fluents
from fluentboard_ontology import FLUENT, PREFIXES

TURTLE = "text/turtle"

Reader = Callable[[IO[bytes], Blackboard], Iterator[Fluent]]


def _from_yaml(file: IO[bytes], board: Blackboard) -> Iterator[Fluent]:
    return read_fluents(file, "the import")


def _from_json_lines(file: IO[bytes], board: Blackboard) -> Iterator[Fluent]:
    return json_lines(file)


def _from_turtle(file: IO[bytes], board: Blackboard) -> Iterator[Fluent]:
    """The fluents of a Turtle file; the triples of one may stand anywhere in it.

    Raises:
        InvalidInput: it does not parse, or says something that is not about a fluent.
    """
    a = ox.NamedNode(RDF_TYPE)
    with tempfile.TemporaryDirectory(prefix="fluentboard-turtle-") as folder:
        store = ox.Store(folder)
        try:
            store.bulk_load(file, format=ox.RdfFormat.TURTLE, base_iri=FLUENT)
        except SyntaxError as problem:
            raise InvalidInput(f"the import is not Turtle: {problem}") from None

        def class_of(name: str) -> str:
            for quad in store.quads_for_pattern(ox.NamedNode(FLUENT + name), a, None, None):
                if isinstance(quad.object, ox.NamedNode):
                    return quad.object.value
            try:
                return board.fluent(name).class_name
            except UnknownFluent:
                # RDF does not say what a reference that leads nowhere was meant to be.
                return PREFIXES["upper"] + "Fluent"

        for subject in _subjects(store):
            quads = store.quads_for_pattern(subject, None, None, None)
            triples = [quad.triple for quad in quads]
            yield fluent_from_triples(triples, board.vocabulary, class_of)


def _subjects(store: ox.Store) -> Iterator[ox.NamedNode]:
    """Every subject once: the store keeps the triples of a subject together."""
    last: object = None
    for quad in store:
        if quad.subject == last:
            continue
        last = quad.subject
        if not isinstance(last, ox.NamedNode) or fluent_name(last.value) is None:
            raise InvalidInput(
                f"the import says something of {last}, which is no fluent: the IRI of a fluent "
                f"begins with {FLUENT}. Ontologies are loaded with `fluentboard serve --ontology`"
            )
        yield last


READERS: Mapping[str, Reader] = {
    YAML: _from_yaml,
    NDJSON: _from_json_lines,
    TURTLE: _from_turtle,
}
"""By media type."""
