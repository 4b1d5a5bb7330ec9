"""Namespaces of the RDF4J protocol: the board's own, and those that clients keep there.

A client's namespace is a statement of the default graph: `<IRI> vann:preferredNamespacePrefix "p"`.
"""

from __future__ import annotations

import re

import pyoxigraph as ox

from fluentboard.board.graphs import Graphs
from fluentboard.board.update_operations import (
    DeleteStatements,
    InsertStatements,
    Operation,
)
from fluentboard.errors import InvalidName, NotAllowed, UnknownResource
from fluentboard_ontology import PREFIXES

_PREFERRED = ox.NamedNode("http://purl.org/vocab/vann/preferredNamespacePrefix")
_DEFAULT = ox.DefaultGraph()
_PREFIX = re.compile(r"[^\W\d_](?:[\w.-]*[\w-])?")


def namespaces(graphs: Graphs) -> dict[str, str]:
    """The IRI of each prefix."""
    found = {
        quad.object.value: quad.subject.value
        for quad in graphs.statements(None, _PREFERRED, graphs=[_DEFAULT])
        if isinstance(quad.object, ox.Literal) and isinstance(quad.subject, ox.NamedNode)
    }
    return {**found, **PREFIXES}


def setting(graphs: Graphs, prefix: str, iri: str) -> list[Operation]:
    """What has a prefix stand for an IRI.

    Raises:
        InvalidName: the prefix or the IRI is none.
        NotAllowed: the prefix is one of the board's own.
    """
    if PREFIXES.get(prefix) == iri:
        return []
    _check(prefix)
    try:
        node = ox.NamedNode(iri)
    except ValueError as problem:
        raise InvalidName(f"the namespace {iri!r} is no IRI: {problem}") from None
    quad = ox.Quad(node, _PREFERRED, ox.Literal(prefix), _DEFAULT)
    return [DeleteStatements(_said(graphs, prefix)), InsertStatements((quad,))]


def removal(graphs: Graphs, prefix: str) -> list[Operation]:
    """What forgets a prefix.

    Raises:
        NotAllowed: the prefix is one of the board's own.
        UnknownResource: there is no such prefix.
    """
    _check(prefix)
    said = _said(graphs, prefix)
    if not said:
        raise UnknownResource(f"there is no prefix {prefix!r}", prefix=prefix)
    return [DeleteStatements(said)]


def clearing(graphs: Graphs) -> list[Operation]:
    """What forgets all prefixes but the board's own."""
    return [DeleteStatements(_said(graphs, None))]


def _check(prefix: str) -> None:
    if prefix in PREFIXES:
        raise NotAllowed(
            f"the prefix {prefix!r} is the board's own, for <{PREFIXES[prefix]}>; choose another",
            prefix=prefix,
        )
    if not _PREFIX.fullmatch(prefix):
        raise InvalidName(
            f"{prefix!r} is no prefix; give letters and digits such as ex", name=prefix
        )


def _said(graphs: Graphs, prefix: str | None) -> tuple[ox.Quad, ...]:
    """The statements about one prefix, or all, that updates made."""
    target = None if prefix is None else ox.Literal(prefix)
    found = graphs.statements(None, _PREFERRED, target, graphs=[_DEFAULT])
    return tuple(quad for quad in found if graphs.was_said(quad))
