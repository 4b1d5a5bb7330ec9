"""What a standing query would have told from a past commit on, computed from the journal.

This is how a client resumes when the query's own memory does not reach back: after a restart of the
service, or when it stayed away for long.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence, Set
from dataclasses import dataclass

from fluentboard.board.events import Commit
from fluentboard.board.subscriptions.changes import CommitChange
from fluentboard.board.subscriptions.messages import Change
from fluentboard.board.subscriptions.reevaluate import Board, Reevaluation
from fluentboard.board.subscriptions.results import (
    NO_DIFFERENCE,
    Difference,
    apply,
    bag_of,
    difference,
)
from fluentboard.board.subscriptions.semi_naive import SemiNaive
from fluentboard.board.subscriptions.settings import SubscriptionSettings
from fluentboard.board.subscriptions.standing import StandingQuery, net
from fluentboard.board.subscriptions.touch_index import TouchIndex
from fluentboard.board.vocabulary import Vocabulary
from fluentboard.errors import FluentboardError

logger = logging.getLogger(__name__)


def replayed(
    standing: StandingQuery,
    commits: Sequence[Commit],
    vocabulary: Vocabulary,
    settings: SubscriptionSettings,
    *,
    spoken_of: Set[str],
    tells_events: bool,
) -> list[Change] | None:
    """The deltas that some commits led to.

    Args:
        standing: the query with its present result, which is exact after the commits.
        commits: the last commits up to now.
        vocabulary: the present one.
        settings: bounds.
        spoken_of: fluents that are spoken of outside their events, too.
        tells_events: whether the deltas are to carry events.

    Returns:
        The deltas in order, or None if the commits alone do not tell: an ontology changed, or they
        touch a query that must be evaluated on the board as it was.
    """
    if any(commit.statements for commit in commits) or any(
        event.after.name in spoken_of for commit in commits for event in commit.events
    ):
        return None
    changes = [CommitChange(commit, vocabulary) for commit in commits]
    steps: list[tuple[CommitChange, Difference]] | None
    if isinstance(standing.plan, Reevaluation | SemiNaive):
        steps = _untouched(standing, changes)
    else:
        steps = [
            (change, net(standing.plan.difference(event) for event in change.events))
            for change in changes
        ]
    if steps is None:
        return None
    past = StandingQuery(standing.query, standing.plan, standing.schema, settings)
    past.bag = dict(standing.bag)
    for _, step in reversed(steps):
        if not apply(past.bag, Difference(step.removed, step.added)):
            return None
    if tells_events:
        past.tell_events(0)
    told: list[Change] = []
    for change, step in steps:
        outcome = past.apply([change], step)
        if outcome is None:
            return None
        if outcome[0] is not None:
            told.append(outcome[0])
    return told


@dataclass(frozen=True)
class Moment(CommitChange):
    """A moment at which nothing changed: where a span of the past begins or ends.

    Attributes:
        time_s: of a query at now: the time that was shown; else None.
    """

    time_s: float | None

    @property
    def before(self) -> int:
        """The commit itself."""
        return self.number

    @property
    def since_s(self) -> float | None:
        """The time that was shown."""
        return self.time_s

    @property
    def at_s(self) -> float | None:
        """The time that was shown."""
        return self.time_s


def span(
    begin: tuple[int, float | None],
    end: tuple[int, float | None],
    commits: Sequence[Commit],
    vocabulary: Vocabulary,
) -> list[CommitChange]:
    """All that happened between two moments, each a commit and, of a query at now, a time."""
    moments = [
        Moment(Commit(commit, 0.0, ""), vocabulary, time_s) for commit, time_s in (begin, end)
    ]
    return [moments[0], *(CommitChange(commit, vocabulary) for commit in commits), moments[1]]


def bridged(
    board: Board,
    standing: StandingQuery,
    covered: Sequence[CommitChange],
    settings: SubscriptionSettings,
    *,
    tells_events: bool,
) -> list[Change] | None:
    """One delta over a span of the past, by asking the board what it answered before it.

    Args:
        board: looks back.
        standing: the query with its present result, which is exact after the span.
        covered: what was missed, from `span`.
        settings: bounds.
        tells_events: whether the delta is to carry events.

    Returns:
        The delta, or nothing if nothing changed; None if the board cannot look back so far.
    """
    query, view = standing.query, standing.plan.view
    if not query.is_timeless:
        return None
    try:
        results = board.past_query(view.text, covered[0].before, covered[0].since_s, standing.at)
        solutions = bag_of(
            results, relabel=query.makes_blank_nodes, limit=settings.result_solutions
        )
    except (FluentboardError, ValueError, OSError, RuntimeError) as problem:
        logger.info("a subscriber is not told what it missed: %s", problem)
        return None
    past = StandingQuery(query, standing.plan, standing.schema, settings, standing.at)
    past.bag = view.support(solutions)
    if tells_events:
        past.tell_events(0)
    outcome = past.apply(covered, difference(past.bag, standing.bag))
    return None if outcome is None else [] if outcome[0] is None else [outcome[0]]


def _untouched(
    standing: StandingQuery, changes: Sequence[CommitChange]
) -> list[tuple[CommitChange, Difference]] | None:
    """No difference for each commit, or None if one of them touches the footprint."""
    footprint: TouchIndex[StandingQuery] = TouchIndex()
    footprint.add(standing, standing.query.footprint.shapes)
    if any(footprint.touched(event.statements) for change in changes for event in change.events):
        return None
    return [(change, NO_DIFFERENCE) for change in changes]
