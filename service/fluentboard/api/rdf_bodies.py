"""RDF bodies: statements as they are sent, in any of the formats of RDF."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from email.parser import BytesParser
from email.policy import HTTP

import pyoxigraph as ox

from fluentboard.board.update_operations import Graph
from fluentboard.errors import InvalidInput, TooLarge, UnsupportedMediaType

PROPER_FORMATS: Mapping[str, ox.RdfFormat] = {
    "text/turtle": ox.RdfFormat.TURTLE,
    "application/n-triples": ox.RdfFormat.N_TRIPLES,
    "application/ld+json": ox.RdfFormat.JSON_LD,
    "application/rdf+xml": ox.RdfFormat.RDF_XML,
    "application/trig": ox.RdfFormat.TRIG,
    "application/n-quads": ox.RdfFormat.N_QUADS,
    "text/n3": ox.RdfFormat.N3,
}
"""Formats that can be read, by media type."""

FORMATS: Mapping[str, ox.RdfFormat] = {
    **PROPER_FORMATS,
    # What some clients call them.
    "application/x-turtle": ox.RdfFormat.TURTLE,
    "text/rdf+n3": ox.RdfFormat.N3,
    "text/plain": ox.RdfFormat.N_TRIPLES,
    "application/xml": ox.RdfFormat.RDF_XML,
    "text/xml": ox.RdfFormat.RDF_XML,
    "application/json": ox.RdfFormat.JSON_LD,
    "application/x-trig": ox.RdfFormat.TRIG,
    "text/x-nquads": ox.RdfFormat.N_QUADS,
}
"""The same, and what some clients call them."""

# Oxigraph's names for blank nodes: 128 random bits, which nobody else comes up with.
_OWN_NAME = re.compile(r"[a-f][0-9a-f]{27,31}")

MULTIPART = "multipart/form-data"


class InvalidRdf(InvalidInput):
    """A body is not RDF in the format that its media type says."""

    code = "invalid-rdf"
    http_status = 400


def triples_in(
    body: bytes, content_type: str, base_iri: str, count_max: int
) -> Iterator[ox.Triple]:
    """The triples of a body; blank nodes that did not come from here get new names.

    Args:
        body: the document, or several in a form.
        content_type: the value of the header.
        base_iri: what relative IRIs are relative to.
        count_max: how many there may be.

    Raises:
        InvalidRdf: it does not parse, or has named graphs; the message says where.
        TooLarge: there are too many.
        UnsupportedMediaType: it is in no known format.
    """
    for quad in _quads(body, content_type, base_iri, count_max, without_graphs=True):
        yield quad.triple


def quads_in(
    body: bytes, content_type: str, base_iri: str, count_max: int, graphs: tuple[Graph, ...] = ()
) -> Iterator[ox.Quad]:
    """The quads of a body; blank nodes that did not come from here get new names.

    Args:
        body: the document.
        content_type: the value of the header.
        base_iri: what relative IRIs are relative to.
        count_max: how many there may be.
        graphs: where every statement goes, whatever the body says; empty to do as it says.

    Raises:
        InvalidRdf: it does not parse, or names graphs by blank nodes.
        TooLarge: there are too many.
        UnsupportedMediaType: it is in no known format.
    """
    # In each of several graphs a statement counts.
    count_max //= max(1, len(graphs))
    for quad in _quads(body, content_type, base_iri, count_max, without_graphs=False):
        for graph in graphs:
            yield ox.Quad(quad.subject, quad.predicate, quad.object, graph)
        if not graphs:
            if isinstance(quad.graph_name, ox.BlankNode):
                raise InvalidRdf("the body has a graph without an IRI; give it one")
            yield quad


def _quads(
    body: bytes, content_type: str, base_iri: str, count_max: int, *, without_graphs: bool
) -> Iterator[ox.Quad]:
    count = 0
    for part, media_type in _documents(body, content_type):
        fresh: dict[ox.BlankNode, ox.BlankNode] = {}
        try:
            for parsed in ox.parse(
                part,
                format=FORMATS[media_type],
                base_iri=base_iri,
                without_named_graphs=without_graphs,
            ):
                quad = _renamed(parsed, fresh)
                count += 1
                if count > count_max:
                    raise TooLarge(
                        f"the body has more than {count_max:,} statements; send it in parts",
                        limit=count_max,
                    )
                yield quad
        except (SyntaxError, ValueError) as problem:
            raise InvalidRdf(f"the body does not parse as {media_type}: {problem}") from None


def _renamed(quad: ox.Quad, fresh: dict[ox.BlankNode, ox.BlankNode]) -> ox.Quad:
    """The quad with new blank nodes, but for those that have names as the board gives them.

    So what was read can be sent back, and stays what it is.
    """
    subject, target = quad.subject, quad.object
    if isinstance(subject, ox.BlankNode):
        subject = _known_or_new(subject, fresh)
    if isinstance(target, ox.BlankNode):
        target = _known_or_new(target, fresh)
    if subject is quad.subject and target is quad.object:
        return quad
    return ox.Quad(subject, quad.predicate, target, quad.graph_name)


def _known_or_new(node: ox.BlankNode, fresh: dict[ox.BlankNode, ox.BlankNode]) -> ox.BlankNode:
    if _OWN_NAME.fullmatch(node.value):
        return node
    return fresh.setdefault(node, ox.BlankNode())


def _documents(body: bytes, content_type: str) -> Iterator[tuple[bytes, str]]:
    media_type = content_type.partition(";")[0].strip().lower()
    if media_type != MULTIPART:
        yield body, _known(media_type)
        return
    header = f"Content-Type: {content_type}\r\n\r\n".encode("latin-1", "replace")
    form = BytesParser(policy=HTTP).parsebytes(header + body)
    if not form.is_multipart():
        raise InvalidRdf("the form cannot be taken apart; is its boundary in Content-Type?")
    for part in form.iter_parts():
        content = part.get_payload(decode=True)
        if isinstance(content, bytes):
            yield content, _known(part.get_content_type())


def _known(media_type: str) -> str:
    if media_type not in FORMATS:
        raise UnsupportedMediaType(
            f"statements are sent as {', '.join(PROPER_FORMATS)}, not as "
            f"{media_type or 'untyped bytes'}",
            accepted=list(PROPER_FORMATS),
        )
    return media_type
