"""A mistake in a query is shown where it is, whatever the engine says around it."""

from __future__ import annotations

from fluentboard.api.mistakes import located
from fluentboard.errors import InvalidQuery


def test_mistake_is_shown_with_what_stands_around_it() -> None:
    query = "SELECT ?a\nWHERE { ?a ?b }"
    found = located(InvalidQuery("does not parse: error at 2:15: expected an object"), query)
    assert (found.detail["line"], found.detail["column"]) == (2, 15)
    assert "near 'WHERE { ?a ?b }'" in found.message


def test_what_was_put_before_the_query_does_not_count() -> None:
    found = located(InvalidQuery("error at 1:30: expected one of a, b"), "SELECT {", 22)
    assert found.detail["column"] == 8


def test_long_list_of_what_could_have_stood_there_is_left_out() -> None:
    expected = ", ".join(f"'{letter}'" for letter in "abcdefghijkl")
    found = located(InvalidQuery(f"error at 1:3: expected one of {expected}"), "SELECT")
    assert "'a'" not in found.message


def test_problem_without_a_place_stays_as_it_is() -> None:
    problem = InvalidQuery("it takes too many words")
    assert located(problem, "SELECT") is problem
