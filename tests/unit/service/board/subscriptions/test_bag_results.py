"""Results are bags of solutions, whose difference is exact."""

from __future__ import annotations

import pyoxigraph as ox
import pytest

from fluentboard.board.subscriptions.results import (
    Bag,
    Difference,
    apply,
    bag_of,
    bindings_to_json,
    difference,
    fluents_in,
    term_to_json,
)
from fluentboard.board.subscriptions.terms import term_of
from fluentboard.errors import TooLarge
from fluentboard_ontology import FLUENT

A, B, C = (ox.Literal(name) for name in "abc")
XSD = "http://www.w3.org/2001/XMLSchema#"


def store(text: str) -> ox.Store:
    made = ox.Store()
    made.load(text.encode(), format=ox.RdfFormat.TURTLE)
    return made


def test_solutions_are_counted() -> None:
    results = store("<urn:1> <urn:p> 1 . <urn:2> <urn:p> 1 .").query("SELECT ?o { ?s <urn:p> ?o }")
    assert list(bag_of(results).values()) == [2]


def test_unbound_variables_are_none() -> None:
    results = store("<urn:1> <urn:p> 1 .").query("SELECT ?x { ?s <urn:p> ?o }")
    assert bag_of(results) == {(None,): 1}


def test_result_over_the_limit_is_refused() -> None:
    board = store("<urn:1> <urn:p> 1 . <urn:2> <urn:p> 1 .")
    query = "SELECT ?o { ?s <urn:p> ?o }"
    assert bag_of(board.query(query), limit=2)
    with pytest.raises(TooLarge, match="more than 1 solutions"):
        bag_of(board.query(query), limit=1)


def test_ask_is_one_empty_solution_or_none() -> None:
    board = store("<urn:1> <urn:p> 1 .")
    assert bag_of(board.query("ASK { ?s <urn:p> ?o }")) == {(): 1}
    assert bag_of(board.query("ASK { ?s <urn:q> ?o }")) == {}


def test_construct_is_a_set_of_triples() -> None:
    board = store("<urn:1> <urn:p> 1 . <urn:2> <urn:p> 1 .")
    bag = bag_of(board.query("CONSTRUCT { <urn:x> <urn:y> ?o } { ?s <urn:p> ?o }"))
    assert list(bag.values()) == [1]


def test_made_blank_nodes_are_named_alike_in_every_evaluation() -> None:
    board = store("<urn:1> <urn:p> 1 . <urn:2> <urn:p> 2 .")
    query = "CONSTRUCT { ?s <urn:q> [ <urn:r> ?o ; <urn:t> [] ] } { ?s <urn:p> ?o }"
    once = bag_of(board.query(query), relabel=True)
    assert bag_of(board.query(query), relabel=True) == once
    assert len(once) == 6


def test_new_solution_leaves_the_blank_nodes_of_others_alone() -> None:
    board = store("<urn:1> <urn:p> 1 .")
    query = "SELECT ?s (BNODE() AS ?b) { ?s <urn:p> ?o }"
    before = bag_of(board.query(query), relabel=True)
    board.load(b"<urn:2> <urn:p> 1 .", format=ox.RdfFormat.TURTLE)
    change = difference(before, bag_of(board.query(query), relabel=True))
    assert len(change.added) == 1
    assert not change.removed


@pytest.mark.parametrize(
    ("before", "after", "added", "removed"),
    [
        ({}, {(A,): 2}, {(A,): 2}, {}),
        ({(A,): 2}, {(A,): 1}, {}, {(A,): 1}),
        ({(A,): 1, (B,): 1}, {(B,): 3, (C,): 1}, {(B,): 2, (C,): 1}, {(A,): 1}),
        ({(A,): 1}, {(A,): 1}, {}, {}),
    ],
)
def test_difference_counts_and_applies(before: Bag, after: Bag, added: Bag, removed: Bag) -> None:
    change = difference(before, after)
    assert change == Difference(added, removed)
    assert bool(change) is (before != after)
    assert apply(before, change)
    assert before == after


def test_difference_that_does_not_fit_changes_nothing() -> None:
    bag: Bag = {(A,): 1}
    assert not apply(bag, Difference({(B,): 1}, {(A,): 2}))
    assert bag == {(A,): 1}


@pytest.mark.parametrize(
    ("term", "json"),
    [
        (ox.NamedNode("urn:a"), {"type": "uri", "value": "urn:a"}),
        (ox.BlankNode("b"), {"type": "bnode", "value": "b"}),
        (ox.Literal("t"), {"type": "literal", "value": "t"}),
        (ox.Literal("t", language="en"), {"type": "literal", "value": "t", "xml:lang": "en"}),
        (ox.Literal(3), {"type": "literal", "value": "3", "datatype": XSD + "integer"}),
    ],
)
def test_terms_are_encoded_as_sparql_json(
    term: ox.NamedNode | ox.BlankNode | ox.Literal, json: dict[str, str]
) -> None:
    assert term_to_json(term) == json


def test_bindings_repeat_a_solution_and_leave_out_what_is_unbound() -> None:
    value = {"type": "literal", "value": "a"}
    assert bindings_to_json(("x", "y"), {(A, None): 2}) == [{"x": value}, {"x": value}]


def test_fluents_are_found_by_their_iris() -> None:
    row = (ox.NamedNode(FLUENT + "mug1"), A, None, ox.NamedNode("urn:x"))
    assert list(fluents_in(row)) == ["mug1"]


@pytest.mark.parametrize(
    ("text", "value"),
    [
        (f'"01"^^<{XSD}integer>', "1"),
        (f'"1.50"^^<{XSD}decimal>', "1.5"),
        (f'"0.0"^^<{XSD}float>', "0"),
        ('"0.0"', "0.0"),
        ("<urn:a>", "urn:a"),
    ],
)
def test_terms_are_spelt_as_the_store_spells_them(text: str, value: str) -> None:
    term = term_of(text)
    assert getattr(term, "value", None) == value
