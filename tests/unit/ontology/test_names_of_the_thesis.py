"""Every name in the thesis's listings and queries is in the ontologies, where the thesis has it."""

from __future__ import annotations

from pathlib import Path

import pytest
import rdflib
from rdflib.namespace import OWL, RDF, RDFS, XSD
from rdflib.term import Node

from fluentboard_ontology import PREFIXES, RACE, UPPER

LISTING_2_1_CLASSES = {
    "MoveObjectFromTo",
    "MoveObjectActivity",
    "Area",
    "PutObjectActivity",
    "GetObjectsActivity",
    "GetObjectsDriveRobotGraspObjectsActivity",
    "GetObjectsFromDifferentActivity",
    "GetObjectsGraspObjectsActivity",
    "RobotActivity",
    "move_object_Task",
    "PassiveObject",
}
LISTING_2_2_CLASSES = {
    "PickUpObjectActivity",
    "Arm",
    "Mug",
    "On",
    "Holding",
    "PlacingAreaEastRight",
    "Gripper",
}
LISTING_4_CLASSES = {"Coffee", "Pose", "BBox"}
SECTION_2_4_AREAS = {"ManipulationArea", "PreManipulationArea", "SittingArea", "PlacingArea"}
SECTION_3_2_2_CLASSES = {
    "Plane",
    "HorizontalPlane",
    "LowShelfPlane",
    "MiddleShelfPlane",
    "HighShelfPlane",
    "ChairSeatPlane",
    "Furniture",
    "Shelf",
}
SECTION_4_3_1_CATEGORIES = {
    "SugarPot",
    "MilkPot",
    "CoffeeJug",
    "Mug",
    "Dish",
    "Fork",
    "Knife",
    "Spoon",
    "TableSign",
}
OBJECT_PROPERTIES = {
    "hasAreaA",
    "hasAreaB",
    "hasPutObject",
    "hasGetObjects",
    "hasTask",
    "hasPassiveObject",
    "hasArm",
    "hasOn",
    "hasHolding",
    "hasArea",
    "hasPhysicalEntity",
    "hasGripper",
    "hasPose",
    "hasBoundingBox",
    "isBelow",
}
DATA_PROPERTIES = {
    "hasResult": XSD.string,
    "isInitialKnowledge": XSD.boolean,
    "hasX": XSD.float,
    "hasY": XSD.float,
    "hasZ": XSD.float,
    "hasRoll": XSD.float,
    "hasPitch": XSD.float,
    "hasYaw": XSD.float,
    "hasXSize": XSD.float,
    "hasYSize": XSD.float,
    "hasZSize": XSD.float,
    "hasStartEarliest": XSD.double,
    "hasStartLatest": XSD.double,
    "hasFinishEarliest": XSD.double,
    "hasFinishLatest": XSD.double,
}

GOLDEN = Path(__file__).parents[2] / "golden"
FLOOR_AREA_QUERY = (GOLDEN / "query_2_3.rq").read_text(encoding="utf-8")
ANCHORING_QUERY = (GOLDEN / "query_4_2_4.rq").read_text(encoding="utf-8")
BOARD = """
fluent:sittingArea1 a race:SittingAreaEast ; upper:hasBoundingBox fluent:box1 .
fluent:box1 a upper:BBox ; upper:hasPose fluent:pose1 .
fluent:pose1 a upper:Pose ; upper:hasZ "0.0"^^xsd:float .
fluent:placingArea1 a race:PlacingAreaEastRight ; upper:hasBoundingBox fluent:box2 .
fluent:box2 a upper:BBox ; upper:hasPose fluent:pose2 .
fluent:pose2 a upper:Pose ; upper:hasZ "0.71"^^xsd:float .
fluent:mug1 a race:Coffee ; upper:hasBoundingBox fluent:box2 .
fluent:keys1 a race:Keys ; upper:hasBoundingBox fluent:box2 .
fluent:table1 a furniture:Table ; upper:hasBoundingBox fluent:box2 .
"""


