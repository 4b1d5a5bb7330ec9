"""What is told of SPARQL without a parser."""

from __future__ import annotations

import pyoxigraph as ox
import pytest

from fluentboard.board.subscriptions.sparql_text import (
    as_select_all,
    blanked,
    filter_texts,
    has_escapes,
    over_dataset,
    prologue,
    query_form,
    without_distinct,
    words,
)
from fluentboard.errors import InvalidInput


def test_strings_comments_and_iris_are_blanked_in_place() -> None:
    query = "ASK { ?x <urn:select#a> 'union' } # filter"
    plain = blanked(query)
    assert len(plain) == len(query)
    assert plain == "ASK { ?x <____________> '_____' }         "


@pytest.mark.parametrize(
    ("query", "form"),
    [
        ("PREFIX select: <urn:ask> SELECT * {}", "select"),
        ("# describe\nASK {}", "ask"),
        ("BASE <urn:construct> CONSTRUCT WHERE {}", "construct"),
        ("PREFIX a: <urn:x> DESCRIBE a:select", "describe"),
        ("INSERT DATA {}", None),
    ],
)
def test_form_is_the_first_word_that_is_one(query: str, form: str | None) -> None:
    assert query_form(query) == form


def test_words_leave_out_variables_and_prefixed_names() -> None:
    assert "NOW" not in words("SELECT ?now { ?now now:now 'NOW()' }")
    assert "NOW" in words("SELECT (now() AS ?n) {}")


def test_escapes_count_outside_strings_and_within_iris() -> None:
    assert not has_escapes(r'SELECT * { ?x ?p "a\"b" FILTER(REGEX(?x, "\\d")) }')
    assert has_escapes(r"SELECT * { ?x p:a\-b ?y }")
    assert has_escapes(r"SELECT * { ?x <urn:\u0041> ?y }")


def test_distinct_is_dropped_from_the_select_clause_alone() -> None:
    assert without_distinct("SELECT  DISTINCT ?x { ?x ?p 'SELECT DISTINCT' }").split() == [
        "SELECT",
        "?x",
        "{",
        "?x",
        "?p",
        "'SELECT",
        "DISTINCT'",
        "}",
    ]


@pytest.mark.parametrize(
    ("query", "expected"),
    [
        ("ASK { ?x a ?y }", "SELECT * { ?x a ?y }"),
        ("CONSTRUCT { ?x a ?z } WHERE { ?x a ?y }", "SELECT * WHERE { ?x a ?y }"),
        ("CONSTRUCT { ?x a '}' } { ?x a ?y }", "SELECT * { ?x a ?y }"),
        ("CONSTRUCT WHERE { ?x a ?y }", "SELECT * WHERE { ?x a ?y }"),
    ],
)
def test_ask_and_construct_become_select_all(query: str, expected: str) -> None:
    assert as_select_all(query) == expected


def test_prologue_ends_before_the_form() -> None:
    assert prologue("PREFIX a: <urn:a#>\nSELECT * {}") == "PREFIX a: <urn:a#>\n"


def test_filters_are_cut_out_with_their_brackets() -> None:
    query = "SELECT * { ?x ?p ?o FILTER(?o > (1 + 2)) FILTER regex(?o, ')') ?x ?q ?filter }"
    assert filter_texts(query) == ["FILTER(?o > (1 + 2))", "FILTER regex(?o, ')')"]


@pytest.mark.parametrize(
    "query",
    [
        "SELECT * WHERE { ?s ?p ?o }",
        "select (exists { ?a ?b ?c } as ?e) ?s ?p ?o { ?s ?p ?o }",
        "PREFIX where: <urn:where> SELECT * # where {\n { ?s ?p ?o }",
        "CONSTRUCT { ?s ?p (1 ?o) } WHERE { ?s ?p ?o }",
        "CONSTRUCT WHERE { ?s ?p ?o }",
        "ASK { ?s ?p ?o FILTER(?o != 'where {') }",
    ],
)
def test_a_query_goes_over_the_graphs_that_the_request_names(query: str) -> None:
    store = ox.Store()
    a, b = ox.NamedNode("urn:a"), ox.NamedNode("urn:b")
    store.add(ox.Quad(a, a, a, a))
    store.add(ox.Quad(b, b, b))
    narrowed = store.query(over_dataset(query, ["urn:a"], []))
    if isinstance(narrowed, ox.QueryBoolean):
        assert narrowed
        assert not store.query(over_dataset(query, ["urn:b"], []))
        return
    found = {str(part) for row in narrowed for part in row}  # type: ignore[union-attr]
    assert "<urn:a>" in found
    assert "<urn:b>" not in found


def test_graphs_are_named_once_and_by_iris() -> None:
    with pytest.raises(InvalidInput, match="FROM"):
        over_dataset("SELECT * FROM <urn:a> {}", ["urn:a"], [])
    with pytest.raises(InvalidInput, match="no IRI"):
        over_dataset("SELECT * {}", ["urn:a> {} #"], [])
