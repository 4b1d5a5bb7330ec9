"""Queries on what holds at a time, as believed after a commit, against filtering a dict."""

from __future__ import annotations

import math
import shutil
import tempfile
from collections import Counter
from pathlib import Path

import pyoxigraph as ox
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from fluentboard.board.blackboard import Blackboard
from fluentboard.board.commands import (
    AssertFluent,
    Command,
    CorrectFluent,
    EndFluent,
    RefineFluent,
    decide,
    name_of,
)
from fluentboard.board.intervals import FluentFilter
from fluentboard.board.triples import fluent_lines
from fluentboard.clock import ReplayClock
from fluentboard.errors import FluentboardError
from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.interval import Certainty, Interval
from fluentboard_ontology import PREFIXES

CLASSES = """
@prefix owl: <http://www.w3.org/2002/07/owl#> . @prefix race: <https://w3id.org/fluentboard/race#> .
@prefix rdfs: <http://www.w3.org/2000/01/rdf-schema#> .
race:Dish a owl:Class . race:Mug a owl:Class ; rdfs:subClassOf race:Dish .
"""
# What a fluent also says itself, what it does not, and what is about no fluent at all.
KNOWLEDGE = """
@prefix race: <https://w3id.org/fluentboard/race#> .
@prefix fluent: <https://w3id.org/fluentboard/fluent/> .
fluent:a a race:Mug ; <urn:colour> "red" . <urn:kitchen> <urn:has> [ <urn:width> 3.50 ] .
"""
QUERIES = (
    "SELECT ?s ?x { ?s upper:hasPose+/upper:hasX ?x }",
    "SELECT ?s { ?s a race:Mug FILTER NOT EXISTS { ?s upper:hasPose/upper:hasX ?x } }",
    "SELECT ?c (COUNT(?s) AS ?n) (SUM(?x) AS ?sum) { ?s a ?c OPTIONAL { ?s upper:hasX ?x } } "
    "GROUP BY ?c",
    "SELECT ?s { ?s rdf:type/rdfs:subClassOf* race:Dish MINUS { ?s upper:hasX 1.5 } }",
    "ASK { ?s upper:hasPose ?p . ?p upper:hasPose ?s }",
)
NAMES = ("a", "b", "c", "d")
TIMES = st.none() | st.sampled_from([1.0, 2.0, 3.0, 4.0, 5.0])
MOMENTS = (0.5, 1.0, 2.5, 4.0, 6.0)
VALUES = st.one_of(
    st.builds(Property, st.just("hasX"), st.just("xsd:float"), st.sampled_from([1.0, 1.5])),
    st.builds(Property, st.just("hasPose"), st.just("Mug"), st.sampled_from(NAMES)),
)


@st.composite
def intervals(draw: st.DrawFn) -> Interval:
    one, other = draw(TIMES), draw(TIMES)
    if one is not None and other is not None and one > other:
        one, other = other, one
    return Interval(one, other)


def answers(results: object) -> Counter[str]:
    if isinstance(results, ox.QueryBoolean):
        return Counter([str(bool(results))])
    assert isinstance(results, ox.QuerySolutions)
    return Counter(str(list(row)) for row in results)


