"""Rules and class definitions, evaluated on a set of planes by array operations.

Classes are found by forward chaining: what may follow from new members is applied until nothing
changes. Relations are looked at only for the pairs whose other conditions hold already, because
gaps between contours and overlaps of footprints are dear.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from fluentboard.model.geometry import FloatArray
from fluentboard_modules.mapping.compiled_rules import (
    EVERYTHING,
    BoolArray,
    CompiledRule,
    CompiledRules,
)
from fluentboard_modules.mapping.plane_features import PlaneRelations
from fluentboard_modules.mapping.rule_language import And, Expression, Named, Or, Some


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
        rules: CompiledRules,
        features: Mapping[str, FloatArray],
        relations: PlaneRelations,
        n_planes: int,
        entailed: Mapping[str, BoolArray] | None = None,
    ) -> None:
        self._rules = rules
        self._features = features
        self._relations = relations
        self._n = n_planes
        self._none = np.zeros(n_planes, dtype=np.bool_)
        self._all = np.ones(n_planes, dtype=np.bool_)
        self._members: dict[str, BoolArray] = {}
        self._growth: dict[str, int] = {}  # how often a class has gained members
        self._compared: dict[int, BoolArray] = {}  # by the identity of the rule
        self._pairs: dict[str, tuple[BoolArray, BoolArray, int]] = {}
        self._under_way: set[str] = set()
        if entailed is None:
            self._chain_forward()
        else:
            self._members.update(entailed)

    def members(self, class_name: str) -> BoolArray:
        """`(n,)`; which planes are of the class."""
        return self._all if class_name == EVERYTHING else self._members.get(class_name, self._none)

    def fired(self, rule: CompiledRule) -> BoolArray:
        """`(n,)`; for which planes a rule with a class in its head holds."""
        return rule.projected(self._satisfied(rule), *rule.head)

    def satisfies(self, expression: Expression, among: BoolArray | None = None) -> BoolArray:
        """`(n,)`; which planes a class expression describes, among the given ones."""
        among = self._all if among is None else among
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
                if not partner.any():
                    return partner
                return self.related(relation, among[:, None] & partner[None, :]).any(axis=1)

    def satisfies_one(self, expression: Expression, plane: int) -> bool:
        """Whether a class expression describes a plane."""
        return bool(self.satisfies(expression, self._only(plane))[plane])

    def partners(self, relation: str, filler: Expression, plane: int) -> list[int]:
        """The planes the filler describes and the relation leads to from a plane."""
        candidates = self._only(plane)[:, None] & self.satisfies(filler)[None, :]
        return [int(other) for other in self.related(relation, candidates)[plane].nonzero()[0]]

    def _only(self, plane: int) -> BoolArray:
        among = self._none.copy()
        among[plane] = True
        return among

    def related(self, relation: str, candidates: BoolArray) -> BoolArray:
        """`(n, n)`; which of the candidate pairs (row, column) are related."""
        age = self._age(self._rules.needs_of.get(relation, frozenset()))
        if relation in self._pairs:
            known, value, known_at = self._pairs[relation]
            if age != known_at:
                known = known & value  # classes only grow: what held still holds
        else:
            known = np.zeros((self._n, self._n), np.bool_)
            value = known.copy()
        missing = candidates & ~known
        if relation not in self._under_way and missing.any():
            # An inverse or a symmetric relation refers back to itself; what it can contribute is
            # being computed already.
            self._under_way.add(relation)
            try:
                value = value | self._derive_pairs(relation, missing)
            finally:
                self._under_way.discard(relation)
            self._pairs[relation] = (known | missing, value, age)
        return candidates & value

    def _age(self, classes: frozenset[str]) -> int:
        """A number that is larger whenever one of the classes has gained members."""
        return sum(self._growth.get(name, 0) for name in classes)

    def _chain_forward(self) -> None:
        """Applies rules, definitions and the hierarchy until no plane gains a class."""
        rules = self._rules
        steps: list[tuple[str, frozenset[str], Callable[[], BoolArray]]] = [
            (class_name, rule.needs, lambda rule=rule: self.fired(rule))
            for class_name, rule in rules.class_rules
        ]
        steps += [
            (class_name, needs, lambda name=class_name, what=what: self._newly(name, what))
            for class_name, what, needs in rules.definitions
        ]
        steps += [
            (class_name, frozenset({child}), lambda child=child: self.members(child))
            for class_name, children in rules.source.subclasses.items()
            for child in children
        ]
        ages: list[int] = [-1] * len(steps)
        changed = True
        while changed:
            changed = False
            for k, (class_name, needs, found) in enumerate(steps):
                age = self._age(needs)
                if age != ages[k]:
                    ages[k] = age
                    changed |= self._add(class_name, found())

    def _newly(self, class_name: str, definition: Expression) -> BoolArray:
        """Planes that a definition puts in a class they are not in yet."""
        return self.satisfies(definition, ~self.members(class_name))

    def _add(self, class_name: str, planes: BoolArray) -> bool:
        """Adds members to a class; whether any of them is new."""
        known = self.members(class_name)
        if not (planes & ~known).any():
            return False
        self._members[class_name] = known | planes
        self._growth[class_name] = self._growth.get(class_name, 0) + 1
        return True

    def _derive_pairs(self, relation: str, missing: BoolArray) -> BoolArray:
        result = np.zeros_like(missing)
        properties = self._rules.source.relations[relation]
        if relation in PlaneRelations.MEASURED:
            result |= self._relations.holds(relation, missing)
        for narrower in properties.sub_relations:
            result |= self.related(narrower, missing & ~result)
        for inverse in properties.inverses:
            result |= self.related(inverse, (missing & ~result).T).T
        for rule in self._rules.relation_rules.get(relation, ()):
            result |= self._pairs_of(rule, missing & ~result)
            if properties.is_symmetric:
                result |= self._pairs_of(rule, (missing & ~result).T).T
        return result

    def _pairs_of(self, rule: CompiledRule, candidates: BoolArray) -> BoolArray:
        """`(n, n)`; for which of the candidate pairs a rule with a relation in its head holds."""
        subject, other = rule.head
        if subject == other:
            loops = rule.projected(
                self._satisfied(rule, rule.along(np.diag(candidates), subject)), subject
            )
            return np.diag(loops)
        mask = self._satisfied(rule, rule.across(candidates, subject, other))
        return rule.projected(mask, subject, other)

    def _satisfied(self, rule: CompiledRule, among: BoolArray | None = None) -> BoolArray:
        """The assignments of planes to the rule's axes that satisfy the body."""
        mask = self._compared.get(id(rule))
        if mask is None:
            mask = self._compared[id(rule)] = rule.compared(self._features, self._n)
        if among is not None:
            mask = mask & among
        for class_name, axis in rule.classes:
            mask = mask & rule.along(self.members(class_name), axis)
        if rule.axes > 1:
            mask = np.broadcast_to(mask, (self._n,) * rule.axes)
        for one in rule.relations:
            if not mask.any():
                break
            if one.subject == one.object:
                here = rule.projected(mask, one.subject)
                loops = np.diag(self.related(one.relation, np.diag(here)))
                mask = mask & rule.along(loops, one.subject)
            else:
                pairs = rule.projected(mask, one.subject, one.object)
                related = self.related(one.relation, pairs)
                mask = mask & rule.across(related, one.subject, one.object)
        return mask
