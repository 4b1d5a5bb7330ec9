"""Terms as the store gives them back, from the text that it was given."""

from __future__ import annotations

from functools import lru_cache

import pyoxigraph as ox

from fluentboard.board.subscriptions.results import Term

_ANY = ox.NamedNode("urn:fluentboard:any")


def term_of(text: str) -> Term:
    """The term that an N-Triples text stands for, spelt as the store spells it.

    The store keeps numbers, booleans and times by value: `"01"^^xsd:integer` comes back as `1`, and
    `xsd:long` as `xsd:integer`. Two texts are the same term for a query if and only if they are
    equal here.
    """
    return ox.NamedNode(text[1:-1]) if text.startswith("<") else _literal(text)


@lru_cache(maxsize=65_536)
def _literal(text: str) -> Term:
    store = ox.Store()
    store.load(f"<{_ANY.value}> <{_ANY.value}> {text} .".encode(), format=ox.RdfFormat.N_TRIPLES)
    return next(iter(store)).object
