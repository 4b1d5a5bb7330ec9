"""Rules prepared for arrays: which axes they have, what they compare, and what they wait for.

A rule with k plane variables is a boolean array with one axis per variable; a condition on some of
them broadcasts. Comparisons of features never change while classes are being found, so they stand
apart from the conditions on classes and relations, which do.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fluentboard.model.geometry import FloatArray
from fluentboard_modules.mapping.plane_features import PlaneRelations
from fluentboard_modules.mapping.rule_language import (
    And,
    ClassAtom,
    ComparisonAtom,
    Expression,
    FeatureAtom,
    Named,
    Or,
    RelationAtom,
    Rule,
    RuleSet,
    Some,
    Term,
    Variable,
)

BoolArray = NDArray[np.bool_]

COMPARE = {
    "greaterThan": np.greater,
    "greaterThanOrEqual": np.greater_equal,
    "lessThan": np.less,
    "lessThanOrEqual": np.less_equal,
    "equal": np.equal,
    "notEqual": np.not_equal,
}
EVERYTHING = "Plane"  # what every individual is told to be


@dataclass(frozen=True, slots=True)
class FeatureOf:
    """A feature of the plane on one of the rule's axes."""

    feature: str
    axis: int


@dataclass(frozen=True, slots=True)
class Comparison:
    """Two sides, each a feature or a number, and how they must compare."""

    name: str
    left: FeatureOf | float
    right: FeatureOf | float


@dataclass(frozen=True, slots=True)
class Related:
    """A relation that must hold between the planes on two axes."""

    relation: str
    subject: int
    object: int


@dataclass(frozen=True, slots=True)
class CompiledRule:
    """A rule whose variables are axes of an array.

    Attributes:
        name: of the rule.
        head: axes of the head's arguments: one for a class, two for a relation.
        axes: how many there are.
        comparisons: of features, also those that a second or a constant value asks for.
        classes: per class atom the class and the axis.
        relations: the cheapest to compute first.
        needs: classes with whose members the rule may hold for more planes.
    """

    name: str
    head: tuple[int, ...]
    axes: int
    comparisons: tuple[Comparison, ...]
    classes: tuple[tuple[str, int], ...]
    relations: tuple[Related, ...]
    needs: frozenset[str]

    def compared(self, features: Mapping[str, FloatArray], n_planes: int) -> BoolArray:
        """`(n,) * axes`, or broadcastable to it; where all comparisons hold."""
        mask: BoolArray = np.ones((1,) * self.axes if self.axes > 1 else n_planes, dtype=np.bool_)
        for one in self.comparisons:
            left, right = (
                self.along(features[side.feature], side.axis)
                if isinstance(side, FeatureOf)
                else side
                for side in (one.left, one.right)
            )
            mask = mask & COMPARE[one.name](left, right)
        return mask

    def along(self, values: NDArray, axis: int) -> NDArray:
        """A value per plane, as an array that varies along one axis only."""
        if self.axes == 1:
            return values
        shape = [1] * self.axes
        shape[axis] = values.size
        return values.reshape(shape)

    def across(self, pairs: NDArray, subject: int, other: int) -> NDArray:
        """A value per pair of planes, as an array that varies along two axes only."""
        shape = [1] * self.axes
        shape[subject] = shape[other] = len(pairs)
        return (pairs if subject < other else pairs.T).reshape(shape)

    def projected(self, mask: BoolArray, *kept: int) -> BoolArray:
        """For which planes on the kept axes there are planes for all others."""
        others = tuple(axis for axis in range(self.axes) if axis not in kept)
        left = mask.any(axis=others) if others else mask
        return left.T if len(kept) == 2 and kept[0] > kept[1] else left


@dataclass(frozen=True, slots=True)
class CompiledRules:
    """A furniture ontology ready for `Evaluation`.

    Attributes:
        source: what was compiled.
        class_rules: per class the rules with it in the head.
        relation_rules: per relation the rules with it in the head.
        needs_of: per class expression of a definition, and per relation, the classes that it waits
            for.
    """

    source: RuleSet
    class_rules: tuple[tuple[str, CompiledRule], ...]
    relation_rules: Mapping[str, tuple[CompiledRule, ...]]
    definitions: tuple[tuple[str, Expression, frozenset[str]], ...]
    needs_of: Mapping[str, frozenset[str]]


