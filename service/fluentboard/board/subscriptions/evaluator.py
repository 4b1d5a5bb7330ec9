"""Keeps all standing queries in step with the board; knows nothing of threads.

The results of queries are exact at commits. A full evaluation sees the newest commit, so before it
counts, all commits up to that one are routed: those that touched the footprint are covered by it,
and the difference to the result before is the delta over them.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable

from fluentboard.board.events import Commit, StatementsChanged
from fluentboard.board.subscriptions.changes import CommitChange, EventChange
from fluentboard.board.subscriptions.messages import Change, Failed, Gap, Resumed
from fluentboard.board.subscriptions.planner import plan
from fluentboard.board.subscriptions.query import ParsedQuery
from fluentboard.board.subscriptions.reevaluate import Board, Reevaluation, evaluate
from fluentboard.board.subscriptions.replay import replayed
from fluentboard.board.subscriptions.results import NO_DIFFERENCE, Bag
from fluentboard.board.subscriptions.router import Router
from fluentboard.board.subscriptions.schema import Schema
from fluentboard.board.subscriptions.semi_naive import SemiNaive, moves_of
from fluentboard.board.subscriptions.settings import SubscriptionSettings
from fluentboard.board.subscriptions.standing import Names, Plan, StandingQuery, net
from fluentboard.board.subscriptions.subscription import Subscription
from fluentboard.errors import FluentboardError
from fluentboard_ontology import FLUENT

logger = logging.getLogger(__name__)

_ADVANCE_TRIES = 4
_FLUENT = "<" + FLUENT


class Evaluator:
    """All standing queries of a board. Used by one thread.

    Args:
        board: evaluates queries.
        settings: bounds.
        arrive: waits until commits up to the given one have been given to `route`; False if that
            takes unreasonably long.
        outside: what ontologies and graph updates have changed so far.

    Attributes:
        routed: the last commit that was routed.
    """

    def __init__(
        self,
        board: Board,
        settings: SubscriptionSettings,
        arrive: Callable[[int], bool],
        outside: Iterable[StatementsChanged] = (),
    ) -> None:
        self._board = board
        self._settings = settings
        self._arrive = arrive
        self._router = Router()
        self._stale: dict[StandingQuery, None] = {}
        self._schema = Schema(board.vocabulary)
        self.routed = 0
        self._ontology_routed = 0
        # Queries without subscribers, and until when they linger; the first to leave comes first.
        self._idle: dict[StandingQuery, float] = {}
        self._spoken_of: set[str] = set()
        for change in outside:
            self._note_outside(change)

    def __len__(self) -> int:
        return len(self._router)

    @property
    def has_work(self) -> bool:
        """Some standing query is to be evaluated again."""
        return bool(self._stale)

    def begin_after(self, commit: int) -> None:
        """Has routing begin after a commit; there are no queries yet."""
        self.routed = max(self.routed, commit)

    def route(self, commit: Commit) -> None:
        """Takes note of a commit: incremental queries change now, others become stale."""
        if commit.number <= self.routed and not commit.statements:
            return
        if any(change.may_declare for change in commit.statements):
            self._schema = Schema(self._board.vocabulary)
        change = CommitChange(commit, self._schema.vocabulary)
        concerned = self._router.concerned(change, self._spoken_of)
        for outside in commit.statements:
            self._note_outside(outside)
        for standing in concerned.touched:
            self._stale[standing] = None
        # While a query is stale it gathers all that its next evaluation covers.
        told = {**concerned.touched, **concerned.candidates, **concerned.told}
        told.update((s, None) for s in self._stale if s.tells_events)
        for standing in told:
            if standing in self._stale:
                standing.pending.append(change)
            else:
                self._step(standing, change, concerned.candidates.get(standing, []))
        self.routed = max(self.routed, commit.number)
        if commit.statements:
            self._ontology_routed = self.routed

    def _note_outside(self, change: StatementsChanged) -> None:
        """Notes fluents that an ontology or a graph update says something of, too.

        What they contribute to a query does not follow from their events alone.
        """
        if change.graph:
            return
        for line in change.added.splitlines():
            subject = line.partition(" ")[0]
            if subject.startswith(_FLUENT):
                self._spoken_of.add(subject[len(_FLUENT) : -1])

    def reevaluate_next(self) -> None:
        """Evaluates the query that has been stale for longest; does nothing if there is none."""
        standing = next(iter(self._stale), None)
        if standing is not None:
            self._reevaluate(standing)

    def open(self, subscription: Subscription, query: ParsedQuery) -> None:
        """Serves a new subscriber: the snapshot, or what it missed since it left."""
        request = subscription.request
        since = request.since
        standing = self._router.find(query.text)
        if standing is None:
            chosen = self._plan(query)
            standing = StandingQuery(query, chosen, self._schema, self._settings)
            if not self._start(standing, subscription):
                return
        if since is not None and since > standing.exact_at(self.routed):
            self._arrive(min(since, self._board.commit))
            while standing in self._stale and standing.exact_at(self.routed) < since:
                self._reevaluate(standing)
        if request.mode != "bindings" and not standing.tells_events:
            names = standing.tell_events(standing.exact_at(self.routed))
            self._router.update_names(standing, Names(names, set()))
        self._idle.pop(standing, None)
        standing.subscribers[subscription] = None
        if since is None:
            self._snapshot(standing, subscription)
            return
        missed = self._missed(standing, since, events=request.mode != "bindings")
        if missed is None:
            subscription.put(Gap(since, standing.exact_at(self.routed)))
            self._snapshot(standing, subscription)
            return
        subscription.put(Resumed(since))
        for change in missed:
            subscription.put_change(change)

    def refresh(self, subscription: Subscription) -> None:
        """Sends a snapshot to a subscriber that lagged."""
        standing = self._router.find(subscription.request.query)
        if standing is not None and subscription in standing.subscribers:
            self._snapshot(standing, subscription)

    def close(self, subscription: Subscription, now_s: float) -> None:
        """Lets a subscriber go; the query stays for a while, should it come back."""
        standing = self._router.find(subscription.request.query)
        if standing is not None and subscription in standing.subscribers:
            del standing.subscribers[subscription]
            if not standing.subscribers:
                self._idle[standing] = now_s + self._settings.linger_s

    def retire(self, now_s: float) -> float | None:
        """Forgets queries that have been without subscribers for too long.

        Returns:
            When the next one is due, on the monotonic clock; None if none is idle.
        """
        # They all linger for equally long, so the first is due first.
        for standing, end_s in list(self._idle.items()):
            if end_s > now_s:
                return end_s
            self._forget(standing)
        return None

    def _start(self, standing: StandingQuery, subscription: Subscription) -> bool:
        # Routed to from now on, and stale: no commit after the evaluation can be overlooked.
        self._router.add(standing)
        self._stale[standing] = None
        try:
            commit, chosen, solutions = self._evaluate(standing)
        except FluentboardError as problem:
            self._forget(standing)
            subscription.put(Failed(problem))
            return False
        self._router.remove(standing)
        standing.start(commit, chosen, solutions)
        self._router.add(standing)
        self._resume(standing, commit)
        return True

    def _reevaluate(self, standing: StandingQuery) -> None:
        try:
            if isinstance(standing.plan, SemiNaive) and self._advance(standing, standing.plan):
                return
            commit, chosen, solutions = self._evaluate(standing)
        except FluentboardError as problem:
            logger.warning("a standing query failed and is given up: %s", problem)
            self._fail(standing, problem)
            return
        covered = [change for change in standing.pending if change.number <= commit]
        if covered:
            self._router.remove(standing)
            outcome = standing.replace(covered, chosen, solutions)
            self._router.add(standing)
            self._tell(standing, *outcome)
        self._resume(standing, commit)

    def _advance(self, standing: StandingQuery, join: SemiNaive) -> bool:
        """Evaluates a join for the changed statements alone; False if that does not do."""
        for _ in range(_ADVANCE_TRIES):
            covered = list(standing.pending)
            if any(change.commit.statements for change in covered):
                return False
            moves = moves_of(covered)
            question = join.question(moves)
            if question is None:
                return False
            found: Bag = {}
            if question:
                commit, found = self._ask(standing, question)
                if not self._arrive(commit):
                    return False
                if any(change.number <= commit for change in standing.pending[len(covered) :]):
                    # The answer reflects later commits too: ask again, for those as well.
                    continue
            outcome = standing.apply(covered, join.advance(moves, found))
            if outcome is None:
                self._complain(standing, covered[-1])
                return False
            self._tell(standing, *outcome)
            self._resume(standing, covered[-1].number)
            return True
        return False

    def _evaluate(self, standing: StandingQuery) -> tuple[int, Plan, Bag]:
        """A full evaluation and its commit, with all commits up to that one routed."""
        while True:
            routed, schema = self.routed, self._schema
            chosen = standing.plan if standing.schema is schema else self._plan(standing.query)
            commit, solutions = self._ask(standing, chosen.view.text)
            if not self._arrive(commit):
                raise FluentboardError(
                    f"the board does not tell of commit {commit} though queries see it; look for "
                    "errors in its log, then subscribe again"
                )
            # An ontology is applied in several steps, which a query may fall between. All of them
            # are done when the commit is told of, so then it is asked again.
            if self._ontology_routed <= routed:
                standing.schema = schema
                return commit, chosen, solutions

    def _ask(self, standing: StandingQuery, text: str) -> tuple[int, Bag]:
        try:
            return evaluate(
                self._board,
                text,
                relabel=standing.query.makes_blank_nodes,
                limit=self._settings.result_solutions,
            )
        except FluentboardError:
            raise
        except Exception as problem:
            # One query must not stop the others, whatever is wrong with it.
            logger.exception("a standing query could not be evaluated: %s", text)
            raise FluentboardError(f"the query could not be evaluated: {problem}") from problem

    def _plan(self, query: ParsedQuery) -> Plan:
        return plan(query, self._schema, self._settings.first_tier)

    def _resume(self, standing: StandingQuery, commit: int) -> None:
        """Goes on after a full evaluation that is exact at a commit."""
        later = [change for change in standing.pending if change.number > commit]
        standing.pending = []
        self._stale.pop(standing, None)
        for number, change in enumerate(later):
            if isinstance(standing.plan, Reevaluation | SemiNaive) or change.commit.statements:
                standing.pending = later[number:]
                self._stale[standing] = None
                return
            self._step(standing, change, list(change.events))

    def _step(
        self, standing: StandingQuery, change: CommitChange, events: Iterable[EventChange]
    ) -> None:
        """Moves a query that is not stale over one commit, without evaluating it."""
        by = NO_DIFFERENCE
        if not isinstance(standing.plan, Reevaluation | SemiNaive):
            by = net(standing.plan.difference(event) for event in events)
        outcome = standing.apply([change], by)
        if outcome is None:
            self._complain(standing, change)
            standing.pending.append(change)
            self._stale[standing] = None
            return
        self._tell(standing, *outcome)

    def _complain(self, standing: StandingQuery, change: CommitChange) -> None:
        logger.error(
            "tier %s disagrees with the result of a standing query at commit %s; the query is "
            "evaluated again: %s",
            standing.plan.tier,
            change.number,
            standing.query.text,
        )

    def _tell(self, standing: StandingQuery, change: Change | None, names: Names) -> None:
        self._router.update_names(standing, names)
        if change is not None:
            for subscription in standing.subscribers:
                subscription.put_change(change)

    def _snapshot(self, standing: StandingQuery, subscription: Subscription) -> None:
        subscription.put_snapshot(standing.exact_at(self.routed), standing.answer())

    def _missed(self, standing: StandingQuery, since: int, *, events: bool) -> list[Change] | None:
        now = standing.exact_at(self.routed)
        if since > now:
            return None
        missed = standing.missed_after(since, events=events)
        if missed is None and now - since <= self._settings.replay_commits:
            return replayed(
                standing,
                list(self._board.commits(since, now)),
                self._schema.vocabulary,
                self._settings,
                spoken_of=self._spoken_of,
                tells_events=events,
            )
        return missed

    def _fail(self, standing: StandingQuery, problem: FluentboardError) -> None:
        self._forget(standing)
        for subscription in standing.subscribers:
            subscription.put(Failed(problem))

    def _forget(self, standing: StandingQuery) -> None:
        self._router.remove(standing)
        self._router.update_names(standing, Names(set(), set(standing.names)))
        self._stale.pop(standing, None)
        self._idle.pop(standing, None)
