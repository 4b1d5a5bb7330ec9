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
