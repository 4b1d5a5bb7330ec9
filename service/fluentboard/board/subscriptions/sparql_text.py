"""SPARQL as text: what can be told without a parser (pure).

Strings, comments and IRIs may contain anything: they are blanked out before words are looked for.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from fluentboard.errors import InvalidInput

_OPAQUE = re.compile(
    r"""
    (?P<comment>\#[^\n\r]*)
  | (?P<string>\"\"\"(?:\\.|\"{0,2}[^"\\])*\"\"\"|'''(?:\\.|'{0,2}[^'\\])*'''
        |"(?:\\.|[^"\\\n\r])*"|'(?:\\.|[^'\\\n\r])*')
  | (?P<iri><[^<>"{}|^`\x00-\x20]*>)
    """,
    re.VERBOSE | re.DOTALL,
)
_FORM = re.compile(r"(?<![\w:?$.-])(select|ask|construct|describe)(?![\w:-])", re.IGNORECASE)
_WORD = re.compile(r"(?<![\w:?$.-])[A-Za-z_]\w*(?![\w:-])")

_BOUNDARY = re.compile(r"[({)]|(?<![\w:?$.-])where(?![\w:-])", re.IGNORECASE)
_IRI = re.compile(r"[A-Za-z][A-Za-z0-9+.-]*:[^<>\"{}|^`\\\x00-\x20]*")


def blanked(query: str) -> str:
    """The query with comments, strings and IRIs overwritten; positions stay the same."""

    def cover(match: re.Match[str]) -> str:
        text = match.group()
        if match.lastgroup == "comment":
            return " " * len(text)
        # A quote or bracket stays at either end, so that what was a term is still seen as one.
        return text[0] + "_" * (len(text) - 2) + text[-1]

    return _OPAQUE.sub(cover, query)


def query_form(query: str) -> str | None:
    """`select`, `ask`, `construct` or `describe`: the first such word, or None."""
    found = _FORM.search(blanked(query))
    return None if found is None else found.group(1).lower()


def words(query: str) -> frozenset[str]:
    """All keywords and function names of the query, in upper case."""
    return frozenset(word.upper() for word in _WORD.findall(blanked(query)))


def has_escapes(query: str) -> bool:
    """A backslash stands outside strings and comments, or inside an IRI."""
    return "\\" in blanked(query) or any(
        "\\" in match.group() for match in _OPAQUE.finditer(query) if match.lastgroup == "iri"
    )


def without_distinct(query: str) -> str:
    """A SELECT DISTINCT query as a plain SELECT."""
    match = re.search(r"(?i)(?<![\w:?$.-])select\s+(distinct)(?![\w:-])", blanked(query))
    if match is None:
        return query
    return query[: match.start(1)] + query[match.end(1) :]


def as_select_all(query: str) -> str | None:
    """An ASK or CONSTRUCT query as `SELECT *` of its pattern, or None if it has no clear form."""
    plain = blanked(query)
    form = _FORM.search(plain)
    if form is None:
        return None
    rest = form.end()
    if form.group(1).lower() == "construct" and plain[rest:].lstrip().startswith("{"):
        opening = plain.index("{", rest)
        depth = 0
        for position in range(opening, len(plain)):
            depth += {"{": 1, "}": -1}.get(plain[position], 0)
            if depth == 0:
                rest = position + 1
                break
        else:
            return None
    return query[: form.start()] + "SELECT *" + query[rest:]


def over_dataset(query: str, default: Sequence[str], named: Sequence[str]) -> str:
    """The query over graphs that the request names, as if it named them with FROM.

    Args:
        query: of any form.
        default: IRIs of graphs that make up the default graph.
        named: IRIs of graphs that GRAPH sees.

    Raises:
        InvalidInput: one of them is no IRI, or the query names graphs itself.
    """
    for iri in (*default, *named):
        if not _IRI.fullmatch(iri):
            raise InvalidInput(f"the graph {iri!r} is no IRI")
    plain = blanked(query)
    form = _FORM.search(plain)
    if "FROM" in words(query):
        raise InvalidInput("the query has FROM, and the request names graphs too; do one of both")
    depth = 0
    for token in _BOUNDARY.finditer(plain, 0 if form is None else form.end()):
        mark = token.group().upper()
        if mark in "()":
            depth += 1 if mark == "(" else -1
        elif depth == 0 and (mark == "WHERE" or not _is_template(plain, form, token.start())):
            clauses = [f"FROM <{iri}>" for iri in default]
            clauses += [f"FROM NAMED <{iri}>" for iri in named]
            return f"{query[: token.start()]} {' '.join(clauses)} {query[token.start() :]}"
    return query


def _is_template(plain: str, form: re.Match[str] | None, brace: int) -> bool:
    """Whether the brace opens what a CONSTRUCT makes, and not a pattern."""
    if form is None or form.group(1).lower() != "construct":
        return False
    return "{" not in plain[form.end() : brace] and plain[form.end() : brace].strip() == ""


def prologue(query: str) -> str:
    """The prefix declarations before the query form."""
    form = _FORM.search(blanked(query))
    return "" if form is None else query[: form.start()]


def filter_texts(query: str) -> list[str]:
    """The texts of all filters, the word FILTER included, in their order."""
    plain = blanked(query)
    found: list[str] = []
    for word in re.finditer(r"(?i)(?<![\w:?$.-])filter(?![\w:-])", plain):
        opening = plain.find("(", word.end())
        depth = 0
        for position in range(max(opening, 0), len(plain)):
            depth += {"(": 1, ")": -1}.get(plain[position], 0)
            if depth == 0:
                found.append(query[word.start() : position + 1])
                break
    return found
