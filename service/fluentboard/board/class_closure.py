"""Rewrites `rdfs:subClassOf+` and `*` in a query to the materialised class hierarchy.

A property path is evaluated row by row: at 100,000 fluents the anchoring query of Section 4.2.4
takes half a minute. Over the materialised hierarchy the same pattern is one join.

A path is rewritten only where both forms have the same answers:

- `+`: always, because every `rdfs:subClassOf` edge of the default graph is in the hierarchy;
- `*`: where one end is a class of the hierarchy written out, or where the path continues
  `rdf:type` (`rdf:type/rdfs:subClassOf*`). With two free ends, or an end outside the hierarchy,
  `*` also relates a term to itself, whatever it is: that form is left to the engine.

Inside `GRAPH` and `SERVICE`, and in a query with `FROM`, nothing is rewritten: the hierarchy is
about the default graph.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from fluentboard.board.sparql_tokens import Token, declared_prefixes, has_word, tokens_of
from fluentboard.board.vocabulary import (
    PROPER_SUB_CLASS_OF,
    RDF_TYPE,
    SUB_CLASS_OF,
    SUB_CLASS_OF_OR_SAME,
)


def use_class_closure(
    query: str, prefixes: Mapping[str, str], is_class: Callable[[str], bool]
) -> str:
    """The query with its class paths replaced where that changes no answer.

    Args:
        query: SPARQL text; text that does not parse is returned as it is, or fails later.
        prefixes: predefined prefixes; those that the query declares come on top.
        is_class: whether an IRI takes part in the materialised hierarchy.
    """
    if "subClassOf" not in query:
        return query
    tokens = tokens_of(query)
    if has_word(tokens, "FROM"):
        return query
    known = {**prefixes, **declared_prefixes(tokens)}

    def iri(position: int) -> str | None:
        if not 0 <= position < len(tokens):
            return None
        token = tokens[position]
        if token.kind == "iri":
            return token.text[1:-1]
        if token.kind == "pname":
            prefix, _, local = token.text.partition(":")
            return None if prefix not in known else known[prefix] + local.rstrip(".")
        return RDF_TYPE if token.kind == "word" and token.text == "a" else None

    def text(position: int) -> str:
        return tokens[position].text if 0 <= position < len(tokens) else ""

    edits: list[tuple[int, int, str]] = []
    foreign = _foreign(tokens)
    for here in range(len(tokens)):
        operator = text(here + 1)
        if foreign[here] or iri(here) != SUB_CLASS_OF or operator not in ("+", "*"):
            continue
        # `subClassOf+1`-like input cannot occur in a path; `++` is a syntax error for the engine.
        before, after = here - 1, here + 2
        if text(before) in ("^", "!") or text(after) in ("+", "*", "?"):
            continue
        if operator == "+":
            target = PROPER_SUB_CLASS_OF
        else:
            after_type = text(before) == "/" and iri(before - 1) == RDF_TYPE
            alone_before = text(before) not in ("/", "|", "(")
            alone_after = text(after) not in ("/", "|", ")")
            ends = [iri(before) if alone_before else None, iri(after) if alone_after else None]
            named = alone_before and alone_after and any(e and is_class(e) for e in ends)
            if not (named or after_type):
                continue
            target = SUB_CLASS_OF_OR_SAME
        edits.append((tokens[here].start, tokens[here + 1].end, f"<{target}>"))
    for start, end, replacement in reversed(edits):
        query = query[:start] + replacement + query[end:]
    return query


def _foreign(tokens: list[Token]) -> list[bool]:
    """For each token, whether it stands inside a GRAPH or SERVICE group."""
    inside: list[bool] = []
    groups: list[bool] = []
    pending = False
    for token in tokens:
        if token.is_word("GRAPH", "SERVICE"):
            pending = True
        elif token.text == "{":
            groups.append(pending or bool(groups and groups[-1]))
            pending = False
        elif token.text == "}" and groups:
            groups.pop()
        inside.append(bool(groups and groups[-1]))
    return inside
