"""Where the engine departs from SPARQL, queries are rewritten until it does not."""

from __future__ import annotations

import pyoxigraph as ox
import pytest

from fluentboard.board.blackboard import Blackboard
from fluentboard.board.engine_repairs import repaired

PROLOGUE = "PREFIX : <http://e/> "
DATA = """INSERT DATA {
    :d :p :d2 .
    GRAPH :g1 { :a :p :b . :b :p :c . :a :q 1 }
    GRAPH :g2 { :a :p :x . :x :q 2 . :b :q 3 }
    GRAPH :g3 { :z :r :z }
}"""
GRAPHS = ["http://e/g1", "http://e/g2", "http://e/g3"]


@pytest.fixture(scope="module")
def board() -> Blackboard:
    board = Blackboard.open(None, builtin_ontologies=False)
    board.graphs.update(PROLOGUE + DATA, "test").result()
    return board


def rows(board: Blackboard, query: str) -> list[str]:
    results = board.query(PROLOGUE + query)
    assert isinstance(results, ox.QuerySolutions)
    names = [variable.value for variable in results.variables]
    return sorted(
        str(sorted((name, str(row[name])) for name in names if row[name] is not None))
        for row in results
    )


@pytest.mark.parametrize(
    "body",
    [
        "?s :p ?o",
        "OPTIONAL { ?s :q ?v }",
        "?s :p ?o MINUS { ?s :q ?v }",
        "FILTER NOT EXISTS { ?s :p ?v }",
        "BIND(1 AS ?x)",
        "VALUES ?x { 1 2 }",
        "VALUES (?g ?t) { (UNDEF 'foo') (:g1 'bar') }",
        "",
        "SELECT ?s { ?s :p ?o }",
        "SELECT * { ?s :p ?o }",
        "SELECT DISTINCT ?s { ?s :p ?o }",
        "SELECT ?s { ?s ?p ?o } ORDER BY ?s LIMIT 1",
        "SELECT (COUNT(*) AS ?c) { ?s :p ?o }",
        "SELECT ?s (COUNT(*) AS ?c) { ?s :p ?o } GROUP BY ?s",
        "?s :p ?o { SELECT ?s (COUNT(*) AS ?c) { ?s ?p ?x } GROUP BY ?s }",
        "?s :p ?o FILTER EXISTS { SELECT ?s { ?s :q ?v } }",
        "?s :p ?o GRAPH ?h { VALUES ?x { 7 } ?y :q ?v }",
        "?s :p ?o OPTIONAL { GRAPH ?h { SELECT (MAX(?v) AS ?m) { ?y :q ?v } } }",
        "?s :p* ?o",
        ":a :p* ?o VALUES ?o { :b :x }",
    ],
)
def test_graph_variable_ranges_over_the_graphs(board: Blackboard, body: str) -> None:
    branches = (f"{{ VALUES ?g {{ <{iri}> }} GRAPH <{iri}> {{ {body} }} }}" for iri in GRAPHS)
    expected = rows(board, f"SELECT * {{ {' UNION '.join(branches)} }}")
    assert rows(board, f"SELECT * {{ GRAPH ?g {{ {body} }} }}") == expected


def test_named_graphs_of_the_query_are_the_ones_ranged_over(board: Blackboard) -> None:
    query = "{ GRAPH ?g { SELECT (COUNT(*) AS ?c) { ?s :p ?o } } }"
    assert len(rows(board, f"SELECT * {query}")) == 3
    assert len(rows(board, f"SELECT * FROM NAMED :g1 FROM NAMED :g3 {query}")) == 2
    assert not rows(board, f"SELECT * FROM :g1 {query}")
    named = [ox.NamedNode(GRAPHS[1])]
    protocol = board.query(
        f"{PROLOGUE} SELECT * FROM NAMED :g1 {query}", default_graphs=[], named_graphs=named
    )
    assert isinstance(protocol, ox.QuerySolutions)
    assert [str(row["g"]) for row in protocol] == ["<http://e/g2>"]


def test_concatenated_group_is_a_plain_string(board: Blackboard) -> None:
    query = "SELECT (GROUP_CONCAT(?x ; SEPARATOR='-)') AS ?all) { VALUES ?x { 'a'@en 'b'@en } }"
    assert rows(board, query) == ["[('all', '\"a-)b\"')]"]


def test_unknown_function_is_an_error_of_its_expression_alone(board: Blackboard) -> None:
    assert rows(board, "SELECT (:f(1) AS ?x) (:g() AS ?y) (2 AS ?z) {}") == [
        "[('z', '\"2\"^^<http://www.w3.org/2001/XMLSchema#integer>')]"
    ]


@pytest.mark.parametrize(
    "query",
    [
        "SELECT * { GRAPH ?g { ?s ?p ?o } }",
        "SELECT * { VALUES ?g { <urn:g> } GRAPH ?g { ?s ?p ?o } }",
        "SELECT * { ?s ?p 'GROUP_CONCAT(' } # GRAPH ?g { SELECT",
        "SELECT * { GRAPH <urn:g> { SELECT ?s { ?s ?p ?o } } }",
        "SELECT (STR(GROUP_CONCAT(?o)) AS ?x) { ?s ?p ?o }",
        "SELECT * { GRAPH ?g { SELECT",
        "GRAPH ?g VALUES",
        "",
        "# GROUP_CONCAT",
    ],
)
def test_other_queries_stay_as_they_are(query: str) -> None:
    assert repaired(query, lambda: GRAPHS) == query


@pytest.mark.parametrize("end", ["<urn:unheard-of>", "'no resource'"])
def test_class_path_to_an_absent_term_has_the_answer_of_any_path(
    board: Blackboard, end: str
) -> None:
    of_classes = rows(board, f"SELECT ?c {{ ?c rdfs:subClassOf* {end} }}")
    assert of_classes == rows(board, f"SELECT ?c {{ ?c :heardOf* {end} }}")
