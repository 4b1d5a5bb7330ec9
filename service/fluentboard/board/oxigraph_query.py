"""Queries of an Oxigraph store, with its errors as ours and its departures from SPARQL mended."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import Any

import pyoxigraph as ox

from fluentboard.board.engine_repairs import repaired
from fluentboard.board.prepared_queries import reading
from fluentboard.board.sparql_tokens import declared_prefixes, tokens_of
from fluentboard.errors import InvalidQuery
from fluentboard_ontology import FB, PREFIXES

QueryResults = ox.QuerySolutions | ox.QueryTriples | ox.QueryBoolean
GraphName = ox.NamedNode | ox.BlankNode | ox.DefaultGraph

_UNKNOWN_PREFIX = "Prefix not found"
_UNKNOWN_FUNCTION = re.compile(r"The custom function <(.*)> is not supported")


def ask(
    store: ox.Store,
    sparql: str,
    default_graphs: Sequence[GraphName] | None,
    named_graphs: Sequence[ox.NamedNode | ox.BlankNode] | None,
    all_graphs: Callable[[], Sequence[ox.NamedNode]],
    **extra: Any,
) -> QueryResults:
    """The results of a query on the snapshot of this moment.

    Args:
        store: what is asked.
        sparql: SPARQL 1.1 text; well-known prefixes need no declaration.
        default_graphs: merged into the default graph; None for the store's own.
        named_graphs: what `GRAPH` sees; None for what the query names, else all.
        all_graphs: gives the named graphs that a query sees by default.
        extra: passed to Oxigraph.

    Raises:
        InvalidQuery: it does not parse, or cannot be evaluated.
    """
    known = reading(sparql)
    has_dataset = named_graphs is not None
    if named_graphs is None and known.sees_all_graphs:
        named_graphs = all_graphs()
    options: dict[str, Any] = {
        "prefixes": known.prefixes,
        "default_graph": None if default_graphs is None else list(default_graphs),
        "named_graphs": None if named_graphs is None else list(named_graphs),
        **extra,
    }

    def graphs() -> list[str]:
        return [graph.value for graph in named_graphs or ()]

    text = sparql
    if known.needs_repair:
        text = repaired(sparql, graphs, has_dataset=has_dataset)
    try:
        return _evaluated(store, text, options)
    except SyntaxError as problem:
        message = str(problem) if text is sparql else _complaint(store, sparql, options)
        if _UNKNOWN_PREFIX in message and (unknown := undeclared_prefixes(sparql)):
            raise InvalidQuery(
                f"the prefix {unknown[0]!r} is not declared; add PREFIX {unknown[0]}: <...>, or "
                f"use one that needs no declaration: {', '.join(PREFIXES)}",
                undeclared=unknown,
            ) from None
        if not sparql.strip():
            raise InvalidQuery(
                "the query is empty; send one such as SELECT * WHERE { ?s ?p ?o } LIMIT 10"
            ) from None
        raise InvalidQuery(f"the query does not parse: {message}") from None
    except (ValueError, OSError, RuntimeError) as problem:
        raise InvalidQuery(f"the query cannot be evaluated: {problem}") from None


def undeclared_prefixes(sparql: str) -> list[str]:
    """The prefixes that a query uses, in its order, without having declared them.

    Example:
        >>> undeclared_prefixes("SELECT * { ?a foaf:knows ?b . ?b a race:Mug }")
        ['foaf']
    """
    tokens = tokens_of(sparql)
    known = {*PREFIXES, *declared_prefixes(tokens)}
    used = (token.text.partition(":")[0] for token in tokens if token.kind == "pname")
    return [prefix for prefix in dict.fromkeys(used) if prefix not in known]


def _evaluated(store: ox.Store, text: str, options: dict[str, Any]) -> QueryResults:
    while True:
        try:
            return store.query(text, **options)
        except RuntimeError as problem:
            # A function that is not known makes its expression an error, not the whole query.
            match = _UNKNOWN_FUNCTION.search(str(problem))
            if match is None or match[1].startswith(FB):
                raise
            known: dict[Any, Any] = options.get("custom_functions") or {}
            options = {**options, "custom_functions": {**known, ox.NamedNode(match[1]): _no_value}}


def _complaint(store: ox.Store, sparql: str, options: dict[str, Any]) -> str:
    """What Oxigraph says of the query as it was sent, with its lines and columns."""
    try:
        store.query(sparql, **options)
    except SyntaxError as problem:
        return str(problem)
    return "it uses GRAPH, VALUES or GROUP_CONCAT in a way that this board does not support"


def _no_value(*_: object) -> None:
    return None
