"""SHACL shapes refuse batches whole, and see the state that a batch would lead to."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from fluentboard.board.blackboard import Blackboard
from fluentboard.board.commands import AssertFluent, CorrectFluent, EndFluent, RefineFluent
from fluentboard.errors import InvalidConfiguration, ShapeViolation
from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.interval import Interval

SHAPES = """
@prefix sh: <http://www.w3.org/ns/shacl#> . @prefix xsd: <http://www.w3.org/2001/XMLSchema#> .
@prefix race: <https://w3id.org/fluentboard/race#> .
@prefix upper: <https://w3id.org/fluentboard/upper#> .
[] a sh:NodeShape ; sh:targetClass race:Dish ;
   sh:property [ sh:path upper:hasPose ; sh:minCount 1 ; sh:class race:Pose ;
                 sh:message "a dish has a pose" ] ;
   sh:property [ sh:path upper:hasX ; sh:maxInclusive 2.0 ; sh:severity sh:Warning ] .
"""
CLASSES = """
@prefix owl: <http://www.w3.org/2002/07/owl#> . @prefix race: <https://w3id.org/fluentboard/race#> .
@prefix rdfs: <http://www.w3.org/2000/01/rdf-schema#> .
race:Dish a owl:Class . race:Mug a owl:Class ; rdfs:subClassOf race:Dish . race:Pose a owl:Class .
"""
POSE = Fluent("pose1", "Pose")
MUG = Fluent("mug1", "Mug", properties=(Property("hasPose", "Pose", "pose1"),))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("shapes")
    (folder / "shapes.ttl").write_text(SHAPES)
    (folder / "classes.ttl").write_text(CLASSES)
    return folder


@pytest.fixture
def board(folder: Path) -> Iterator[Blackboard]:
    with Blackboard.open(
        None,
        ontologies=[folder / "classes.ttl"],
        builtin_ontologies=False,
        shapes=[folder / "shapes.ttl"],
    ) as board:
        yield board


def test_a_batch_that_meets_the_shapes_is_stored(board: Blackboard) -> None:
    board.execute([AssertFluent(MUG), AssertFluent(POSE)], "test")
    board.execute([EndFluent("mug1", Interval(5.0, 6.0))], "test")
    assert board.fluent("mug1").finish == Interval(5.0, 6.0)


def test_a_batch_that_violates_one_is_refused_whole_with_the_report(board: Blackboard) -> None:
    before = board.commit
    with pytest.raises(ShapeViolation, match=r"'mug2' violates a shape .* a dish has a pose") as no:
        board.execute([AssertFluent(POSE), AssertFluent(Fluent("mug2", "Mug"))], "test")
    (violation,) = no.value.detail["violations"]
    assert violation["constraint"] == "MinCountConstraintComponent"
    assert violation["path"].endswith("hasPose")
    assert board.commit == before
    assert "pose1" not in board


def test_what_is_on_the_board_counts(board: Blackboard) -> None:
    board.execute([AssertFluent(POSE)], "test")
    board.execute([AssertFluent(MUG)], "test")
    with pytest.raises(ShapeViolation):
        board.execute([CorrectFluent(Fluent("mug1", "Mug"), "lost its pose")], "admin")
    assert board.fluent("mug1").properties == MUG.properties


def test_a_reference_to_a_fluent_of_a_wrong_class_is_refused(board: Blackboard) -> None:
    board.execute([AssertFluent(Fluent("pose1", "Pose"))], "test")
    wrong = Fluent("mug3", "Mug", properties=(Property("hasPose", "Pose", "nowhere"),))
    with pytest.raises(ShapeViolation):
        board.execute([AssertFluent(wrong)], "test")


def test_warnings_let_a_write_pass(board: Blackboard) -> None:
    board.execute([AssertFluent(MUG), AssertFluent(POSE)], "test")
    far = (Property("hasX", "xsd:float", 3.0),)
    assert board.execute([RefineFluent("mug1", None, None, far)], "test").events


def test_what_no_shape_aims_at_is_not_looked_at(board: Blackboard) -> None:
    assert board.execute([AssertFluent(Fluent("pose2", "Pose"))], "test").events


@pytest.mark.parametrize("text", ["no turtle", "<urn:a> <urn:b> <urn:c> ."])
def test_a_file_without_shapes_is_refused_at_the_start(tmp_path: Path, text: str) -> None:
    (tmp_path / "shapes.ttl").write_text(text)
    with pytest.raises(InvalidConfiguration, match="shapes"):
        Blackboard.open(None, shapes=[tmp_path / "shapes.ttl"])


def test_a_board_that_does_not_start_lets_go_of_its_folder(tmp_path: Path) -> None:
    (tmp_path / "shapes.ttl").write_text("no turtle")
    with pytest.raises(InvalidConfiguration) as refused:
        Blackboard.open(tmp_path / "data", shapes=[tmp_path / "shapes.ttl"])

    with Blackboard.open(tmp_path / "data", builtin_ontologies=False) as board:
        assert len(board) == 0
    assert "shapes" in refused.value.message
