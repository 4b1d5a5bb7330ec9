"""Rewrites `rdfs:subClassOf+` and `*` in a query to the materialised class hierarchy.

A property path is evaluated row by row: at 100,000 fluents the anchoring query of Section 4.2.4
takes half a minute. Over the materialised hierarchy the same pattern is one join.

A path is rewritten only where both forms have the same answers:

- `+`: always, because every `rdfs:subClassOf` edge of the default graph is in the hierarchy;
- `*`: where one end is a class of the hierarchy written out, or where the path continues
  `rdf:type` (`rdf:type/rdfs:subClassOf*`). With two free ends, or an end outside the hierarchy,
  `*` also relates a term to itself, whatever it is: that form is left to the engine.

Inside `GRAPH` and `SERVICE` nothing is rewritten: the hierarchy is about the default graph.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import NamedTuple

from fluentboard.board.vocabulary import (
    PROPER_SUB_CLASS_OF,
    RDF_TYPE,
    SUB_CLASS_OF,
    SUB_CLASS_OF_OR_SAME,
)

_TOKEN = re.compile(
    r"""
    (?P<space>\s+|\#[^\n\r]*)
  | (?P<string>\"\"\"(?:\\.|\"{0,2}[^"\\])*\"\"\"|'''(?:\\.|'{0,2}[^'\\])*'''
        |"(?:\\.|[^"\\\n\r])*"|'(?:\\.|[^'\\\n\r])*')
  | (?P<iri><[^<>"{}|^`\\\x00-\x20]*>)
  | (?P<variable>[?$]\w+)
  | (?P<name>[^\W\d_][\w.-]*)?:(?P<local>(?:[\w:.-]|%[0-9A-Fa-f]{2}|\\[_~.\-!$&'()*+,;=/?\#@%])*)
  | (?P<word>[A-Za-z_]\w*)
  | (?P<other>.)
    """,
    re.VERBOSE | re.DOTALL,
)


class _Token(NamedTuple):
    kind: str
    text: str
    start: int
    end: int


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
    tokens = _tokens(query)
    known = {**prefixes, **_declared(tokens)}

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


def _tokens(query: str) -> list[_Token]:
    found: list[_Token] = []
    for match in _TOKEN.finditer(query):
        kind = match.lastgroup or "other"
        if kind == "space":
            continue
        if kind == "local" or kind == "name":
            kind = "pname"
        found.append(_Token(kind, match.group(), match.start(), match.end()))
    return found


def _declared(tokens: list[_Token]) -> dict[str, str]:
    """Prefixes that the query declares itself."""
    return {
        name.text.partition(":")[0]: target.text[1:-1]
        for word, name, target in zip(tokens, tokens[1:], tokens[2:], strict=False)
        if word.text.upper() == "PREFIX" and name.kind == "pname" and target.kind == "iri"
    }


def _foreign(tokens: list[_Token]) -> list[bool]:
    """For each token, whether it stands inside a GRAPH or SERVICE group."""
    inside: list[bool] = []
    groups: list[bool] = []
    pending = False
    for token in tokens:
        if token.kind == "word" and token.text.upper() in ("GRAPH", "SERVICE"):
            pending = True
        elif token.text == "{":
            groups.append(pending or bool(groups and groups[-1]))
            pending = False
        elif token.text == "}" and groups:
            groups.pop()
        inside.append(bool(groups and groups[-1]))
    return inside
