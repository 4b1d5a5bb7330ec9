"""What cannot be evaluated is refused before it is tried."""

from __future__ import annotations

from fluentboard.errors import InvalidOntology
from fluentboard_modules.mapping.compiled_rules import plane_variables
from fluentboard_modules.mapping.plane_features import FEATURES, PlaneRelations
from fluentboard_modules.mapping.rule_language import (
    And,
    ComparisonAtom,
    Expression,
    FeatureAtom,
    Named,
    Or,
    RelationAtom,
    RuleSet,
    Some,
    Variable,
)


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
        planes = set(plane_variables(rule, body_only=True))
        for variable in plane_variables(rule):
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
