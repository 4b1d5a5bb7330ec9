"""What can be asked of the statements outside fluents: the operations of SPARQL 1.1 Update.

An update request is a list of these, and so is a request of the Graph Store Protocol or of the
RDF4J protocol.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import pyoxigraph as ox

from fluentboard.board.query_reach import Reach

Graph = ox.NamedNode | ox.DefaultGraph
"""A graph that can be changed."""

Term = ox.NamedNode | ox.BlankNode | ox.Literal | ox.Triple
Position = Term | ox.Variable
"""What a place in a template holds."""


@dataclass(frozen=True, slots=True)
class TemplateQuad:
    """A statement with variables, to be filled in with each solution.

    Attributes:
        subject: its blank nodes are new in each solution.
        predicate: a property or a variable.
        object: likewise.
        graph: a graph or a variable.
    """

    subject: Position
    predicate: Position
    object: Position
    graph: Graph | ox.Variable


@dataclass(frozen=True, slots=True)
class InsertStatements:
    """Says statements: INSERT DATA.

    Attributes:
        quads: what to say.
        tolerates: statements that are there already may be of any kind, fluents included, so that
            what was read can be sent back.
    """

    quads: tuple[ox.Quad, ...]
    tolerates: bool = False


@dataclass(frozen=True, slots=True)
class DeleteStatements:
    """No longer says statements: DELETE DATA."""

    quads: tuple[ox.Quad, ...]


@dataclass(frozen=True, slots=True)
class DeleteMatching:
    """No longer says what a pattern matches; None matches any term.

    Attributes:
        subject: a subject or None.
        predicate: a predicate or None.
        object: an object or None.
        graphs: in these graphs; empty for all.
    """

    subject: ox.NamedNode | ox.BlankNode | None
    predicate: ox.NamedNode | None
    object: Term | None
    graphs: tuple[Graph, ...] = ()


@dataclass(frozen=True, slots=True)
class Modify:
    """Deletes and inserts for every solution of a query: DELETE, INSERT ... WHERE.

    Attributes:
        query: SELECT query of the variables in the templates.
        delete: what each solution deletes.
        insert: what each solution inserts.
        default_graphs: what the query's default graph is made of; None for the board's own.
        named_graphs: what the query's GRAPH sees; None for all.
        base_iri: what relative IRIs in the query are relative to.
        reach: what the query can look at; None for everything.
    """

    query: str
    delete: tuple[TemplateQuad, ...]
    insert: tuple[TemplateQuad, ...]
    default_graphs: tuple[Graph, ...] | None = None
    named_graphs: tuple[ox.NamedNode, ...] | None = None
    base_iri: str | None = None
    reach: Reach | None = None


@dataclass(frozen=True, slots=True)
class Clear:
    """Empties graphs, or removes them.

    Attributes:
        target: a graph, the named graphs, or all.
        drops: a named graph itself goes too.
        is_silent: no error if there is no such graph.
    """

    target: Graph | Literal["named", "all"]
    drops: bool = False
    is_silent: bool = False


@dataclass(frozen=True, slots=True)
class Create:
    """Makes an empty named graph.

    Attributes:
        graph: its name.
        is_silent: no error if it is there already.
    """

    graph: ox.NamedNode
    is_silent: bool = False


@dataclass(frozen=True, slots=True)
class Transfer:
    """Brings the statements of one graph into another: ADD, COPY, MOVE.

    Attributes:
        kind: `add` keeps what the target says, `copy` replaces it, `move` also removes the source.
        source: from where.
        target: where to.
        is_silent: no error if there is no such source.
    """

    kind: Literal["add", "copy", "move"]
    source: Graph
    target: Graph
    is_silent: bool = False


@dataclass(frozen=True, slots=True)
class Load:
    """Reads a document from the web into a graph: LOAD.

    Attributes:
        address: of the document.
        target: where its statements go.
        is_silent: no error if it cannot be read.
    """

    address: str
    target: Graph
    is_silent: bool = False


Operation = (
    InsertStatements | DeleteStatements | DeleteMatching | Modify | Clear | Create | Transfer | Load
)


def in_graph(triple: ox.Triple | ox.Quad, graph: Graph) -> ox.Quad:
    """The statement, said in a graph."""
    return ox.Quad(triple.subject, triple.predicate, triple.object, graph)
