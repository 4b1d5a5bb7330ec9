"""Rules and class definitions, evaluated on a set of planes by array operations.

Classes are found by forward chaining: everything is applied until nothing changes. Relations are
looked at only for the pairs whose other conditions hold already, because gaps between contours and
overlaps of footprints are dear. A rule with k plane variables is a boolean array with one axis per
variable; a condition on some of them broadcasts.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from fluentboard.errors import InvalidOntology
from fluentboard.model.geometry import FloatArray
from fluentboard_modules.mapping.plane_features import FEATURES, PlaneRelations
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

_EVERYTHING = "Plane"  # what every individual is told to be


class Evaluation:
    """Which planes belong to which class, which pairs are related, and by which rules.

    Args:
        rules: the ontology.
        features: `(n,)` per feature of the ontology.
        relations: the measured relations of the same n planes.
        n_planes: n.
        entailed: `(n,)` per class, if a reasoner has found the members already.
    """

    def __init__(
        self,
        rules: RuleSet,
        features: Mapping[str, FloatArray],
        relations: PlaneRelations,
        n_planes: int,
        entailed: Mapping[str, BoolArray] | None = None,
    ) -> None:
        self._rules = rules
        self._features = features
        self._relations = relations
        self._n = n_planes
        self._members: dict[str, BoolArray] = {}
        self._pairs: dict[str, tuple[BoolArray, BoolArray]] = {}
        self._under_way: set[str] = set()
        if entailed is None:
            self._chain_forward()
        else:
            self._members.update(entailed)

    def members(self, class_name: str) -> BoolArray:
        """`(n,)`; which planes are of the class."""
        if class_name == _EVERYTHING:
            return np.ones(self._n, dtype=np.bool_)
        return self._members.get(class_name, np.zeros(self._n, dtype=np.bool_))

    def fired(self, rule: Rule) -> BoolArray:
        """`(n,)`; for which planes a rule with a class in its head holds."""
        if not isinstance(rule.head, ClassAtom):
            raise TypeError(f"rule {rule.name} relates planes, it classifies none")
        axes = _plane_variables(rule)
        mask = self._satisfied(rule, axes, np.ones((self._n,) * len(axes), dtype=np.bool_))
        return _project(mask, axes, (rule.head.argument,))

    def satisfies(self, expression: Expression, among: BoolArray | None = None) -> BoolArray:
        """`(n,)`; which planes a class expression describes, among the given ones."""
        among = np.ones(self._n, dtype=np.bool_) if among is None else among
        if not among.any():
            return among
        match expression:
            case Named(class_name):
                return among & self.members(class_name)
            case And(parts):
                for part in sorted(parts, key=lambda part: isinstance(part, Some)):
                    among = self.satisfies(part, among)
                return among
            case Or(parts):
                return np.logical_or.reduce([self.satisfies(part, among) for part in parts])
            case Some(relation, filler):
                partner = self.satisfies(filler)
                return self.related(relation, among[:, None] & partner[None, :]).any(axis=1)

    def satisfies_one(self, expression: Expression, plane: int) -> bool:
        """Whether a class expression describes a plane."""
        return bool(self.satisfies(expression, self._only(plane))[plane])

    def partners(self, relation: str, filler: Expression, plane: int) -> list[int]:
        """The planes the filler describes and the relation leads to from a plane."""
        candidates = self._only(plane)[:, None] & self.satisfies(filler)[None, :]
        return [int(other) for other in self.related(relation, candidates)[plane].nonzero()[0]]

    def _only(self, plane: int) -> BoolArray:
        among = np.zeros(self._n, dtype=np.bool_)
        among[plane] = True
        return among

    def related(self, relation: str, candidates: BoolArray) -> BoolArray:
        """`(n, n)`; which of the candidate pairs (row, column) are related."""
        known, value = self._pairs.setdefault(
            relation,
            (np.zeros((self._n, self._n), np.bool_), np.zeros((self._n, self._n), np.bool_)),
        )
        missing = candidates & ~known
        if missing.any() and relation not in self._under_way:
            # An inverse or a symmetric relation refers back to itself; what it can contribute is
            # being computed already.
            self._under_way.add(relation)
            try:
                value |= self._derive_pairs(relation, missing)
            finally:
                self._under_way.discard(relation)
            known |= missing
        return candidates & value

    def _chain_forward(self) -> None:
        """Applies rules, definitions and the hierarchy until no plane gains a class."""
        changed = True
        while changed:
            changed = False
            # What follows for pairs may rest on classes; what was measured stays measured.
            self._pairs.clear()
            for rule in self._rules.rules:
                if isinstance(rule.head, ClassAtom):
                    changed |= self._add(rule.head.class_name, self.fired(rule))
            for class_name, definitions in self._rules.definitions.items():
                for definition in definitions:
                    rest = ~self.members(class_name)
                    changed |= self._add(class_name, self.satisfies(definition, rest))
            for class_name, subclasses in self._rules.subclasses.items():
                for subclass in subclasses:
                    changed |= self._add(class_name, self.members(subclass))

    def _add(self, class_name: str, planes: BoolArray) -> bool:
        """Adds members to a class; whether any of them is new."""
        known = self.members(class_name)
        if not (planes & ~known).any():
            return False
        self._members[class_name] = known | planes
        return True

    def _derive_pairs(self, relation: str, missing: BoolArray) -> BoolArray:
        result = np.zeros_like(missing)
        properties = self._rules.relations[relation]
        if relation in PlaneRelations.MEASURED:
            result |= self._relations.holds(relation, missing)
        for narrower in properties.sub_relations:
            result |= self.related(narrower, missing & ~result)
        for inverse in properties.inverses:
            result |= self.related(inverse, (missing & ~result).T).T
        for rule in self._rules.rules:
            if isinstance(rule.head, RelationAtom) and rule.head.relation == relation:
                result |= self._apply_to_pairs(rule, rule.head, missing & ~result)
                if properties.is_symmetric:
                    result |= self._apply_to_pairs(rule, rule.head, (missing & ~result).T).T
        return result

    def _apply_to_pairs(self, rule: Rule, head: RelationAtom, candidates: BoolArray) -> BoolArray:
        axes = _plane_variables(rule)
        pair = (head.subject, head.object)
        mask = np.broadcast_to(_broadcast(candidates, pair, axes), (self._n,) * len(axes)).copy()
        return _project(self._satisfied(rule, axes, mask), axes, pair)

    def _satisfied(self, rule: Rule, axes: tuple[Variable, ...], mask: BoolArray) -> BoolArray:
        """The assignments of planes to the rule's variables that satisfy the body."""
        values = feature_values(rule, self._features)
        for atom in rule.body:
            if isinstance(atom, ClassAtom):
                members = self.members(atom.class_name)
                mask &= _broadcast(members, (atom.argument,), axes)
            elif isinstance(atom, FeatureAtom):
                # A second feature for the same variable, or a constant, is an equation.
                mask &= _compare("equal", _feature(self._features, atom), atom.value, values, axes)
            elif isinstance(atom, ComparisonAtom):
                mask &= _compare(atom.comparison, atom.left, atom.right, values, axes)
        relation_atoms = [atom for atom in rule.body if isinstance(atom, RelationAtom)]
        for atom in sorted(relation_atoms, key=_cost):
            pair = (atom.subject, atom.object)
            if atom.subject == atom.object:
                loop = self.related(atom.relation, np.diag(_project(mask, axes, (atom.subject,))))
                mask &= _broadcast(np.diag(loop).copy(), (atom.subject,), axes)
            else:
                related = self.related(atom.relation, _project(mask, axes, pair))
                mask &= _broadcast(related, pair, axes)
        return mask


