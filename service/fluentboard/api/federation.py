"""Federation: which other endpoints a query may have the board ask (pure).

`SERVICE` makes the board send requests on behalf of whoever may read. Left open, that reaches
whatever the board's machine reaches, so only endpoints that the settings name are asked.
"""

from __future__ import annotations

from collections.abc import Collection

from fluentboard.board.sparql_tokens import tokens_of
from fluentboard.errors import NotAllowed


def check_services(query: str, allowed: Collection[str]) -> None:
    """Refuses a query that asks an endpoint it may not.

    Args:
        query: SPARQL text.
        allowed: IRIs of the endpoints that may be asked.

    Raises:
        NotAllowed: it asks another, or one that a variable or a prefixed name stands for.
    """
    if "SERVICE" not in query.upper():
        return
    tokens = tokens_of(query)
    for position, token in enumerate(tokens):
        if not token.is_word("SERVICE"):
            continue
        target = next((t for t in tokens[position + 1 :] if not t.is_word("SILENT")), None)
        if target is None or target.kind != "iri" or target.text[1:-1] not in allowed:
            named = "nothing" if target is None else target.text
            raise NotAllowed(
                f"the query has the board ask {named} (SERVICE); it may ask only endpoints that "
                "security.service_endpoints names, each written out as a whole IRI",
                service=named,
            )
