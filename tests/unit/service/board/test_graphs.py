"""Updates reach what is said outside fluents, and nothing else."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import pyoxigraph as ox
import pytest

from fluentboard.board.blackboard import Blackboard
from fluentboard.board.commands import AssertFluent, Command
from fluentboard.board.statement_rules import ClassInUse, ProtectedStatement
from fluentboard.board.update_operations import DeleteMatching, InsertStatements
from fluentboard.errors import (
    FluentsAreReadOnly,
    InvalidQuery,
    UnknownClass,
    UnknownResource,
)
from fluentboard.model.fluent import Fluent

CLASSES = """
    @prefix ex: <http://ex/> . @prefix owl: <http://www.w3.org/2002/07/owl#> .
    @prefix rdfs: <http://www.w3.org/2000/01/rdf-schema#> .
    ex:Thing a owl:Class . ex:Cup a owl:Class ; rdfs:subClassOf ex:Thing .
"""
NAMESPACE = "PREFIX ex: <http://ex/> "


@pytest.fixture
def board(tmp_path: Path) -> Iterator[Blackboard]:
    file = tmp_path / "classes.ttl"
    file.write_text(CLASSES)
    with Blackboard.open(None, builtin_ontologies=False, ontologies=[file]) as opened:
        yield opened


def update(board: Blackboard, text: str) -> int:
    return board.graphs.update(NAMESPACE + text, "tests").result().number


def rows(board: Blackboard, pattern: str) -> set[tuple[str, ...]]:
    results = board.query(f"{NAMESPACE} SELECT * {{ {pattern} }}")
    assert isinstance(results, ox.QuerySolutions)
    return {tuple(str(value) for value in row) for row in results}


def assert_fluents(board: Blackboard, *fluents: Fluent) -> None:
    commands: Sequence[Command] = [AssertFluent(fluent) for fluent in fluents]
    board.execute(commands, "tests")


def test_what_is_said_can_be_queried_and_unsaid(board: Blackboard) -> None:
    update(board, "INSERT DATA { ex:a ex:p 1, 2 . GRAPH ex:g { ex:a ex:p 3 } }")
    assert len(rows(board, "ex:a ex:p ?v")) == 2
    update(board, "DELETE DATA { ex:a ex:p 1 } ; DELETE WHERE { GRAPH ex:g { ?s ?p ?o } }")
    assert len(rows(board, "ex:a ex:p ?v")) == 1
    assert not rows(board, "GRAPH ex:g { ?s ?p ?o }")


def test_update_that_changes_nothing_makes_no_commit(board: Blackboard) -> None:
    before = update(board, "INSERT DATA { ex:a ex:p 1 }")
    assert update(board, "INSERT DATA { ex:a ex:p 1 } ; DELETE DATA { ex:a ex:p 2 }") == before


@pytest.mark.parametrize(
    "text",
    [
        "INSERT DATA { fluent:cup1 ex:p 1 }",
        "INSERT DATA { fluent:cup2 a ex:Cup }",
        "INSERT DATA { GRAPH ex:g { fluent:cup1 ex:p 1 } }",
        "DELETE DATA { fluent:cup1 a ex:Cup }",
        "DELETE WHERE { ?s a ex:Cup }",
        "DELETE WHERE { ?s ?p ?o }",
        "INSERT { ?s ex:p 1 } WHERE { ?s a ex:Cup }",
        "INSERT DATA { ex:a ex:p 1 } ; DELETE { ?s ?p ?o } WHERE { ?s a ex:Cup ; ?p ?o }",
    ],
)
def test_update_that_would_touch_fluents_is_refused_whole(board: Blackboard, text: str) -> None:
    assert_fluents(board, Fluent("cup1", "Cup"))
    everything = rows(board, "?s ?p ?o")
    with pytest.raises(FluentsAreReadOnly, match=r"/fluents"):
        update(board, text)
    assert rows(board, "?s ?p ?o") == everything


def test_fluents_may_be_spoken_of_as_objects(board: Blackboard) -> None:
    assert_fluents(board, Fluent("cup1", "Cup"))
    update(board, "INSERT { ex:shelf ex:holds ?c } WHERE { ?c a ex:Cup }")
    assert len(rows(board, "ex:shelf ex:holds ?c")) == 1


def test_clearing_everything_leaves_fluents_and_ontologies_alone(board: Blackboard) -> None:
    assert_fluents(board, Fluent("cup1", "Cup"))
    before = rows(board, "?s ?p ?o")
    update(board, "INSERT DATA { ex:a ex:p 1 . GRAPH ex:g { ex:a ex:p 3 } }")
    update(board, "CLEAR ALL")
    assert rows(board, "?s ?p ?o") == before
    assert board.graphs.named_graphs() == [ox.NamedNode("http://ex/g")]


def test_sweeping_an_empty_board_leaves_ontologies_alone(board: Blackboard) -> None:
    before = rows(board, "?s ?p ?o")
    update(board, "INSERT DATA { ex:a ex:p 1 }")
    update(board, "DELETE WHERE { ?s ?p ?o }")
    assert rows(board, "?s ?p ?o") == before


@pytest.mark.parametrize(
    "text",
    [
        "DELETE DATA { ex:Cup rdfs:subClassOf ex:Thing }",
        "DELETE WHERE { ex:Cup ?p ?o }",
        "INSERT DATA { ex:Cup fb:properSubClassOf ex:Other }",
        "INSERT DATA { GRAPH fb:meta { ex:a ex:b 1 } }",
        "INSERT DATA { GRAPH fb:said { ex:a ex:b 1 } }",
        "CREATE GRAPH fb:meta",
        "DROP GRAPH fb:said",
    ],
)
def test_ontologies_and_notes_of_the_board_are_protected(board: Blackboard, text: str) -> None:
    with pytest.raises(ProtectedStatement):
        update(board, text)


def test_notes_of_the_board_are_not_seen(board: Blackboard) -> None:
    update(board, "INSERT DATA { ex:a ex:p 1 . GRAPH ex:g { ex:a ex:p 3 } }")
    assert rows(board, "GRAPH ?g { ?s ?p ?o }") == {
        (*_in_order(board, "GRAPH ?g { ?s ?p ?o }"),),
    }
    assert len(list(board.graphs.statements(ox.NamedNode("http://ex/a")))) == 2


def _in_order(board: Blackboard, pattern: str) -> tuple[str, ...]:
    (row,) = rows(board, pattern)
    assert {"<http://ex/g>", "<http://ex/a>", "<http://ex/p>"} < set(row)
    return row


def test_what_an_ontology_says_too_stays_when_it_is_unsaid(board: Blackboard) -> None:
    update(board, "INSERT DATA { ex:Cup rdfs:subClassOf ex:Thing }")
    update(board, "DELETE DATA { ex:Cup rdfs:subClassOf ex:Thing }")
    assert rows(board, "ex:Cup rdfs:subClassOf ?c") == {("<http://ex/Thing>",)}


def test_what_was_said_stays_when_the_ontology_no_longer_says_it(
    board: Blackboard, tmp_path: Path
) -> None:
    update(board, "INSERT DATA { ex:Cup rdfs:subClassOf ex:Thing }")
    file = tmp_path / "classes.ttl"
    file.write_text(CLASSES.replace("; rdfs:subClassOf ex:Thing", ""))
    board.load_ontologies([file])
    assert rows(board, "ex:Cup rdfs:subClassOf ?c") == {("<http://ex/Thing>",)}
    assert rows(board, "ex:Cup rdfs:subClassOf+ ?c") == {("<http://ex/Thing>",)}


def test_class_paths_follow_what_is_said(board: Blackboard) -> None:
    update(board, "INSERT DATA { ex:Mug a owl:Class ; rdfs:subClassOf ex:Cup }")
    assert rows(board, "?c rdfs:subClassOf+ ex:Thing") == {
        ("<http://ex/Cup>",),
        ("<http://ex/Mug>",),
    }
    update(board, "DELETE DATA { ex:Mug rdfs:subClassOf ex:Cup }")
    assert rows(board, "?c rdfs:subClassOf+ ex:Thing") == {("<http://ex/Cup>",)}


def test_fluents_can_have_a_class_that_was_said(board: Blackboard) -> None:
    with pytest.raises(UnknownClass):
        assert_fluents(board, Fluent("mug1", "Mug"))
    update(board, "INSERT DATA { ex:Mug a owl:Class ; rdfs:subClassOf ex:Cup }")
    assert_fluents(board, Fluent("mug1", "Mug"), Fluent("mug2", "http://ex/Mug"))
    assert board.fluent("mug1").class_name == "http://ex/Mug"
    assert len(rows(board, "?f a/rdfs:subClassOf* ex:Thing")) == 2


def test_class_in_use_keeps_its_declaration(board: Blackboard) -> None:
    update(board, "INSERT DATA { ex:Mug a owl:Class ; rdfs:subClassOf ex:Cup }")
    assert_fluents(board, Fluent("mug1", "Mug"))
    with pytest.raises(ClassInUse, match="mug1"):
        update(board, "DELETE WHERE { ex:Mug ?p ?o }")
    update(board, "DELETE DATA { ex:Mug rdfs:subClassOf ex:Cup }")
    assert not rows(board, "?f a/rdfs:subClassOf* ex:Cup")


def test_short_names_are_the_ontologies(board: Blackboard) -> None:
    update(board, "INSERT DATA { <urn:other#Cup> a owl:Class }")
    assert board.vocabulary.class_iri("Cup") == "http://ex/Cup"
    assert board.vocabulary.class_name("urn:other#Cup") == "urn:other#Cup"


def test_later_operations_see_what_earlier_ones_did(board: Blackboard) -> None:
    update(
        board,
        "INSERT DATA { ex:a ex:p 1, 2 } ; DELETE { ?s ex:p 1 } WHERE { ?s ex:p 2 } ;"
        " INSERT { GRAPH ex:g { ?s ex:q ?v } } WHERE { ?s ex:p ?v } ; "
        " INSERT { ex:count ex:is ?n } WHERE { SELECT (COUNT(*) AS ?n) { GRAPH ?g { ?s ?p ?o } } }",
    )
    assert rows(board, "GRAPH ex:g { ?s ex:q ?v } ex:count ex:is ?n") == {
        (*sorted_terms(board, "GRAPH ex:g { ?s ex:q ?v } ex:count ex:is ?n"),)
    }


def sorted_terms(board: Blackboard, pattern: str) -> tuple[str, ...]:
    (row,) = rows(board, pattern)
    assert sum('"1"' in term for term in row) == 1
    assert sum('"2"' in term for term in row) == 1
    return row


def test_request_that_fails_half_way_changes_nothing(board: Blackboard) -> None:
    with pytest.raises(UnknownResource, match="no graph"):
        update(board, "INSERT DATA { ex:a ex:p 1 } ; CLEAR GRAPH ex:nowhere")
    assert not rows(board, "ex:a ?p ?o")


def test_blank_nodes_are_new_in_each_solution(board: Blackboard) -> None:
    update(board, "INSERT DATA { ex:a ex:p 1, 2 }")
    update(board, "INSERT { GRAPH ex:g { [] ex:value ?v } } WHERE { ex:a ex:p ?v }")
    assert len(rows(board, "GRAPH ex:g { ?b ex:value ?v }")) == 2


def test_blank_nodes_that_are_there_can_be_unsaid(board: Blackboard) -> None:
    update(board, "INSERT DATA { GRAPH ex:g { _:x ex:p _:y . _:y ex:p ex:a . _:x ex:q _:x } }")
    update(board, "DELETE WHERE { GRAPH ex:g { ?x ex:p ?y . ?y ex:p ex:a } }")
    assert len(rows(board, "GRAPH ex:g { ?s ?p ?o }")) == 1


def test_empty_graphs_are_there_until_dropped(board: Blackboard) -> None:
    update(board, "CREATE GRAPH ex:g")
    assert rows(board, "GRAPH ?g {}") == {("<http://ex/g>",)}
    with pytest.raises(InvalidQuery, match="already"):
        update(board, "CREATE GRAPH ex:g")
    update(board, "CREATE SILENT GRAPH ex:g ; DROP GRAPH ex:g")
    assert not rows(board, "GRAPH ?g {}")
    with pytest.raises(UnknownResource):
        update(board, "DROP GRAPH ex:g")
    update(board, "DROP SILENT GRAPH ex:g")


@pytest.mark.parametrize(("word", "left"), [("ADD", {"a", "b"}), ("COPY", {"a"}), ("MOVE", {"a"})])
def test_graphs_are_brought_into_others(board: Blackboard, word: str, left: set[str]) -> None:
    update(board, "INSERT DATA { GRAPH ex:g { ex:a ex:p 1 } GRAPH ex:h { ex:b ex:p 1 } }")
    update(board, f"{word} ex:g TO ex:h")
    found = {row[0] for row in rows(board, "GRAPH ex:h { ?s ex:p 1 }")}
    assert found == {f"<http://ex/{name}>" for name in left}
    assert board.graphs.has_graph(ox.NamedNode("http://ex/g")) is (word != "MOVE")


def test_moving_the_default_graph_moves_what_was_said(board: Blackboard) -> None:
    assert_fluents(board, Fluent("cup1", "Cup"))
    before = rows(board, "?s ?p ?o")
    update(board, "INSERT DATA { ex:a ex:p 1 } ; MOVE DEFAULT TO ex:g")
    assert rows(board, "?s ?p ?o") == before
    assert len(rows(board, "GRAPH ex:g { ?s ?p ?o }")) == 1


def test_with_and_using_choose_the_dataset(board: Blackboard) -> None:
    update(board, "INSERT DATA { GRAPH ex:g { ex:a ex:p 1 } GRAPH ex:h { ex:b ex:p 2 } }")
    update(board, "WITH ex:g DELETE { ?s ex:p ?v } INSERT { ?s ex:q ?v } WHERE { ?s ex:p ?v }")
    assert len(rows(board, "GRAPH ex:g { ex:a ex:q ?v }")) == 1
    update(board, "INSERT { ?s ex:seen ?v } USING ex:h WHERE { ?s ?p ?v }")
    assert len(rows(board, "ex:b ex:seen ?v")) == 1
    request = "PREFIX ex: <http://ex/> INSERT { ?s ex:too ?v } WHERE { ?s ?p ?v }"
    board.graphs.update(request, "tests", using_graphs=["http://ex/g"]).result()
    assert len(rows(board, "?s ex:too ?v")) == 1
    with pytest.raises(InvalidQuery, match="WITH"):
        board.graphs.update(
            "WITH <urn:g> DELETE { ?s ?p ?o } WHERE { ?s ?p ?o }", "tests", using_graphs=["urn:g"]
        )


def test_matching_statements_are_unsaid(board: Blackboard) -> None:
    update(board, "INSERT DATA { ex:a ex:p 1 ; ex:q 1 . GRAPH ex:g { ex:a ex:p 1 } }")
    board.graphs.change([DeleteMatching(None, ox.NamedNode("http://ex/p"), None)], "tests").result()
    assert {row[0] for row in rows(board, "ex:a ?p 1")} == {"<http://ex/q>"}
    assert not rows(board, "GRAPH ex:g { ?s ?p ?o }")


def test_what_was_read_can_be_sent_back(board: Blackboard) -> None:
    assert_fluents(board, Fluent("cup1", "Cup"))
    everything = tuple(board.graphs.statements())
    number = board.graphs.change([InsertStatements(everything, tolerates=True)], "tests").result()
    assert number.number == board.commit
    assert not number.statements


def test_board_that_is_rebuilt_says_the_same(tmp_path: Path) -> None:
    data = tmp_path / "data"
    with Blackboard.open(data) as board:
        update(board, "INSERT DATA { ex:a ex:p _:b . GRAPH ex:g { _:b ex:q 1.50 } }")
        update(board, "INSERT DATA { ex:Pot a owl:Class ; rdfs:subClassOf race:Mug }")
        update(board, "CREATE GRAPH ex:empty ; CREATE GRAPH ex:gone ; COPY ex:g TO ex:h")
        update(board, "DROP GRAPH ex:gone ; DELETE WHERE { GRAPH ex:h { ?s ex:q ?o } }")
        assert_fluents(board, Fluent("pot1", "http://ex/Pot"))
        graphs = set(board.graphs.named_graphs())
        said = {str(quad) for quad in board.graphs.statements()}
    for file in sorted((data / "store").iterdir()):
        file.unlink()
    with Blackboard.open(data) as board:
        assert set(board.graphs.named_graphs()) == graphs
        assert {str(quad) for quad in board.graphs.statements()} == said
        assert board.vocabulary.class_name("Pot") == "http://ex/Pot"
        update(board, "DELETE WHERE { ex:a ?p ?o }")
        assert not rows(board, "ex:a ?p ?o")