def named(graph: rdflib.Graph, kind: rdflib.URIRef) -> dict[str, Node]:
    found = graph.subjects(RDF.type, kind)
    return {str(n).rpartition("#")[2]: n for n in found if isinstance(n, rdflib.URIRef)}


def answers(ontologies: rdflib.Graph, query: str) -> set[str]:
    prefixes = "".join(f"@prefix {name}: <{iri}> .\n" for name, iri in PREFIXES.items())
    board = rdflib.Graph().parse(data=prefixes + BOARD, format="turtle")
    # rdflib hands out rows of whatever kind the query is; a SELECT's can be indexed.
    rows = (ontologies + board).query(query, initNs=dict(PREFIXES))
    return {str(row[0]).removeprefix(PREFIXES["fluent"]) for row in rows}  # type: ignore[index]


@pytest.mark.parametrize(
    "names",
    [
        LISTING_2_1_CLASSES,
        LISTING_2_2_CLASSES,
        LISTING_4_CLASSES,
        SECTION_2_4_AREAS,
        SECTION_3_2_2_CLASSES,
        SECTION_4_3_1_CATEGORIES,
    ],
    ids=["listing 2.1", "listing 2.2", "listings 4.1 and 4.2", "2.4", "3.2.2", "4.3.1"],
)
def test_classes_of_the_thesis_are_declared(everything: rdflib.Graph, names: set[str]) -> None:
    assert names - named(everything, OWL.Class).keys() == set()


def test_object_properties_of_the_thesis_are_declared(everything: rdflib.Graph) -> None:
    assert OBJECT_PROPERTIES - named(everything, OWL.ObjectProperty).keys() == set()


def test_data_properties_of_the_thesis_have_its_types(everything: rdflib.Graph) -> None:
    declared = named(everything, OWL.DatatypeProperty)
    for name, datatype in DATA_PROPERTIES.items():
        assert everything.value(declared[name], RDFS.range) == datatype, name
    assert {"hasSize", "hasPosY"} <= declared.keys()


def test_names_that_the_queries_prefix_live_in_those_namespaces(everything: rdflib.Graph) -> None:
    for iri in (UPPER + "Area", RACE + "Kitchenware", RACE + "PersonalItem"):
        assert (rdflib.URIRef(iri), RDF.type, OWL.Class) in everything
    for iri in (UPPER + "hasBoundingBox", UPPER + "hasPose"):
        assert (rdflib.URIRef(iri), RDF.type, OWL.ObjectProperty) in everything
    assert (rdflib.URIRef(UPPER + "hasZ"), RDF.type, OWL.DatatypeProperty) in everything


def test_query_of_section_2_3_finds_the_floor_areas_as_printed(everything: rdflib.Graph) -> None:
    assert answers(everything, FLOOR_AREA_QUERY) == {"sittingArea1"}


def test_query_of_section_4_2_4_finds_the_objects_as_printed(everything: rdflib.Graph) -> None:
    assert answers(everything, ANCHORING_QUERY) == {"mug1", "keys1"}


@pytest.mark.parametrize("name", sorted(SECTION_4_3_1_CATEGORIES | {"Coffee"}))
def test_anchored_classes_are_proper_subclasses_of_kitchenware(
    everything: rdflib.Graph, name: str
) -> None:
    term = rdflib.URIRef(RACE + name)
    above = set(everything.transitive_objects(term, RDFS.subClassOf)) - {term}
    assert rdflib.URIRef(RACE + "Kitchenware") in above


def test_coffee_is_a_mug_because_both_are_classes_of_mug1(everything: rdflib.Graph) -> None:
    assert (
        rdflib.URIRef(RACE + "Coffee"),
        RDFS.subClassOf,
        rdflib.URIRef(RACE + "Mug"),
    ) in everything
