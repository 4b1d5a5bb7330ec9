"""Nothing is forgotten: random commands against a dict, in memory and across restarts."""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path

import pyoxigraph as ox
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from fluentboard.board.blackboard import Blackboard
from fluentboard.board.commands import (
    AssertFluent,
    Command,
    EndFluent,
    RefineFluent,
    decide,
    name_of,
)
from fluentboard.board.triples import fluent_from_triples, fluent_iri
from fluentboard.clock import ReplayClock
from fluentboard.errors import FluentboardError
from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.interval import Interval

NAMES = st.sampled_from(["a", "b", "c", "d"])
TIMES = st.one_of(st.none(), st.sampled_from([1.0, 2.0, 3.5, 5.0, 8.25]))
TEXTS = st.text('aé"\\\n ', max_size=4)
VALUES = st.one_of(
    st.builds(Property, st.just("hasX"), st.just("xsd:float"), st.sampled_from([0.0, 0.5, -1.25])),
    st.builds(Property, st.just("hasPose"), st.just("Pose"), NAMES),
    st.builds(Property, st.just("hasResult"), st.just("xsd:string"), TEXTS),
)


@st.composite
def intervals(draw: st.DrawFn) -> Interval:
    one, other = draw(TIMES), draw(TIMES)
    if one is not None and other is not None and one > other:
        one, other = other, one
    return Interval(one, other)


class BoardAgainstDict(RuleBasedStateMachine):
    """The board agrees with a dict of fluents after any sequence of commands and restarts."""

    @initialize()
    def open(self) -> None:
        self.folder = Path(tempfile.mkdtemp(prefix="fluentboard-test-"))
        self.clock = ReplayClock(10.0)
        self.board = Blackboard.open(self.folder, durability="process", clock=self.clock)
        self.model: dict[str, Fluent] = {}
        self.highest = self.board.commit

    @rule(
        batch=st.lists(
            st.one_of(
                st.tuples(
                    st.just("assert"), NAMES, intervals(), intervals(), st.lists(VALUES, max_size=3)
                ),
                st.tuples(
                    st.just("refine"), NAMES, intervals(), intervals(), st.lists(VALUES, max_size=2)
                ),
                st.tuples(st.just("end"), NAMES, intervals(), intervals(), st.just([])),
            ),
            min_size=1,
            max_size=3,
        )
    )
    def write(self, batch: list[tuple[str, str, Interval, Interval, list[Property]]]) -> None:
        model = dict(self.model)
        expected: type[Exception] | None = None
        try:
            commands = [self._command(*entry) for entry in batch]
        except FluentboardError:
            return  # no such fluent can be built, so there is nothing to send
        try:
            for command in commands:
                event = decide(command, model.get(name_of(command)))
                if event is not None:
                    model[event.after.name] = event.after
        except FluentboardError as problem:
            expected = type(problem)
        outcome = self.board.submit(commands, "test").exception()
        assert (None if outcome is None else type(outcome)) is expected
        if expected is None:
            self.model = model
        assert self.board.commit >= self.highest
        self.highest = self.board.commit

    @staticmethod
    def _command(
        kind: str, name: str, start: Interval, finish: Interval, properties: list[Property]
    ) -> Command:
        if kind == "assert":
            return AssertFluent(Fluent(name, "Mug", start, finish, tuple(properties)))
        if kind == "refine":
            return RefineFluent(name, start, finish, tuple(properties))
        return EndFluent(name, finish)

    @rule()
    def restart(self) -> None:
        self.board.close()
        self.board = Blackboard.open(self.folder, durability="process", clock=self.clock)

    @rule()
    def lose_the_store(self) -> None:
        self.board.close()
        shutil.rmtree(self.folder / "store")
        self.board = Blackboard.open(self.folder, durability="process", clock=self.clock)

    @invariant()
    def board_and_dict_agree(self) -> None:
        assert len(self.board) == len(self.model)
        for name, expected in self.model.items():
            found = self.board.fluent(name)
            assert (found.class_name, found.start, found.finish, found.properties) == (
                expected.class_name,
                expected.start,
                expected.finish,
                expected.properties,
            )

    @invariant()
    def store_and_dict_agree(self) -> None:
        for name, expected in self.model.items():
            results = self.board.query(f"CONSTRUCT WHERE {{ <{fluent_iri(name)}> ?p ?o }}")
            assert isinstance(results, ox.QueryTriples)
            types = {str(p.value): p.type for p in expected.properties if p.is_reference}
            stored = fluent_from_triples(results, self.board.vocabulary, types.__getitem__)
            assert (stored.class_name, stored.start, stored.finish) == (
                expected.class_name,
                expected.start,
                expected.finish,
            )
            assert set(stored.properties) == set(expected.properties)

    def teardown(self) -> None:
        if hasattr(self, "board"):
            self.board.close()
            shutil.rmtree(self.folder)


TestBoardAgainstDict = BoardAgainstDict.TestCase
TestBoardAgainstDict.settings = settings(max_examples=10, stateful_step_count=12, deadline=None)
