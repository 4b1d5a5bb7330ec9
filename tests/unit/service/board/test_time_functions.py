"""Time in SPARQL: the extension functions of the board."""

from __future__ import annotations

from collections.abc import Iterator

import pyoxigraph as ox
import pytest

from fluentboard.board.blackboard import Blackboard
from fluentboard.board.commands import AssertFluent, EndFluent
from fluentboard.board.time_functions import FUNCTIONS, mentions_functions
from fluentboard.clock import ReplayClock
from fluentboard.model.fluent import Fluent
from fluentboard.model.interval import UNKNOWN, Certainty, Interval
from fluentboard.model.relations import Relation, bounds_of, relation_certainty
from fluentboard_ontology import FB

FLUENTS = (
    Fluent("on4", "On", UNKNOWN, Interval(119.0, 161.0)),
    Fluent("holding0", "Holding", Interval(119.0, 161.0), UNKNOWN),
    Fluent("pick1", "PickUpObjectActivity", Interval.at(119.0), Interval.at(161.0)),
)


@pytest.fixture(scope="module")
def board() -> Iterator[Blackboard]:
    with Blackboard.open(None, clock=ReplayClock(150.0)) as board:
        board.execute([AssertFluent(fluent) for fluent in FLUENTS], "test")
        yield board


def value(board: Blackboard, expression: str) -> str | None:
    """The value of an expression, or None for an error."""
    results = board.query(f"SELECT ({expression} AS ?x) {{}}")
    assert isinstance(results, ox.QuerySolutions)
    (row,) = results
    return None if row[0] is None else row[0].value


@pytest.mark.parametrize(
    ("expression", "expected"),
    [
        ("fb:now()", "150"),
        ("fb:holdsAt(fluent:on4, fb:now())", "true"),
        ("fb:possiblyHoldsAt(fluent:on4, 150)", "true"),
        ("fb:certainlyHoldsAt(fluent:on4, 150.0)", "false"),
        ("fb:certaintyAt(fluent:on4, 1.5e2)", "possible"),
        ("fb:certaintyAt(fluent:on4, 118)", "certain"),
        ("fb:certaintyAt(fluent:on4, 'INF'^^xsd:double)", "impossible"),
        ("fb:durationMin(fluent:pick1)", "42"),
        ("fb:durationMax(fluent:on4)", "INF"),
        ("fb:certainlyBefore(fluent:on4, 161)", "false"),
        ("fb:certainlyBefore(fluent:on4, 162)", "true"),
        ("fb:certainlyDuring(fluent:pick1, 100, 200)", "true"),
        ("fb:certainlyContains(100, 200, fluent:pick1)", "true"),
        ("fb:possiblyOverlaps(fluent:on4, fluent:pick1)", "true"),
        ("fb:certainlyEquals(fluent:on4, fluent:on4)", "true"),
        ("fb:certainlyEquals(1, 2, 1, 2.0)", "true"),
        ("fb:certainlyIntersects(fluent:pick1, 160, 170)", "true"),
        ("fb:certainlyCovers(fluent:on4, 1, 100)", "true"),
    ],
)
def test_a_function_has_the_value_of_the_reference(
    board: Blackboard, expression: str, expected: str
):
    assert value(board, expression) == expected


@pytest.mark.parametrize(
    "expression",
    [
        "fb:holdsAt(fluent:nobody, 150)",
        "fb:holdsAt(race:Mug, 150)",
        "fb:holdsAt(150, 150)",
        "fb:holdsAt(fluent:on4, 'soon')",
        "fb:holdsAt(fluent:on4, 'NaN'^^xsd:double)",
        "fb:holdsAt(fluent:on4, '1_0'^^xsd:double)",
        "fb:holdsAt(fluent:on4)",
        "fb:certainlyBefore(fluent:on4)",
        "fb:certainlyBefore(fluent:on4, fluent:nobody)",
        "fb:certainlyDuring(fluent:on4, 200, 100)",
        "fb:durationMin(150)",
    ],
)
def test_what_is_no_fluent_or_no_time_is_an_error_of_the_expression(
    board: Blackboard, expression: str
):
    assert value(board, expression) is None


@pytest.mark.parametrize("relation", Relation)
def test_every_relation_agrees_with_the_model(board: Blackboard, relation: Relation):
    for one in FLUENTS:
        for other in FLUENTS:
            if one is not other:
                found = relation_certainty(relation, bounds_of(one), bounds_of(other))
                both = f"(fluent:{one.name}, fluent:{other.name})"
                possibly, certainly = (
                    value(board, f"fb:{prefix}{relation.camel}{both}")
                    for prefix in ("possibly", "certainly")
                )
                assert possibly == ("true" if found >= Certainty.POSSIBLE else "false")
                assert certainly == ("true" if found is Certainty.CERTAIN else "false")


def test_a_filter_drops_what_is_an_error(board: Blackboard):
    results = board.query(
        "SELECT ?f { VALUES ?f { fluent:on4 race:Mug } FILTER(fb:holdsAt(?f, 1)) }"
    )
    assert isinstance(results, ox.QuerySolutions)
    assert [str(row[0]) for row in results] == ["<https://w3id.org/fluentboard/fluent/on4>"]


def test_results_that_are_read_late_are_of_the_snapshot_of_the_query():
    with Blackboard.open(None) as board:
        board.execute([AssertFluent(Fluent("mug1", "Mug"))], "test")
        late = board.query("SELECT ?f { ?f a race:Mug FILTER(fb:certainlyHoldsAt(?f, 50)) }")
        board.execute([EndFluent("mug1", Interval.at(20.0))], "test")
        assert isinstance(late, ox.QuerySolutions)
        assert len(list(late)) == 1


@pytest.mark.parametrize(
    "query",
    [
        "SELECT ?x { BIND(fb:now() AS ?x) }",
        f"SELECT ?x {{ BIND(<{FB}now>() AS ?x) }}",
        f"PREFIX : <{FB}> SELECT ?x {{ BIND(:now() AS ?x) }}",
        "BASE <https://w3id.org/fluentboard/> PREFIX x: <board#> SELECT ?x { BIND(x:now() AS ?x) }",
        "BASE <https://w3id.org/fluentboard/board> SELECT ?x { BIND(<#now>() AS ?x) }",
        "SELECT ?x { BIND(<https://w3id.org/fluentboard/b\\u006Fard#n\\u006Fw>() AS ?x) }",
    ],
)
def test_a_function_is_found_however_it_is_written(board: Blackboard, query: str):
    assert mentions_functions(query)
    results = board.query(query)
    assert isinstance(results, ox.QuerySolutions)
    assert [row[0].value for row in results] == ["150"]


def test_ordinary_queries_are_not_taken_for_calls():
    assert not mentions_functions("SELECT ?m { ?m a race:Mug ; upper:hasPose ?p }")


def test_there_are_two_functions_for_every_relation():
    assert len(FUNCTIONS) == 7 + 2 * len(Relation)
