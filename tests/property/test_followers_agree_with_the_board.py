"""A follower says at each commit what the board says, from whichever checkpoint it began."""

from __future__ import annotations

import tempfile
from collections import Counter
from pathlib import Path

import pyoxigraph as ox
from hypothesis import given, settings
from hypothesis import strategies as st

from fluentboard.board.blackboard import Blackboard
from fluentboard.board.commands import AssertFluent, Command, CorrectFluent, EndFluent
from fluentboard.board.follower import Follower
from fluentboard.board.time_views import TimedResults
from fluentboard.clock import ReplayClock
from fluentboard.errors import FluentboardError
from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.interval import Interval

CLASSES = """
@prefix owl: <http://www.w3.org/2002/07/owl#> . @prefix race: <https://w3id.org/fluentboard/race#> .
@prefix rdfs: <http://www.w3.org/2000/01/rdf-schema#> .
race:Dish a owl:Class . race:Mug a owl:Class ; rdfs:subClassOf race:Dish .
"""
QUERIES = (
    "SELECT * { ?s ?p ?o }",
    "SELECT * { GRAPH ?g { ?s ?p ?o } }",
    "SELECT ?s { ?s rdf:type/rdfs:subClassOf* race:Dish }",
    "SELECT ?s { ?s a race:Mug FILTER(fb:holdsAt(?s, 2.5)) }",
    "SELECT ?s ?t { ?s a race:Mug ; upper:hasStartEarliest ?b BIND(fb:now() AS ?t) }",
)
NAMES = st.sampled_from(["a", "b", "c"])


def mug(name: str, start_s: float, x: float) -> Command:
    properties = (Property("hasX", "xsd:float", x),)
    fluent = Fluent(name, "Mug", Interval(start_s, start_s), properties=properties)
    return AssertFluent(fluent, merge=True)


def end(name: str) -> Command:
    return EndFluent(name, Interval(4.0, 5.0))


def correction(name: str) -> Command:
    return CorrectFluent(Fluent(name, "Dish"), "tested")


WRITES = st.one_of(
    st.builds(mug, NAMES, st.sampled_from([1.0, 2.0, 3.0]), st.sampled_from([0.5, 1.5])),
    st.builds(end, NAMES),
    st.builds(correction, NAMES),
    st.sampled_from(
        [
            "INSERT DATA { GRAPH <urn:g> { <urn:a> <urn:b> 1 } }",
            "DELETE DATA { GRAPH <urn:g> { <urn:a> <urn:b> 1 } }",
            "INSERT DATA { <urn:kitchen> <urn:has> [ <urn:width> 3.50 ] }",
            "DROP SILENT GRAPH <urn:g>",
        ]
    ),
)


def write(board: Blackboard, what: Command | str) -> None:
    try:
        if isinstance(what, str):
            board.graphs.update(what, "test").result()
        else:
            board.execute([what], "test")
    except FluentboardError:
        pass  # a command that does not fit: nothing changes


def rows(timed: TimedResults) -> Counter[str]:
    assert isinstance(timed.results, ox.QuerySolutions)
    found: Counter[str] = Counter()
    for row in timed.results:
        # A blank node has a name of its own in each store.
        found[" ".join("_" if isinstance(t, ox.BlankNode) else str(t) for t in row)] += 1
    return found


@settings(max_examples=12)
@given(before=st.lists(WRITES, max_size=6), after=st.lists(WRITES, max_size=8))
def test_follower_agrees_with_the_board(
    before: list[Command | str], after: list[Command | str]
) -> None:
    clock = ReplayClock(2.5)
    with tempfile.TemporaryDirectory(prefix="fluentboard-test-") as name:
        folder = Path(name)
        (folder / "classes.ttl").write_text(CLASSES)
        with Blackboard.open(
            folder / "data",
            durability="process",
            ontologies=[folder / "classes.ttl"],
            builtin_ontologies=False,
            clock=clock,
        ) as board:
            for command in before:
                write(board, command)
            board.query("ASK {}")  # waits until the store has everything
            applied = board.checkpoint(folder / "store")
            assert board.journal_file is not None
            follower = Follower(board.journal_file, folder / "store", applied, clock)
            for command in after:
                write(board, command)
                follower.wait_for(board.commit)
                assert follower.commit == board.commit
            for sparql in QUERIES:
                assert rows(follower.timed_query(sparql)) == rows(board.timed_query(sparql))
                assert rows(follower.timed_query(sparql, at="now")) == rows(
                    board.timed_query(sparql, at="now")
                )
                past = board.commit // 2
                assert rows(follower.timed_query(sparql, as_of=past)) == rows(
                    board.timed_query(sparql, as_of=past)
                )
            assert follower.named_graphs() == board.named_graphs()
            follower.close()
