"""What a commit, or the clock alone, changed of what holds now (pure).

A query at now sees only the fluents that hold. For it a fluent that begins to hold comes with all
its statements, and one that ceases to hold goes with them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import pyoxigraph as ox

from fluentboard.board.events import Commit, FluentRefined
from fluentboard.board.subscriptions.changes import (
    CommitChange,
    EventChange,
    FluentBegan,
    FluentCeased,
    ToldEvent,
)
from fluentboard.board.vocabulary import Statement, Vocabulary
from fluentboard.model.fluent import Fluent
from fluentboard.model.interval import Certainty
from fluentboard.model.relations import bounds_of, holding_period


def holds(fluent: Fluent, certainty: Certainty, at_s: float) -> bool:
    """The fluent holds at a time, with at least some certainty."""
    begin, end = holding_period(bounds_of(fluent), certainty)
    return begin <= at_s < end


@dataclass(frozen=True)
class HeldChange(EventChange):
    """What one event changed of what holds.

    Attributes:
        whole: the event as queries over the whole history see it.
        was_held: the fluent held before it.
        is_held: the fluent holds after it.
        by_clock: nothing was written; the time came.
    """

    whole: EventChange
    was_held: bool
    is_held: bool
    by_clock: bool = False

    @property
    def told(self) -> ToldEvent:
        """The event that a subscriber is told of."""
        if not self.by_clock:
            return self.event
        fluent = self.event.after
        return FluentBegan(fluent) if self.is_held else FluentCeased(fluent)

    @property
    def added(self) -> list[Statement]:
        """The statements that came."""
        if self.was_held and self.is_held:
            return self.whole.added
        return self.after

    @property
    def removed(self) -> list[Statement]:
        """The statements that went."""
        if self.was_held and self.is_held:
            return self.whole.removed
        return self.before

    @cached_property
    def after_quads(self) -> list[ox.Quad]:
        """All that can be seen of the fluent after the event."""
        return self.whole.after_quads if self.is_held else []

    @cached_property
    def before_quads(self) -> list[ox.Quad]:
        """All that could be seen of the fluent before the event."""
        return self.whole.before_quads if self.was_held else []

    @cached_property
    def after(self) -> list[Statement]:
        """All that can be seen of the fluent after the event."""
        return self.whole.after if self.is_held else []

    @cached_property
    def before(self) -> list[Statement]:
        """All that could be seen of the fluent before the event."""
        return self.whole.before if self.was_held else []


@dataclass(frozen=True)
class HeldCommit(CommitChange):
    """What a commit changed of what holds.

    Attributes:
        whole: the commit as queries over the whole history see it.
        certainty: with which certainty a fluent must hold to be seen.
        shown_s: the time that was shown before the commit and after it.
    """

    whole: CommitChange
    certainty: Certainty
    shown_s: float

    @property
    def since_s(self) -> float:
        """The time that was shown before it."""
        return self.shown_s

    @property
    def at_s(self) -> float:
        """The time that is shown after it."""
        return self.shown_s

    @cached_property
    def events(self) -> tuple[EventChange, ...]:
        """What the commit's events changed, in order."""
        found: list[EventChange] = []
        for change in self.whole.events:
            before = change.event.before
            was_held = before is not None and holds(before, self.certainty, self.shown_s)
            is_held = holds(change.event.after, self.certainty, self.shown_s)
            if was_held or is_held:
                found.append(HeldChange(change.event, self.vocabulary, change, was_held, is_held))
        return tuple(found)


@dataclass(frozen=True)
class TimePassed(CommitChange):
    """What the clock alone changed of what holds.

    Attributes:
        passed: the fluents that began or ceased to hold.
        shown_s: the times that were shown before and that are shown after.
    """

    passed: tuple[EventChange, ...]
    shown_s: tuple[float, float]

    @property
    def since_s(self) -> float:
        """The time that was shown before it."""
        return self.shown_s[0]

    @property
    def at_s(self) -> float:
        """The time that is shown after it."""
        return self.shown_s[1]

    @property
    def before(self) -> int:
        """No commit came with it."""
        return self.number

    @cached_property
    def events(self) -> tuple[EventChange, ...]:
        """What changed of each fluent."""
        return self.passed


def time_passed(
    changed: list[tuple[Fluent, bool]],
    commit: int,
    vocabulary: Vocabulary,
    since_s: float,
    at_s: float,
) -> TimePassed:
    """The change that the clock alone makes.

    Args:
        changed: fluents, each with whether it begins to hold (else it ceases to).
        commit: the last commit that was routed.
        vocabulary: as it is after that commit.
        since_s: the time that was shown before.
        at_s: the time that is shown after.
    """
    changes: list[EventChange] = []
    for fluent, begins in changed:
        event = FluentRefined(fluent, fluent)
        whole = EventChange(event, vocabulary)
        changes.append(HeldChange(event, vocabulary, whole, not begins, begins, by_clock=True))
    return TimePassed(Commit(commit, at_s, ""), vocabulary, tuple(changes), (since_s, at_s))
