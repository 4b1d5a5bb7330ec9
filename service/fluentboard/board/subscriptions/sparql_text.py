"""SPARQL as text: what can be told without a parser (pure).

Strings, comments and IRIs may contain anything: they are blanked out before words are looked for.
"""

from __future__ import annotations

import re

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