def compile_rules(rules: RuleSet) -> CompiledRules:
    """Prepares an ontology that `check_rules` has found nothing wrong with."""
    needs_of = {name: _needs_of_relation(rules, name, frozenset()) for name in rules.relations}
    relation_rules: dict[str, list[CompiledRule]] = {}
    class_rules: list[tuple[str, CompiledRule]] = []
    for rule in rules.rules:
        compiled = _compile(rule, needs_of)
        if isinstance(rule.head, ClassAtom):
            class_rules.append((rule.head.class_name, compiled))
        else:
            relation_rules.setdefault(rule.head.relation, []).append(compiled)
    return CompiledRules(
        source=rules,
        class_rules=tuple(class_rules),
        relation_rules={name: tuple(found) for name, found in relation_rules.items()},
        definitions=tuple(
            (class_name, definition, _needs_of_expression(definition, needs_of))
            for class_name, definitions in rules.definitions.items()
            for definition in definitions
        ),
        needs_of=needs_of,
    )


def plane_variables(rule: Rule, *, body_only: bool = False) -> tuple[Variable, ...]:
    """The variables of a rule that stand for planes, sorted by name."""
    found: set[Variable] = set()
    for atom in rule.body if body_only else (*rule.body, rule.head):
        if isinstance(atom, ClassAtom):
            found.add(atom.argument)
        elif isinstance(atom, RelationAtom):
            found |= {atom.subject, atom.object}
        elif isinstance(atom, FeatureAtom):
            found.add(atom.subject)
    return tuple(sorted(found, key=lambda variable: variable.name))


def _compile(rule: Rule, needs_of: Mapping[str, frozenset[str]]) -> CompiledRule:
    axis = {variable: k for k, variable in enumerate(plane_variables(rule))}
    features: dict[Variable, FeatureOf] = {}
    comparisons: list[Comparison] = []
    for atom in rule.body:
        if isinstance(atom, FeatureAtom):
            feature = FeatureOf(atom.feature, axis[atom.subject])
            if not isinstance(atom.value, Variable):
                comparisons.append(Comparison("equal", feature, atom.value))
            elif features.setdefault(atom.value, feature) != feature:
                # A second feature for the same variable is an equation.
                comparisons.append(Comparison("equal", feature, features[atom.value]))

    def side(term: Term) -> FeatureOf | float:
        return features[term] if isinstance(term, Variable) else term

    comparisons += [
        Comparison(atom.comparison, side(atom.left), side(atom.right))
        for atom in rule.body
        if isinstance(atom, ComparisonAtom)
    ]
    classes = tuple(
        (atom.class_name, axis[atom.argument])
        for atom in rule.body
        if isinstance(atom, ClassAtom) and atom.class_name != EVERYTHING
    )
    related = sorted((a for a in rule.body if isinstance(a, RelationAtom)), key=_cost)
    head = rule.head
    ends = (head.argument,) if isinstance(head, ClassAtom) else (head.subject, head.object)
    return CompiledRule(
        name=rule.name,
        head=tuple(axis[variable] for variable in ends),
        axes=len(axis),
        comparisons=tuple(comparisons),
        classes=classes,
        relations=tuple(Related(a.relation, axis[a.subject], axis[a.object]) for a in related),
        needs=frozenset(name for name, _ in classes).union(
            *(needs_of[a.relation] for a in related)
        ),
    )


def _cost(atom: RelationAtom) -> int:
    """Measured relations in their own order, derived ones last."""
    measured = PlaneRelations.MEASURED
    return measured.index(atom.relation) if atom.relation in measured else len(measured)


def _needs_of_relation(rules: RuleSet, relation: str, seen: frozenset[str]) -> frozenset[str]:
    """The classes that pairs of a relation may follow from, by whatever detour."""
    if relation in seen or relation not in rules.relations:
        return frozenset()
    seen |= {relation}
    properties = rules.relations[relation]
    needs: set[str] = set()
    for other in (*properties.sub_relations, *properties.inverses):
        needs |= _needs_of_relation(rules, other, seen)
    for rule in rules.rules:
        if isinstance(rule.head, RelationAtom) and rule.head.relation == relation:
            for atom in rule.body:
                if isinstance(atom, ClassAtom) and atom.class_name != EVERYTHING:
                    needs.add(atom.class_name)
                elif isinstance(atom, RelationAtom):
                    needs |= _needs_of_relation(rules, atom.relation, seen)
    return frozenset(needs)


def _needs_of_expression(
    expression: Expression, needs_of: Mapping[str, frozenset[str]]
) -> frozenset[str]:
    match expression:
        case Named(class_name):
            return frozenset() if class_name == EVERYTHING else frozenset({class_name})
        case And(parts) | Or(parts):
            return frozenset[str]().union(*(_needs_of_expression(p, needs_of) for p in parts))
        case Some(relation, filler):
            return needs_of[relation] | _needs_of_expression(filler, needs_of)
