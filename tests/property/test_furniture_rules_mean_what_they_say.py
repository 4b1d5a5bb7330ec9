"""The compiled rules agree with a literal reading of them, plane by plane and pair by pair.

The literal reading below tries every assignment of planes to a rule's variables and applies
everything until nothing new follows. It shares the parsed rules and the measured relations with the
compiled evaluation, and nothing else.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping, Sequence
from itertools import product
from random import Random

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import MultiPolygon, box

from fluentboard.model.geometry import FloatArray, Transform
from fluentboard_modules.mapping.planar_region import PlanarRegion, upright_axes
from fluentboard_modules.mapping.plane_features import PlaneRelations, measure_features
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
from fluentboard_modules.mapping.rules import load_rules
from fluentboard_ontology import read

RULES = load_rules(read("furniture"))
HOLDS: dict[str, Callable[[float, float], bool]] = {
    "greaterThan": operator.gt,
    "greaterThanOrEqual": operator.ge,
    "lessThan": operator.lt,
    "lessThanOrEqual": operator.le,
    "equal": operator.eq,
    "notEqual": operator.ne,
}

Facts = dict[str, set[int]]
Pairs = dict[str, set[tuple[int, int]]]


class LiteralReading:
    """All classes and relations that follow, by brute force."""

    def __init__(self, rules: RuleSet, planes: Sequence[PlanarRegion]) -> None:
        self.rules = rules
        self.n = len(planes)
        self.features = measure_features(planes)
        self.members: Facts = {"Plane": set(range(self.n))}
        self.pairs: Pairs = {}
        measured = PlaneRelations(
            planes, {name: p.tolerances for name, p in rules.relations.items()}
        )
        for relation in PlaneRelations.MEASURED:
            for i, j in product(range(self.n), repeat=2):
                one = np.zeros((self.n, self.n), dtype=np.bool_)
                one[i, j] = True
                if measured.holds(relation, one)[i, j]:
                    self.pairs.setdefault(relation, set()).add((i, j))
        while self._step():
            pass

    def _size(self) -> int:
        return sum(map(len, self.members.values())) + sum(map(len, self.pairs.values()))

    def _step(self) -> bool:
        before = self._size()
        for rule in self.rules.rules:
            self._apply(rule)
        for name, definitions in self.rules.definitions.items():
            for definition in definitions:
                found = {i for i in range(self.n) if self.describes(definition, i)}
                self.members.setdefault(name, set()).update(found)
        for name, subclasses in self.rules.subclasses.items():
            for subclass in subclasses:
                self.members.setdefault(name, set()).update(self.members.get(subclass, set()))
        for name, properties in self.rules.relations.items():
            known = self.pairs.setdefault(name, set())
            for narrower in properties.sub_relations:
                known.update(self.pairs.get(narrower, set()))
            for inverse in properties.inverses:
                known.update((j, i) for i, j in self.pairs.get(inverse, set()))
            if properties.is_symmetric:
                known.update({(j, i) for i, j in known})
        return self._size() > before

    def describes(self, expression: Expression, plane: int) -> bool:
        match expression:
            case Named(name):
                return plane in self.members.get(name, set())
            case And(parts):
                return all(self.describes(part, plane) for part in parts)
            case Or(parts):
                return any(self.describes(part, plane) for part in parts)
            case Some(relation, filler):
                return any(
                    i == plane and self.describes(filler, j)
                    for i, j in self.pairs.get(relation, set())
                )

    def _apply(self, rule: Rule) -> None:
        names = sorted(
            {
                variable.name
                for atom in rule.body
                for variable in (
                    [atom.argument]
                    if isinstance(atom, ClassAtom)
                    else [atom.subject, atom.object]
                    if isinstance(atom, RelationAtom)
                    else [atom.subject]
                    if isinstance(atom, FeatureAtom)
                    else []
                )
            }
        )
        for choice in product(range(self.n), repeat=len(names)):
            where = dict(zip(names, choice, strict=True))
            if self._holds(rule, where):
                if isinstance(rule.head, ClassAtom):
                    self.members.setdefault(rule.head.class_name, set()).add(
                        where[rule.head.argument.name]
                    )
                else:
                    self.pairs.setdefault(rule.head.relation, set()).add(
                        (where[rule.head.subject.name], where[rule.head.object.name])
                    )

    def _holds(self, rule: Rule, where: Mapping[str, int]) -> bool:
        numbers: dict[str, float] = {}
        for atom in rule.body:
            if isinstance(atom, FeatureAtom) and isinstance(atom.value, Variable):
                numbers[atom.value.name] = float(
                    self.features[atom.feature][where[atom.subject.name]]
                )

        def value(term: Term) -> float:
            return numbers[term.name] if isinstance(term, Variable) else term

        for atom in rule.body:
            if isinstance(atom, ClassAtom):
                if where[atom.argument.name] not in self.members.get(atom.class_name, set()):
                    return False
            elif isinstance(atom, RelationAtom):
                pair = (where[atom.subject.name], where[atom.object.name])
                if pair not in self.pairs.get(atom.relation, set()):
                    return False
            elif isinstance(atom, ComparisonAtom) and not HOLDS[atom.comparison](
                value(atom.left), value(atom.right)
            ):
                return False
        return True


def plane(
    centre: tuple[float, float, float],
    tilt_deg: float,
    heading_deg: float,
    sides: tuple[float, float],
) -> PlanarRegion:
    tilt, heading = np.deg2rad(tilt_deg), np.deg2rad(heading_deg)
    normal: FloatArray = np.array(
        [np.sin(tilt) * np.cos(heading), np.sin(tilt) * np.sin(heading), np.cos(tilt)]
    )
    half = 0.5 * np.array(sides)
    return PlanarRegion(
        index=0,
        T_map_region=Transform.from_parts(upright_axes(normal), np.array(centre)),
        contour=MultiPolygon([box(-half[0], -half[1], half[0], half[1])]),
        n_points=100,
        rms_m=0.003,
    )


def chair_parts(x: float, z: float, gap: float, tilt_deg: float) -> list[PlanarRegion]:
    return [
        plane((x, 0.0, 0.45 + z), tilt_deg, 0.0, (0.4, 0.4)),
        plane((x, 0.25 + gap, 0.75), 90.0 - 2.0 * tilt_deg, -90.0, (0.4, 0.3)),
    ]


def shelf_parts(low: float, spacing: float, shift: float) -> list[PlanarRegion]:
    heights = [0.13 + low + k * spacing for k in range(3)]
    return [plane((shift * k, 0.5, z), 0.0, 0.0, (0.8, 0.3)) for k, z in enumerate(heights)]


def cabinet_parts(height: float, drop: float) -> list[PlanarRegion]:
    return [
        plane((-0.5, 0.0, height), 0.0, 0.0, (0.8, 0.5)),
        plane((-0.5, -0.26 - drop, 0.5 * height), 90.0, -90.0, (0.8, 0.8)),
    ]


# Crowded on purpose, and at the heights the rules speak of: sparse planes are never related.
single = st.builds(
    plane,
    st.tuples(
        st.floats(-0.5, 0.5),
        st.floats(-0.5, 0.5),
        st.sampled_from([0.0, 0.08, 0.13, 0.45, 0.48, 0.7, 0.72, 0.9, 1.2, 2.3]),
    ),
    st.sampled_from([0.0, 0.0, 3.0, 20.0, 75.0, 90.0, 90.0, 180.0]),
    st.floats(0.0, 360.0),
    st.tuples(st.floats(0.1, 1.5), st.floats(0.1, 0.9)),
)
nudge = st.floats(-0.15, 0.15)
groups = st.one_of(
    single.map(lambda one: [one]),
    st.builds(chair_parts, nudge, nudge, nudge, st.floats(0.0, 15.0)),
    st.builds(shelf_parts, nudge, st.floats(0.2, 0.5), nudge),
    st.builds(cabinet_parts, st.floats(0.6, 1.6), nudge),
)
planes = st.lists(groups, max_size=4).map(
    lambda several: [region for group in several for region in group]
)


def test_compiled_rules_equal_a_literal_evaluation() -> None:
    seen: set[str] = set()

    @settings(max_examples=80)
    @given(planes)
    def agree(planes: list[PlanarRegion]) -> None:
        literal = LiteralReading(RULES.rules, planes)
        classified = RULES.classify(planes)

        for index, labels in enumerate(classified.labels):
            expected = {
                name
                for name, members in literal.members.items()
                if index in members and name.endswith("Plane") and name != "Plane"
            }
            assert labels == expected
        furniture = {
            (name, index)
            for name in RULES.rules.furniture
            for index in literal.members.get(name, set())
        }
        assert {(h.class_name, h.main_plane) for h in classified.hypotheses} == furniture
        seen.update(name for name, _ in furniture)

    agree()
    # Agreement about nothing would be no agreement.
    assert {"Chair", "Shelf", "Cabinet", "Table"} <= seen


@settings(max_examples=30)
@given(planes, st.randoms(use_true_random=False))
def test_the_order_of_the_planes_does_not_matter(
    planes: list[PlanarRegion], random: Random
) -> None:
    order = list(range(len(planes)))
    random.shuffle(order)
    there = RULES.classify(planes)
    back = RULES.classify([planes[k] for k in order])

    for position, k in enumerate(order):
        assert back.labels[position] == there.labels[k]
    assert {(h.class_name, order[h.main_plane]) for h in back.hypotheses} == {
        (h.class_name, h.main_plane) for h in there.hypotheses
    }


@settings(max_examples=30)
@given(planes)
def test_a_hypothesis_names_only_planes_that_bear_the_label(planes: list[PlanarRegion]) -> None:
    classified = RULES.classify(planes)

    for hypothesis in classified.hypotheses:
        assert hypothesis.planes[0].plane == hypothesis.main_plane
        for part in hypothesis.planes:
            assert part.label in classified.labels[part.plane]
        for miss in classified.near_misses:
            assert (miss.class_name, miss.plane) != (hypothesis.class_name, hypothesis.main_plane)
