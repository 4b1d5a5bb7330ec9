"""Reach: which part of a store a query can look at (pure)."""

from __future__ import annotations

import logging
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, cast

import pyoxigraph as ox
from rdflib.plugins.sparql.parserutils import CompValue

from fluentboard.board.sparql_tokens import has_word, tokens_of
from fluentboard.board.subscriptions.footprint import Shape, footprint_of
from fluentboard.board.subscriptions.sparql_text import has_escapes
from fluentboard.board.subscriptions.syntax_tree import tree_of

logger = logging.getLogger(__name__)

_ABSOLUTE = re.compile(r"<[A-Za-z][A-Za-z0-9+.-]*:")

Pattern = tuple[ox.NamedNode | None, ox.NamedNode | None, ox.NamedNode | ox.Literal | None]
"""Subject, predicate and object; None stands for any term."""


@dataclass(frozen=True, slots=True)
class Reach:
    """What the answer of a query can depend on.

    Attributes:
        patterns: statements that match one of these.
        looks_outside_graphs: patterns stand outside GRAPH groups.
        names_dataset: it has FROM clauses.
    """

    patterns: frozenset[Pattern]
    looks_outside_graphs: bool
    names_dataset: bool


def reach_of(query: str) -> Reach:
    """The reach of a query that parses; everything, if it cannot be told."""
    tokens = tokens_of(query)
    # BASE and escapes are read differently by different parsers.
    is_clear = not has_word(tokens, "BASE") and not has_escapes(query)
    tree = _tree(query) if is_clear else None
    patterns = None if tree is None else _patterns(footprint_of(tree).shapes)
    return Reach(
        frozenset({(None, None, None)}) if patterns is None else patterns,
        tree is None or _looks_outside_graphs(tree),
        has_word(tokens, "FROM"),
    )


def _tree(query: str) -> Any:
    try:
        return tree_of(query)
    # pyparsing and rdflib raise a wide range of types for SPARQL they do not know.
    except Exception as problem:
        logger.info("rdflib does not read a query that Oxigraph reads: %s", problem)
        return None


def _patterns(shapes: frozenset[Shape]) -> frozenset[Pattern] | None:
    found: set[Pattern] = set()
    for shape in shapes:
        for term in shape:
            if term is not None and term.startswith("<") and not _ABSOLUTE.match(term):
                # Only Oxigraph is told what a relative IRI is relative to.
                return None
        subject, predicate, target = (_term(text) for text in shape)
        # A literal can be the end of a path, but nothing begins with it.
        if not isinstance(subject, ox.Literal) and not isinstance(predicate, ox.Literal):
            found.add((subject, predicate, target))
    return frozenset(found)


def _looks_outside_graphs(node: Any) -> bool:
    if isinstance(node, CompValue):
        if str(node.name) == "GraphGraphPattern":
            return False
        return any(
            bool(part) if key == "triples" else _looks_outside_graphs(part)
            for key, part in cast("Mapping[str, Any]", node).items()
        )
    if isinstance(node, Mapping):
        return any(_looks_outside_graphs(part) for part in cast("Mapping[Any, Any]", node).values())
    if isinstance(node, (list, tuple)):
        return any(_looks_outside_graphs(part) for part in cast("list[Any]", node))
    return False


def _term(text: str | None) -> ox.NamedNode | ox.Literal | None:
    if text is None:
        return None
    return ox.NamedNode(text[1:-1]) if text.startswith("<") else ox.Literal(text[1:-1])
