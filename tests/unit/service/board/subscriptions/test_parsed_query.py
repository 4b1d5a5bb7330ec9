"""What a standing query may be, and what is known of it."""

from __future__ import annotations

import pytest

from fluentboard.board.subscriptions.query import parse
from fluentboard.errors import InvalidQuery


@pytest.mark.parametrize(
    ("query", "complaint"),
    [
        ("DESCRIBE fluent:mug1", "DESCRIBE"),
        ("INSERT DATA { fluent:a upper:b 1 }", "without a query form"),
        ("SELECT ?x { ?x a }", "does not parse"),
        ("SELECT ?x { ?x unknown:p ?y }", "does not parse"),
        ("SELECT ?x { SERVICE <http://127.0.0.1:9/> { ?x a ?y } }", "SERVICE"),
        ("SELECT (RAND() AS ?r) { ?x a race:Mug }", "RAND"),
        ("SELECT (uuid() AS ?r) { ?x a race:Mug }", "UUID"),
        ("SELECT (StrUUID() AS ?r) { ?x a race:Mug }", "STRUUID"),
    ],
)
def test_query_that_cannot_stand_is_refused_with_the_reason(query: str, complaint: str) -> None:
    with pytest.raises(InvalidQuery, match=complaint):
        parse(query)


@pytest.mark.parametrize(
    ("query", "form", "variables"),
    [
        ("SELECT ?y ?x { ?x upper:a ?y }", "select", ("y", "x")),
        ("SELECT (1 AS ?one) ?missing { ?x upper:a ?y }", "select", ("one", "missing")),
        ("ASK { ?x upper:a ?y }", "ask", ()),
        ("CONSTRUCT WHERE { ?x a ?y }", "construct", ("subject", "predicate", "object")),
    ],
)
def test_form_and_columns_are_known(query: str, form: str, variables: tuple[str, ...]) -> None:
    parsed = parse(query)
    assert (parsed.form, parsed.variables) == (form, variables)


def test_well_known_prefixes_need_no_declaration() -> None:
    parse("ASK { ?a rdf:x ?b ; rdfs:x ?b ; owl:x ?b ; xsd:x ?b ; upper:x ?b ; race:x ?b }")
    parse("ASK { ?a furniture:x ?b ; fb:x ?b . fluent:x ?c ?d }")


@pytest.mark.parametrize(
    ("query", "makes"),
    [
        ("SELECT (BNODE() AS ?b) {}", True),
        ("SELECT ?bnode { [] a ?bnode }", False),
        ("CONSTRUCT { ?x upper:a [] } WHERE { ?x a ?y }", True),
        ("CONSTRUCT { ?x upper:a ?y } WHERE { ?x a ?y }", False),
        ("CONSTRUCT WHERE { ?x a [] }", True),
    ],
)
def test_query_that_makes_blank_nodes_is_noticed(query: str, makes: bool) -> None:
    assert parse(query).makes_blank_nodes is makes


def test_query_that_looks_into_named_graphs_is_noticed() -> None:
    assert parse("ASK { GRAPH ?g { FILTER NOT EXISTS { ?x upper:a ?y } } }").reads_graphs
    assert parse("ASK FROM <urn:g> { ?x upper:a ?y }").reads_graphs
    assert not parse("ASK { ?graph upper:from <urn:from> }").reads_graphs


def test_functions_of_the_board_are_known_and_others_refused() -> None:
    assert parse("ASK { ?x a race:Mug FILTER(fb:holdsAt(?x, 3)) }").calls
    assert not parse("ASK { ?x upper:a ?y FILTER(xsd:integer(?y) > 3) }").calls
    with pytest.raises(InvalidQuery, match="cannot be evaluated"):
        parse("ASK { ?x a race:Mug FILTER(<urn:f>(?x)) }")


def test_now_is_allowed_but_noticed() -> None:
    assert not parse("SELECT (fb:now() AS ?n) { ?x a race:Mug }").is_timeless
    assert not parse("SELECT (NOW() AS ?n) { ?x a race:Mug }").is_timeless
    assert parse("SELECT ?now { ?now a race:Mug }").is_timeless
