"""Evaluator: serves subscribers of standing queries, from the first message to the last.

Whoever comes is given a snapshot, or what it missed while it was away; whoever goes leaves its
query behind for a while, should it come back. Nothing here knows of threads.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from fluentboard.board.events import StatementsChanged
from fluentboard.board.subscriptions.messages import Answer, Change, Gap, Live, Resumed
from fluentboard.board.subscriptions.query import ParsedQuery
from fluentboard.board.subscriptions.reevaluate import Board
from fluentboard.board.subscriptions.replay import bridged, replayed, span
from fluentboard.board.subscriptions.results import difference
from fluentboard.board.subscriptions.settings import SubscriptionSettings
from fluentboard.board.subscriptions.standing import Names, StandingQuery
from fluentboard.board.subscriptions.standing_queries import StandingQueries
from fluentboard.board.subscriptions.subscription import Subscription, SubscriptionRequest


class Evaluator(StandingQueries):
    """The standing queries of a board and their subscribers. Used by one thread.

    Args:
        board: evaluates queries.
        settings: bounds.
        arrive: waits until commits up to the given one have been given to `route`; False if that
            takes unreasonably long.
        outside: what ontologies and graph updates have changed so far.
    """

    def __init__(
        self,
        board: Board,
        settings: SubscriptionSettings,
        arrive: Callable[[int], bool],
        outside: Iterable[StatementsChanged] = (),
    ) -> None:
        super().__init__(board, settings, arrive, outside)
        # Queries without subscribers, and until when they linger; the first to leave comes first.
        self._idle: dict[StandingQuery, float] = {}

    def open(self, subscription: Subscription, query: ParsedQuery) -> None:
        """Serves a new subscriber: the snapshot, or what it missed since it left."""
        request = subscription.request
        since = request.since
        standing = self._standing(subscription, query)
        if standing is None:
            return
        # A snapshot has all that was acknowledged before it was asked for.
        wanted = self._board.commit if since is None else min(since, self._board.commit)
        if wanted > standing.exact_at(self.routed):
            self._arrive(wanted)
            while standing in self._stale and standing.exact_at(self.routed) < wanted:
                self._reevaluate(standing)
            if self._find(request) is not standing:
                # It failed and was given up. A new one tells whether it fails now, too.
                self.open(subscription, query)
                return
        standing.subscribers[subscription] = None
        if since is None:
            self._snapshot(standing, subscription)
            return
        missed = self._missed(standing, since, request.since_s, events=request.mode != "bindings")
        if missed is None:
            subscription.put(Gap(since, standing.exact_at(self.routed)))
            self._snapshot(standing, subscription)
            return
        subscription.put(Resumed(since, request.since_s))
        for change in missed:
            subscription.put_change(change)

    def told(self, subscription: Subscription) -> tuple[int, float | None, Answer] | None:
        """The commit, time and result that a subscriber has been told; None if it is not here."""
        standing = self._find(subscription.request)
        if standing is None or subscription not in standing.subscribers:
            return None
        at_s = standing.exact_at_s(self._time.at_s)
        return standing.exact_at(self.routed), at_s, standing.answer()

    def adopt(
        self, subscription: Subscription, query: ParsedQuery, commit: int, answer: Answer
    ) -> None:
        """Goes on live with a subscriber that has been told a result elsewhere.

        Args:
            subscription: the subscriber.
            query: its query.
            commit: the commit at which it was told the result.
            answer: the result.
        """
        standing = self._standing(subscription, query)
        if standing is None:
            return
        standing.subscribers[subscription] = None
        events = subscription.request.mode != "bindings"
        missed = None
        if standing.at is None:
            self._arrive(min(commit, self._board.commit))
            missed = self._missed(standing, commit, None, events=events)
        if missed is None:
            at_s = standing.exact_at_s(self._time.at_s)
            now = standing.answer()
            by = difference(answer.bag, now.bag)
            exact_at = max(commit, standing.exact_at(self.routed))
            boolean = bool(now.bag) if query.form == "ask" else None
            form, variables = query.form, query.variables
            missed = [Change(form, variables, commit, exact_at, by, (), boolean, at_s, at_s)]
        subscription.put(Live(commit))
        for change in missed:
            subscription.put_change(change)

    def refresh(self, subscription: Subscription) -> None:
        """Sends a snapshot to a subscriber that lagged."""
        standing = self._find(subscription.request)
        if standing is not None and subscription in standing.subscribers:
            self._snapshot(standing, subscription)

    def close(self, subscription: Subscription, now_s: float) -> None:
        """Lets a subscriber go; the query stays for a while, should it come back."""
        standing = self._find(subscription.request)
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

    def _standing(self, subscription: Subscription, query: ParsedQuery) -> StandingQuery | None:
        """The standing query of a subscriber, started if need be; None if it cannot be."""
        request = subscription.request
        if request.at is not None:
            self._time.follow(request.at, self.routed)
        standing = self._find(request)
        if standing is None:
            chosen = self._plan(query, request.at)
            standing = StandingQuery(query, chosen, self._schema, self._settings, request.at)
            if not self._start(standing, subscription):
                return None
        if request.mode != "bindings" and not standing.tells_events:
            names = standing.tell_events(standing.exact_at(self.routed))
            self._routers[standing.at].update_names(standing, Names(names, set()))
        self._idle.pop(standing, None)
        return standing

    def _snapshot(self, standing: StandingQuery, subscription: Subscription) -> None:
        commit = standing.exact_at(self.routed)
        subscription.put_snapshot(commit, standing.answer(), standing.exact_at_s(self._time.at_s))

    def _missed(
        self, standing: StandingQuery, since: int, since_s: float | None, *, events: bool
    ) -> list[Change] | None:
        now = standing.exact_at(self.routed)
        if since > now or (since_s is not None and since_s > self._time.at_s):
            # The clock may have been set back since.
            return None
        missed = standing.missed_after(since, since_s, events=events)
        if missed is not None:
            return missed
        is_near = now - since <= self._settings.replay_commits
        commits = list(self._board.commits(since, now)) if is_near else None
        if standing.at is None and commits is not None:
            missed = replayed(
                standing,
                commits,
                self._schema.vocabulary,
                self._settings,
                spoken_of=self._spoken_of,
                tells_events=events,
            )
        if missed is not None:
            return missed
        at_s = standing.exact_at_s(self._time.at_s)
        if (events and commits is None) or (standing.at is not None and since_s is None):
            return None
        told = commits if events and commits is not None else ()
        covered = span((since, since_s), (now, at_s), told, self._schema.vocabulary)
        return bridged(self._board, standing, covered, self._settings, tells_events=events)

    def _forget(self, standing: StandingQuery) -> None:
        super()._forget(standing)
        self._idle.pop(standing, None)

    def _find(self, request: SubscriptionRequest) -> StandingQuery | None:
        router = self._routers.get(request.at)
        return None if router is None else router.find(request.query)
