"""The law of subscriptions: snapshot plus deltas equals a fresh evaluation at every commit."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Generator, Sequence
from pathlib import Path

import pytest
import yaml
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from fluentboard.board.blackboard import Blackboard
from fluentboard.board.commands import (
    AssertFluent,
    Command,
    CorrectFluent,
    EndFluent,
    RefineFluent,
)
from fluentboard.board.events import Commit
from fluentboard.board.statement_rules import ProtectedStatement
from fluentboard.board.subscriptions.messages import (
    Delta,
    Gap,
    Lagged,
    Message,
    Resumed,
    Snapshot,
)
from fluentboard.board.subscriptions.query import parse
from fluentboard.board.subscriptions.registry import SubscriptionRegistry
from fluentboard.board.subscriptions.results import Bag, apply, bag_of
from fluentboard.board.subscriptions.settings import SubscriptionSettings
from fluentboard.board.subscriptions.subscription import Subscription
from fluentboard.errors import IntervalReversed, NotARefinement, UnknownFluent
from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.interval import UNKNOWN, Interval

GOLDEN = Path(__file__).parents[1] / "golden"
QUERIES: dict[str, str] = {
    "thesis, floor areas": (GOLDEN / "query_2_3.rq").read_text(encoding="utf-8"),
    "thesis, anchoring objects": (GOLDEN / "query_4_2_4.rq").read_text(encoding="utf-8"),
    **yaml.safe_load(Path(__file__).with_name("standing_queries.yaml").read_text(encoding="utf-8")),
}

_PREFIXES = """
@prefix rdfs: <http://www.w3.org/2000/01/rdf-schema#> .
@prefix owl: <http://www.w3.org/2002/07/owl#> .
@prefix upper: <https://w3id.org/fluentboard/upper#> .
@prefix race: <https://w3id.org/fluentboard/race#> .
@prefix furniture: <https://w3id.org/fluentboard/furniture#> .
@prefix fluent: <https://w3id.org/fluentboard/fluent/> .
"""
# Far smaller than the real ones: every query is evaluated after every step.
ONTOLOGY = (
    _PREFIXES
    + """
upper:PhysicalEntity a owl:Class .
upper:Area a owl:Class .
upper:Pose a owl:Class .
upper:BBox a owl:Class .
race:Kitchenware a owl:Class ; rdfs:subClassOf upper:PhysicalEntity .
race:PersonalItem a owl:Class ; rdfs:subClassOf upper:PhysicalEntity .
race:Drinkware a owl:Class ; rdfs:subClassOf race:Kitchenware .
race:Mug a owl:Class ; rdfs:subClassOf race:Drinkware .
race:Plate a owl:Class ; rdfs:subClassOf race:Kitchenware .
race:FloorArea a owl:Class ; rdfs:subClassOf upper:Area .
furniture:Table a owl:Class ; rdfs:subClassOf upper:PhysicalEntity .
upper:hasPose a owl:ObjectProperty .
race:kitchen a race:FloorArea ; upper:hasBoundingBox fluent:BBox0 .
"""
)
CHANGES_OF_ONTOLOGY = (
    _PREFIXES
    + """
race:Goblet a owl:Class ; rdfs:subClassOf race:Mug .
race:Plate rdfs:subClassOf race:PersonalItem .
fluent:Mug0 upper:onTop fluent:Table0 ; upper:label "a" .
""",
    _PREFIXES
    + """
