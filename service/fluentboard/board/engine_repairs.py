"""Engine repairs: queries rewritten where Oxigraph departs from SPARQL 1.1 (pure).

- A `SELECT` or `VALUES` inside `GRAPH ?g` is evaluated by Oxigraph on all named graphs at once and
  leaves `?g` unbound. It is replaced by one branch per graph.
- `GROUP_CONCAT` of strings with one language tag keeps the tag. SPARQL 1.1 gives a plain string, so
  `STR` is put around it.

Text in which none of this occurs is returned as it is, after a look for the words.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence

from fluentboard.board.sparql_tokens import Token, tokens_of

_SUSPECT = re.compile(
    r"GROUP_CONCAT|\bGRAPH\b(?=.*\b(?:SELECT|VALUES)\b)", re.IGNORECASE | re.DOTALL
)


def needs_repair(query: str) -> bool:
    """Whether the text has one of the forms on which the engine may go wrong; errs towards yes."""
    return _SUSPECT.search(query) is not None


def repaired(query: str, graphs: Callable[[], Sequence[str]], *, has_dataset: bool = False) -> str:
    """The query in a form that Oxigraph evaluates as SPARQL 1.1 says.

    Args:
        query: SPARQL text; text that does not parse fails in this form, too.
        graphs: gives the IRIs of the named graphs that `GRAPH` sees.
        has_dataset: they hold whatever graphs the query names itself.
    """
    if not needs_repair(query):
        return query
    tokens = tokens_of(query)
    if not tokens:
        return query
    named = None if has_dataset else _named_in(tokens)

    def terms() -> list[str]:
        return [f"<{iri}>" for iri in graphs()] if named is None else named

    return query[: tokens[0].start] + _rewritten(query, tokens, terms) + query[tokens[-1].end :]


def _rewritten(query: str, tokens: Sequence[Token], terms: Callable[[], list[str]]) -> str:
    """The text of the tokens, and what stands between them, rewritten."""
    parts: list[str] = []
    last = tokens[0].start if tokens else 0
    here = 0
    while here < len(tokens):
        found = _replacement(query, tokens, here, terms)
        if found is None:
            here += 1
            continue
        end, text = found
        parts += [query[last : tokens[here].start], text]
        last = tokens[end].end
        here = end + 1
    parts.append(query[last : tokens[-1].end] if tokens else "")
    return "".join(parts)


def _replacement(
    query: str, tokens: Sequence[Token], here: int, terms: Callable[[], list[str]]
) -> tuple[int, str] | None:
    """What takes the place of the tokens from `here` up to the one given, if anything does."""
    token = tokens[here]
    if token.is_word("GROUP_CONCAT") and not _is_word(tokens, here - 2, "STR"):
        end = _closing(tokens, here + 1, "(", ")")
        return None if end is None else (end, f"STR({query[token.start : tokens[end].end]})")
    if token.is_word("GRAPH") and here + 1 < len(tokens) and tokens[here + 1].kind == "variable":
        end = _closing(tokens, here + 2, "{", "}")
        body = tokens[here + 3 : end] if end is not None else ()
        if end is not None and any(inner.is_word("SELECT", "VALUES") for inner in body):
            inside = _rewritten(query, body, terms)
            return end, _branches(tokens[here + 1].text, inside, terms())
    return None


def _branches(variable: str, body: str, graphs: Sequence[str]) -> str:
    branches = [
        f"{{ VALUES {variable} {{ {graph} }} GRAPH {graph} {{ {body} }} }}" for graph in graphs
    ]
    return " UNION ".join(branches) or f"{{ VALUES {variable} {{ }} }}"


def _named_in(tokens: Sequence[Token]) -> list[str] | None:
    """The graphs that FROM NAMED names; None if the query does not name its dataset."""
    if not any(token.is_word("FROM") for token in tokens):
        return None
    return [
        tokens[here + 2].text
        for here, token in enumerate(tokens[:-2])
        if token.is_word("FROM") and tokens[here + 1].is_word("NAMED")
    ]


def _closing(tokens: Sequence[Token], here: int, opening: str, closing: str) -> int | None:
    """Where the bracket closes that opens here; None if none opens or it does not close."""
    if here >= len(tokens) or tokens[here].text != opening:
        return None
    depth = 0
    for place in range(here, len(tokens)):
        depth += {opening: 1, closing: -1}.get(tokens[place].text, 0)
        if depth == 0:
            return place
    return None


def _is_word(tokens: Sequence[Token], here: int, word: str) -> bool:
    return 0 <= here < len(tokens) and tokens[here].is_word(word)
