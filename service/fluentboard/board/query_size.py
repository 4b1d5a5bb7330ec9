"""Query size: how deep and how long a SPARQL request may be before it is parsed at all (pure).

Oxigraph's parser and optimiser call themselves for each level of nesting, and for each member of a
chain such as `a || b || c`. A request of a few kilobytes can exhaust their stack, which ends the
process. What is far beyond any real query is refused before they see it.
"""

from __future__ import annotations

from fluentboard.board.sparql_tokens import tokens_of
from fluentboard.errors import InvalidQuery

DEPTH_MAX = 200
"""How many brackets may be open at once; a parser's stack ends somewhere above 1,000."""

TOKENS_MAX = 8_000
"""How many tokens there may be outside lists of data; a chain of 10,000 members is too much."""

# So short a text cannot hold a chain that is too long.
_SHORT_CHARACTERS = 4_000
_OPENING, _CLOSING = frozenset("([{"), frozenset(")]}")


def check_size(text: str) -> None:
    """Refuses a query or update that is nested too deeply, or too long to be evaluated.

    Statements of `INSERT DATA` and `DELETE DATA`, and rows of `VALUES`, do not count.

    Args:
        text: SPARQL text.

    Raises:
        InvalidQuery: it is.

    Example:
        >>> check_size("SELECT * { ?s ?p ?o }")
        >>> try:
        ...     check_size("SELECT * " + "{" * 300)
        ... except InvalidQuery as refused:
        ...     print(refused.message)
        the query has more than 200 nested brackets; split it
    """
    if len(text) < _SHORT_CHARACTERS and sum(text.count(b) for b in _OPENING) < DEPTH_MAX:
        return
    depth = counted = 0
    data_from: int | None = None
    is_data_next = False
    for token in tokens_of(text):
        if token.text in _OPENING:
            depth += 1
            if depth > DEPTH_MAX:
                raise InvalidQuery(
                    f"the query has more than {DEPTH_MAX} nested brackets; split it",
                    limit=DEPTH_MAX,
                )
            if is_data_next and token.text == "{" and data_from is None:
                data_from, is_data_next = depth, False
        elif token.text in _CLOSING:
            if data_from == depth:
                data_from = None
            depth -= 1
        elif token.is_word("DATA", "VALUES"):
            is_data_next = True
        if data_from is None:
            counted += 1
            if counted > TOKENS_MAX:
                raise InvalidQuery(
                    f"the query has more than {TOKENS_MAX:,} words and signs outside its lists of "
                    "data; split it",
                    limit=TOKENS_MAX,
                )
