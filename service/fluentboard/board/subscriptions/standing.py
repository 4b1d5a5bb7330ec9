"""A standing query as it lives: its present result, its past deltas, and who is told of changes."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import ClassVar, Protocol

from fluentboard.board.subscriptions.changes import CommitChange, EventChange, ToldEvent
from fluentboard.board.subscriptions.footprint import Shape
from fluentboard.board.subscriptions.messages import Answer, Change
from fluentboard.board.subscriptions.query import ParsedQuery
from fluentboard.board.subscriptions.reevaluate import Reevaluation
from fluentboard.board.subscriptions.results import (
    Bag,
    Difference,
    Solution,
    apply,
    difference,
    fluents_in,
)
from fluentboard.board.subscriptions.schema import Schema
from fluentboard.board.subscriptions.semi_naive import SemiNaive
from fluentboard.board.subscriptions.settings import SubscriptionSettings
from fluentboard.board.subscriptions.subscription import Subscription
from fluentboard.board.subscriptions.touch_index import matches
from fluentboard.board.subscriptions.view import View
from fluentboard.model.interval import Certainty


class Incremental(Protocol):
    """A tier that tells from an event alone how the result changes.

    An ontology makes the planner choose anew, so an instance lives with one vocabulary.
    """

    tier: ClassVar[int]

    @property
    def reason(self) -> str:
        """Why the tier is sound for the query."""
        ...

    @property
    def view(self) -> View:
        """How the result follows from the support that `difference` speaks of."""
        ...

    def support_of(self, solutions: Bag) -> Bag:
        """The support that the solutions of `view.text` give."""
        ...

    @property
    def keys(self) -> frozenset[Shape]:
        """A fluent without a statement of one of these shapes contributes nothing."""
        ...

    def difference(self, change: EventChange) -> Difference:
        """How the event changes the support of the result."""
        ...


Plan = Reevaluation | SemiNaive | Incremental


@dataclass(frozen=True, slots=True)
class Evaluated:
    """A full evaluation of a query.

    Attributes:
        commit: the commit that it is exact at.
        at_s: the time that it shows, of a query at now; else None.
        plan: how the query is evaluated from here on.
        solutions: of the plan's view.
    """

    commit: int
    at_s: float | None
    plan: Plan
    solutions: Bag

    def covers(self, change: CommitChange) -> bool:
        """The evaluation saw what came of a change."""
        if change.number <= self.commit:
            return True
        # What the clock alone changed came before the evaluation, whatever was routed meanwhile.
        return change.before == change.number


@dataclass(frozen=True, slots=True)
class Names:
    """Fluents that came into a result and that left it."""

    come: set[str]
    gone: set[str]


class StandingQuery:
    """One query text with all its subscribers. Used by the evaluator's thread alone.

    Attributes:
        query: the query.
        at: with which certainty a fluent must hold now to be seen; None sees the whole history.
        plan: how it is evaluated.
        schema: the class hierarchy that the plan was made with.
        bag: the support of the result (see view.py), exact at every commit up to the first of
            `pending`.
        pending: commits that may have changed the result since, not evaluated yet.
        subscribers: who is told, in the order they came.
    """

    def __init__(
        self,
        query: ParsedQuery,
        plan: Plan,
        schema: Schema,
        settings: SubscriptionSettings,
        at: Certainty | None = None,
    ) -> None:
        self.query = query
        self.at = at
        self.plan = plan
        self.schema = schema
        self.bag: Bag = {}
        self.pending: list[CommitChange] = []
        self.subscribers: dict[Subscription, None] = {}
        self._settings = settings
        self._answer: Answer | None = None
        self._ring: deque[Change] = deque()
        self._ring_solutions = 0
        self._ring_start = 0
        self._ring_start_s: float | None = None
        # How many solutions hold each fluent; kept once a subscriber wants events.
        self._names: Counter[str] | None = None
        self._events_start = 0

    @property
    def key(self) -> tuple[str, Certainty | None]:
        """What it is known by."""
        return self.query.text, self.at

    @property
    def tells_events(self) -> bool:
        """Deltas carry events, because somebody asked for them."""
        return self._names is not None

    @property
    def names(self) -> Iterable[str]:
        """Fluents in the result; empty unless `tells_events`."""
        return () if self._names is None else self._names.keys()

    def start(self, commit: int, at_s: float | None, plan: Plan, solutions: Bag) -> None:
        """Takes over the first evaluation."""
        self.plan = plan
        self.bag = plan.support_of(solutions)
        self._ring_start = commit
        self._ring_start_s = at_s

    def forget_past(self, commit: int, at_s: float | None) -> None:
        """Forgets the past deltas: the clock was set back."""
        self._ring.clear()
        self._ring_solutions = 0
        self._ring_start = commit
        self._ring_start_s = at_s

    def tell_events(self, commit: int) -> set[str]:
        """Has deltas after `commit` carry events; the fluents in the result at present."""
        self._names = Counter()
        self._events_start = commit
        for solution in self.bag:
            self._names.update(set(fluents_in(solution)))
        return set(self._names)

    def exact_at(self, routed: int) -> int:
        """The last commit at which the result is known to be `bag`.

        Args:
            routed: the last commit that was compared with the footprint.
        """
        return self.pending[0].before if self.pending else routed

    def exact_at_s(self, at_s: float) -> float | None:
        """The time at which the result of a query at now is known to be `bag`; else None.

        Args:
            at_s: the time up to which the clock was followed.
        """
        if self.at is None:
            return None
        return self.pending[0].since_s if self.pending else at_s

    def answer(self) -> Answer:
        """The present result, copied so that it stays as it is."""
        if self._answer is None:
            result = dict(self.plan.view.result(self.bag))
            self._answer = Answer(self.query.form, self.query.variables, result)
        return self._answer

    def replace(
        self, covered: Sequence[CommitChange], found: Evaluated
    ) -> tuple[Change | None, Names]:
        """Takes over a fresh evaluation, and perhaps a new plan, that covers some commits."""
        bag = found.plan.support_of(found.solutions)
        change = difference(self.plan.view.result(self.bag), found.plan.view.result(bag))
        self.plan = found.plan
        self.bag = bag
        return self._changed(covered, change, min(covered[-1].number, found.commit), found.at_s)

    def apply(
        self, covered: Sequence[CommitChange], change: Difference
    ) -> tuple[Change | None, Names] | None:
        """Takes over a difference of the support; None if it does not fit, then nothing changes."""
        if not apply(self.bag, change):
            return None
        return self._changed(
            covered,
            self.plan.view.difference(change, self.bag),
            covered[-1].number,
            covered[-1].at_s,
        )

    def missed_after(
        self, since: int, since_s: float | None = None, *, events: bool
    ) -> list[Change] | None:
        """The deltas after a commit, or None if they are not all known any more.

        Args:
            since: the last commit that was seen.
            since_s: of a query at now: the last time that was seen.
            events: the deltas are to carry events.
        """
        if since < self._ring_start or (events and since < self._events_start):
            return None
        if self._ring_start_s is not None and (since_s is None or since_s < self._ring_start_s):
            return None
        missed: list[Change] = []
        for change in self._ring:
            # Of queries over the whole history a commit tells all; others go on in time, too.
            time_comes = since_s is not None and change.at_s is not None and change.at_s > since_s
            if change.commit > since or time_comes:
                missed.append(change)
        if missed:
            first = missed[0]
            is_later = since_s is not None and first.since_s is not None and first.since_s < since_s
            if first.since < since or is_later:
                # Inside a coalesced delta: the state at that moment was never computed.
                return None
        return missed

    def _changed(
        self,
        covered: Sequence[CommitChange],
        change: Difference,
        commit: int,
        at_s: float | None,
    ) -> tuple[Change | None, Names]:
        if change:
            self._answer = None
        names = self._count_names(change)
        events = self._events(covered, change, names.gone)
        if not (change or events):
            return None, names
        told = Change(
            self.query.form,
            self.query.variables,
            covered[0].before,
            commit,
            change,
            events,
            bool(self.bag) if self.query.form == "ask" else None,
            covered[0].since_s,
            at_s,
        )
        self._remember(told)
        return told, names

    def _count_names(self, change: Difference) -> Names:
        come: set[str] = set()
        gone: set[str] = set()
        if self._names is None:
            return Names(come, gone)
        is_set = self.plan.view.kind == "set"
        for solution in change.removed:
            if is_set or solution not in self.bag:
                for name in set(fluents_in(solution)):
                    self._names[name] -= 1
                    if not self._names[name]:
                        del self._names[name]
                        gone.add(name)
        for solution, count in change.added.items():
            if is_set or self.bag.get(solution) == count:
                for name in set(fluents_in(solution)):
                    if not self._names[name]:
                        come.add(name)
                    self._names[name] += 1
        return Names(come - gone, gone - come)

    def _events(
        self, covered: Sequence[CommitChange], change: Difference, gone: set[str]
    ) -> tuple[tuple[int, ToldEvent], ...]:
        """The events to tell of.

        Those of fluents that are in the result before or after. If there are none although the
        result changed (a count, an ASK, a fluent that others complete), those that touched the
        footprint.
        """
        if self._names is None:
            return ()
        concerned = tuple(
            (commit.number, event.told)
            for commit in covered
            for event in commit.events
            if event.event.after.name in self._names or event.event.after.name in gone
        )
        if concerned or not change:
            return concerned
        return tuple(
            (commit.number, event.told)
            for commit in covered
            for event in commit.events
            if self._is_touched_by(event)
        )

    def _is_touched_by(self, event: EventChange) -> bool:
        return any(
            matches(shape, statement)
            for statement in event.statements
            for shape in self.query.footprint.shapes
        )

    def _remember(self, change: Change) -> None:
        self._ring.append(change)
        self._ring_solutions += len(change)
        while len(self._ring) > self._settings.ring_deltas or (
            self._ring_solutions > self._settings.ring_solutions
        ):
            oldest = self._ring.popleft()
            self._ring_solutions -= len(oldest)
            self._ring_start = oldest.commit
            self._ring_start_s = oldest.at_s


def net(differences: Iterable[Difference]) -> Difference:
    """One difference for several in a row."""
    several = list(differences)
    if len(several) == 1:
        # Nearly always; and a difference never both adds and removes a solution.
        return several[0]
    total: Counter[Solution] = Counter()
    for change in several:
        for solution, count in change.added.items():
            total[solution] += count
        for solution, count in change.removed.items():
            total[solution] -= count
    return Difference(
        {solution: count for solution, count in total.items() if count > 0},
        {solution: -count for solution, count in total.items() if count < 0},
    )