race:Goblet a owl:Class ; rdfs:subClassOf race:Kitchenware .
furniture:Table rdfs:subClassOf upper:Area .
upper:onTop a owl:ObjectProperty .
""",
)

CLASSES = ("Mug", "Plate", "Table", "FloorArea", "BBox", "Pose")


def _individual(class_name: str, number: int) -> str:
    return f"{class_name}{number}"


def _class_of(name: str) -> str:
    return name.rstrip("01")


def _reference(name: str, target: str) -> Property:
    return Property(name, _class_of(target), target)


def _label(text: str) -> Property:
    return Property("label", "xsd:string", text)


def _weight(kind: str, weight: int) -> Property:
    return Property("weight", kind, weight)


def _height(z: float) -> Property:
    return Property("hasZ", "xsd:float", z)


def _soon_after(time_s: float) -> Interval:
    return Interval(time_s, time_s + 5.0)


def _fluent(name: str, finish: Interval, properties: tuple[Property, ...]) -> Fluent:
    return Fluent(name, _class_of(name), Interval(1.0, 2.0), finish, properties)


_names = st.builds(_individual, st.sampled_from(CLASSES), st.integers(0, 1))
_statements = st.one_of(
    st.builds(_reference, st.sampled_from(["onTop", "near", "hasBoundingBox", "hasPose"]), _names),
    st.builds(_label, st.sampled_from("abc")),
    st.builds(_weight, st.sampled_from(["xsd:float", "xsd:integer"]), st.integers(0, 2)),
    st.builds(_height, st.sampled_from([0.0, 1.5])),
)
_properties = st.lists(_statements, max_size=4).map(tuple)
_times = st.sampled_from([10.0, 30.0, 70.0])
_fluents = st.builds(
    _fluent, _names, st.just(UNKNOWN) | st.builds(_soon_after, _times), _properties
)
_command = st.one_of(
    st.builds(AssertFluent, _fluents, merge=st.just(True)),
    st.builds(RefineFluent, _names, properties=_properties),
    st.builds(EndFluent, _names, st.builds(Interval.at, _times)),
    st.builds(CorrectFluent, _fluents, st.just("measured again")),
)
# Fluents are not the business of updates: these speak of other things, and of classes.
_updates = st.sampled_from(
    [
        "INSERT DATA { GRAPH <urn:notes> { <urn:x> upper:label 'b' ; upper:near race:kitchen } }",
        "INSERT DATA { GRAPH <urn:more> { <urn:x> upper:label 'a' } }",
        "DELETE DATA { GRAPH <urn:notes> { <urn:x> upper:label 'b' } }",
        "DROP SILENT GRAPH <urn:notes>",
        "CREATE SILENT GRAPH <urn:empty>",
        "INSERT DATA { race:kitchen upper:label 'a' ; upper:near race:hall }",
        "INSERT DATA { race:hall a race:FloorArea ; upper:hasBoundingBox fluent:BBox1 }",
        "DELETE WHERE { race:hall ?p ?o }",
        "INSERT DATA { race:Drinkware rdfs:subClassOf race:PersonalItem }",
        "DELETE DATA { race:Drinkware rdfs:subClassOf race:PersonalItem }",
    ]
)
Step = tuple[list[Command] | str | int, bool]
_step: st.SearchStrategy[Step] = st.tuples(
    st.one_of(st.lists(_command, min_size=1, max_size=4), _updates, st.integers(0, 1)),
    st.booleans(),
)


class Witness:
    """A board, and what every query answered at every commit."""

    def __init__(self, folder: Path) -> None:
        base = folder / "base.ttl"
        base.write_text(ONTOLOGY, encoding="utf-8")
        self.board = Blackboard.open(None, builtin_ontologies=False, ontologies=[base])
        self._told = threading.Condition()
        self._last = 0
        self.board.listen(self._on_commits)
        self._file = folder / "extra.ttl"
        self.truth: dict[str, dict[int, Bag]] = {name: {} for name in QUERIES}
        self.perform([AssertFluent(Fluent("Pose9", "Pose"))])

    def perform(self, step: list[Command] | str | int) -> None:
        """Carries out a step, and notes the answers; a refused batch changes nothing."""
        if isinstance(step, int):
            self.change_ontology(step)
        elif isinstance(step, str):
            with contextlib.suppress(ProtectedStatement):
                self.board.graphs.update(step, "test").result()
        else:
            with contextlib.suppress(IntervalReversed, NotARefinement, UnknownFluent):
                self.board.execute(step, "test")
        self.note()

    def change_ontology(self, number: int) -> None:
        self._file.write_text(CHANGES_OF_ONTOLOGY[number], encoding="utf-8")
        self.board.load_ontologies([self._file])

    def _on_commits(self, commits: Sequence[Commit]) -> None:
        with self._told:
            self._last = commits[-1].number
            self._told.notify_all()

    def note(self) -> None:
        with self._told:
            assert self._told.wait_for(lambda: self._last >= self.board.commit, 20.0)
        for name, text in QUERIES.items():
            fresh = bag_of(self.board.query(text), relabel=PARSED[name].makes_blank_nodes)
            self.truth[name][self.board.commit] = fresh


PARSED = {name: parse(text) for name, text in QUERIES.items()}


def follow(messages: list[Message], truth: dict[int, Bag], state: Bag | None = None) -> Bag:
    """The result that the messages lead to; every step of it is compared with the truth."""
    for message in messages:
        if isinstance(message, Snapshot):
            state = dict(message.answer.bag)
        elif isinstance(message, Delta):
            assert state is not None
            assert state == truth[message.since]
            assert apply(state, message.change.difference)
        elif isinstance(message, Resumed):
            assert state is not None
        else:
            # A gap or a lag: what follows is a snapshot.
            assert isinstance(message, Gap | Lagged)
            state = None
            continue
        assert state == truth[message.commit]
    return {} if state is None else state


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("ontologies")


@contextlib.contextmanager
def witnessed(folder: Path, **limits: float) -> Generator[tuple[Witness, SubscriptionRegistry]]:
    witness = Witness(folder)
    registry = SubscriptionRegistry(
        witness.board, SubscriptionSettings.model_validate({"reevaluation_share": 1.0, **limits})
    )
    try:
        yield witness, registry
    finally:
        registry.close()
        witness.board.close()


@settings(max_examples=20, phases=(Phase.explicit, Phase.generate))
@given(
    first_tier=st.sampled_from([1, 2, 3, 4]),
    before=st.lists(_step, max_size=3),
    after=st.lists(_step, min_size=1, max_size=8),
)
def test_snapshot_and_deltas_lead_to_the_fresh_result(
    folder: Path, first_tier: int, before: list[Step], after: list[Step]
) -> None:
    with witnessed(folder, first_tier=first_tier) as (witness, registry):
        for step, _ in before:
            witness.perform(step)
        opened = {name: registry.open(text, "both") for name, text in QUERIES.items()}
        for step, waits in after:
            witness.perform(step)
            if waits:
                assert registry.wait_until(witness.board.commit, 20.0)
        assert registry.wait_until(witness.board.commit, 20.0)
        for name, subscription in opened.items():
            truth = witness.truth[name]
            assert follow(subscription.poll(), truth) == truth[witness.board.commit], name


@settings(max_examples=12, phases=(Phase.explicit, Phase.generate))
@given(
    limits=st.sampled_from(
        [{}, {"linger_s": 0.0}, {"ring_deltas": 1}, {"replay_commits": 0}, {"queue_messages": 2}]
    ),
    before=st.lists(_step, max_size=4),
    away=st.lists(_step, max_size=4),
    after=st.lists(_step, max_size=3),
)
def test_client_that_resumes_misses_nothing(
    folder: Path,
    limits: dict[str, float],
    before: list[Step],
    away: list[Step],
    after: list[Step],
) -> None:
    with witnessed(folder, **limits) as (witness, registry):
        opened = {name: registry.open(text, "both") for name, text in QUERIES.items()}
        states: dict[str, tuple[int, Bag]] = {}
        for step, _ in before:
            witness.perform(step)
        assert registry.wait_until(witness.board.commit, 20.0)
        for name, subscription in opened.items():
            state, seen = follow_until(subscription, registry, witness.truth[name])
            states[name] = seen, state
            subscription.close()
        for step, _ in away:
            witness.perform(step)
        again = {
            name: registry.open(text, "both", since=states[name][0])
            for name, text in QUERIES.items()
        }
        for step, _ in after:
            witness.perform(step)
        assert registry.wait_until(witness.board.commit, 20.0)
        for name, subscription in again.items():
            truth = witness.truth[name]
            state, _ = follow_until(subscription, registry, truth, states[name][1])
            assert state == truth[witness.board.commit], name


def follow_until(
    subscription: Subscription,
    registry: SubscriptionRegistry,
    truth: dict[int, Bag],
    state: Bag | None = None,
) -> tuple[Bag, int]:
    """The result and the commit that a subscription's messages lead to, until none are left."""
    commit = 0
    while messages := subscription.poll():
        state = follow(messages, truth, state)
        commit = max(commit, *(getattr(message, "commit", 0) for message in messages))
        # A subscriber that lagged is sent a snapshot once it has caught up.
        assert registry.wait_until(0, 20.0)
    assert state is not None
    return state, commit


