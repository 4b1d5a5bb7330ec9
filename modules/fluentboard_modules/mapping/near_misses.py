"""Why is this not a chair? Planes that fail a definition by one condition only.

Two ways to miss: the label of the main plane fails by one comparison ("height above the floor
0.61 m, must be less than 0.53 m") while everything else holds; or the label is there and the other
plane is not, or stands wrongly ("gap 0.31 m, at most 0.25 m").
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from fluentboard.model.geometry import FloatArray
from fluentboard_modules.mapping.compiled_rules import COMPARE
from fluentboard_modules.mapping.plane_features import FEATURE_UNITS, Measurement, PlaneRelations
from fluentboard_modules.mapping.rule_evaluation import Evaluation
from fluentboard_modules.mapping.rule_language import (
    And,
    ClassAtom,
    ComparisonAtom,
    Expression,
    FeatureAtom,
    FurnitureClass,
    Named,
    Or,
    RelationAtom,
    Rule,
    RuleSet,
    Some,
    Variable,
)

_NEAR = 0.35
"""A bound missed by up to this share of itself is a near miss: a seat at 0.61 m, not a table."""

_WORDS = {
    "greaterThan": "must be more than",
    "greaterThanOrEqual": "must be at least",
    "lessThan": "must be less than",
    "lessThanOrEqual": "must be at most",
    "equal": "must be",
    "notEqual": "must not be",
}


@dataclass(frozen=True, slots=True)
class NearMiss:
    """A plane that is nearly furniture.

    Attributes:
        class_name: what it is not.
        plane: index of the region that would be its main plane.
        reason: the one condition that fails, with the value, its unit and the bound.
        shortfall: how far the value is beyond the bound, as a share of the bound.
    """

    class_name: str
    plane: int
    reason: str
    shortfall: float


def find_near_misses(
    rules: RuleSet,
    features: Mapping[str, FloatArray],
    relations: PlaneRelations,
    evaluation: Evaluation,
) -> list[NearMiss]:
    """The near misses of all furniture classes, the nearest first."""
    found: list[NearMiss] = []
    for furniture in rules.furniture.values():
        members = evaluation.members(furniture.name)
        for plane in np.flatnonzero(~members):
            misses = list(_misses(rules, features, relations, evaluation, furniture, int(plane)))
            if misses:
                found.append(min(misses, key=lambda miss: miss.shortfall))
    return sorted(found, key=lambda miss: (miss.shortfall, miss.class_name, miss.plane))


def _misses(
    rules: RuleSet,
    features: Mapping[str, FloatArray],
    relations: PlaneRelations,
    evaluation: Evaluation,
    furniture: FurnitureClass,
    plane: int,
) -> Iterator[NearMiss]:
    alternatives = [
        alternative
        for definition in rules.definitions[furniture.name]
        for alternative in _alternatives(definition)
    ]
    for alternative in alternatives:
        own, others = _split(alternative)
        labelled = [label for label in own if evaluation.members(label)[plane]]
        if labelled:
            missing = [part for part in others if not evaluation.satisfies_one(part, plane)]
            if len(missing) == 1:
                yield from _missing_partner(
                    rules, relations, evaluation, furniture, plane, missing[0]
                )
        else:
            near = [
                miss
                for rule in rules.rules
                if isinstance(rule.head, ClassAtom) and rule.head.class_name in own
                for miss in _failed_comparison(rules, features, evaluation, furniture, rule, plane)
            ]
            # Last because it measures relations.
            if near and all(evaluation.satisfies_one(part, plane) for part in others):
                yield from near


def _alternatives(definition: Expression) -> tuple[Expression, ...]:
    """The ways to satisfy a definition: the parts of a union, if they are more than labels."""
    if isinstance(definition, Or) and not all(isinstance(p, Named) for p in definition.parts):
        return definition.parts
    return (definition,)


def _split(definition: Expression) -> tuple[list[str], list[Expression]]:
    """The labels the main plane itself may have, and the conditions on other planes."""
    match definition:
        case Named(class_name):
            return [class_name], []
        case Or(parts):
            return [part.class_name for part in parts if isinstance(part, Named)], []
        case And(parts):
            own: list[str] = []
            others: list[Expression] = []
            for part in parts:
                labels, rest = _split(part)
                own += labels
                others += rest
            return own, others
        case Some():
            return [], [definition]


def _failed_comparison(
    rules: RuleSet,
    features: Mapping[str, FloatArray],
    evaluation: Evaluation,
    furniture: FurnitureClass,
    rule: Rule,
    plane: int,
) -> Iterator[NearMiss]:
    """The near miss of a rule about one plane, if exactly one of its comparisons fails."""
    names: dict[Variable, str] = {}
    for atom in rule.body:
        if isinstance(atom, RelationAtom):
            return
        if isinstance(atom, ClassAtom) and not evaluation.members(atom.class_name)[plane]:
            return
        if isinstance(atom, FeatureAtom) and isinstance(atom.value, Variable):
            names[atom.value] = atom.feature
    failed: list[tuple[str, float, float, str]] = []
    for atom in rule.body:
        if not isinstance(atom, ComparisonAtom) or not isinstance(atom.left, Variable):
            continue
        if isinstance(atom.right, Variable):
            continue
        value = float(features[names[atom.left]][plane])
        if not COMPARE[atom.comparison](value, atom.right):
            failed.append((names[atom.left], value, atom.right, _WORDS[atom.comparison]))
    if len(failed) == 1:
        feature, value, bound, words = failed[0]
        shortfall = abs(value - bound) / max(abs(bound), 1e-9)
        if shortfall <= _NEAR:
            unit = FEATURE_UNITS[feature]
            quantity = rules.labels.get(feature, feature).removeprefix("has ")
            label = rules.labels.get(rule.head.class_name, rule.head.class_name)  # type: ignore[union-attr]
            yield NearMiss(
                furniture.name,
                plane,
                f"no {label}: {quantity} {_apart(value, bound)} {unit}, {words} {bound:.2f} {unit}",
                shortfall,
            )


def _missing_partner(
    rules: RuleSet,
    relations: PlaneRelations,
    evaluation: Evaluation,
    furniture: FurnitureClass,
    plane: int,
    condition: Expression,
) -> Iterator[NearMiss]:
    """Which other plane is missing, or what is wrong with the best candidate."""
    if not isinstance(condition, Some):
        return
    label = _describe(rules, condition.filler)
    candidates = np.flatnonzero(evaluation.satisfies(condition.filler))
    best: tuple[float, Measurement] | None = None
    for other in candidates:
        failed = [
            measurement
            for relation, i, j in _measured_parts(rules, condition.relation, plane, int(other))
            for measurement in relations.measure(relation, i, j)
            if not measurement.holds
        ]
        if len(failed) == 1 and np.isfinite(failed[0].value):
            shortfall = abs(failed[0].value - failed[0].limit) / max(abs(failed[0].limit), 1e-9)
            if best is None or shortfall < best[0]:
                best = shortfall, failed[0]
    if best is not None and best[0] <= 1.0:
        shortfall, m = best
        unit = f" {m.unit}" if m.unit else ""
        bound = "at least" if m.at_least else "at most"
        reason = (
            f"its {label} is off: {m.quantity} {_apart(m.value, m.limit)}{unit}, "
            f"{bound} {m.limit:.2f}{unit}"
        )
        yield NearMiss(furniture.name, plane, reason, shortfall)
    else:
        words = rules.labels.get(condition.relation, condition.relation)
        yield NearMiss(furniture.name, plane, f"{words}: no {label} seen there", 1.0)


def _measured_parts(
    rules: RuleSet, relation: str, plane: int, other: int
) -> list[tuple[str, int, int]]:
    """A relation between two planes as measured relations, taking its first rule if it has one."""
    if relation in PlaneRelations.MEASURED:
        return [(relation, plane, other)]
    for rule in rules.rules:
        if isinstance(rule.head, RelationAtom) and rule.head.relation == relation:
            place = {rule.head.subject: plane, rule.head.object: other}
            return [
                part
                for atom in rule.body
                if isinstance(atom, RelationAtom) and {atom.subject, atom.object} <= place.keys()
                for part in _measured_parts(
                    rules, atom.relation, place[atom.subject], place[atom.object]
                )
            ]
    return []


def _describe(rules: RuleSet, expression: Expression) -> str:
    match expression:
        case Named(class_name):
            return rules.labels.get(class_name, class_name)
        case And(parts):
            return _describe(rules, parts[0])
        case Or(parts):
            return " or ".join(_describe(rules, part) for part in parts)
        case Some(relation, filler):
            words = rules.labels.get(relation, relation)
            return f"plane that {words} {_describe(rules, filler)}"


def _apart(value: float, bound: float) -> str:
    """A value with two digits, or with more if these would be the digits of the bound."""
    return next(
        (text for n in (2, 3) if float(text := f"{value:.{n}f}") != round(bound, n)), f"{value:.4f}"
    )
