"""Standing queries: all of them, kept in step with the board; knows nothing of threads.

The results of queries are exact at commits. A full evaluation sees the newest commit, so before it
counts, all commits up to that one are routed: those that touched the footprint are covered by it,
and the difference to the result before is the delta over them.

Queries at now see the fluents that hold, so the clock changes them, too. They are exact at a commit
and a time. The time goes on between commits, see time_keeper.py.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable

from fluentboard.board.events import Commit, StatementsChanged
from fluentboard.board.subscriptions.changes import CommitChange, EventChange
from fluentboard.board.subscriptions.held import HeldCommit, time_passed
from fluentboard.board.subscriptions.messages import Change, Failed
from fluentboard.board.subscriptions.planner import plan
from fluentboard.board.subscriptions.query import ParsedQuery
from fluentboard.board.subscriptions.reevaluate import Board, Reevaluation, evaluate
from fluentboard.board.subscriptions.results import NO_DIFFERENCE, Bag
from fluentboard.board.subscriptions.router import Concerned, Router
from fluentboard.board.subscriptions.schema import Schema
from fluentboard.board.subscriptions.semi_naive import SemiNaive, moves_of
from fluentboard.board.subscriptions.settings import SubscriptionSettings
from fluentboard.board.subscriptions.standing import Evaluated, Names, Plan, StandingQuery, net
from fluentboard.board.subscriptions.subscription import Subscription
from fluentboard.board.subscriptions.time_keeper import TimeKeeper
from fluentboard.errors import FluentboardError
from fluentboard.model.interval import Certainty
from fluentboard_ontology import FLUENT

logger = logging.getLogger(__name__)

_ADVANCE_TRIES = 4
_FLUENT = "<" + FLUENT


class StandingQueries:
    """All standing queries of a board, and what becomes of them. Used by one thread.

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
        self._routers: dict[Certainty | None, Router] = {None: Router()}
        self._time = TimeKeeper(board)
        self._stale: dict[StandingQuery, None] = {}
        self._schema = Schema(board.vocabulary)
        self.routed = 0
        self._ontology_routed = 0
        self._spoken_of: set[str] = set()
        for change in outside:
            self._note_outside(change)

    def __len__(self) -> int:
        return sum(map(len, self._routers.values()))

    @property
    def next_change_s(self) -> float:
        """When the clock alone changes what a query sees next, in seconds; infinite if never."""
        return self._time.next_s()

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
        spread = [(self._routers[None], change)]
        for at in self._time:
            held = HeldCommit(commit, change.vocabulary, change, at, self._time.at_s)
            spread.append((self._routers[at], held))
        concerned = [router.concerned(seen, self._spoken_of) for router, seen in spread]
        for outside in commit.statements:
            self._note_outside(outside)
        for (router, seen), found in zip(spread, concerned, strict=True):
            self._spread(router, seen, found)
        self._time.note(commit)
        self.routed = max(self.routed, commit.number)
        if commit.statements:
            self._ontology_routed = self.routed

    def pass_time(self) -> None:
        """Follows the board's clock: what began or ceased to hold changes the queries at now."""
        if len(self._time):
            self._pass_to(self._board.clock.now_s())

    def _pass_to(self, now_s: float) -> None:
        if self._time.went_back(now_s, self.routed):
            vocabulary = self._schema.vocabulary
            for at in self._time:
                for standing in self._routers[at]:
                    standing.forget_past(self.routed, now_s)
                    back = time_passed([], self.routed, vocabulary, now_s, now_s)
                    standing.pending.append(back)
                    self._stale[standing] = None
            return
        for at, passed in self._time.pass_to(now_s, self.routed, self._schema.vocabulary):
            router = self._routers[at]
            self._spread(router, passed, router.concerned(passed, self._spoken_of))

    def _spread(self, router: Router, change: CommitChange, concerned: Concerned) -> None:
        for standing in concerned.touched:
            self._stale[standing] = None
        # While a query is stale it gathers all that its next evaluation covers.
        told = {**concerned.touched, **concerned.candidates, **concerned.told}
        told.update((s, None) for s in self._stale if s.tells_events and s.at == router.at)
        for standing in told:
            if standing in self._stale:
                standing.pending.append(change)
            else:
                self._step(standing, change, concerned.candidates.get(standing, []))

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

    def _start(self, standing: StandingQuery, subscription: Subscription) -> bool:
        # Routed to from now on, and stale: no commit after the evaluation can be overlooked.
        router = self._routers.setdefault(standing.at, Router(standing.at))
        router.add(standing)
        self._stale[standing] = None
        try:
            found = self._evaluate(standing)
        except FluentboardError as problem:
            self._forget(standing)
            subscription.put(Failed(problem))
            return False
        router.remove(standing)
        standing.start(found.commit, found.at_s, found.plan, found.solutions)
        router.add(standing)
        self._resume(standing, found.commit)
        return True

    def _reevaluate(self, standing: StandingQuery) -> None:
        try:
            if isinstance(standing.plan, SemiNaive) and self._advance(standing, standing.plan):
                return
            found = self._evaluate(standing)
        except FluentboardError as problem:
            logger.warning("a standing query failed and is given up: %s", problem)
            self._fail(standing, problem)
            return
        covered = [change for change in standing.pending if found.covers(change)]
        if covered:
            router = self._routers[standing.at]
            router.remove(standing)
            outcome = standing.replace(covered, found)
            router.add(standing)
            self._tell(standing, *outcome)
        self._resume(standing, found.commit)

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
                commit, _, found = self._ask(standing, question)
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

    def _evaluate(self, standing: StandingQuery) -> Evaluated:
        """A full evaluation, with all commits and the time up to its own routed."""
        while True:
            routed, schema, chosen = self.routed, self._schema, standing.plan
            if standing.schema is not schema:
                chosen = self._plan(standing.query, standing.at)
            commit, at_s, solutions = self._ask(standing, chosen.view.text)
            if at_s is not None:
                # First: a commit that the evaluation has not seen changes what held at that time.
                self._pass_to(at_s)
            if not self._arrive(commit):
                raise FluentboardError(
                    f"the board does not tell of commit {commit} though queries see it; look for "
                    "errors in its log, then subscribe again"
                )
            # An ontology is applied in several steps, which a query may fall between. All of them
            # are done when the commit is told of, so then it is asked again.
            if self._ontology_routed <= routed:
                standing.schema = schema
                return Evaluated(commit, at_s, chosen, solutions)

    def _ask(self, standing: StandingQuery, text: str) -> tuple[int, float | None, Bag]:
        try:
            return evaluate(
                self._board,
                text,
                certainty=standing.at,
                relabel=standing.query.makes_blank_nodes,
                limit=self._settings.result_solutions,
            )
        except FluentboardError:
            raise
        except Exception as problem:
            # One query must not stop the others, whatever is wrong with it.
            logger.exception("a standing query could not be evaluated: %s", text)
            raise FluentboardError(f"the query could not be evaluated: {problem}") from problem

    def _plan(self, query: ParsedQuery, at: Certainty | None) -> Plan:
        follows_clock = at is not None
        return plan(query, self._schema, self._settings.first_tier, follows_clock=follows_clock)

    def _resume(self, standing: StandingQuery, commit: int) -> None:
        """Goes on after a full evaluation that is exact at a commit (and at the present time)."""
        later = [change for change in standing.pending if change.number > commit]
        standing.pending = []
        self._stale.pop(standing, None)
        for number, change in enumerate(later):
            if isinstance(standing.plan, Reevaluation | SemiNaive) or change.commit.statements:
                standing.pending = later[number:]
                self._stale[standing] = None
                return
            self._step(standing, change, change.events)

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
        self._routers[standing.at].update_names(standing, names)
        if change is not None:
            for subscription in standing.subscribers:
                subscription.put_change(change)

    def _fail(self, standing: StandingQuery, problem: FluentboardError) -> None:
        self._forget(standing)
        for subscription in standing.subscribers:
            subscription.put(Failed(problem))

    def _forget(self, standing: StandingQuery) -> None:
        router = self._routers[standing.at]
        router.remove(standing)
        router.update_names(standing, Names(set(), set(standing.names)))
        self._stale.pop(standing, None)
        if standing.at is not None and not len(router):
            del self._routers[standing.at]
            self._time.leave(standing.at)
