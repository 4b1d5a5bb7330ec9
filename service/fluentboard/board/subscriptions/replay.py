"""What a standing query would have told from a past commit on, computed from the journal.

This is how a client resumes when the query's own memory does not reach back: after a restart of the
service, or when it stayed away for long.
"""

from __future__ import annotations

from collections.abc import Sequence, Set

from fluentboard.board.events import Commit
from fluentboard.board.subscriptions.changes import CommitChange
from fluentboard.board.subscriptions.messages import Change
from fluentboard.board.subscriptions.reevaluate import Reevaluation
from fluentboard.board.subscriptions.results import NO_DIFFERENCE, Difference, apply
from fluentboard.board.subscriptions.semi_naive import SemiNaive
from fluentboard.board.subscriptions.settings import SubscriptionSettings
from fluentboard.board.subscriptions.standing import StandingQuery, net
from fluentboard.board.subscriptions.touch_index import TouchIndex
from fluentboard.board.vocabulary import Vocabulary


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


def _untouched(
    standing: StandingQuery, changes: Sequence[CommitChange]
) -> list[tuple[CommitChange, Difference]] | None:
    """No difference for each commit, or None if one of them touches the footprint."""
    footprint: TouchIndex[StandingQuery] = TouchIndex()
    footprint.add(standing, standing.query.footprint.shapes)
    if any(footprint.touched(event.statements) for change in changes for event in change.events):
        return None
    return [(change, NO_DIFFERENCE) for change in changes]
