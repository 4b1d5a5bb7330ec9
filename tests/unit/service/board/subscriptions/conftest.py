"""A board in memory whose commits are told of when the test says so."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, Literal

import pyoxigraph as ox
import pytest

from fluentboard.board.class_closure import use_class_closure
from fluentboard.board.commands import Command, decide, name_of
from fluentboard.board.events import Commit, FluentEvent, StatementsChanged
from fluentboard.board.store import QueryResults
from fluentboard.board.subscriptions.changes import CommitChange
from fluentboard.board.subscriptions.evaluator import Evaluator
from fluentboard.board.subscriptions.messages import Delta, Message, Mode, Snapshot
from fluentboard.board.subscriptions.planner import plan
from fluentboard.board.subscriptions.query import parse
from fluentboard.board.subscriptions.schema import Schema
from fluentboard.board.subscriptions.settings import SubscriptionSettings
from fluentboard.board.subscriptions.standing import Plan
from fluentboard.board.subscriptions.subscription import Subscription, SubscriptionRequest
from fluentboard.board.time_view import Perspective, TimeView
from fluentboard.board.time_views import TimedResults
from fluentboard.board.triples import event_lines
from fluentboard.board.vocabulary import Vocabulary, parse_statements
from fluentboard.clock import ReplayClock
from fluentboard.errors import InvalidInput
from fluentboard.model.fluent import Fluent
from fluentboard.model.interval import Certainty
from fluentboard_ontology import PREFIXES

ONTOLOGY = """
@prefix rdfs: <http://www.w3.org/2000/01/rdf-schema#> .
@prefix owl: <http://www.w3.org/2002/07/owl#> .
@prefix upper: <https://w3id.org/fluentboard/upper#> .
@prefix race: <https://w3id.org/fluentboard/race#> .
upper:Area a owl:Class .
race:FloorArea a owl:Class ; rdfs:subClassOf upper:Area .
race:Kitchenware a owl:Class .
race:Mug a owl:Class ; rdfs:subClassOf race:Kitchenware .
race:Plate a owl:Class ; rdfs:subClassOf race:Kitchenware .
race:Table a owl:Class .
upper:Pose a owl:Class .
upper:BBox a owl:Class .
"""


class FakeBoard:
    """Applies commits at once, tells of them when asked to."""

    def __init__(self) -> None:
        self.vocabulary = Vocabulary()
        self.clock = ReplayClock()
        self.questions: list[str] = []
        self.before_next_query: Callable[[], None] | None = None
        self._store = ox.Store()
        self._journal: list[Commit] = []
        self._untold: list[Commit] = []
        self._fluents: dict[str, Fluent] = {}
        self._listeners: list[Callable[[Sequence[Commit]], None]] = []
        self.load(ONTOLOGY)

    @property
    def commit(self) -> int:
        return len(self._journal)

    def load(self, turtle: str) -> Commit:
        """Replaces the ontology and tells of it."""
        triples = parse_statements(turtle, "test")
        self.vocabulary = Vocabulary(triples)
        closure = "".join(f"{s} {p} {o} .\n" for s, p, o in self.vocabulary.closure())
        text = "".join(f"{triple} .\n" for triple in triples)
        self._store.update(
            "DELETE { ?c ?p ?d } WHERE { ?c ?p ?d "
            "FILTER(STRSTARTS(STR(?p), 'https://w3id.org/fluentboard/board#')) }"
        )
        self._store.load((text + closure).encode(), format=ox.RdfFormat.N_TRIPLES)
        change = StatementsChanged("", text, "", "test", "digest")
        return self._commit(Commit(self.commit + 1, 1.0, "test", statements=(change,)), tell=True)

    def write(self, *commands: Command, tell: bool = True) -> Commit:
        """Executes a batch."""
        events: list[FluentEvent] = []
        for command in commands:
            event = decide(command, self._fluents.get(name_of(command)))
            if event is not None:
                events.append(event)
                self._fluents[name_of(command)] = event.after
                added, removed = event_lines(event, self.vocabulary)
                self._store.update(
                    f"DELETE DATA {{ {''.join(removed)} }} ; INSERT DATA {{ {''.join(added)} }}"
                )
        return self._commit(Commit(self.commit + 1, 1.0, "test", tuple(events)), tell=tell)

    def tell(self) -> None:
        """Tells of all commits not told of yet."""
        told, self._untold = self._untold, []
        if told:
            for listener in self._listeners:
                listener(told)

    def snapshot_query(self, sparql: str) -> tuple[int, QueryResults]:
        if self.before_next_query is not None:
            action, self.before_next_query = self.before_next_query, None
            action()
        self.questions.append(sparql)
        text = use_class_closure(sparql, PREFIXES, self.vocabulary.is_node)
        return self.commit, self._store.query(text, prefixes=dict(PREFIXES))

    def timed_query(self, sparql: str, *, at: Literal["now"], certainty: Certainty) -> TimedResults:
        raise NotImplementedError("queries at now are tested on the real board")

    def fluent(self, name: str, as_of: int | None = None) -> Fluent:
        return self._fluents[name]

    def past_query(
        self, sparql: str, commit: int, at_s: float | None, certainty: Certainty | None
    ) -> QueryResults:
        raise InvalidInput("this board has no past")

    def commit_at(self, wall_s: float) -> int:
        return self.commit

    def own_view(self, perspective: Perspective) -> TimeView:
        raise NotImplementedError("replays are tested on the real board")

    def bring_up(self, view: TimeView, commit: int, now_s: float) -> None:
        raise NotImplementedError("replays are tested on the real board")

    def coming(self, certainty: Certainty, at_s: float, as_of: int) -> list[tuple[float, str]]:
        return []

    def commits(self, after: int, up_to: int | None = None) -> Iterator[Commit]:
        yield from self._journal[after:up_to]

    def listen(self, callback: Callable[[Sequence[Commit]], None]) -> Callable[[], None]:
        self._listeners.append(callback)
        return lambda: self._listeners.remove(callback)

    def _commit(self, commit: Commit, *, tell: bool) -> Commit:
        self._journal.append(commit)
        self._untold.append(commit)
        if tell:
            self.tell()
        return commit


class Desk:
    """An evaluator over the fake board, which is told of commits at `settle`."""

    def __init__(self, board: Any, **settings: Any) -> None:
        self.board = board
        self._settings = SubscriptionSettings.model_validate(settings)
        self.evaluator = Evaluator(board, self._settings, self._arrive)
        self._told: list[Any] = []
        board.listen(self._told.extend)
        self.evaluator.begin_after(board.commit)

    def open(self, query: str, mode: Mode = "bindings", since: int | None = None) -> Subscription:
        subscription = Subscription(
            SubscriptionRequest(query, mode, since),
            "",
            self._settings,
            on_ready=None,
            on_drained=self.evaluator.refresh,
            on_close=lambda closed: self.evaluator.close(closed, now_s=0.0),
        )
        self.evaluator.open(subscription, parse(query))
        return subscription

    def settle(self) -> None:
        """Tells of everything and evaluates what is stale."""
        self._arrive(self.board.commit)
        while self.evaluator.has_work:
            self.evaluator.reevaluate_next()

    def _arrive(self, commit: int) -> bool:
        self.board.tell()
        for told in self._told:
            self.evaluator.route(told)
        self._told.clear()
        return self.evaluator.routed >= commit

    @staticmethod
    def outline(messages: list[Message]) -> list[tuple[str, int, int, int]]:
        """Kind, commit, and how many solutions came and went."""
        found: list[tuple[str, int, int, int]] = []
        for message in messages:
            if isinstance(message, Delta):
                change = message.change.difference
                came, went = sum(change.added.values()), sum(change.removed.values())
                found.append(("delta", message.commit, came, went))
            elif isinstance(message, Snapshot):
                count = sum(message.answer.bag.values())
                found.append(("snapshot", message.commit, count, 0))
            else:
                found.append((type(message).__name__.lower(), getattr(message, "commit", 0), 0, 0))
        return found


@pytest.fixture
def board() -> FakeBoard:
    return FakeBoard()


@pytest.fixture(scope="session")
def schema() -> Schema:
    return Schema(Vocabulary(parse_statements(ONTOLOGY, "test")))


@pytest.fixture
def plan_of(schema: Schema) -> Callable[[str], Plan]:
    """The plan of a query text."""
    return lambda text: plan(parse(text), schema)


@pytest.fixture
def change_of(board: FakeBoard) -> Callable[..., CommitChange]:
    """What the commit of some commands changes."""
    return lambda *commands: CommitChange(board.write(*commands), board.vocabulary)


@pytest.fixture
def desk_of(board: FakeBoard) -> Callable[..., Desk]:
    """An evaluator over the board, with other settings."""

    def make(**limits: Any) -> Desk:
        return Desk(board, **limits)

    return make


@pytest.fixture
def desk(board: FakeBoard) -> Desk:
    """An evaluator over the board."""
    return Desk(board)
