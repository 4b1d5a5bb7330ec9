"""What a query text asks for is worked out once, and never outlives the class hierarchy."""

from __future__ import annotations

import gc
import weakref

import pyoxigraph as ox
import pytest

from fluentboard.board.blackboard import Blackboard
from fluentboard.board.prepared_queries import PreparedQueries, reading
from fluentboard.board.vocabulary import SUB_CLASS_OF, Vocabulary
from fluentboard_ontology import PREFIXES

STAR = "SELECT ?c { ?c rdfs:subClassOf* <urn:Cup> }"


def hierarchy(*edges: tuple[str, str]) -> Vocabulary:
    below = ox.NamedNode(SUB_CLASS_OF)
    return Vocabulary(ox.Triple(ox.NamedNode(a), below, ox.NamedNode(b)) for a, b in edges)


def test_text_that_comes_again_is_not_worked_out_again() -> None:
    text = "SELECT ?p ?o { race:mug1 ?p ?o }"
    assert reading(text) is reading(text[:3] + text[3:])


def test_long_text_is_not_kept() -> None:
    text = "SELECT ?p ?o { ?s ?p ?o } #" + " " * 10_000
    assert reading(text) is not reading(text)


def test_only_the_prefixes_that_occur_are_declared() -> None:
    assert set(reading("SELECT * { ?m a race:Mug ; upper:hasPose ?p }").prefixes) == {
        "race",
        "upper",
    }


def test_escaped_prefix_is_declared() -> None:
    assert set(reading(r"SELECT * { ?m a r\u0061ce:Mug }").prefixes) == set(PREFIXES)


@pytest.mark.parametrize(
    "query",
    [
        "SELECT * { ?a upper:x ?x FILTER(?x<?y&&race:z>3) }",
        "SELECT * { ?a a 'race:Mug' }",
        "SELECT * { ?a a race:Mug } # <urn:x>",
    ],
)
def test_prefix_is_never_missed(query: str) -> None:
    assert "race" in reading(query).prefixes


def test_path_is_rewritten_for_the_hierarchy_of_the_moment() -> None:
    prepared = PreparedQueries()
    without, with_cup = hierarchy(), hierarchy(("urn:Mug", "urn:Cup"))
    assert prepared.rewritten(STAR, without) == STAR
    assert prepared.rewritten(STAR, with_cup) != STAR
    assert prepared.rewritten(STAR, without) == STAR


def test_what_is_kept_goes_with_its_vocabulary() -> None:
    prepared = PreparedQueries()
    vocabulary = hierarchy(("urn:Mug", "urn:Cup"))
    prepared.rewritten(STAR, vocabulary)
    gone = weakref.ref(vocabulary)
    del vocabulary
    gc.collect()
    assert gone() is None


def test_text_unused_for_longest_makes_room() -> None:
    prepared, vocabulary = PreparedQueries(kept_max=2), hierarchy(("urn:Mug", "urn:Cup"))
    texts = [f"{STAR} # {n}" for n in range(3)]
    first = prepared.rewritten(texts[0], vocabulary)
    second = prepared.rewritten(texts[1], vocabulary)
    assert prepared.rewritten(texts[0], vocabulary) is first
    prepared.rewritten(texts[2], vocabulary)
    assert prepared.rewritten(texts[0], vocabulary) is first
    assert prepared.rewritten(texts[1], vocabulary) is not second


def test_answer_follows_the_ontology_while_the_text_stays() -> None:
    board = Blackboard.open(None)
    query = "SELECT ?c { ?c rdfs:subClassOf* <urn:x:Cup> }"
    statement = "INSERT DATA { <urn:x:%s> a owl:Class ; rdfs:subClassOf <urn:x:Cup> }"

    def answer() -> set[str]:
        results = board.query(query)
        assert isinstance(results, ox.QuerySolutions)
        return {str(solution["c"]) for solution in results}

    before = answer()
    board.graphs.update(statement % "Mug", author="test").result()
    once = answer()
    board.graphs.update(statement % "Beaker", author="test").result()
    assert before == set()  # the engine knows no class that nothing is said of
    assert once == {"<urn:x:Cup>", "<urn:x:Mug>"}
    assert answer() == {"<urn:x:Cup>", "<urn:x:Mug>", "<urn:x:Beaker>"}
    board.close()
