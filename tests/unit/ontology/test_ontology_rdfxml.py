"""The ontologies survive the trip to RDF/XML and into owlready2, rules included."""

from __future__ import annotations

import io
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import rdflib
from rdflib.compare import isomorphic

from fluentboard_ontology import ONTOLOGIES, ontology_iri
from fluentboard_ontology.rdfxml import to_rdfxml, write_owl_files


@pytest.fixture(scope="module")
def world() -> Iterator[Any]:
    """All ontologies in a world of owlready2, which has no types: hence Any."""
    owlready2 = pytest.importorskip("owlready2")
    world = owlready2.World()
    for name in ONTOLOGIES:
        ontology = world.get_ontology(ontology_iri(name) + "#")
        ontology.load(fileobj=io.BytesIO(to_rdfxml(name).encode()))
    yield world
    world.close()


def test_rdfxml_says_the_same_as_the_turtle(graphs: dict[str, rdflib.Graph]) -> None:
    back = rdflib.Graph().parse(data=to_rdfxml("upper"), format="xml")
    assert isomorphic(back, graphs["upper"])


def test_owl_files_are_named_after_the_ontologies(tmp_path: Path) -> None:
    files = write_owl_files(tmp_path / "new")
    assert [file.name for file in files] == ["upper.owl", "furniture.owl", "race.owl"]
    assert files[2].read_text(encoding="utf-8").startswith("<?xml")


def test_missing_rdflib_is_reported_with_the_extra_to_install(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, "rdflib", None)
    with pytest.raises(ImportError, match=r"fluentboard\[service\]"):
        to_rdfxml("upper")


def test_owlready2_sees_the_classes_and_imports(world: Any) -> None:
    race = world.get_ontology(ontology_iri("race") + "#")
    assert issubclass(race.Coffee, race.Kitchenware)
    assert {o.name for o in race.imported_ontologies} == {"upper", "furniture"}


def test_owlready2_sees_every_rule(world: Any) -> None:
    furniture = world.get_ontology(ontology_iri("furniture") + "#")
    assert len(list(furniture.rules())) == 32
    by_name = {rule.name: rule for rule in furniture.rules()}
    assert str(by_name["LowShelfPlaneRule"]) == (
        "HorizontalPlane(?p), hasSize(?p, ?s), greaterThan(?s, 0.01), lessThan(?s, 0.5), "
        "hasPosY(?p, ?h), greaterThan(?h, 0.08), lessThan(?h, 0.18) -> LowShelfPlane(?p)"
    )


def test_owlready2_sees_listing_2_1_with_the_precedence_of_manchester_syntax(world: Any) -> None:
    race = world.get_ontology(ontology_iri("race") + "#")
    (definition,) = race.MoveObjectFromTo.equivalent_to
    conjunction, *alternatives = definition.Classes
    assert str(conjunction) == (
        "race.MoveObjectActivity & race.hasAreaA.exactly(1, upper.Area) & "
        "race.hasPutObject.exactly(1, race.PutObjectActivity) & "
        "race.hasGetObjects.exactly(1, race.GetObjectsActivity)"
    )
    assert [c.name for c in alternatives] == [
        "GetObjectsDriveRobotGraspObjectsActivity",
        "GetObjectsFromDifferentActivity",
        "GetObjectsGraspObjectsActivity",
    ]
    (move,) = race.MoveObjectActivity.equivalent_to
    assert str(move) == (
        "upper.RobotActivity & race.hasTask.exactly(1, race.move_object_Task) & "
        "upper.hasPassiveObject.exactly(1, upper.PassiveObject) & "
        "race.hasAreaB.exactly(1, upper.Area)"
    )


def test_owlready2_sees_the_shelf_of_the_thesis(world: Any) -> None:
    furniture = world.get_ontology(ontology_iri("furniture") + "#")
    (shelf,) = furniture.Shelf.equivalent_to
    boards, _front = shelf.Classes  # the second is not the thesis's: a front of books
    lowest, stacked = boards.Classes
    assert furniture.LowShelfPlane in lowest.Classes
    assert str(stacked) == (
        "furniture.isBelow.some(furniture.MiddleShelfPlane & "
        "furniture.isBelow.some(furniture.HighShelfPlane))"
    )
