"""The class hierarchy as the tiers use it, and a small store to try single fluents in."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import pyoxigraph as ox

from fluentboard.board.class_closure import use_class_closure
from fluentboard.board.subscriptions.results import Bag, bag_of
from fluentboard.board.vocabulary import (
    PROPER_SUB_CLASS_OF,
    SUB_CLASS_OF_OR_SAME,
    Vocabulary,
)
from fluentboard_ontology import PREFIXES

CLOSURE = frozenset({f"<{PROPER_SUB_CLASS_OF}>", f"<{SUB_CLASS_OF_OR_SAME}>"})
"""The materialised predicates; no fluent has statements with them."""


class Schema:
    """What one vocabulary says of classes. Used by the evaluator's thread alone.

    Attributes:
        vocabulary: what it was made from.
    """

    def __init__(self, vocabulary: Vocabulary) -> None:
        self.vocabulary = vocabulary
        self._closure = vocabulary.closure()
        self._below: dict[tuple[str, str], set[str]] = {}
        for below, predicate, above in self._closure:
            self._below.setdefault((predicate, above), set()).add(below)
        self._trial: _Trial | None = None

    def below(self, predicate: str, above: str) -> frozenset[str]:
        """Classes related to a class by a closure predicate, all in N-Triples syntax."""
        return frozenset(self._below.get((predicate, above), ()))

    def rewritten(self, query: str) -> str:
        """The query with class paths replaced by closure predicates, as the board does."""
        return use_class_closure(query, PREFIXES, self.vocabulary.is_node)

    def evaluate(self, query: str, fluent: Sequence[ox.Quad]) -> Bag:
        """The answer to a query if the board held the class hierarchy and one fluent alone."""
        if self._trial is None:
            self._trial = _Trial(self._closure)
        return self._trial.evaluate(query, fluent)


class _Trial:
    """A store in memory with the class hierarchy and at most one fluent."""

    def __init__(self, closure: set[tuple[str, str, str]]) -> None:
        text = "".join(f"{s} {p} {o} .\n" for s, p, o in closure)
        self._store = ox.Store()
        self._store.extend(list(ox.parse(text, format=ox.RdfFormat.N_TRIPLES)))
        self._prefixes: Mapping[str, str] = dict(PREFIXES)
        self._fluent: Sequence[ox.Quad] = ()

    def evaluate(self, query: str, fluent: Sequence[ox.Quad]) -> Bag:
        # Many queries are tried on the same fluent in a row.
        if fluent is not self._fluent:
            for quad in self._fluent:
                self._store.remove(quad)
            self._store.extend(fluent)
            self._fluent = fluent
        return bag_of(self._store.query(query, prefixes=dict(self._prefixes)))
