"""Class paths in queries become joins over the materialised hierarchy, where that is exact."""

from __future__ import annotations

import pytest

from fluentboard.board.class_closure import use_class_closure

PREFIXES = {
    "rdf": "http://www.w3.org/1999/02/22-rdf-syntax-ns#",
    "rdfs": "http://www.w3.org/2000/01/rdf-schema#",
    "race": "urn:race#",
}
PLUS, STAR = "board#properSubClassOf>", "board#subClassOfOrSame>"


def rewritten(query: str) -> str:
    return use_class_closure(query, PREFIXES, lambda iri: iri == "urn:race#Mug")


@pytest.mark.parametrize(
    "query",
    [
        "SELECT * { ?c rdfs:subClassOf+ ?d }",
        "SELECT * { ?c rdfs:subClassOf + race:Mug }",
        "SELECT * { ?c <http://www.w3.org/2000/01/rdf-schema#subClassOf>+ race:Anything }",
        "PREFIX s: <http://www.w3.org/2000/01/rdf-schema#> SELECT * { ?c s:subClassOf+ ?d }",
    ],
)
def test_plus_becomes_one_join(query: str) -> None:
    assert PLUS in rewritten(query)
    assert "subClassOf+" not in rewritten(query)


@pytest.mark.parametrize(
    "query",
    [
        "SELECT * { ?c rdfs:subClassOf* race:Mug }",
        "SELECT * { race:Mug rdfs:subClassOf* ?c }",
        "SELECT * { ?x rdf:type/rdfs:subClassOf* ?c }",
        "SELECT * { ?x a/rdfs:subClassOf* race:Other }",
    ],
)
def test_star_becomes_one_join_where_an_end_is_known(query: str) -> None:
    assert STAR in rewritten(query)


@pytest.mark.parametrize(
    "query",
    [
        "SELECT * { ?c rdfs:subClassOf* ?d }",
        "SELECT * { ?c rdfs:subClassOf* race:Unheard }",
        "SELECT * { ?c (rdfs:subClassOf*)+ race:Mug }",
        "SELECT * { ?c ^rdfs:subClassOf* race:Mug }",
        "SELECT * { ?c rdfs:subClassOf*/rdfs:label race:Mug }",
        "SELECT * { GRAPH ?g { ?c rdfs:subClassOf+ race:Mug } }",
        "SELECT * FROM <urn:g> { ?c rdfs:subClassOf+ race:Mug }",
        "SELECT * { ?c rdfs:label 'rdfs:subClassOf+' }",
        "SELECT * { ?c rdfs:label ?d } # rdfs:subClassOf+ race:Mug",
        "SELECT * { ?c rdfs:subClassOf ?d }",
        "SELECT * { ?c <urn:rdfs:subClassOf+> ?d }",
    ],
)
def test_what_would_change_answers_is_left_alone(query: str) -> None:
    assert rewritten(query) == query


def test_path_after_a_graph_group_is_rewritten() -> None:
    query = "SELECT * { GRAPH ?g { ?a ?b ?c } ?c rdfs:subClassOf+ race:Mug }"
    assert PLUS in rewritten(query)
