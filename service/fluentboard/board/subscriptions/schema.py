"""The class hierarchy as the tiers use it, and a small store to try single fluents in."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import pyoxigraph as ox

from fluentboard.board.class_closure import use_class_closure
from fluentboard.board.subscriptions.results import Bag, bag_of
from fluentboard.board.time_functions import mentions_functions, time_functions
from fluentboard.board.vocabulary import (
    PROPER_SUB_CLASS_OF,
    SUB_CLASS_OF_OR_SAME,
    Vocabulary,
)
from fluentboard.model.fluent import Fluent
from fluentboard.model.relations import Bounds
from fluentboard.model.relations import bounds_of as bounds_of_fluent
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

    def evaluate(self, query: str, statements: Sequence[ox.Quad], fluent: Fluent | None) -> Bag:
        """The answer to a query if the board held the class hierarchy and one fluent alone.

        Args:
            query: SPARQL text over the materialised hierarchy.
            statements: what the fluent says; the same object for the same fluent.
            fluent: the fluent, or None for none.
        """
        if self._trial is None:
            self._trial = _Trial(self._closure)
        return self._trial.evaluate(query, statements, fluent)


class _Trial:
    """A store in memory with the class hierarchy and at most one fluent."""

    def __init__(self, closure: set[tuple[str, str, str]]) -> None:
        text = "".join(f"{s} {p} {o} .\n" for s, p, o in closure)
        self._store = ox.Store()
        self._store.extend(list(ox.parse(text, format=ox.RdfFormat.N_TRIPLES)))
        self._statements: Sequence[ox.Quad] = ()

    def evaluate(self, query: str, statements: Sequence[ox.Quad], fluent: Fluent | None) -> Bag:
        # Many queries are tried on the same fluent in a row.
        if statements is not self._statements:
            for quad in self._statements:
                self._store.remove(quad)
            self._store.extend(statements)
            self._statements = statements
        options: dict[str, Any] = {}
        if mentions_functions(query):

            def bounds_of(name: str) -> Bounds | None:
                if fluent is None or name != fluent.name:
                    return None
                return bounds_of_fluent(fluent)

            # Queries that ask for the present are not tried here.
            options["custom_functions"] = time_functions(query, bounds_of, math.nan)
        return bag_of(self._store.query(query, prefixes=dict(PREFIXES), **options))
