"""The law of subscriptions as a machine: any history, with the clock going on and set back.

A subscription over the whole history is exact at the commit of each message; one at now is exact at
its commit and its time, whatever happened in between.
"""

from __future__ import annotations

import contextlib
from pathlib import Path
from tempfile import TemporaryDirectory

from hypothesis import HealthCheck, Phase, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from fluentboard.board.blackboard import Blackboard
from fluentboard.board.commands import AssertFluent, Command, CorrectFluent, EndFluent, RefineFluent
from fluentboard.board.statement_rules import ProtectedStatement
from fluentboard.board.subscriptions.messages import Delta, Gap, Lagged, Resumed, Snapshot
from fluentboard.board.subscriptions.query import parse
from fluentboard.board.subscriptions.registry import SubscriptionRegistry
from fluentboard.board.subscriptions.results import Bag, apply, bag_of
from fluentboard.board.subscriptions.settings import SubscriptionSettings
from fluentboard.board.subscriptions.subscription import Subscription
from fluentboard.clock import ReplayClock
from fluentboard.errors import IntervalReversed, NotARefinement, UnknownFluent
from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.interval import UNKNOWN, Certainty, Interval

ONTOLOGY = """
@prefix rdfs: <http://www.w3.org/2000/01/rdf-schema#> .
@prefix owl: <http://www.w3.org/2002/07/owl#> .
@prefix upper: <https://w3id.org/fluentboard/upper#> .
@prefix race: <https://w3id.org/fluentboard/race#> .
race:Kitchenware a owl:Class .
race:PersonalItem a owl:Class .
race:Mug a owl:Class ; rdfs:subClassOf race:Kitchenware .
race:Plate a owl:Class {more} .
"""
CHANGES_OF_ONTOLOGY = (
    "; rdfs:subClassOf race:Kitchenware",
    "; rdfs:subClassOf race:PersonalItem . fluent:Mug0 upper:label 'said'",
)
FLUENT_PREFIX = "@prefix fluent: <https://w3id.org/fluentboard/fluent/> .\n"

QUERIES = (
    "SELECT ?x { ?x a race:Mug }",
    "SELECT ?x { ?x rdf:type/rdfs:subClassOf* race:Kitchenware ; upper:label ?l }",
    "SELECT ?x ?l { ?x a race:Mug OPTIONAL { ?x upper:label ?l FILTER(?l != 'b') } }",
    "SELECT DISTINCT ?l { ?x upper:label ?l FILTER NOT EXISTS { ?x upper:near ?x } }",
    "SELECT ?x ?l { ?x upper:near ?y . ?y upper:label ?l }",
    "SELECT ?x { ?x a race:Plate FILTER NOT EXISTS { ?y upper:near ?x } }",
    "SELECT (COUNT(*) AS ?n) { ?x a race:Mug }",
    "SELECT ?x { ?x upper:label ?l } ORDER BY ?l ?x LIMIT 2",
    "SELECT ?x ?y { ?x upper:near+ ?y }",
    "SELECT ?x { ?x a race:Mug FILTER(fb:holdsAt(?x, 40)) }",
    "SELECT ?g ?x { GRAPH ?g { ?x upper:label ?l } }",
    "ASK { ?x a race:Mug ; upper:label 'a' }",
    "CONSTRUCT { ?y upper:nearOf ?x } WHERE { ?x upper:near ?y }",
    "SELECT ?p { fluent:Mug0 ?p ?o }",
)
VIEWS = (None, Certainty.POSSIBLE, Certainty.CERTAIN)
TIMEOUT_S = 20.0

_names = st.sampled_from(["Mug0", "Mug1", "Plate0", "Plate1"])


def _bounds(time_s: float, width_s: float) -> Interval:
    return Interval(time_s, time_s + width_s)


_widths = st.sampled_from([0.0, 5.0, 15.0])
_starts = st.just(UNKNOWN) | st.builds(_bounds, st.sampled_from([5.0, 15.0, 25.0]), _widths)
_finishes = st.builds(_bounds, st.sampled_from([30.0, 40.0, 55.0]), _widths)
_properties = st.lists(
    st.builds(Property, st.just("label"), st.just("xsd:string"), st.sampled_from("abc"))
    | st.builds(Property, st.just("near"), st.just("Mug"), st.sampled_from(["Mug0", "Mug1"])),
    max_size=3,
).map(tuple)


def _fluent(name: str, start: Interval, finish: Interval, some: tuple[Property, ...]) -> Fluent:
    return Fluent(name, name[:-1], start, finish, some)


_fluents = st.builds(_fluent, _names, _starts, st.just(UNKNOWN) | _finishes, _properties)
_assert = st.builds(AssertFluent, _fluents, merge=st.just(True))
_commands = st.one_of(
    _assert,
    _assert,
    st.builds(RefineFluent, _names, properties=_properties),
    st.builds(EndFluent, _names, _finishes),
    st.builds(CorrectFluent, _fluents, st.just("measured again")),
)
_updates = st.sampled_from(
    [
        "INSERT DATA { GRAPH <urn:notes> { <urn:x> upper:label 'b' } }",
        "DROP SILENT GRAPH <urn:notes>",
        "INSERT DATA { race:kitchen upper:label 'a' ; a race:Mug }",
        "DELETE WHERE { race:kitchen ?p ?o }",
        "INSERT DATA { race:Plate rdfs:subClassOf race:Kitchenware }",
        "DELETE DATA { race:Plate rdfs:subClassOf race:Kitchenware }",
    ]
)


