"""The blackboard: commands in, durable and visible facts out."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Sequence

import pyoxigraph as ox
import pytest

from fluentboard.board import listing
from fluentboard.board.blackboard import Blackboard
from fluentboard.board.commands import AssertFluent, CorrectFluent, EndFluent, RefineFluent
from fluentboard.board.events import Commit
from fluentboard.board.intervals import FluentFilter
from fluentboard.clock import ReplayClock
from fluentboard.errors import (
    FluentExists,
    IdempotencyConflict,
    InvalidInput,
    InvalidName,
    InvalidQuery,
    NotARefinement,
    StorageFailed,
    UnknownClass,
    UnknownFluent,
    VersionMismatch,
)
from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.interval import Certainty, Interval

MUG = Fluent("mug1", "Mug", properties=(Property("hasPose", "Pose", "pose1"),))


@pytest.fixture(scope="module")
def shared_board() -> Iterator[Blackboard]:
    with Blackboard.open(None, clock=ReplayClock(100.0)) as board:
        yield board


@pytest.fixture
def board() -> Iterator[Blackboard]:
    with Blackboard.open(None, clock=ReplayClock(100.0)) as board:
        yield board


def bindings(board: Blackboard, query: str) -> list[list[str]]:
    results = board.query(query)
    assert isinstance(results, ox.QuerySolutions)
    return sorted([str(term) for term in row] for row in results)


def test_asserted_fluent_is_read_back_with_its_commit(board: Blackboard) -> None:
    commit = board.execute([AssertFluent(MUG)], "ann")
    found = board.fluent("mug1")
    assert (found.version, found.created, found.author) == (commit.number, commit.number, "ann")
    assert found.properties == MUG.properties


def test_asserting_the_same_again_changes_nothing(board: Blackboard) -> None:
    first = board.execute([AssertFluent(MUG)], "ann")
    again = board.execute([AssertFluent(MUG)], "bob")
    assert again.events == ()
    assert board.fluent("mug1").version == first.number


def test_asserting_something_else_under_a_taken_name_is_refused(board: Blackboard) -> None:
    board.execute([AssertFluent(MUG)], "ann")
    with pytest.raises(FluentExists, match="mug1"):
        board.execute([AssertFluent(Fluent("mug1", "Plate"))], "bob")


def test_merging_adds_what_the_second_account_says(board: Blackboard) -> None:
    board.execute([AssertFluent(MUG)], "ann")
    second = Fluent("mug1", "Mug", properties=(Property("hasPose", "Pose", "pose2"),))
    board.execute([AssertFluent(second, merge=True)], "bob")
    assert board.fluent("mug1").values("hasPose") == ("pose1", "pose2")


def test_ended_fluent_stays_queryable(board: Blackboard) -> None:
    board.execute([AssertFluent(MUG)], "ann")
    board.execute([EndFluent("mug1", Interval(5.0, 6.0))], "ann")
    rows = bindings(
        board,
        "SELECT ?f1 ?f2 { fluent:mug1 a race:Mug ; upper:hasFinishEarliest ?f1 ; "
        "upper:hasFinishLatest ?f2 }",
    )
    assert [[term.split('"')[1] for term in row] for row in rows] == [["5", "6"]]


def test_ending_twice_at_another_time_is_refused(board: Blackboard) -> None:
    board.execute([AssertFluent(MUG), EndFluent("mug1", Interval.at(5.0))], "ann")
    with pytest.raises(NotARefinement):
        board.execute([EndFluent("mug1", Interval.at(7.0))], "ann")


def test_batch_is_all_or_nothing(board: Blackboard) -> None:
    with pytest.raises(UnknownFluent, match="ghost"):
        board.execute([AssertFluent(MUG), EndFluent("ghost", Interval.at(5.0))], "ann")
    assert "mug1" not in board
    assert bindings(board, "SELECT * { fluent:mug1 ?p ?o }") == []


def test_batch_sees_its_own_earlier_commands(board: Blackboard) -> None:
    board.execute([AssertFluent(MUG), EndFluent("mug1", Interval.at(5.0))], "ann")
    assert board.fluent("mug1").finish == Interval.at(5.0)
    finishes = bindings(board, "SELECT ?f { fluent:mug1 upper:hasFinishLatest ?f }")
    assert len(finishes) == 1


def test_unknown_class_is_refused_with_a_suggestion(board: Blackboard) -> None:
    with pytest.raises(UnknownClass, match="Mug"):
        board.execute([AssertFluent(Fluent("m", "Mugg"))], "ann")


def test_unknown_class_of_a_reference_is_refused(board: Blackboard) -> None:
    fluent = Fluent("m", "Mug", properties=(Property("hasPose", "Posture", "p"),))
    with pytest.raises(UnknownClass, match="Posture"):
        board.execute([AssertFluent(fluent)], "ann")


@pytest.mark.parametrize(
    "name", ["rdf:type", "hasStartEarliest", "upper:hasFinishLatest", "fb:subClassOfOrSame"]
)
def test_what_the_board_states_itself_cannot_be_a_property(board: Blackboard, name: str) -> None:
    fluent = Fluent("m", "Mug", properties=(Property(name, "xsd:double", 1.0),))
    with pytest.raises(InvalidName, match=name):
        board.execute([AssertFluent(fluent)], "ann")


def test_class_may_be_given_as_prefixed_name_or_iri(board: Blackboard) -> None:
    iri = board.vocabulary.class_iri("Mug")
    board.execute([AssertFluent(Fluent("a", "race:Mug")), AssertFluent(Fluent("b", iri))], "ann")
    assert board.fluent("a").class_name == board.fluent("b").class_name == "Mug"


def test_stale_version_is_refused(board: Blackboard) -> None:
    first = board.execute([AssertFluent(MUG)], "ann").number
    more = (Property("hasPose", "Pose", "pose2"),)
    board.execute([RefineFluent("mug1", properties=more, expected_version=first)], "ann")
    with pytest.raises(VersionMismatch):
        board.execute([EndFluent("mug1", Interval.at(5.0), expected_version=first)], "bob")


def test_same_idempotency_key_gives_the_first_answer(board: Blackboard) -> None:
    first = board.execute([AssertFluent(MUG)], "ann", idempotency_key="k1")
    again = board.execute([AssertFluent(MUG)], "ann", idempotency_key="k1")
    assert again == first


def test_idempotency_key_of_another_request_is_refused(board: Blackboard) -> None:
    board.execute([AssertFluent(MUG)], "ann", idempotency_key="k1")
    with pytest.raises(IdempotencyConflict):
        board.execute([AssertFluent(Fluent("x", "Mug"))], "ann", idempotency_key="k1")


def test_correction_needs_a_reason_and_keeps_it(board: Blackboard) -> None:
    board.execute([AssertFluent(MUG)], "ann")
    corrected = Fluent("mug1", "Plate")
    with pytest.raises(InvalidInput, match="reason"):
        board.execute([CorrectFluent(corrected)], "admin")
    board.execute([CorrectFluent(corrected, "it was a plate all along")], "admin")
    assert board.history("mug1")[-1].reason == "it was a plate all along"
    assert bindings(board, "SELECT ?c { fluent:mug1 a ?c FILTER(?c = race:Plate) }")
    assert bindings(board, "SELECT ?c { fluent:mug1 a ?c FILTER(?c = race:Mug) }") == []


def test_history_tells_each_change(board: Blackboard) -> None:
    board.execute([AssertFluent(MUG)], "ann")
    board.execute([RefineFluent("mug1", start=Interval(1.0, 2.0))], "bob")
    board.execute([EndFluent("mug1", Interval.at(5.0))], "cid")
    history = board.history("mug1")
    assert [c.author for c in history] == ["ann", "bob", "cid"]
    assert [c.events[0].kind for c in history] == ["added", "refined", "ended"]


def test_fluent_is_read_as_it_stood_at_a_commit(board: Blackboard) -> None:
    first = board.execute([AssertFluent(MUG)], "ann").number
    board.execute([EndFluent("mug1", Interval.at(5.0))], "ann")
    assert board.fluent("mug1", as_of=first).is_open
    with pytest.raises(UnknownFluent):
        board.fluent("mug1", as_of=first - 1)


def test_listing_by_class_includes_subclasses(shared_board: Blackboard) -> None:
    shared_board.execute([AssertFluent(Fluent("listed_mug", "Mug"))], "ann")
    page = shared_board.list(FluentFilter(class_name="Kitchenware"))
    assert "listed_mug" in [f.name for f in page.fluents]
    assert shared_board.list(FluentFilter(class_name="Area")).fluents == ()


def test_listing_by_time_tells_certain_from_possible(board: Blackboard) -> None:
    fluent = Fluent("on4", "On", finish=Interval(119.621, 161.817))
    board.execute([AssertFluent(fluent)], "ann")
    for at_s, certainty, expected in [
        (100.0, Certainty.CERTAIN, 1),
        (140.0, Certainty.CERTAIN, 0),
        (140.0, Certainty.POSSIBLE, 1),
        (170.0, Certainty.POSSIBLE, 0),
    ]:
        page = board.list(FluentFilter(at_s=at_s, certainty=certainty))
        assert len(page.fluents) == expected


def test_listing_goes_on_where_the_page_before_ended(board: Blackboard) -> None:
    board.execute([AssertFluent(Fluent(f"m{i}", "Mug")) for i in range(5)], "ann")
    first = board.list(FluentFilter(), limit=3)
    assert first.next is not None
    second = board.list(FluentFilter(), after=first.next, limit=3)
    names = [f.name for f in (*first.fluents, *second.fluents)]
    assert names == [f"m{i}" for i in range(5)]
    assert second.next is None


def test_listing_as_of_a_commit_shows_what_was_believed_then(board: Blackboard) -> None:
    first = board.execute([AssertFluent(MUG)], "ann").number
    board.execute([EndFluent("mug1", Interval.at(5.0)), AssertFluent(Fluent("m2", "Mug"))], "ann")
    believed = board.list(FluentFilter(at_s=50.0, as_of=first)).fluents
    assert [f.name for f in believed] == ["mug1"]
    assert [f.name for f in board.list(FluentFilter(at_s=50.0)).fluents] == ["m2"]


def test_listing_by_property_value(board: Blackboard) -> None:
    pose = Fluent("pose1", "Pose", properties=(Property("hasZ", "xsd:float", 0.71),))
    board.execute([AssertFluent(MUG), AssertFluent(pose)], "ann")
    by_reference = FluentFilter(property_name="hasPose", property_value="pose1")
    by_literal = FluentFilter(property_name="hasZ", property_value="0.71")
    assert [f.name for f in board.list(by_reference).fluents] == ["mug1"]
    assert [f.name for f in board.list(by_literal).fluents] == ["pose1"]


def test_listener_gets_commits_in_order(board: Blackboard) -> None:
    seen: list[int] = []
    heard_all = threading.Event()

    def remember(commits: Sequence[Commit]) -> None:
        seen.extend(commit.number for commit in commits)
        if len(seen) >= 3:
            heard_all.set()

    stop = board.listen(remember)
    numbers = [board.execute([AssertFluent(Fluent(f"m{i}", "Mug"))], "a").number for i in range(3)]
    assert heard_all.wait(10.0)
    stop()
    board.execute([AssertFluent(Fluent("unheard", "Mug"))], "a")
    board.close()
    assert seen == numbers


def test_concurrent_writers_get_distinct_commits(board: Blackboard) -> None:
    numbers: list[int] = []

    def write(author: int) -> None:
        for i in range(10):
            command = AssertFluent(Fluent(f"w{author}_{i}", "Mug"))
            numbers.append(board.execute([command], str(author)).number)

    threads = [threading.Thread(target=write, args=(a,)) for a in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(set(numbers)) == 40
    assert max(numbers) == board.commit


def test_refused_request_leaves_its_neighbours_alone(board: Blackboard) -> None:
    futures = [
        board.submit([AssertFluent(Fluent("a", "Mug"))], "x"),
        board.submit([EndFluent("ghost", Interval.at(1.0))], "x"),
        board.submit([AssertFluent(Fluent("b", "Mug"))], "x"),
    ]
    assert futures[0].result().events
    assert futures[2].result().events
    with pytest.raises(UnknownFluent):
        futures[1].result()


def test_dangling_references_and_undeclared_properties_are_remarked(board: Blackboard) -> None:
    odd = Fluent("m", "Mug", properties=(Property("hasColour", "xsd:string", "blue"),))
    remarks = board.remarks([AssertFluent(odd), AssertFluent(MUG)])
    assert any("hasColour" in remark for remark in remarks)
    assert any("pose1" in remark for remark in remarks)


def test_malformed_query_is_an_error_with_its_place(shared_board: Blackboard) -> None:
    with pytest.raises(InvalidQuery, match="1:"):
        shared_board.query("SELECT ?x WHERE {")


def test_closed_board_refuses_writes(board: Blackboard) -> None:
    board.close()
    with pytest.raises(StorageFailed, match="closed"):
        board.execute([AssertFluent(MUG)], "ann")


def test_listing_by_property_as_believed_at_a_commit(board: Blackboard) -> None:
    board.execute([AssertFluent(MUG), AssertFluent(Fluent("m2", "Mug"))], "ann")
    seen = board.execute([RefineFluent("m2", properties=MUG.properties)], "ann").number
    moved = Fluent("mug1", "Mug", properties=(Property("hasPose", "Pose", "pose2"),))
    board.execute([CorrectFluent(moved, "wrong mug")], "ann")
    wanted = FluentFilter(property_name="hasPose", property_value="pose1")
    assert [f.name for f in board.list(wanted).fluents] == ["m2"]
    then = FluentFilter(property_name="hasPose", property_value="pose1", as_of=seen)
    assert [f.name for f in board.list(then).fluents] == ["mug1", "m2"]
    before = FluentFilter(property_name="hasPose", property_value="pose1", as_of=seen - 1)
    assert [f.name for f in board.list(before).fluents] == ["mug1"]


@pytest.mark.parametrize(
    ("kind", "value", "text"),
    [
        ("xsd:float", 5.0, "5"),
        ("xsd:float", 5.0, "5.0"),
        ("xsd:boolean", True, "true"),
        ("xsd:integer", 12, "12"),
        ("xsd:string", "5.0", "5.0"),
    ],
)
def test_listing_by_a_value_takes_any_way_to_write_it(
    board: Blackboard, kind: str, value: str | float | bool, text: str
) -> None:
    board.execute(
        [AssertFluent(Fluent("f", "Mug", properties=(Property("hasX", kind, value),)))], "a"
    )
    wanted = FluentFilter(property_name="hasX", property_value=text)
    assert [f.name for f in board.list(wanted).fluents] == ["f"]


def test_listing_by_a_common_property_is_paged(
    board: Blackboard, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(listing, "_CANDIDATES_MAX", 2)
    board.execute([AssertFluent(Fluent(f"m{i}", "Mug")) for i in range(3)], "ann")
    posed = [Fluent(f"p{i}", "Mug", properties=MUG.properties) for i in range(4)]
    board.execute([AssertFluent(fluent) for fluent in posed], "ann")
    page = board.list(FluentFilter(property_name="hasPose"), limit=3)
    assert [f.name for f in page.fluents] == ["p0", "p1", "p2"]
    assert page.next is not None
    rest = board.list(FluentFilter(property_name="hasPose"), after=page.next, limit=3)
    assert ([f.name for f in rest.fluents], rest.next) == (["p3"], None)


def test_a_page_says_the_commit_it_is_exact_at(board: Blackboard) -> None:
    number = board.execute([AssertFluent(MUG)], "ann").number
    assert board.list(FluentFilter()).commit == number
    assert board.list(FluentFilter(as_of=number - 1)).commit == number - 1
