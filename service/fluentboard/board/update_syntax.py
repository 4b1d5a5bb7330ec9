"""SPARQL 1.1 Update text to operations.

Oxigraph's parser decides what is an update; this file then only has to find where each operation
begins and what kind it is. Statements and templates are read by Oxigraph too: a template is data
in which variables stand in as IRIs of a name space of their own.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Literal, cast

import pyoxigraph as ox

from fluentboard.board.query_reach import reach_of
from fluentboard.board.query_size import check_size
from fluentboard.board.sparql_tokens import Token, has_word
from fluentboard.board.update_operations import (
    Clear,
    Create,
    DeleteStatements,
    Graph,
    InsertStatements,
    Load,
    Modify,
    Operation,
    Position,
    TemplateQuad,
    Transfer,
)
from fluentboard.board.update_text import OperationText, operations_in
from fluentboard.errors import InvalidQuery
from fluentboard_ontology import PREFIXES

_VARIABLE = "urn:x-fluentboard:variable:"
_PREFIXES = dict(PREFIXES)
_DEFAULT = ox.DefaultGraph()


def parse_update(
    text: str,
    *,
    base_iri: str | None = None,
    using_graphs: Sequence[str] = (),
    using_named_graphs: Sequence[str] = (),
) -> list[Operation]:
    """The operations of an update request, in order.

    Args:
        text: SPARQL 1.1 Update; well-known prefixes need no declaration.
        base_iri: what relative IRIs are relative to.
        using_graphs: as if every WHERE had `USING` these.
        using_named_graphs: as if every WHERE had `USING NAMED` these.

    Raises:
        InvalidQuery: it does not parse, calls SERVICE, or names its dataset although the request
            does so too.
    """
    check_size(text)
    parts = operations_in(text, base_iri)
    for part in parts:
        if has_word(part.tokens, "SERVICE"):
            raise InvalidQuery(
                "an update cannot ask other endpoints; ask them with a query (SERVICE) first, and "
                "write what they answer with INSERT DATA"
            )
    dataset = _named_nodes(using_graphs), _named_nodes(using_named_graphs)
    return [
        _Reader(text, part, base_iri, *dataset, follows_others=number > 0).operation()
        for number, part in enumerate(parts)
    ]


class _Reader:
    """Walks over the tokens of an operation that is known to parse."""

    def __init__(
        self,
        text: str,
        part: OperationText,
        base_iri: str | None,
        using: tuple[ox.NamedNode, ...],
        using_named: tuple[ox.NamedNode, ...],
        *,
        follows_others: bool,
    ) -> None:
        self._text = text
        self._tokens = part.tokens
        self._prologue = part.prologue
        self._base_iri = base_iri
        self._here = 0
        self._has_dataset = bool(using or using_named)
        self._using = using
        self._using_named = using_named
        self._follows_others = follows_others

    def operation(self) -> Operation:
        """What the tokens say."""
        word = self._next().text.upper()
        if word == "LOAD":
            is_silent = self._takes("SILENT")
            address = self._iri().value
            target: Graph = _DEFAULT
            if self._takes("INTO"):
                self._takes("GRAPH")
                target = self._iri()
            return Load(address, target, is_silent)
        if word in ("CLEAR", "DROP"):
            is_silent = self._takes("SILENT")
            return Clear(self._target(), word == "DROP", is_silent)
        if word == "CREATE":
            is_silent = self._takes("SILENT")
            self._takes("GRAPH")
            return Create(self._iri(), is_silent)
        if word in ("ADD", "COPY", "MOVE"):
            is_silent = self._takes("SILENT")
            source = self._graph()
            self._takes("TO")
            kind = cast("Literal['add', 'copy', 'move']", word.lower())
            return Transfer(kind, source, self._graph(), is_silent)
        if word == "INSERT" and self._takes("DATA"):
            return InsertStatements(tuple(self._data(self._group())))
        if word == "DELETE" and self._takes("DATA"):
            return DeleteStatements(tuple(self._data(self._group())))
        if word == "DELETE" and self._takes("WHERE"):
            group = self._group()
            return self._modify(group, None, None, "", group)
        self._here = 0
        return self._modification()

    def _modification(self) -> Modify:
        graph = self._iri() if self._takes("WITH") else None
        if graph is not None and self._has_dataset:
            raise _conflict("WITH")
        delete = self._group() if self._takes("DELETE") else None
        insert = self._group() if self._takes("INSERT") else None
        dataset = ""
        while self._takes("USING"):
            if self._has_dataset:
                raise _conflict("USING")
            named = "NAMED " if self._takes("NAMED") else ""
            dataset += f"FROM {named}{self._next().text}\n"
        self._takes("WHERE")
        return self._modify(delete, insert, graph, dataset, self._group())

    def _modify(
        self,
        delete: Sequence[Token] | None,
        insert: Sequence[Token] | None,
        graph: ox.NamedNode | None,
        dataset: str,
        where: Sequence[Token],
    ) -> Modify:
        variables = dict.fromkeys(
            "?" + token.text[1:]
            for token in (*(delete or ()), *(insert or ()))
            if token.kind == "variable"
        )
        pattern = self._text[where[0].start : where[-1].end]
        columns = " ".join(variables) or "(1 AS ?x_fluentboard_any)"
        default_graphs: tuple[Graph, ...] | None = None
        named_graphs: tuple[ox.NamedNode, ...] | None = None
        if self._has_dataset:
            default_graphs, named_graphs = self._using, self._using_named
        elif graph is not None and not dataset:
            default_graphs = (graph,)
        insert_template = self._template(insert, graph)
        # The same solution twice makes a difference only where it makes new blank nodes.
        distinct = "" if _makes_blank_nodes(insert_template) else "DISTINCT "
        query = f"{self._prologue}SELECT {distinct}{columns}\n{dataset}WHERE {pattern}"
        return Modify(
            query,
            self._template(delete, graph),
            insert_template,
            default_graphs,
            named_graphs,
            self._base_iri,
            reach_of(query) if self._follows_others else None,
        )

    def _template(
        self, group: Sequence[Token] | None, graph: ox.NamedNode | None
    ) -> tuple[TemplateQuad, ...]:
        if group is None:
            return ()
        quads = self._data(group)
        return tuple(
            TemplateQuad(
                _position(quad.subject),
                _position(quad.predicate),
                _position(quad.object),
                _graph_position(quad, graph),
            )
            for quad in quads
        )

    def _data(self, group: Sequence[Token]) -> list[ox.Quad]:
        """The statements in braces; a variable becomes an IRI."""
        if any(token.kind == "variable" for token in group):
            parts: list[str] = []
            last = group[0].start
            for token in group:
                if token.kind == "variable":
                    parts += [self._text[last : token.start], f" <{_VARIABLE}{token.text[1:]}> "]
                    last = token.end
            parts.append(self._text[last : group[-1].end])
            text = "".join(parts)
        else:
            text = self._text[group[0].start : group[-1].end]
        store = ox.Store()
        store.update(
            f"{self._prologue}INSERT DATA {text}", base_iri=self._base_iri, prefixes=_PREFIXES
        )
        return list(store)

    def _target(self) -> Graph | Literal["named", "all"]:
        if self._takes("NAMED"):
            return "named"
        return "all" if self._takes("ALL") else self._graph()

    def _graph(self) -> Graph:
        if self._takes("DEFAULT"):
            return _DEFAULT
        self._takes("GRAPH")
        return self._iri()

    def _iri(self) -> ox.NamedNode:
        """The IRI that the next token stands for."""
        token = self._next()
        store = ox.Store()
        store.update(
            f"{self._prologue}CREATE GRAPH {token.text}",
            base_iri=self._base_iri,
            prefixes=_PREFIXES,
        )
        (graph,) = store.named_graphs()
        assert isinstance(graph, ox.NamedNode)
        return graph

    def _group(self) -> Sequence[Token]:
        """The tokens from an opening brace to the one that closes it."""
        begin, depth = self._here, 0
        while True:
            text = self._next().text
            depth += {"{": 1, "}": -1}.get(text, 0)
            if depth == 0:
                return self._tokens[begin : self._here]

    def _takes(self, word: str) -> bool:
        """Goes over the keyword if it comes next."""
        if self._here < len(self._tokens) and self._peek().is_word(word):
            self._here += 1
            return True
        return False

    def _peek(self) -> Token:
        return self._tokens[self._here]

    def _next(self) -> Token:
        self._here += 1
        return self._tokens[self._here - 1]


def _position(term: object) -> Position:
    if isinstance(term, ox.NamedNode):
        name = term.value.removeprefix(_VARIABLE)
        return term if name == term.value else ox.Variable(name)
    if isinstance(term, ox.Triple) and (_VARIABLE in str(term) or "_:" in str(term)):
        raise InvalidQuery(
            "a template has a triple term with a variable or blank node in it; name its parts "
            "instead (rdf:reifies is not supported in templates)"
        )
    assert isinstance(term, ox.BlankNode | ox.Literal | ox.Triple)
    return term


def _graph_position(quad: ox.Quad, graph: ox.NamedNode | None) -> Graph | ox.Variable:
    name = quad.graph_name
    if isinstance(name, ox.DefaultGraph):
        return name if graph is None else graph
    found = _position(name)
    assert isinstance(found, ox.NamedNode | ox.Variable)
    return found


def _makes_blank_nodes(template: Iterable[TemplateQuad]) -> bool:
    return any(
        isinstance(position, ox.BlankNode)
        for quad in template
        for position in (quad.subject, quad.object)
    )


def _named_nodes(iris: Sequence[str]) -> tuple[ox.NamedNode, ...]:
    try:
        return tuple(ox.NamedNode(iri) for iri in iris)
    except ValueError as problem:
        raise InvalidQuery(f"a graph of the dataset is no IRI: {problem}") from None


def _conflict(word: str) -> InvalidQuery:
    return InvalidQuery(
        f"the update has a {word} clause, but the request names the dataset too (using-graph-uri "
        "or using-named-graph-uri); keep one of the two"
    )