class ViewsAgainstDicts(RuleBasedStateMachine):
    """Every view has the statements that a filter leaves of what was replayed into a dict."""

    @initialize()
    def open(self) -> None:
        self.folder = Path(tempfile.mkdtemp(prefix="fluentboard-test-"))
        (self.folder / "classes.ttl").write_text(CLASSES)
        self.clock = ReplayClock(2.5)
        self.board = Blackboard.open(
            None,
            builtin_ontologies=False,
            ontologies=[self.folder / "classes.ttl"],
            clock=self.clock,
        )
        everything = self.board.query("CONSTRUCT { ?s ?p ?o } { ?s ?p ?o }")
        assert isinstance(everything, ox.QueryTriples)
        self.background = {ox.Quad(*triple) for triple in everything}
        self.knowledge: set[ox.Quad] = set()
        self.fluents: dict[str, Fluent] = {}
        self.past: dict[int, tuple[set[ox.Quad], dict[str, Fluent]]] = {
            0: (set(), {}),
            1: (self.background, {}),
        }

    @rule(
        kind=st.sampled_from(["assert", "refine", "end", "correct"]),
        name=st.sampled_from(NAMES),
        start=intervals(),
        finish=intervals(),
        values=st.lists(VALUES, max_size=2),
    )
    def write(
        self, kind: str, name: str, start: Interval, finish: Interval, values: list[Property]
    ) -> None:
        try:
            command: Command = EndFluent(name, finish)
            if kind == "refine":
                command = RefineFluent(name, start, finish, tuple(values))
            elif kind != "end":
                fluent = Fluent(name, "Mug", start, finish, tuple(values))
                command = AssertFluent(fluent)
                if kind == "correct" and name in self.fluents:
                    command = CorrectFluent(fluent, "tested")
            event = decide(command, self.fluents.get(name_of(command)))
        except FluentboardError:
            return
        number = self.board.execute([command], "test").number
        if event is not None:
            self.fluents = {**self.fluents, name: event.after}
        self._remember(number)

    @rule(width=st.sampled_from(["3.50", "4"]))
    def learn(self, width: str) -> None:
        file = self.folder / "knowledge.ttl"
        file.write_text(KNOWLEDGE.replace("3.50", width))
        self.board.load_ontologies([file])
        if self.board.commit not in self.past:
            text = file.read_text()
            self.knowledge = set(
                ox.parse(text, format=ox.RdfFormat.TURTLE, base_iri="urn:fluentboard:knowledge")
            )
            # Blank nodes have other labels on the board.
            self._remember(self.board.commit)

    @rule(now_s=st.sampled_from([1.0, 2.0, 2.5, 3.0, 4.0, 4.5, 6.0]))
    def set_clock(self, now_s: float) -> None:
        self.clock.set(now_s)

    def _remember(self, number: int) -> None:
        self.past[number] = (self.background | self.knowledge, dict(self.fluents))

    @invariant()
    def what_holds_now_is_what_a_filter_leaves(self) -> None:
        for certainty in (Certainty.POSSIBLE, Certainty.CERTAIN):
            now_s = self.clock.now_s()
            expected = self._expected(self.board.commit, now_s, certainty)
            found = self.board.timed_query(
                "CONSTRUCT { ?s ?p ?o } { ?s ?p ?o }", at="now", certainty=certainty
            )
            assert (found.commit, found.at_s) == (self.board.commit, now_s)
            self._compare(found.results, expected)
            for query in QUERIES:
                results = self.board.query(query, at="now", certainty=certainty)
                assert answers(results) == answers(expected.query(query, prefixes=dict(PREFIXES)))
            assert self.board.next_change_s(certainty) == self._next_change_s(certainty)

    @rule(certainty=st.sampled_from([Certainty.POSSIBLE, Certainty.CERTAIN]))
    def look_back(self, certainty: Certainty) -> None:
        for as_of in (None, *self.past):
            for at in (None, *MOMENTS):
                if at is None and as_of is None:
                    continue
                commit = self.board.commit if as_of is None else as_of
                expected = self._expected(commit, at, certainty)
                found = self.board.timed_query(
                    "CONSTRUCT { ?s ?p ?o } { ?s ?p ?o }", at=at, as_of=as_of, certainty=certainty
                )
                assert (found.commit, found.at_s) == (commit, at)
                self._compare(found.results, expected)
                for query in QUERIES:
                    results = self.board.query(query, at=at, as_of=as_of, certainty=certainty)
                    assert answers(results) == answers(
                        expected.query(query, prefixes=dict(PREFIXES))
                    )
                if at is not None:
                    wanted = FluentFilter(at_s=at, as_of=as_of, certainty=certainty)
                    listed = {fluent.name for fluent in self.board.list(wanted).fluents}
                    assert listed == self._holding(commit, at, certainty)

    @rule(certainty=st.sampled_from([Certainty.POSSIBLE, Certainty.CERTAIN]))
    def look_back_from_now(self, certainty: Certainty) -> None:
        for as_of in self.past:
            expected = self._expected(as_of, self.clock.now_s(), certainty)
            found = self.board.query(
                "CONSTRUCT { ?s ?p ?o } { ?s ?p ?o }", at="now", as_of=as_of, certainty=certainty
            )
            self._compare(found, expected)

    def _holding(self, commit: int, at: float | None, certainty: Certainty) -> set[str]:
        return {
            name
            for name, fluent in self.past[commit][1].items()
            if at is None or fluent.holds_at(at) >= certainty
        }

    def _expected(self, commit: int, at: float | None, certainty: Certainty) -> ox.Store:
        background, fluents = self.past[commit]
        store = ox.Store()
        store.extend(background)
        for name in self._holding(commit, at, certainty):
            lines = fluent_lines(fluents[name], self.board.vocabulary)
            store.load("".join(lines), format=ox.RdfFormat.N_TRIPLES)
        return store

    def _next_change_s(self, certainty: Certainty) -> float:
        now_s, coming = self.clock.now_s(), math.inf
        for time_s in (1.0, 2.0, 3.0, 4.0, 5.0):
            if time_s > now_s and coming == math.inf:
                # Between two end points nothing changes.
                before = self._holding(self.board.commit, time_s - 0.25, certainty)
                if self._holding(self.board.commit, time_s, certainty) != before:
                    coming = time_s
        return coming

    @staticmethod
    def _compare(found: object, expected: ox.Store) -> None:
        assert isinstance(found, ox.QueryTriples)
        triples = ox.Dataset(ox.Quad(*triple) for triple in found)
        wanted = ox.Dataset(expected)
        for dataset in (triples, wanted):
            dataset.canonicalize(ox.CanonicalizationAlgorithm.UNSTABLE)
        assert set(triples) == set(wanted)

    def teardown(self) -> None:
        if hasattr(self, "board"):
            self.board.close()
            shutil.rmtree(self.folder)


TestViewsAgainstDicts = ViewsAgainstDicts.TestCase
TestViewsAgainstDicts.settings = settings(max_examples=25, stateful_step_count=15, deadline=None)