_Value = tuple[FloatArray, Variable]


def feature_values(rule: Rule, features: Mapping[str, FloatArray]) -> dict[Variable, _Value]:
    """What each data variable of a rule stands for: a feature of one of the planes."""
    values: dict[Variable, _Value] = {}
    for atom in rule.body:
        if isinstance(atom, FeatureAtom) and isinstance(atom.value, Variable):
            values.setdefault(atom.value, _feature(features, atom))
    return values


def check_rules(rules: RuleSet) -> None:
    """Refuses what cannot be evaluated, with the reason.

    Raises:
        InvalidOntology: a rule uses a feature or relation nobody measures, a variable that is never
            bound, or itself.
    """
    derived = {
        rule.head.relation for rule in rules.rules if isinstance(rule.head, RelationAtom)
    } | {
        name
        for name, properties in rules.relations.items()
        if properties.sub_relations or properties.inverses
    }
    for name in PlaneRelations.MEASURED:
        if name in rules.relations and not rules.relations[name].tolerances:
            raise InvalidOntology(f"relation {name} has no tolerances; annotate it")
    for rule in rules.rules:
        bound = {
            atom.value
            for atom in rule.body
            if isinstance(atom, FeatureAtom) and isinstance(atom.value, Variable)
        }
        planes = set(_plane_variables(rule, body_only=True))
        for variable in _plane_variables(rule):
            if variable not in planes:
                raise InvalidOntology(f"rule {rule.name}: ?{variable.name} is not in its body")
        for atom in rule.body:
            if isinstance(atom, FeatureAtom) and atom.feature not in FEATURES:
                raise InvalidOntology(
                    f"rule {rule.name}: {atom.feature} is not measured at planes; use one of "
                    f"{', '.join(FEATURES)}"
                )
            if isinstance(atom, ComparisonAtom):
                for term in (atom.left, atom.right):
                    if isinstance(term, Variable) and term not in bound:
                        raise InvalidOntology(
                            f"rule {rule.name}: ?{term.name} is compared but stands for no feature"
                        )
            if isinstance(atom, RelationAtom):
                _check_relation(rules, derived, atom.relation, f"rule {rule.name}")
    for class_name, definitions in rules.definitions.items():
        for definition in definitions:
            for relation in _relations_of(definition):
                _check_relation(rules, derived, relation, f"the definition of {class_name}")
    _check_recursion(rules)


