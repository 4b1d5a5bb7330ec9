"""Reading rules: what is understood, and what is refused with which words."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from fluentboard.errors import InvalidOntology
from fluentboard_modules.mapping.planar_region import PlanarRegion
from fluentboard_modules.mapping.rules import load_rules

HEADER = """
@prefix owl: <http://www.w3.org/2002/07/owl#> .
@prefix rdfs: <http://www.w3.org/2000/01/rdf-schema#> .
@prefix xsd: <http://www.w3.org/2001/XMLSchema#> .
@prefix swrl: <http://www.w3.org/2003/11/swrl#> .
@prefix swrlb: <http://www.w3.org/2003/11/swrlb#> .
@prefix var: <urn:swrl:var#> .
@prefix f: <https://w3id.org/fluentboard/furniture#> .
f:Plane a owl:Class . f:Furniture a owl:Class .
f:HighPlane a owl:Class ; rdfs:subClassOf f:Plane .
f:hasPosY a owl:DatatypeProperty . f:hasSize a owl:DatatypeProperty .
f:hasColour a owl:DatatypeProperty .
f:isLowerThan a owl:ObjectProperty ; f:minimumRise 0.05 .
f:isUnder a owl:ObjectProperty . f:isOver a owl:ObjectProperty ; owl:inverseOf f:isUnder .
var:p a swrl:Variable . var:q a swrl:Variable . var:h a swrl:Variable . var:s a swrl:Variable .
"""
HIGH = """
f:HighRule a swrl:Imp ;
    swrl:body (
        [ a swrl:DatavaluedPropertyAtom ; swrl:propertyPredicate f:hasPosY ;
          swrl:argument1 var:p ; swrl:argument2 var:h ]
        [ a swrl:BuiltinAtom ; swrl:builtin swrlb:greaterThan ; swrl:arguments ( var:h 1.0 ) ]
    ) ;
    swrl:head ( [ a swrl:ClassAtom ; swrl:classPredicate f:HighPlane ; swrl:argument1 var:p ] ) .
"""
UNDER = """
f:UnderRule a swrl:Imp ;
    swrl:body (
        [ a swrl:IndividualPropertyAtom ; swrl:propertyPredicate f:isLowerThan ;
          swrl:argument1 var:p ; swrl:argument2 var:q ]
        [ a swrl:ClassAtom ; swrl:classPredicate f:HighPlane ; swrl:argument1 var:q ]
    ) ;
    swrl:head ( [ a swrl:IndividualPropertyAtom ; swrl:propertyPredicate f:isUnder ;
                  swrl:argument1 var:p ; swrl:argument2 var:q ] ) .
