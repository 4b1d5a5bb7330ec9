"""The formats of an import, each as a stream of fluents and statements from an open file."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import IO

import pyoxigraph as ox

from fluentboard.api.bodies import NDJSON, YAML, json_lines
from fluentboard.api.descriptions import Descriptions
from fluentboard.api.rdf_bodies import InvalidRdf
from fluentboard.board.blackboard import Blackboard
from fluentboard.board.triples import fluent_from_triples, fluent_name
from fluentboard.board.update_operations import Graph
from fluentboard.errors import InvalidInput, UnknownFluent
from fluentboard.model.fluent import Fluent
from fluentboard.model.yaml_format import read_fluents
from fluentboard_ontology import FLUENT, PREFIXES

Reader = Callable[[IO[bytes], Blackboard, Graph | None], Iterator[Fluent | ox.Quad]]
"""Reads a file; statements that are in no graph of their own go to the given one."""

_RDF_FORMATS = {
    "text/turtle": ox.RdfFormat.TURTLE,
    "application/n-triples": ox.RdfFormat.N_TRIPLES,
    "application/trig": ox.RdfFormat.TRIG,
    "application/n-quads": ox.RdfFormat.N_QUADS,
    "application/ld+json": ox.RdfFormat.JSON_LD,
    "application/rdf+xml": ox.RdfFormat.RDF_XML,
}


def graph_named(iri: str | None, is_default: bool) -> Graph | None:
    """The graph that a request names for statements outside fluents; None if it names none.

    Raises:
        InvalidInput: it names two, or one by something that is no IRI.
    """
    if iri is None:
        return ox.DefaultGraph() if is_default else None
    if is_default:
        raise InvalidInput("the request names both ?default and ?graph; give one of them")
    try:
        return ox.NamedNode(iri)
    except ValueError as problem:
        raise InvalidInput(f"the graph {iri!r} is no IRI: {problem}", parameter="graph") from None


def _from_yaml(file: IO[bytes], board: Blackboard, target: Graph | None) -> Iterator[Fluent]:
    return read_fluents(file, "the import")


def _from_json_lines(file: IO[bytes], board: Blackboard, target: Graph | None) -> Iterator[Fluent]:
    return json_lines(file)


def _from_rdf(
    media_type: str, file: IO[bytes], board: Blackboard, target: Graph | None
) -> Iterator[Fluent | ox.Quad]:
    """What an RDF file says; the triples of a fluent may stand anywhere in it.

    A blank node is named after the file and its place in it, so that the same file can be imported
    again without saying anything twice.

    Raises:
        InvalidRdf: it does not parse, or names a graph by a blank node.
        InvalidInput: it says something that is not about a fluent, in no graph, and `target` is
            None.
    """
    whole = hashlib.sha256()
    while block := file.read(2**20):
        whole.update(block)
    digest = whole.digest()
    file.seek(0)
    names: dict[ox.BlankNode, ox.BlankNode] = {}

    def named(node: ox.BlankNode) -> ox.BlankNode:
        if node not in names:
            label = hashlib.sha256(digest + str(len(names)).encode()).hexdigest()
            names[node] = ox.BlankNode("a" + label[:31])
        return names[node]

    with Descriptions() as descriptions:
        for quad in _parsed(file, media_type):
            subject, graph = quad.subject, quad.graph_name
            if isinstance(graph, ox.DefaultGraph):
                name = fluent_name(subject.value) if isinstance(subject, ox.NamedNode) else None
                if name is not None:
                    descriptions.add(name, quad.triple)
                    continue
                if target is None:
                    raise InvalidInput(
                        f"the import says something of {subject}, which is no fluent: the IRI of a "
                        f"fluent begins with {FLUENT}. Name a graph for such statements with "
                        "?graph=IRI, or load an ontology with `fluentboard serve --ontology`"
                    )
                graph = target
            elif isinstance(graph, ox.BlankNode):
                raise InvalidRdf("the import has a graph without an IRI; give it one")
            value = quad.object
            yield ox.Quad(
                named(subject) if isinstance(subject, ox.BlankNode) else subject,
                quad.predicate,
                named(value) if isinstance(value, ox.BlankNode) else value,
                graph,
            )
        yield from _fluents(descriptions, board)


def _parsed(file: IO[bytes], media_type: str) -> Iterator[ox.Quad]:
    try:
        yield from ox.parse(file, format=_RDF_FORMATS[media_type], base_iri=FLUENT)
    except (SyntaxError, ValueError) as problem:
        raise InvalidRdf(f"the import does not parse as {media_type}: {problem}") from None


def _fluents(descriptions: Descriptions, board: Blackboard) -> Iterator[Fluent]:
    def class_of(name: str) -> str:
        found = descriptions.class_of(name)
        if found is not None:
            return found
        try:
            return board.fluent(name).class_name
        except UnknownFluent:
            # RDF does not say what a reference that leads nowhere was meant to be.
            return PREFIXES["upper"] + "Fluent"

    for triples in descriptions:
        yield fluent_from_triples(triples, board.vocabulary, class_of)


READERS: Mapping[str, Reader] = {
    YAML: _from_yaml,
    NDJSON: _from_json_lines,
    **{media_type: partial(_from_rdf, media_type) for media_type in _RDF_FORMATS},
}
"""By media type."""
