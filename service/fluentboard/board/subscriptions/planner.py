"""Chooses the cheapest tier that is sound for a query."""

from __future__ import annotations

import contextlib

from fluentboard.board.subscriptions.bind_changed import BoundEvaluation, bound_evaluation
from fluentboard.board.subscriptions.partition import NotASum
from fluentboard.board.subscriptions.patterns import Select, select_of
from fluentboard.board.subscriptions.query import ParsedQuery
from fluentboard.board.subscriptions.reevaluate import Reevaluation
from fluentboard.board.subscriptions.schema import Schema
from fluentboard.board.subscriptions.semi_naive import SemiNaive, semi_naive
from fluentboard.board.subscriptions.standing import Plan
from fluentboard.board.subscriptions.stars import Star, star
from fluentboard.board.subscriptions.syntax_tree import tree_of


def plan(query: ParsedQuery, schema: Schema, first_tier: int = 1) -> Plan:
    """The plan for a query; it holds until an ontology changes.

    Args:
        query: the query.
        schema: the class hierarchy.
        first_tier: tiers below this one are not considered.
    """
    if first_tier == Reevaluation.tier:
        return Reevaluation(query, "the settings ask for full re-evaluation")
    if query.why_opaque:
        return Reevaluation(query, query.why_opaque)
    select = _pattern_of(query, schema)
    if first_tier <= Star.tier:
        with contextlib.suppress(NotASum):
            return star(query, select, schema)
    if first_tier <= BoundEvaluation.tier:
        with contextlib.suppress(NotASum):
            return bound_evaluation(query, select, schema)
    try:
        return semi_naive(query, select, schema)
    except NotASum as reason:
        return Reevaluation(query, f"no cheaper tier is sound: {reason}")


def explanation(query: ParsedQuery, chosen: Plan) -> str:
    """Which tier a query has, and why, for people."""
    if not isinstance(chosen, Reevaluation | SemiNaive):
        concerned = f"events of fluents that have one of {len(chosen.keys)} keys"
    elif query.footprint.is_everything:
        concerned = f"every commit, because {query.footprint.why_everything}"
    else:
        concerned = f"commits that touch one of {len(query.footprint.shapes)} shapes of statements"
    return f"tier {chosen.tier}: {chosen.reason}; concerned by {concerned}"


def _pattern_of(query: ParsedQuery, schema: Schema) -> Select:
    """The query's pattern over the materialised class hierarchy."""
    return select_of(tree_of(schema.rewritten(query.text)))
