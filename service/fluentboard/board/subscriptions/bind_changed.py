"""Tier 2: try the query on the changed fluent alone, before and after.

Sound where the answer is a sum over single fluents, see partition.py. The trial store in memory
holds the class hierarchy and one fluent, so the cost does not depend on the size of the board, and
no snapshot of the board is needed: the difference is exact for each commit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import pyoxigraph as ox

from fluentboard.board.subscriptions.changes import EventChange
from fluentboard.board.subscriptions.footprint import Shape
from fluentboard.board.subscriptions.partition import NotASum, pivots, require_sum, required_keys
from fluentboard.board.subscriptions.patterns import Const, Place, Select
from fluentboard.board.subscriptions.query import ParsedQuery
from fluentboard.board.subscriptions.results import Bag, Difference, difference
from fluentboard.board.subscriptions.schema import Schema
from fluentboard.board.subscriptions.view import View, view_of
from fluentboard.board.triples import fluent_name
from fluentboard.model.fluent import Fluent


@dataclass(slots=True)
class BoundEvaluation:
    """The tier of queries about one fluent at a time.

    Attributes:
        reason: why it is sound.
        keys: what a fluent must say to contribute.
        view: how the result follows from the solutions.
        text: the solutions' query over the materialised class hierarchy.
        schema: the class hierarchy and the trial store.
    """

    reason: str
    keys: frozenset[Shape]
    view: View
    text: str
    schema: Schema
    tier: ClassVar[int] = 2
    _empty: Bag | None = field(default=None, init=False)

    def support_of(self, solutions: Bag) -> Bag:
        """The support that the solutions of `view.text` give."""
        return self.view.support(solutions)

    def difference(self, change: EventChange) -> Difference:
        """How the event changes the support of the result."""
        after = self._solutions(change.after_quads, change.event.after)
        before = self._solutions(change.before_quads, change.event.before)
        return difference(self.view.support(before), self.view.support(after))

    def _solutions(self, quads: Sequence[ox.Quad], fluent: Fluent | None) -> Bag:
        if quads:
            return self.schema.evaluate(self.text, quads, fluent)
        if self._empty is None:
            self._empty = self.schema.evaluate(self.text, (), None)
        return self._empty


def bound_evaluation(query: ParsedQuery, select: Select, schema: Schema) -> BoundEvaluation:
    """The plan of a query for this tier.

    Args:
        query: the query as the client wrote it.
        select: its pattern over the materialised class hierarchy.
        schema: the class hierarchy.

    Raises:
        NotASum: the tier is not sound for the query.
    """
    if query.makes_blank_nodes:
        raise NotASum("blank nodes are made anew at each evaluation")
    if not query.is_timeless:
        raise NotASum("NOW() differs at each evaluation")
    pivot, why_not = None, "the query has no pattern about a fluent"
    for candidate in pivots(select):
        try:
            require_sum(select, candidate)
            pivot = candidate
            break
        except NotASum as reason:
            why_not = str(reason)
    if pivot is None:
        raise NotASum(why_not)
    if isinstance(pivot, Const):
        if fluent_name(pivot.text[1:-1]) is None:
            raise NotASum("the query is about something that is no fluent")
        # One term only, so nothing is to be counted.
        view = View(query.text, query.variables, "bag")
    else:
        found = view_of(query, select)
        if found is None:
            raise NotASum("the template of CONSTRUCT cannot be filled in here")
        view = found
    return BoundEvaluation(
        f"every solution is about {_name(pivot)} alone, so the changed fluent is tried by itself",
        required_keys(select.where, pivot, schema),
        view,
        schema.rewritten(view.text),
        schema,
    )


def _name(pivot: Place) -> str:
    if isinstance(pivot, Const):
        return pivot.text
    return "one unnamed subject" if pivot.is_blank else f"?{pivot.name}"