def _check_relation(rules: RuleSet, derived: set[str], relation: str, where: str) -> None:
    measured = relation in PlaneRelations.MEASURED
    if relation not in rules.relations or not (measured or relation in derived):
        raise InvalidOntology(
            f"{where} uses {relation}, which is neither measured ("
            f"{', '.join(PlaneRelations.MEASURED)}) nor the head of a rule"
        )


def _check_recursion(rules: RuleSet) -> None:
    """Classes may refer back to each other, relations may not: their pairs are asked for once."""
    needs: dict[str, set[str]] = {}
    for rule in rules.rules:
        if isinstance(rule.head, RelationAtom):
            needs.setdefault(rule.head.relation, set()).update(
                atom.relation for atom in rule.body if isinstance(atom, RelationAtom)
            )

    def visit(name: str, path: tuple[str, ...]) -> None:
        if name in path:
            circle = " -> ".join((*path[path.index(name) :], name))
            raise InvalidOntology(
                f"{circle}: relations that follow from themselves need a reasoner"
            )
        for other in sorted(needs.get(name, ())):
            visit(other, (*path, name))

    for name in sorted(needs):
        visit(name, ())


def _relations_of(expression: Expression) -> set[str]:
    match expression:
        case Named():
            return set()
        case And(parts) | Or(parts):
            return set[str]().union(*(_relations_of(part) for part in parts))
        case Some(relation, filler):
            return {relation} | _relations_of(filler)


def _plane_variables(rule: Rule, body_only: bool = False) -> tuple[Variable, ...]:
    """The variables that stand for planes, sorted by name."""
    found: set[Variable] = set()
    for atom in rule.body if body_only else (*rule.body, rule.head):
        if isinstance(atom, ClassAtom):
            found.add(atom.argument)
        elif isinstance(atom, RelationAtom):
            found |= {atom.subject, atom.object}
        elif isinstance(atom, FeatureAtom):
            found.add(atom.subject)
    return tuple(sorted(found, key=lambda variable: variable.name))


def _cost(atom: RelationAtom) -> int:
    """Measured relations in their own order, derived ones last."""
    measured = PlaneRelations.MEASURED
    return measured.index(atom.relation) if atom.relation in measured else len(measured)


def _feature(features: Mapping[str, FloatArray], atom: FeatureAtom) -> _Value:
    return features[atom.feature], atom.subject


def _compare(
    comparison: str,
    left: Term | _Value,
    right: Term | _Value,
    values: Mapping[Variable, _Value],
    axes: tuple[Variable, ...],
) -> BoolArray:
    sides: list[FloatArray | float] = []
    for term in (left, right):
        value = values[term] if isinstance(term, Variable) else term
        if isinstance(value, tuple):
            sides.append(_broadcast(value[0], (value[1],), axes))
        else:
            sides.append(value)
    return np.asarray(COMPARE[comparison](*sides))


def _broadcast(
    array: NDArray[np.generic], variables: tuple[Variable, ...], axes: tuple[Variable, ...]
) -> NDArray:
    """The array with one axis per variable of the rule, of length 1 where it does not depend."""
    order = sorted(range(len(variables)), key=lambda k: axes.index(variables[k]))
    array = array.transpose(order)
    shape = [1] * len(axes)
    for k, size in zip(order, array.shape, strict=True):
        shape[axes.index(variables[k])] = size
    return array.reshape(shape)


def _project(
    mask: BoolArray, axes: tuple[Variable, ...], variables: tuple[Variable, ...]
) -> BoolArray:
    """For which values of the given variables some assignment of the others is left."""
    others = tuple(k for k, axis in enumerate(axes) if axis not in variables)
    left = mask.any(axis=others)
    remaining = [axis for axis in axes if axis in variables]
    return left.transpose([remaining.index(variable) for variable in variables])
