"""Tiers 1 and 2: the difference that an event makes, without asking the board."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from fluentboard.board.commands import AssertFluent, CorrectFluent, EndFluent, RefineFluent
from fluentboard.board.subscriptions.changes import CommitChange
from fluentboard.board.subscriptions.results import Difference
from fluentboard.board.subscriptions.standing import Plan
from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.interval import Interval

PlanOf = Callable[[str], Plan]
ChangeOf = Callable[..., CommitChange]


def mug(*properties: Property, name: str = "mug1") -> Fluent:
    return Fluent(name, "Mug", properties=properties)


def on(table: str) -> Property:
    return Property("onTop", "Table", table)


def size(value: float, kind: str = "xsd:integer") -> Property:
    return Property("size", kind, value)


def effect(chosen: Plan, change: CommitChange) -> Difference:
    assert hasattr(chosen, "difference")
    return chosen.difference(change.events[0])  # type: ignore[union-attr]


def counts(change: Difference) -> tuple[list[int], list[int]]:
    return sorted(change.added.values()), sorted(change.removed.values())


QUERIES = {
    1: "SELECT ?x ?t { ?x a race:Mug ; upper:onTop ?t }",
    2: "SELECT ?x ?t { ?x a race:Mug ; upper:onTop ?t FILTER(ISIRI(?t)) }",
}


@pytest.mark.parametrize("tier", [1, 2])
def test_new_fluent_adds_all_combinations(plan_of: PlanOf, change_of: ChangeOf, tier: int) -> None:
    chosen = plan_of(QUERIES[tier])
    change = change_of(AssertFluent(mug(on("a"), on("b"))))
    assert chosen.tier == tier
    assert counts(effect(chosen, change)) == ([1, 1], [])


@pytest.mark.parametrize("tier", [1, 2])
def test_refinement_adds_what_is_new(plan_of: PlanOf, change_of: ChangeOf, tier: int) -> None:
    change_of(AssertFluent(mug(on("a"))))
    change = change_of(RefineFluent("mug1", properties=(on("b"),)))
    assert counts(effect(plan_of(QUERIES[tier]), change)) == ([1], [])


@pytest.mark.parametrize("tier", [1, 2])
def test_correction_removes_what_is_wrong(plan_of: PlanOf, change_of: ChangeOf, tier: int) -> None:
    change_of(AssertFluent(mug(on("a"))))
    change = change_of(CorrectFluent(Fluent("mug1", "Plate", properties=(on("a"),)), "a plate"))
    assert counts(effect(plan_of(QUERIES[tier]), change)) == ([], [1])


@pytest.mark.parametrize("tier", [1, 2])
def test_fluent_of_another_class_makes_no_difference(
    plan_of: PlanOf, change_of: ChangeOf, tier: int
) -> None:
    change = change_of(AssertFluent(Fluent("plate1", "Plate", properties=(on("a"),))))
    assert not effect(plan_of(QUERIES[tier]), change)


def test_numbers_match_by_value_and_type(plan_of: PlanOf, change_of: ChangeOf) -> None:
    change = change_of(AssertFluent(mug(size(1), size(1, "xsd:long"), size(1.0, "xsd:float"))))
    assert counts(effect(plan_of("SELECT ?x { ?x upper:size 1 }"), change)) == ([1], [])
    assert counts(effect(plan_of("SELECT ?s { ?x upper:size ?s }"), change)) == ([1, 1], [])
    assert not effect(plan_of("SELECT ?x { ?x upper:size 1.0 }"), change)


def test_one_variable_in_two_places_is_one_value(plan_of: PlanOf, change_of: ChangeOf) -> None:
    near = Property("near", "Table", "b")
    change = change_of(AssertFluent(mug(on("a"), on("b"), near)))
    chosen = plan_of("SELECT ?t { ?x upper:onTop ?t ; upper:near ?t }")
    assert counts(effect(chosen, change)) == ([1], [])


@pytest.mark.parametrize(
    "pattern",
    [
        "?x rdf:type/rdfs:subClassOf* race:Kitchenware",
        "?x rdf:type/rdfs:subClassOf* race:Mug",
        "?x a ?c . ?c rdfs:subClassOf+ race:Kitchenware",
    ],
)
def test_class_counts_with_those_above_it(
    plan_of: PlanOf, change_of: ChangeOf, pattern: str
) -> None:
    change = change_of(AssertFluent(mug()))
    assert counts(effect(plan_of(f"SELECT ?x {{ {pattern} }}"), change)) == ([1], [])


def test_class_itself_is_not_above_itself(plan_of: PlanOf, change_of: ChangeOf) -> None:
    change = change_of(AssertFluent(mug()))
    chosen = plan_of("SELECT ?x { ?x a ?c . ?c rdfs:subClassOf+ race:Mug }")
    assert not effect(chosen, change)


def test_solution_of_two_fluents_has_twice_the_support(
    plan_of: PlanOf, change_of: ChangeOf
) -> None:
    chosen = plan_of("SELECT DISTINCT ?t { ?x upper:onTop ?t }")
    one = effect(chosen, change_of(AssertFluent(mug(on("a")))))
    two = effect(chosen, change_of(AssertFluent(mug(on("a"), name="mug2"))))
    assert one.added == two.added
    support = dict.fromkeys(one.added, 2)
    assert not chosen.view.difference(two, support)
    assert chosen.view.difference(one, dict.fromkeys(one.added, 1)) == one


def test_ask_turns_with_the_first_support_and_the_last(
    plan_of: PlanOf, change_of: ChangeOf
) -> None:
    chosen = plan_of("ASK { ?x a race:Mug }")
    change = effect(chosen, change_of(AssertFluent(mug())))
    assert chosen.view.difference(change, {(): 1}).added == {(): 1}
    assert not chosen.view.difference(change, {(): 5})


def test_optional_part_that_comes_replaces_the_solution_without_it(
    plan_of: PlanOf, change_of: ChangeOf
) -> None:
    chosen = plan_of("SELECT ?x ?t { ?x a race:Mug OPTIONAL { ?x upper:onTop ?t } }")
    change_of(AssertFluent(mug()))
    change = change_of(RefineFluent("mug1", properties=(on("a"),)))
    assert counts(effect(chosen, change)) == ([1], [1])


def test_end_of_a_fluent_takes_it_out_of_the_open_ones(
    plan_of: PlanOf, change_of: ChangeOf
) -> None:
    chosen = plan_of('SELECT ?x { ?x upper:hasFinishLatest ?f FILTER(?f = "INF"^^xsd:double) }')
    change_of(AssertFluent(mug()))
    change = change_of(EndFluent("mug1", Interval(3.0, 4.0)))
    assert counts(effect(chosen, change)) == ([], [1])


def test_fluent_that_ends_holds_no_more(plan_of: PlanOf, change_of: ChangeOf) -> None:
    chosen = plan_of("SELECT ?x { ?x a race:Mug FILTER(fb:holdsAt(?x, 30)) }")
    added = change_of(AssertFluent(Fluent("mug1", "Mug", Interval.at(10.0))))
    ended = change_of(EndFluent("mug1", Interval.at(20.0)))
    assert counts(effect(chosen, added)) == ([1], [])
    assert counts(effect(chosen, ended)) == ([], [1])


def test_aggregate_over_one_named_fluent_is_recounted(plan_of: PlanOf, change_of: ChangeOf) -> None:
    chosen = plan_of("SELECT (COUNT(*) AS ?n) { fluent:mug1 upper:onTop ?t }")
    change = effect(chosen, change_of(AssertFluent(mug(on("a"), on("b")))))
    assert [solution[0] for solution in change.removed] != [s[0] for s in change.added]
    assert counts(change) == ([1], [1])


def test_keys_are_the_rarest_statements_that_are_required(plan_of: PlanOf) -> None:
    chosen = plan_of("SELECT ?x { ?x a race:Mug ; upper:near ?y ; upper:onTop fluent:table1 }")
    assert {key[2] for key in chosen.keys} == {  # type: ignore[union-attr]
        "<https://w3id.org/fluentboard/fluent/table1>"
    }