class Follower:
    """A client of one subscription, with the result that its messages led to."""

    def __init__(self, query: str, certainty: Certainty | None) -> None:
        self.query = query
        self.certainty = certainty
        self.state: Bag | None = None
        self.commit: int | None = None
        self.at_s: float | None = None
        self.subscription: Subscription | None = None

    def open(self, registry: SubscriptionRegistry) -> None:
        at = None if self.certainty is None else "now"
        self.subscription = registry.open(
            self.query,
            "both",
            self.commit,
            at=at,
            certainty=self.certainty or Certainty.POSSIBLE,
            since_s=self.at_s,
        )

    def hear(self, board: Blackboard, told: list[object]) -> None:
        for message in told:
            if isinstance(message, Snapshot):
                self.state = dict(message.answer.bag)
            elif isinstance(message, Delta):
                assert self.state is not None
                assert apply(self.state, message.change.difference), self.query
            elif isinstance(message, Gap | Lagged):
                self.state = None
                continue
            else:
                assert isinstance(message, Resumed)
                assert self.state is not None
                continue
            self.commit, self.at_s = message.commit, message.at_s
            assert self.state == self.truth(board, self.commit, self.at_s), self.query

    def truth(self, board: Blackboard, commit: int, at_s: float | None) -> Bag:
        results = board.query(
            self.query, at=at_s, as_of=commit, certainty=self.certainty or Certainty.POSSIBLE
        )
        return bag_of(results, relabel=parse(self.query).makes_blank_nodes)


class Histories(RuleBasedStateMachine):
    """A board whose clock is set, and clients that come, listen, go and come again."""

    def __init__(self) -> None:
        super().__init__()
        self._folder = TemporaryDirectory()
        self._file = Path(self._folder.name) / "extra.ttl"
        self._write_ontology("")
        self.clock = ReplayClock(10.0)
        self.board = Blackboard.open(
            None, builtin_ontologies=False, ontologies=[self._file], clock=self.clock
        )
        self.registry = SubscriptionRegistry(self.board)

    @initialize(
        first_tier=st.sampled_from([1, 1, 2, 4]),
        limits=st.sampled_from([{}, {"ring_deltas": 1}, {"queue_messages": 2}, {"linger_s": 0.0}]),
    )
    def begin(self, first_tier: int, limits: dict[str, float]) -> None:
        self.registry.close()
        given = {"first_tier": first_tier, "reevaluation_share": 1.0, **limits}
        self.registry = SubscriptionRegistry(
            self.board, SubscriptionSettings.model_validate(given), self.board.statements()
        )
        self.followers = [Follower(query, view) for query in QUERIES for view in VIEWS]
        for follower in self.followers:
            follower.open(self.registry)

    @rule(commands=st.lists(_commands, min_size=1, max_size=3))
    def write(self, commands: list[Command]) -> None:
        for command in commands:
            with contextlib.suppress(IntervalReversed, NotARefinement, UnknownFluent):
                self.board.execute([command], "test")

    @rule(commands=st.lists(_commands, min_size=2, max_size=5), by_s=st.sampled_from([5.0, 20.0]))
    def write_as_time_passes(self, commands: list[Command], by_s: float) -> None:
        for command in commands:
            self.write([command])
            self.let_time_pass(by_s)

    @rule(change=_updates | st.sampled_from(CHANGES_OF_ONTOLOGY))
    def change_the_rest(self, change: str) -> None:
        if change in CHANGES_OF_ONTOLOGY:
            self._write_ontology(change)
            self.board.load_ontologies([self._file])
            return
        with contextlib.suppress(ProtectedStatement):
            self.board.graphs.update(change, "test").result()

    @rule(by_s=st.sampled_from([5.0, 10.0, 25.0]))
    def let_time_pass(self, by_s: float) -> None:
        self.clock.set(self.clock.now_s() + by_s)

    @rule()
    def set_the_clock_back(self) -> None:
        self.clock.set(max(10.0, self.clock.now_s() - 15.0))

    @rule(
        away=st.sets(st.integers(0, len(QUERIES) * len(VIEWS) - 1), max_size=12),
        commands=st.lists(_commands, max_size=3),
        by_s=st.sampled_from([0.0, 10.0]),
    )
    def be_away(self, away: set[int], commands: list[Command], by_s: float) -> None:
        self._listen()
        for number in away:
            subscription = self.followers[number].subscription
            assert subscription is not None
            subscription.close()
        self.write_as_time_passes(commands, by_s)
        for number in away:
            self.followers[number].open(self.registry)

    @rule()
    def listen(self) -> None:
        self._listen()

    @invariant()
    def nothing_failed(self) -> None:
        assert self.board.failure is None

    def teardown(self) -> None:
        try:
            if hasattr(self, "followers"):
                self._listen()
                for follower in self.followers:
                    now_s = None if follower.certainty is None else self.clock.now_s()
                    truth = follower.truth(self.board, self.board.commit, now_s)
                    assert follower.state == truth, follower.query
        finally:
            self.registry.close()
            self.board.close()
            self._folder.cleanup()

    def _listen(self) -> None:
        heard = True
        while heard:
            # A subscriber that lagged is sent a snapshot once it has caught up.
            assert self.registry.wait_until(self.board.commit, TIMEOUT_S)
            heard = False
            for follower in self.followers:
                if follower.subscription is not None:
                    told = follower.subscription.poll()
                    heard = heard or bool(told)
                    follower.hear(self.board, list(told))

    def _write_ontology(self, more: str) -> None:
        self._file.write_text(FLUENT_PREFIX + ONTOLOGY.format(more=more), encoding="utf-8")


TestHistories = Histories.TestCase
TestHistories.settings = settings(
    max_examples=25,
    stateful_step_count=14,
    deadline=None,
    phases=(Phase.explicit, Phase.generate),
    suppress_health_check=[HealthCheck.too_slow],
)
