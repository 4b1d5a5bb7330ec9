"""Explains a subscription: how it is evaluated, and why it has nothing to say of a fluent."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Literal

import pyoxigraph as ox

from fluentboard.board.blackboard import Blackboard
from fluentboard.board.subscriptions.changes import EventChange
from fluentboard.board.subscriptions.footprint import Shape
from fluentboard.board.subscriptions.held import holds
from fluentboard.board.subscriptions.patterns import Pattern, Place, Triples, Var, select_of
from fluentboard.board.subscriptions.planner import Choice, concern, explanation
from fluentboard.board.subscriptions.query import ParsedQuery, parse
from fluentboard.board.subscriptions.reevaluate import Reevaluation
from fluentboard.board.subscriptions.registry import SubscriptionRegistry
from fluentboard.board.subscriptions.results import bag_of, fluents_in
from fluentboard.board.subscriptions.schema import CLOSURE, Schema
from fluentboard.board.subscriptions.semi_naive import SemiNaive
from fluentboard.board.subscriptions.syntax_tree import tree_of
from fluentboard.board.subscriptions.touch_index import matches
from fluentboard.board.triples import fluent_iri
from fluentboard.model.fluent import Fluent
from fluentboard.model.interval import Certainty
from fluentboard_ontology import PREFIXES

_SHAPES_SHOWN = 50


@dataclass(frozen=True, slots=True)
class _Question:
    board: Blackboard
    certainty: Certainty | None

    def bag(self, sparql: str, limit: int | None = None) -> dict[Any, int]:
        at: Literal["now"] | None = None if self.certainty is None else "now"
        certainty = self.certainty or Certainty.POSSIBLE
        return bag_of(self.board.query(sparql, at=at, certainty=certainty), limit=limit)


def explained(
    board: Blackboard,
    registry: SubscriptionRegistry,
    text: str,
    fluent: str | None = None,
    certainty: Certainty | None = None,
) -> dict[str, Any]:
    """How a query would be evaluated and why, as JSON.

    Args:
        board: what is asked.
        registry: chooses the tier.
        text: the query.
        fluent: also say why this fluent is, or is not, in the result.
        certainty: the query sees what holds now with this certainty; None for the whole history.

    Raises:
        InvalidQuery: it does not parse, or cannot be subscribed to.
        UnknownFluent: there is no such fluent.
    """
    query = parse(text)
    choice = registry.choose(query, follows_clock=certainty is not None)
    shapes = sorted(map(_shape_text, _concerning(query, choice)))
    found: dict[str, Any] = {
        "tier": choice.plan.tier,
        "reason": choice.plan.reason,
        "concerned_by": concern(query, choice.plan),
        "refused": [{"tier": tier, "reason": reason} for tier, reason in choice.refused],
        "shapes": shapes[:_SHAPES_SHOWN],
        "shapes_left_out": max(0, len(shapes) - _SHAPES_SHOWN),
        "changes_with_the_clock": certainty is not None,
        "explanation": explanation(query, choice.plan),
    }
    if fluent is not None:
        found["fluent"] = _of_fluent(_Question(board, certainty), query, choice, fluent)
    return found


def _of_fluent(
    question: _Question, query: ParsedQuery, choice: Choice, name: str
) -> dict[str, Any]:
    board, certainty = question.board, question.certainty
    fluent = board.fluent(name)
    last = board.history(name)[-1]
    change = EventChange(last.events[-1], board.vocabulary)
    touched = _touches(query, choice, change)
    solutions = sum(
        count
        for solution, count in question.bag(query.text).items()
        if name in fluents_in(solution)
    )
    conditions = _conditions(question, query, name)
    is_held = certainty is None or holds(fluent, certainty, board.clock.now_s())
    unmet = [condition for condition in conditions if not condition["met"]]
    return {
        "name": name,
        "solutions": solutions,
        "conditions": conditions,
        "holds": None if certainty is None else is_held,
        "last_change": {
            "commit": last.number,
            "event": last.events[-1].kind,
            "touched": touched,
        },
        "verdict": _verdict(fluent, solutions, unmet, conditions, is_held=is_held, touched=touched),
    }


def _verdict(
    fluent: Fluent,
    solutions: int,
    unmet: list[dict[str, Any]],
    conditions: list[dict[str, Any]],
    *,
    is_held: bool,
    touched: bool,
) -> str:
    name = fluent.name
    if solutions:
        plural = "" if solutions == 1 else "s"
        told = (
            "its last change touched what the query depends on, so subscribers were told if that "
            "changed the result"
            if touched
            else "its last change touched nothing that the query depends on, so only subscribers "
            "in the modes fluents and both were told of it"
        )
        return f"{name} is in the result, in {solutions} solution{plural}; {told}"
    if not is_held:
        return (
            f"{name} does not hold now (it starts {_bounds(fluent.start_bounds)} and finishes "
            f"{_bounds(fluent.finish_bounds)}), so a query at now does not see it"
        )
    if unmet:
        wanted = "; ".join(f"{one['pattern']} ({one['why']})" for one in unmet)
        return f"{name} is not in the result, because it does not meet: {wanted}"
    if conditions:
        return (
            f"{name} meets each pattern by itself, but no solution has it: another fluent that is "
            "to go with it is missing, or a FILTER, NOT EXISTS, MINUS or LIMIT leaves it out, or "
            "its variable is not among the results"
        )
    return f"{name} is not in the result, and no pattern of the query can be tried on it alone"


def _conditions(question: _Question, query: ParsedQuery, name: str) -> list[dict[str, Any]]:
    """The patterns of the variable that the fluent fits best, each with whether it meets it."""
    if query.why_opaque:
        return []
    schema = Schema(question.board.vocabulary)
    select = select_of(tree_of(schema.rewritten(query.text)))
    patterns = [
        pattern
        for part in select.where.all_parts()
        if isinstance(part, Triples)
        for pattern in part.patterns
        if pattern.predicate is not None
    ]
    iri = f"<{fluent_iri(name)}>"
    best: list[dict[str, Any]] = []
    for subject in dict.fromkeys(pattern.subject for pattern in patterns):
        if isinstance(subject, Var) or subject.text == iri:
            own = [p for p in patterns if p.subject == subject and not _is_closure(p)]
            tried = [_condition(question, pattern, patterns, iri) for pattern in own]
            if sum(one["met"] for one in tried) > sum(one["met"] for one in best) or not best:
                best = tried
    return best


def _condition(
    question: _Question, pattern: Pattern, beside: Iterable[Pattern], iri: str
) -> dict[str, Any]:
    closures = [p for p in beside if _is_closure(p) and p.subject == pattern.target]
    body = " . ".join(_pattern_text(p, pattern.subject, iri) for p in (pattern, *closures))
    met = bool(question.bag(f"ASK {{ {body} }}"))
    shown = " . ".join(_short(_pattern_text(p, None, "")) for p in (pattern, *closures))
    if met:
        return {"pattern": shown, "met": True, "why": ""}
    predicate = pattern.predicate
    assert predicate is not None
    if isinstance(predicate, Var):
        return {"pattern": shown, "met": False, "why": "it says nothing like it"}
    values = question.bag(f"SELECT ?value {{ {iri} {predicate.text} ?value }}", 1_000)
    told = sorted(_short(str(term)) for (term,) in values)
    short = _short(predicate.text)
    why = f"its {short} is {', '.join(told)}" if told else f"it has no {short}"
    return {"pattern": shown, "met": False, "why": why}


def _touches(query: ParsedQuery, choice: Choice, change: EventChange) -> bool:
    if isinstance(choice.plan, Reevaluation | SemiNaive):
        statements = change.statements
    else:
        statements = [*change.after, *change.before]
    shapes = _concerning(query, choice)
    return any(matches(shape, statement) for statement in statements for shape in shapes)


def _concerning(query: ParsedQuery, choice: Choice) -> frozenset[Shape]:
    if isinstance(choice.plan, Reevaluation | SemiNaive):
        return query.footprint.shapes
    return choice.plan.keys


def _is_closure(pattern: Pattern) -> bool:
    return not isinstance(pattern.predicate, Var | None) and pattern.predicate.text in CLOSURE


def _pattern_text(pattern: Pattern, subject: Place | None, iri: str) -> str:
    places = (pattern.subject, pattern.predicate, pattern.target)
    return " ".join(iri if place == subject else _place_text(place) for place in places)


def _place_text(place: Place | None) -> str:
    if place is None:
        return "?path"
    if isinstance(place, Var):
        return f"?b{abs(hash(place.name)) % 10_000}" if place.is_blank else f"?{place.name}"
    return place.text


def _shape_text(shape: Shape) -> str:
    return _short(" ".join("any" if term is None else term for term in shape))


def _short(text: str) -> str:
    for prefix, iri in PREFIXES.items():
        text = text.replace(f"<{iri}", f"{prefix}:\0")
    shown: list[str] = []
    for piece in text.split("\0"):
        head, closing, rest = piece.partition(">")
        shown.append(head + (rest if shown and closing else closing + rest))
    return "".join(shown)


def _bounds(bounds: tuple[float, float]) -> str:
    earliest, latest = (ox.Literal(str(bound)).value for bound in bounds)
    return f"at {earliest} s" if earliest == latest else f"between {earliest} and {latest} s"
