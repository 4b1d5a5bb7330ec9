"""The footprint holds every statement shape that an answer depends on."""

from __future__ import annotations

import pytest

from fluentboard.board.subscriptions.footprint import Footprint, Shape
from fluentboard.board.subscriptions.query import parse
from fluentboard.board.triples import ENDPOINTS
from fluentboard_ontology import FLUENT, RACE, UPPER

TYPE = "<http://www.w3.org/1999/02/22-rdf-syntax-ns#type>"
MUG = f"<{RACE}Mug>"
A, B, C = (f"<{UPPER}{name}>" for name in "abc")
ONE = f"<{FLUENT}one>"


def footprint(pattern: str) -> Footprint:
    return parse(f"SELECT * {{ {pattern} }}").footprint


@pytest.mark.parametrize(
    ("pattern", "shapes"),
    [
        ("?x a race:Mug", {(None, TYPE, MUG)}),
        ("?x upper:a ?y ; upper:b 'text'", {(None, A, None), (None, B, '"text"')}),
        ("?x upper:a 1.0", {(None, A, None)}),
        ("?x upper:a 'mot'@fr", {(None, A, None)}),
        ("fluent:one ?p ?o", {(ONE, None, None)}),
        ("?x ?p fluent:one", {(None, None, ONE)}),
        ("?x upper:a ?y OPTIONAL { ?y upper:b ?z }", {(None, A, None), (None, B, None)}),
        ("?x upper:a ?y MINUS { ?y upper:b ?z }", {(None, A, None), (None, B, None)}),
        ("{ ?x upper:a ?y } UNION { ?x upper:b ?y }", {(None, A, None), (None, B, None)}),
        ("?x upper:a ?y FILTER NOT EXISTS { ?y upper:b ?z }", {(None, A, None), (None, B, None)}),
        (
            "?x upper:a ?y FILTER NOT EXISTS { ?y upper:b ?z FILTER EXISTS { ?z upper:c 'd' } }",
            {(None, A, None), (None, B, None), (None, C, '"d"')},
        ),
        ("?x upper:a ?y BIND(EXISTS { ?x upper:b ?z } AS ?e)", {(None, A, None), (None, B, None)}),
        ("?x upper:a/upper:b fluent:one", {(None, A, None), (None, B, ONE)}),
        ("fluent:one upper:a/upper:b* ?y", {(ONE, A, None), (None, B, None)}),
        ("?x ^upper:a fluent:one", {(ONE, A, None)}),
        ("?x (upper:a|upper:b)+ ?y", {(None, A, None), (None, B, None)}),
        ("?x upper:a ?y . ?y upper:b* ?z", {(None, A, None), (None, B, None)}),
        ("?x upper:a [ upper:b ?y ]", {(None, A, None), (None, B, None)}),
        ("GRAPH ?g { ?x upper:a ?y }", {(None, A, None)}),
        ("{ SELECT ?x { ?x upper:a ?y } LIMIT 1 }", {(None, A, None)}),
        ("VALUES ?x { fluent:one }", set[Shape]()),
    ],
)
def test_pattern_leads_to_its_shapes(pattern: str, shapes: set[Shape]) -> None:
    assert footprint(pattern).shapes == shapes


def test_constant_end_of_a_path_of_length_zero_must_occur_in_the_graph() -> None:
    assert footprint("fluent:one upper:a* ?y").shapes == {
        (None, A, None),
        (ONE, None, None),
        (None, None, ONE),
    }


@pytest.mark.parametrize(
    "pattern",
    [
        "?s ?p ?o",
        "?x upper:a* ?y",
        "?x upper:a? ?y",
        "?x (upper:a|upper:b*) ?y",
        "?x upper:a*/upper:b* ?y",
        "OPTIONAL { ?x upper:a ?y } ?x upper:b* ?z",
        "?x !upper:a ?y",
        "GRAPH ?g {}",
        "?x upper:a ?y LATERAL { ?y upper:b ?z }",
        r"?x upper:a\-b ?y",
    ],
)
def test_unbounded_patterns_depend_on_everything_and_say_why(pattern: str) -> None:
    found = footprint(pattern)
    assert found.is_everything
    assert found.why_everything


def test_functions_of_the_board_depend_on_end_points() -> None:
    ends = {(None, f"<{iri}>", None) for iri in ENDPOINTS}
    cast, now = "FILTER(xsd:integer(?y) > 3)", "FILTER(?y < fb:now())"
    assert footprint(f"?x upper:a ?y {cast} {now}").shapes == {(None, A, None)}
    holding = "FILTER NOT EXISTS { ?x upper:b ?z FILTER(fb:holdsAt(?x, 3)) }"
    assert footprint(f"?x upper:a ?y {holding}").shapes == {
        (None, A, None),
        (None, B, None),
        *ends,
    }


@pytest.mark.parametrize(
    "query",
    [
        "SELECT ?x (EXISTS { ?x upper:b ?z } AS ?e) { ?x upper:a ?y }",
        "SELECT ?x { ?x upper:a ?y } ORDER BY (EXISTS { ?x upper:b ?z })",
        "SELECT ?x { ?x upper:a ?y } GROUP BY ?x HAVING (EXISTS { ?x upper:b ?z })",
        "ASK { ?x upper:a ?y FILTER(EXISTS { ?x upper:b ?z } || ?y > 3) }",
        "CONSTRUCT { ?s ?p ?x } WHERE { ?x upper:a ?y . ?y upper:b ?p }",
        "CONSTRUCT WHERE { ?x upper:a ?y ; upper:b ?z }",
        "SELECT ?x FROM <urn:g> { ?x upper:a ?y ; upper:b ?z }",
    ],
)
def test_every_clause_counts_but_a_template_does_not(query: str) -> None:
    assert parse(query).footprint.shapes == {(None, A, None), (None, B, None)}
