from __future__ import annotations

import pytest

from fluentboard.api.point_queries import point_query


@pytest.mark.parametrize(
    "query",
    [
        "SELECT ?p ?o WHERE { <http://x/a> ?p ?o }",
        "select * where { fluent:mug1 ?p ?o . }",
        "SELECT ?pose { fluent:mug1 upper:hasPose ?pose }",
        "PREFIX x: <http://x/>\nSELECT ?o WHERE {\n  x:a x:b ?o .\n}\n",
        "ASK { fluent:mug1 a ?class }",
        "SELECT ?s ?f { fluent:m upper:hasStart ?s ; upper:hasFinish ?f }",
    ],
)
def test_patterns_about_one_constant_subject_are_point_queries(query: str) -> None:
    assert point_query(query) is not None


@pytest.mark.parametrize(
    "query",
    [
        "SELECT ?s WHERE { ?s a race:Mug }",  # every mug
        "SELECT DISTINCT ?p WHERE { fluent:m ?p ?o }",  # rows may collapse
        "SELECT ?o WHERE { fluent:m upper:a/upper:b ?o }",  # a path
        "SELECT ?o WHERE { fluent:m upper:a+ ?o }",
        "SELECT ?o WHERE { fluent:m !upper:a ?o }",
        "SELECT ?a WHERE { fluent:m upper:a ?a ; upper:b ?a }",  # a join without rows
        "SELECT ?a WHERE { fluent:m upper:a ?a ; upper:a ?b }",  # a product
        "SELECT ?a WHERE { fluent:m ?p ?a ; ?q ?b }",
        "SELECT ?p WHERE { fluent:m ?p ?p }",
        "SELECT ?o WHERE { fluent:m ?p ?o . fluent:n ?q ?r }",
        "SELECT ?o WHERE { fluent:m ?p ?o FILTER(?o > 3) }",
        "SELECT (COUNT(*) AS ?n) WHERE { fluent:m ?p ?o }",
        "SELECT ?o WHERE { fluent:m ?p ?o } ORDER BY ?o",
        "SELECT ?o FROM <http://x/g> WHERE { fluent:m ?p ?o }",
        "SELECT ?o WHERE { GRAPH <http://x/g> { fluent:m ?p ?o } }",
        "SELECT ?o WHERE { SERVICE <http://x/g> { fluent:m ?p ?o } }",
        "CONSTRUCT { fluent:m ?p ?o } WHERE { fluent:m ?p ?o }",
        "SELECT ?o WHERE { fluent:m ?p ?o, ?q }",
        "SELECT ?o WHERE { fluent:m ?p ?o } # " + "x" * 2_000,
        "",
    ],
)
def test_everything_else_takes_the_usual_way(query: str) -> None:
    assert point_query(query) is None
