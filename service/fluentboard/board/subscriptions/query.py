"""A standing query as read at registration: form, variables, footprint (pure)."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Literal

import pyoxigraph as ox

from fluentboard.board.query_size import check_size
from fluentboard.board.subscriptions.footprint import Footprint, footprint_of
from fluentboard.board.subscriptions.results import Term
from fluentboard.board.subscriptions.sparql_text import has_escapes, query_form, words
from fluentboard.board.subscriptions.syntax_tree import (
    calls_of,
    template_makes_blank_nodes,
    tree_of,
)
from fluentboard.board.time_functions import FUNCTIONS
from fluentboard.board.triples import ENDPOINTS
from fluentboard.errors import InvalidQuery
from fluentboard_ontology import FB, PREFIXES

logger = logging.getLogger(__name__)

Form = Literal["select", "ask", "construct"]


def _nothing(*_terms: Term) -> None:
    """Stands in for the board's functions where the engine only has to know that they exist."""


_BOARD_NOW = FB + "now"
_END_POINTS = frozenset((None, f"<{iri}>", None) for iri in ENDPOINTS)
_FUNCTIONS = {ox.NamedNode(FB + name): _nothing for name in FUNCTIONS}
_WITHOUT_A_FIXED_ANSWER = ("RAND", "UUID", "STRUUID")


@dataclass(frozen=True, slots=True, eq=False)
class ParsedQuery:
    """What is known of a standing query before it is evaluated.

    Attributes:
        text: the SPARQL text.
        form: which of the three forms it has.
        variables: names of the result's columns; for CONSTRUCT subject, predicate and object.
        why_opaque: why its syntax tree is not to be had or not to be trusted, or "" if it is.
        footprint: which statements the answer depends on.
        reads_graphs: it looks into named graphs, so it may depend on which there are.
        makes_blank_nodes: each evaluation labels some blank nodes of the result anew.
        calls: IRIs of the functions that it calls, casts aside; empty where `why_opaque`.
        is_timeless: the answer follows from the statements alone; false with `NOW()` or `fb:now()`.
    """

    text: str
    form: Form
    variables: tuple[str, ...]
    why_opaque: str
    footprint: Footprint
    reads_graphs: bool
    makes_blank_nodes: bool
    calls: frozenset[str]
    is_timeless: bool


@lru_cache(maxsize=1_024)
def parse(text: str) -> ParsedQuery:
    """Reads a standing query.

    Raises:
        InvalidQuery: it does not parse; it is a DESCRIBE or an update; it calls SERVICE; or it
            calls a function whose value differs at every evaluation.
    """
    check_size(text)
    form = query_form(text)
    if form not in ("select", "ask", "construct"):
        what = "a DESCRIBE query" if form == "describe" else "text without a query form"
        raise InvalidQuery(f"a subscription needs a SELECT, ASK or CONSTRUCT query; this is {what}")
    used = words(text)
    if "SERVICE" in used:
        raise InvalidQuery(
            "a subscription cannot ask another endpoint: the board is not told when SERVICE data "
            "change. Leave SERVICE out and join the results in the client"
        )
    for function in _WITHOUT_A_FIXED_ANSWER:
        if function in used:
            raise InvalidQuery(
                f"a subscription cannot use {function}(): its value differs at every evaluation, "
                "so every solution would change with every commit. Compute it in the client"
            )
    variables = _variables(text, form)
    tree, why = _tree(text)
    calls = frozenset[str]() if tree is None else calls_of(tree)
    footprint = Footprint.everything(why) if tree is None else footprint_of(tree)
    if calls - {_BOARD_NOW}:
        # The board's functions look up the end points of fluents.
        footprint = Footprint(footprint.shapes | _END_POINTS, footprint.why_everything)
    return ParsedQuery(
        text,
        form,
        variables,
        why,
        footprint,
        reads_graphs=not used.isdisjoint(("GRAPH", "FROM")),
        makes_blank_nodes="BNODE" in used
        or (form == "construct" and (tree is None or template_makes_blank_nodes(tree))),
        calls=calls,
        is_timeless="NOW" not in used and _BOARD_NOW not in calls,
    )


def _variables(text: str, form: Form) -> tuple[str, ...]:
    """The columns of the result, as the engine that will evaluate the query sees them."""
    try:
        results = ox.Store().query(text, prefixes=dict(PREFIXES), custom_functions=dict(_FUNCTIONS))
    except SyntaxError as problem:
        raise InvalidQuery(f"the query does not parse: {problem}") from None
    except (ValueError, OSError, RuntimeError) as problem:
        raise InvalidQuery(f"the query cannot be evaluated: {problem}") from None
    if form == "select" and isinstance(results, ox.QuerySolutions):
        return tuple(variable.value for variable in results.variables)
    if form == "construct" and isinstance(results, ox.QueryTriples):
        return ("subject", "predicate", "object")
    if form == "ask" and isinstance(results, ox.QueryBoolean):
        return ()
    raise InvalidQuery("the form of the query cannot be told; put SELECT, ASK or CONSTRUCT first")


def _tree(text: str) -> tuple[Any, str]:
    """The query's syntax tree, or None and the reason why there is none."""
    if "BASE" in words(text):
        return None, "BASE is resolved differently by different parsers"
    if has_escapes(text):
        return None, "escapes in names are read differently by different parsers"
    try:
        return tree_of(text), ""
    # pyparsing and rdflib raise a wide range of types for SPARQL they do not know.
    except Exception as problem:
        logger.info("rdflib does not read a query that Oxigraph reads: %s", problem)
        return None, f"the query analyser does not understand it: {problem}"
