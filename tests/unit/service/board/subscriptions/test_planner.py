"""Each query gets the cheapest tier that is sound for it, and a reason."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from fluentboard.board.subscriptions.planner import explanation, plan
from fluentboard.board.subscriptions.query import parse
from fluentboard.board.subscriptions.schema import Schema
from fluentboard.board.subscriptions.standing import Plan

PlanOf = Callable[[str], Plan]


@pytest.mark.parametrize(
    "query",
    [
        "SELECT ?x { ?x a race:Mug }",
        "SELECT DISTINCT ?t { ?x a race:Mug ; upper:onTop ?t ; upper:size 3 }",
        "SELECT ?t { fluent:mug1 upper:onTop ?t }",
        "SELECT ?x { ?x rdf:type/rdfs:subClassOf* race:Kitchenware }",
        "SELECT ?x ?c { ?x a ?c . ?c rdfs:subClassOf+ race:Kitchenware . ?x upper:onTop ?t }",
        "SELECT ?x { ?x a race:Mug ; upper:label ?l } ORDER BY ?l",
        "ASK { ?x a race:Mug ; upper:onTop fluent:table1 }",
        "CONSTRUCT { ?t upper:carries ?x } WHERE { ?x upper:onTop ?t }",
        "CONSTRUCT WHERE { ?x a race:Mug }",
        "SELECT ?l { [] a race:Mug ; upper:label ?l }",
    ],
)
def test_star_is_matched_without_sparql(plan_of: PlanOf, query: str) -> None:
    assert plan_of(query).tier == 1


@pytest.mark.parametrize(
    "query",
    [
        "SELECT ?x { ?x upper:size ?s FILTER(?s > 3) }",
        "SELECT ?x { ?x a race:Mug OPTIONAL { ?x upper:onTop ?t FILTER(?t != ?x) } }",
        "SELECT ?x { ?x a race:Mug FILTER NOT EXISTS { ?x upper:onTop ?t } }",
        "SELECT ?x { ?x a race:Mug MINUS { ?x upper:onTop ?t } }",
        "SELECT ?x { { ?x a race:Mug } UNION { ?x upper:onTop ?t } }",
        "SELECT ?x { ?x a ?c { ?c rdfs:subClassOf+ race:Kitchenware } UNION "
        "{ ?c rdfs:subClassOf+ upper:Area } }",
        "SELECT ?x ?d { ?x a ?c . ?c rdfs:subClassOf+ ?d }",
        "SELECT ?x (STR(?t) AS ?s) { ?x upper:onTop ?t BIND(1 AS ?one) }",
        "SELECT ?x { VALUES ?x { fluent:a } ?x upper:onTop ?t }",
        "SELECT ?p { ?x ?p fluent:table1 }",
        "SELECT (COUNT(*) AS ?n) { fluent:mug1 ?p ?o }",
        "SELECT ?p { fluent:mug1 ?p ?o } ORDER BY ?p LIMIT 1",
        'SELECT ?x { ?x upper:label "tasse"@fr }',
        "SELECT ?x { ?x a race:Mug FILTER(fb:certainlyHoldsAt(?x, 30)) }",
        "SELECT ?x { ?x upper:since ?t FILTER(fb:holdsAt(?x, ?t)) }",
        "SELECT ?x (fb:durationMin(?x) AS ?d) { ?x a race:Mug FILTER(fb:possiblyBefore(?x, 3)) }",
    ],
)
def test_query_about_single_fluents_is_tried_on_the_changed_one(
    plan_of: PlanOf, query: str
) -> None:
    assert plan_of(query).tier == 2


@pytest.mark.parametrize(
    "query",
    [
        "SELECT ?x { ?x upper:onTop ?t . ?t upper:label ?l }",
        "SELECT DISTINCT ?l { ?x upper:near ?y . ?y upper:label ?l FILTER(?l > 'a') }",
        "ASK { ?x upper:near ?y . ?y upper:near ?x }",
        "SELECT ?x { ?x upper:near [ upper:label 'a' ] }",
        "SELECT ?x { ?x upper:hasPose/upper:hasZ ?z }",
        "SELECT ?x { ?x a ?c ; upper:near ?y . ?y a race:Mug . ?c rdfs:subClassOf* upper:Area }",
    ],
)
def test_join_is_evaluated_for_the_changed_statements(plan_of: PlanOf, query: str) -> None:
    assert plan_of(query).tier == 3


@pytest.mark.parametrize(
    ("query", "reason"),
    [
        ("SELECT ?x { ?x a race:Mug } LIMIT 1", "LIMIT"),
        ("SELECT ?x { ?x a race:Mug } OFFSET 1", "OFFSET"),
        ("SELECT (COUNT(*) AS ?n) { ?x a race:Mug }", "aggregate"),
        ("SELECT ?t { ?x upper:onTop ?t } GROUP BY ?t", "GROUP BY"),
        ("SELECT REDUCED ?t { ?x upper:onTop ?t }", "REDUCED"),
        ("SELECT ?x FROM <urn:g> { ?x a race:Mug }", "FROM"),
        ("SELECT ?x { GRAPH ?g { ?x a race:Mug } }", "conjunction"),
        ("SELECT ?x { { SELECT ?x { ?x a race:Mug } LIMIT 1 } }", "conjunction"),
        ("SELECT ?x { OPTIONAL { ?x a race:Mug } }", "conjunction"),
        ("SELECT ?x { ?x a race:Mug OPTIONAL { ?x upper:near ?y . ?y a ?c } }", "conjunction"),
        ("SELECT ?x { ?x a race:Mug FILTER NOT EXISTS { ?y upper:near ?x } }", "conjunction"),
        ("SELECT ?x { ?x a race:Mug MINUS { ?y upper:near ?x } }", "conjunction"),
        ("SELECT ?x { { ?x a race:Mug } UNION { BIND(1 AS ?one) } }", "conjunction"),
        ("SELECT ?x { ?x upper:near+ ?y }", "path"),
        ("SELECT ?x (NOW() AS ?n) { ?x a race:Mug }", ""),
        ("SELECT ?x { ?x a race:Mug FILTER(NOW() > 3) }", ""),
        ("CONSTRUCT { ?x upper:near [] } WHERE { ?x a race:Mug }", ""),
        ("SELECT (BNODE() AS ?b) { ?x a race:Mug }", ""),
        (
            "SELECT ?y { fluent:m upper:near ?y } ORDER BY (EXISTS { ?y upper:near ?b }) LIMIT 1",
            "LIMIT",
        ),
        ("SELECT ?x { fluent:mug1 upper:near ?x FILTER EXISTS { ?x a race:Mug } }", ""),
        ("SELECT ?x { ?x upper:near ?y FILTER(fb:holdsAt(?y, 30)) }", ""),
        ("SELECT ?x { ?x upper:near ?y FILTER(fb:possiblyBefore(?x, ?y)) }", ""),
        ("SELECT ?x { ?x a race:Mug FILTER(fb:possiblyBefore(?x, fluent:mug1)) }", ""),
        ("SELECT ?x { ?x a race:Mug FILTER(fb:holdsAt(?x, fb:now())) }", ""),
        ("SELECT ?x { ?x upper:near ?y . ?y a race:Mug FILTER(fb:holdsAt(?x, 3)) }", "filters"),
        ("SELECT ?x { ?x a race:Mug LATERAL { ?x upper:near ?y } }", "does not understand"),
    ],
)
def test_what_no_tier_is_sound_for_is_evaluated_again(
    plan_of: PlanOf, query: str, reason: str
) -> None:
    chosen = plan_of(query)
    assert chosen.tier == 4
    assert reason in chosen.reason


def test_explanation_names_tier_reason_and_what_concerns_the_query(
    schema: Schema,
) -> None:
    query = parse("SELECT ?x { ?x a race:Mug } LIMIT 1")
    assert explanation(query, plan(query, schema)) == (
        "tier 4: no cheaper tier is sound: LIMIT or OFFSET needs all solutions at once; concerned "
        "by commits that touch one of 1 shapes of statements"
    )


@pytest.mark.parametrize("first", [1, 2, 3, 4])
def test_tiers_below_the_first_are_not_used(schema: Schema, first: int) -> None:
    assert plan(parse("SELECT ?x { ?x a race:Mug }"), schema, first).tier == first
