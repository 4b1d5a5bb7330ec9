"""rdflib's syntax tree of a query; the one file that calls rdflib's parser.

The tree is used rather than rdflib's algebra: the translation to algebra drops parts (filters in
nested EXISTS, GRAPH with an empty pattern) that an answer depends on.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import lru_cache, partial
from typing import Any, cast

from rdflib import BNode
from rdflib.plugins.sparql import algebra
from rdflib.plugins.sparql.parser import parseQuery
from rdflib.plugins.sparql.parserutils import CompValue

from fluentboard_ontology import PREFIXES, XSD


@lru_cache(maxsize=64)
def tree_of(text: str) -> Any:
    """The syntax tree with prefixed names resolved and property paths as rdflib path objects.

    Reading takes milliseconds, and a text is read a few times in a row: nobody changes the tree.

    Raises:
        Exception: of many types, if rdflib does not read the query.
    """
    parsed = cast("Any", parseQuery(text))
    tools = cast("Any", algebra)
    prologue = tools.translatePrologue(parsed[0], None, dict(PREFIXES))
    tree = tools.traverse(parsed[1], visitPost=partial(tools.translatePName, prologue=prologue))
    return tools.traverse(tree, visitPost=tools.translatePath)


def calls_of(tree: Any) -> frozenset[str]:
    """IRIs of all functions that are called by IRI, casts to XSD types aside."""
    if isinstance(tree, CompValue):
        items = cast("Mapping[str, Any]", tree)
        found = frozenset[str]().union(*map(calls_of, items.values()))
        called = str(items["iri"]) if str(tree.name) == "Function" else XSD
        return found if called.startswith(XSD) else found | {called}
    if isinstance(tree, (list, tuple)):
        return frozenset[str]().union(*map(calls_of, cast("Iterable[Any]", tree)))
    return frozenset()


def template_makes_blank_nodes(tree: Any) -> bool:
    """The template of a CONSTRUCT has blank nodes, which are new in each solution."""
    if "template" in tree:
        return any(isinstance(term, BNode) for triple in tree["template"] for term in triple)
    # CONSTRUCT WHERE: the blank nodes of its pattern stand in the template too.
    return any(
        isinstance(term, BNode)
        for part in tree["where"]["part"]
        for triple in part["triples"]
        for term in triple
    )
