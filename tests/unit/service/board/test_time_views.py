"""Time views: which are kept, what they cost, and how they follow commits and the clock."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import pyoxigraph as ox
import pytest

import fluentboard.board.time_view as time_view_module
import fluentboard.board.time_views as time_views_module
from fluentboard.board.blackboard import Blackboard
from fluentboard.board.commands import AssertFluent, EndFluent, RefineFluent
from fluentboard.clock import ReplayClock
from fluentboard.errors import InvalidQuery, InvalidTime
from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.interval import Certainty, Interval

ONTOLOGY = """
@prefix owl: <http://www.w3.org/2002/07/owl#> . @prefix race: <https://w3id.org/fluentboard/race#> .
race:Mug a owl:Class .
"""
MUGS = "SELECT ?m { ?m a race:Mug }"


@pytest.fixture(scope="module")
def ontology(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("ontologies") / "mugs.ttl"
    file.write_text(ONTOLOGY)
    return file


@pytest.fixture
def clock() -> ReplayClock:
    return ReplayClock(5.0)


@pytest.fixture
def board(ontology: Path, clock: ReplayClock) -> Iterator[Blackboard]:
    with Blackboard.open(
        None, builtin_ontologies=False, ontologies=[ontology], clock=clock
    ) as board:
        yield board


def mug(name: str, start_s: float, finish_s: float | None = None) -> AssertFluent:
    finish = Interval() if finish_s is None else Interval.at(finish_s)
    return AssertFluent(Fluent(name, "Mug", Interval.at(start_s), finish))


def names(results: object) -> list[str]:
    assert isinstance(results, ox.QuerySolutions)
    return sorted(row[0].value.rpartition("/")[2] for row in results)


def test_now_follows_the_clock(board: Blackboard, clock: ReplayClock) -> None:
    board.execute([mug("a", 1.0, 6.0), mug("b", 7.0)], "test")
    assert names(board.query(MUGS, at="now")) == ["a"]
    clock.set(6.5)
    assert names(board.query(MUGS, at="now")) == []
    clock.set(8.0)
    assert names(board.query(MUGS, at="now")) == ["b"]


def test_now_follows_a_clock_that_is_turned_back(board: Blackboard, clock: ReplayClock) -> None:
    board.execute([mug("a", 1.0, 6.0)], "test")
    clock.set(9.0)
    assert names(board.query(MUGS, at="now")) == []
    clock.set(2.0)
    assert names(board.query(MUGS, at="now")) == ["a"]


def test_now_sees_what_was_just_written(board: Blackboard) -> None:
    assert names(board.query(MUGS, at="now")) == []
    board.execute([mug("a", 1.0)], "test")
    assert names(board.query(MUGS, at="now")) == ["a"]
    board.execute([EndFluent("a", Interval.at(4.0))], "test")
    assert names(board.query(MUGS, at="now")) == []


def test_a_property_that_is_added_shows(board: Blackboard) -> None:
    board.execute([mug("a", 1.0)], "test")
    colour = "SELECT ?c { ?m upper:hasX ?c }"
    board.query(colour, at="now")
    board.execute([RefineFluent("a", properties=(Property("hasX", "xsd:float", 5.0),))], "test")
    results = board.query(colour, at="now")
    assert isinstance(results, ox.QuerySolutions)
    assert [row[0].value for row in results] == ["5"]


def test_the_next_change_by_the_clock_is_known(board: Blackboard, clock: ReplayClock) -> None:
    assert board.next_change_s() == math.inf
    board.execute([mug("a", 1.0, 9.0), mug("b", 7.0)], "test")
    assert board.next_change_s() == 7.0
    clock.set(7.0)
    assert board.next_change_s() == 9.0
    board.execute([EndFluent("b", Interval(8.0, 12.0))], "test")
    assert board.next_change_s(Certainty.CERTAIN) == 8.0


def test_results_say_what_they_are_exact_at(board: Blackboard) -> None:
    commit = board.execute([mug("a", 1.0, 9.0)], "test").number
    found = board.timed_query(MUGS, at="now")
    assert (found.commit, found.at_s, found.next_change_s) == (commit, 5.0, 9.0)
    past = board.timed_query(MUGS, as_of=commit - 1)
    assert (past.commit, past.at_s, past.next_change_s) == (commit - 1, None, math.inf)
    whole = board.timed_query(MUGS)
    assert (whole.commit, whole.at_s) == (commit, None)


def test_a_belief_of_the_future_is_the_present_one(board: Blackboard) -> None:
    commit = board.execute([mug("a", 1.0)], "test").number
    found = board.timed_query(MUGS, as_of=commit + 10)
    assert (found.commit, names(found.results)) == (commit, ["a"])


def test_an_earlier_belief_stays_when_the_board_goes_on(board: Blackboard) -> None:
    commit = board.execute([mug("a", 1.0)], "test").number
    assert names(board.query(MUGS, as_of=commit)) == ["a"]
    board.execute([mug("b", 1.0)], "test")
    assert names(board.query(MUGS, as_of=commit)) == ["a"]
    assert names(board.query(MUGS, at=5.0)) == ["a", "b"]
    assert names(board.query(MUGS, at=5.0, as_of=commit)) == ["a"]


def test_results_that_are_read_late_are_of_the_moment_of_the_query(board: Blackboard) -> None:
    board.execute([mug("a", 1.0)], "test")
    late = board.query(f"{MUGS[:-1]} FILTER(fb:certainlyHoldsAt(?m, 5)) }}", at="now")
    board.execute([EndFluent("a", Interval.at(4.0))], "test")
    assert names(board.query(MUGS, at="now")) == []
    assert names(late) == ["a"]


def test_functions_see_the_belief_of_the_view(board: Blackboard) -> None:
    commit = board.execute([mug("a", 1.0)], "test").number
    board.execute([EndFluent("a", Interval.at(4.0))], "test")
    ends = "SELECT ?m { ?m a race:Mug FILTER(fb:certainlyBefore(?m, 5)) }"
    assert names(board.query(ends, as_of=commit)) == []
    assert names(board.query(ends, at=2.0)) == ["a"]


def test_now_in_a_function_is_the_time_of_the_view(board: Blackboard, clock: ReplayClock) -> None:
    clock.set(6.25)
    results = board.query("SELECT (fb:now() AS ?t) {}", at="now")
    assert isinstance(results, ox.QuerySolutions)
    assert [row[0].value for row in results] == ["6.25"]


def test_class_paths_are_answered_in_a_view(board: Blackboard) -> None:
    board.execute([mug("a", 1.0)], "test")
    query = "SELECT ?m { ?m rdf:type/rdfs:subClassOf* race:Mug }"
    assert names(board.query(query, at="now")) == ["a"]


def test_a_query_that_does_not_parse_leaves_the_view_usable(board: Blackboard) -> None:
    with pytest.raises(InvalidQuery):
        board.query("SELECT", at="now")
    assert names(board.query(MUGS, at="now")) == []


def test_no_time_is_refused(board: Blackboard) -> None:
    with pytest.raises(InvalidTime, match="NaN"):
        board.query(MUGS, at=math.nan)


def test_more_views_than_are_kept_are_answered(board: Blackboard) -> None:
    board.execute([mug(f"m{i}", float(i)) for i in range(1, 20)], "test")
    for _ in range(2):
        for i in range(1, 20):
            assert len(names(board.query(MUGS, at=float(i)))) == i


def test_views_with_too_many_fluents_go(board: Blackboard, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(time_views_module, "_FLUENTS_MAX", 3)
    board.execute([mug(f"m{i}", float(i)) for i in range(1, 5)], "test")
    for at in (4.0, 3.0, 4.0):
        assert len(names(board.query(MUGS, at=at))) == at


def test_a_large_view_is_kept_on_disk(board: Blackboard, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(time_view_module, "_IN_MEMORY_MAX", 1)
    board.execute([mug("a", 1.0), mug("b", 1.0)], "test")
    assert names(board.query(MUGS, at="now")) == ["a", "b"]
    board.execute([EndFluent("a", Interval.at(4.0))], "test")
    assert names(board.query(MUGS, at="now")) == ["b"]
