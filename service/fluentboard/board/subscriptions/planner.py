"""Chooses the cheapest tier that is sound for a query."""

from __future__ import annotations

from fluentboard.board.subscriptions.query import ParsedQuery
from fluentboard.board.subscriptions.reevaluate import Reevaluation
from fluentboard.board.subscriptions.standing import Plan
from fluentboard.board.vocabulary import Vocabulary


def plan(query: ParsedQuery, vocabulary: Vocabulary) -> Plan:
    """The plan for a query; it holds until an ontology changes."""
    del vocabulary
    return Reevaluation("only full re-evaluation is sound for every query")


def explanation(query: ParsedQuery, chosen: Plan) -> str:
    """Which tier a query has, and why, for people."""
    if query.footprint.is_everything:
        touched = f"every commit, because {query.footprint.why_everything}"
    else:
        touched = f"commits that touch one of {len(query.footprint.shapes)} shapes of statements"
    return f"tier {chosen.tier}: {chosen.reason}; concerned by {touched}"