@settings(max_examples=3, phases=(Phase.explicit, Phase.generate))
@given(first_tier=st.sampled_from([1, 3, 4]), steps=st.lists(_step, min_size=20, max_size=30))
def test_writers_that_do_not_wait_lead_to_the_same_result(
    folder: Path, first_tier: int, steps: list[Step]
) -> None:
    with witnessed(folder, first_tier=first_tier) as (witness, registry):
        opened = {name: registry.open(text, "both") for name, text in QUERIES.items()}
        for commands, _ in steps:
            if isinstance(commands, int):
                witness.change_ontology(commands)
            elif isinstance(commands, str):
                with contextlib.suppress(ProtectedStatement):
                    witness.board.graphs.update(commands, "test")
            else:
                witness.board.submit(commands, "test")
        witness.perform([AssertFluent(Fluent("Pose8", "Pose"))])
        last = witness.board.commit
        assert registry.wait_until(last, 20.0)
        for name, subscription in opened.items():
            state: Bag = {}
            seen = 0
            for message in subscription.poll():
                if isinstance(message, Snapshot):
                    state = dict(message.answer.bag)
                else:
                    assert isinstance(message, Delta)
                    assert message.since >= seen
                    assert apply(state, message.change.difference), name
                seen = message.commit
            assert state == witness.truth[name][last], name
