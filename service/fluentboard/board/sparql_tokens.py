"""SPARQL text as tokens (pure): enough to find keywords, terms and braces, not to check syntax."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import NamedTuple

_TOKEN = re.compile(
    r"""
    (?P<space>\s+|\#[^\n\r]*)
  | (?P<string>\"\"\"(?:\\.|\"{0,2}[^"\\])*\"\"\"|'''(?:\\.|'{0,2}[^'\\])*'''
        |"(?:\\.|[^"\\\n\r])*"|'(?:\\.|[^'\\\n\r])*')
  | (?P<iri><[^<>"{}|^`\x00-\x20]*>)
  | (?P<variable>[?$]\w+)
  | (?P<name>[^\W\d_][\w.-]*)?:(?P<local>(?:[\w:.-]|%[0-9A-Fa-f]{2}|\\[_~.\-!$&'()*+,;=/?\#@%])*)
  | (?P<blank>_:\w[\w.-]*)
  | (?P<language>@[A-Za-z]+(?:-[A-Za-z0-9]+)*)
  | (?P<word>[A-Za-z_]\w*)
  | (?P<other>.)
    """,
    re.VERBOSE | re.DOTALL,
)


class Token(NamedTuple):
    """A piece of the text that is neither white space nor comment.

    Attributes:
        kind: `string`, `iri`, `variable`, `pname`, `blank`, `language`, `word` or `other`.
        text: as it stands.
        start: where it begins.
        end: where it ends.
    """

    kind: str
    text: str
    start: int
    end: int

    def is_word(self, *words: str) -> bool:
        """It is one of these keywords (given in upper case)."""
        return self.kind == "word" and self.text.upper() in words


def tokens_of(text: str) -> list[Token]:
    """The tokens of a query or update."""
    found: list[Token] = []
    for match in _TOKEN.finditer(text):
        kind = match.lastgroup or "other"
        if kind == "space":
            continue
        if kind in ("local", "name"):
            kind = "pname"
        found.append(Token(kind, match.group(), match.start(), match.end()))
    return found


def has_word(tokens: Iterable[Token], *words: str) -> bool:
    """One of the tokens is one of these keywords (given in upper case)."""
    return any(token.is_word(*words) for token in tokens)


def declared_prefixes(tokens: list[Token]) -> Mapping[str, str]:
    """The prefixes that the text declares itself."""
    return {
        name.text.partition(":")[0]: target.text[1:-1]
        for word, name, target in zip(tokens, tokens[1:], tokens[2:], strict=False)
        if word.is_word("PREFIX") and name.kind == "pname" and target.kind == "iri"
    }
