"""Chooses the cheapest tier that is sound for a query."""

from __future__ import annotations

from dataclasses import dataclass

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


@dataclass(frozen=True, slots=True)
class Choice:
    """The plan of a query, and why it is not a cheaper one.

    Attributes:
        plan: how it is evaluated.
        refused: the tiers that were considered first, each with the reason against it.
    """

    plan: Plan
    refused: tuple[tuple[int, str], ...] = ()


def plan(
    query: ParsedQuery, schema: Schema, first_tier: int = 1, *, follows_clock: bool = False
) -> Plan:
    """The plan for a query; see `choose`."""
    return choose(query, schema, first_tier, follows_clock=follows_clock).plan


def choose(
    query: ParsedQuery, schema: Schema, first_tier: int = 1, *, follows_clock: bool = False
) -> Choice:
    """The plan for a query, and the reasons; it holds until an ontology changes.

    Args:
        query: the query.
        schema: the class hierarchy.
        first_tier: tiers below this one are not considered.
        follows_clock: the query sees what holds now.
    """
    if first_tier == Reevaluation.tier:
        return Choice(Reevaluation(query, "the settings ask for full re-evaluation"))
    if query.why_opaque:
        return Choice(Reevaluation(query, query.why_opaque))
    select = _pattern_of(query, schema)
    refused: list[tuple[int, str]] = []
    if first_tier <= Star.tier:
        try:
            return Choice(star(query, select, schema))
        except NotASum as reason:
            refused.append((Star.tier, str(reason)))
    if first_tier <= BoundEvaluation.tier:
        try:
            return Choice(bound_evaluation(query, select, schema), tuple(refused))
        except NotASum as reason:
            refused.append((BoundEvaluation.tier, str(reason)))
    try:
        if follows_clock:
            raise NotASum("a join of several fluents is evaluated again when one begins or ceases")
        return Choice(semi_naive(query, select, schema), tuple(refused))
    except NotASum as reason:
        refused.append((SemiNaive.tier, str(reason)))
        full = Reevaluation(query, f"no cheaper tier is sound: {reason}")
        return Choice(full, tuple(refused))


def explanation(query: ParsedQuery, chosen: Plan) -> str:
    """Which tier a query has, and why, for people."""
    return f"tier {chosen.tier}: {chosen.reason}; concerned by {concern(query, chosen)}"


def concern(query: ParsedQuery, chosen: Plan) -> str:
    """Which commits a query is concerned by, for people."""
    if not isinstance(chosen, Reevaluation | SemiNaive):
        return f"events of fluents that have one of {len(chosen.keys)} keys"
    if query.footprint.is_everything:
        return f"every commit, because {query.footprint.why_everything}"
    return f"commits that touch one of {len(query.footprint.shapes)} shapes of statements"


def _pattern_of(query: ParsedQuery, schema: Schema) -> Select:
    """The query's pattern over the materialised class hierarchy."""
    return select_of(tree_of(schema.rewritten(query.text)))