"""
MakePlane = Callable[..., PlanarRegion]


def test_a_rule_labels_the_planes_its_body_describes(make_plane: MakePlane) -> None:
    rules = load_rules(HEADER + HIGH)

    result = rules.classify([make_plane((0.0, 0.0, 0.9)), make_plane((0.0, 0.0, 1.1))])

    assert "HighPlane" not in result.labels[0]
    assert "HighPlane" in result.labels[1]


def test_bounds_are_exclusive(make_plane: MakePlane) -> None:
    rules = load_rules(HEADER + HIGH)

    assert "HighPlane" not in rules.classify([make_plane((0.0, 0.0, 1.0))]).labels[0]


def test_a_relation_that_follows_by_rule_can_define_a_class(make_plane: MakePlane) -> None:
    bench = """
    f:Bench a owl:Class ; rdfs:subClassOf f:Furniture ; f:mainPlane f:Plane ;
        owl:equivalentClass [ a owl:Restriction ;
            owl:onProperty f:isUnder ; owl:someValuesFrom f:HighPlane ] .
    """
    rules = load_rules(HEADER + HIGH + UNDER + bench)
    planes = [make_plane((0.0, 0.0, z)) for z in (0.5, 0.9, 1.2)]

    hypotheses = rules.classify(planes).hypotheses

    assert {h.main_plane for h in hypotheses} == {0, 1}


def test_an_inverse_relation_is_understood(make_plane: MakePlane) -> None:
    lamp = """
    f:Lamp a owl:Class ; rdfs:subClassOf f:Furniture ; f:mainPlane f:HighPlane ;
        owl:equivalentClass [ a owl:Class ; owl:intersectionOf ( f:HighPlane
            [ a owl:Restriction ; owl:onProperty f:isOver ; owl:someValuesFrom f:Plane ] ) ] .
    """
    rules = load_rules(HEADER + HIGH + UNDER + lamp)
    planes = [make_plane((0.0, 0.0, z)) for z in (0.5, 1.2)]

    assert [h.main_plane for h in rules.classify(planes).hypotheses] == [1]


def test_two_comparisons_of_two_features_are_understood(make_plane: MakePlane) -> None:
    larger_than_high = HIGH.replace(
        "[ a swrl:BuiltinAtom ; swrl:builtin swrlb:greaterThan ; swrl:arguments ( var:h 1.0 ) ]",
        """[ a swrl:DatavaluedPropertyAtom ; swrl:propertyPredicate f:hasSize ;
             swrl:argument1 var:p ; swrl:argument2 var:s ]
           [ a swrl:BuiltinAtom ; swrl:builtin swrlb:greaterThan ; swrl:arguments ( var:s var:h ) ]
        """,
    )
    rules = load_rules(HEADER + larger_than_high)

    result = rules.classify([make_plane((0.0, 0.0, 0.9)), make_plane((0.0, 0.0, 1.1))])

    assert ["HighPlane" in labels for labels in result.labels] == [True, False]


def test_text_that_is_not_turtle_is_refused() -> None:
    with pytest.raises(InvalidOntology, match="not Turtle"):
        load_rules("<rdf:RDF>")


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("f:hasPosY ;\n", "f:hasColour ;\n", "hasColour is not measured at planes"),
        ("swrlb:greaterThan", "swrlb:matches", "built-in matches"),
        ("( var:h 1.0 )", "( var:s 1.0 )", r"\?s is compared but stands for no feature"),
        ("( var:h 1.0 )", '( var:h "high" )', "high is not a number"),
        ("swrl:argument1 var:p ] )", "swrl:argument1 var:q ] )", r"\?q is not in its body"),
        ("swrl:argument1 var:p ] )", "swrl:argument1 f:p ] )", "must be declared a swrl:Variable"),
    ],
)
def test_rules_that_cannot_be_evaluated_are_refused(old: str, new: str, words: str) -> None:
    assert old in HIGH
    with pytest.raises(InvalidOntology, match=words) as caught:
        load_rules(HEADER + HIGH.replace(old, new))
    assert "rule HighRule" in caught.value.message


def test_a_relation_that_nobody_measures_is_refused() -> None:
    near = UNDER.replace("f:isLowerThan", "f:isNear")

    with pytest.raises(InvalidOntology, match="isNear, which is neither measured"):
        load_rules(HEADER + HIGH + near + "f:isNear a owl:ObjectProperty .")


def test_a_measured_relation_without_tolerances_is_refused() -> None:
    with pytest.raises(InvalidOntology, match="isParallelTo has no tolerances"):
        load_rules(HEADER + "f:isParallelTo a owl:ObjectProperty .")


def test_relations_in_a_circle_are_refused() -> None:
    circle = UNDER.replace("f:isLowerThan", "f:isUnder")

    with pytest.raises(InvalidOntology, match="isUnder -> isUnder"):
        load_rules(HEADER + HIGH + circle)


def test_furniture_without_a_main_plane_is_refused() -> None:
    bench = "f:Bench rdfs:subClassOf f:Furniture ; owl:equivalentClass f:HighPlane ."

    with pytest.raises(InvalidOntology, match="Bench is defined but has no furniture:mainPlane"):
        load_rules(HEADER + HIGH + bench)


def test_a_class_expression_that_needs_a_reasoner_is_refused() -> None:
    bench = """f:Bench rdfs:subClassOf f:Furniture ; f:mainPlane f:HighPlane ;
        owl:equivalentClass [ a owl:Class ; owl:complementOf f:HighPlane ] ."""

    with pytest.raises(InvalidOntology, match="complementOf"):
        load_rules(HEADER + HIGH + bench)
