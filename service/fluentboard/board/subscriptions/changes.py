"""What a commit changed, as statements that footprints can be compared with (pure)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import pyoxigraph as ox

from fluentboard.board.events import Commit, FluentEvent
from fluentboard.board.triples import event_lines, fluent_lines
from fluentboard.board.vocabulary import Statement, Vocabulary
from fluentboard.model.fluent import Fluent


def statement_of(line: str) -> Statement:
    """The statement of an N-Triples line, in the spacing that the board writes."""
    subject, predicate, rest = line.split(" ", 2)
    if rest.endswith(" .\n"):
        return subject, predicate, rest[:-3]
    return subject, predicate, rest.rstrip()[:-2]


@dataclass(frozen=True, slots=True)
class FluentBegan:
    """A fluent began to hold, by the clock alone."""

    after: Fluent

    kind = "began"


@dataclass(frozen=True, slots=True)
class FluentCeased:
    """A fluent ceased to hold, by the clock alone."""

    after: Fluent

    kind = "ceased"


ToldEvent = FluentEvent | FluentBegan | FluentCeased


@dataclass(frozen=True)
class EventChange:
    """What one event changed.

    Attributes:
        event: the event.
        vocabulary: gives short names their IRIs.
    """

    event: FluentEvent
    vocabulary: Vocabulary

    @property
    def told(self) -> ToldEvent:
        """The event that a subscriber is told of."""
        return self.event

    @cached_property
    def _moves(self) -> tuple[list[Statement], list[Statement]]:
        added, removed = event_lines(self.event, self.vocabulary)
        return [statement_of(line) for line in added], [statement_of(line) for line in removed]

    @property
    def added(self) -> list[Statement]:
        """The statements that came."""
        return self._moves[0]

    @property
    def removed(self) -> list[Statement]:
        """The statements that went."""
        return self._moves[1]

    @property
    def statements(self) -> list[Statement]:
        """The statements that came or went."""
        added, removed = self.added, self.removed
        return added + removed if removed else added

    @cached_property
    def after_quads(self) -> list[ox.Quad]:
        """All that the board says of the fluent after the event."""
        return _quads(fluent_lines(self.event.after, self.vocabulary))

    @cached_property
    def before_quads(self) -> list[ox.Quad]:
        """All that the board said of the fluent before the event."""
        before = self.event.before
        return [] if before is None else _quads(fluent_lines(before, self.vocabulary))

    @cached_property
    def after(self) -> list[Statement]:
        """All that the board says of the fluent after the event."""
        if self.event.before is None:
            return self.added
        return [statement_of(line) for line in fluent_lines(self.event.after, self.vocabulary)]

    @cached_property
    def before(self) -> list[Statement]:
        """All that the board said of the fluent before the event."""
        if self.event.before is None:
            return []
        return [statement_of(line) for line in fluent_lines(self.event.before, self.vocabulary)]


def _quads(lines: list[str]) -> list[ox.Quad]:
    return list(ox.parse("".join(lines), format=ox.RdfFormat.N_TRIPLES))


@dataclass(frozen=True)
class CommitChange:
    """What one commit changed.

    Attributes:
        commit: the commit.
        vocabulary: as it is after the commit.
    """

    commit: Commit
    vocabulary: Vocabulary

    @property
    def number(self) -> int:
        """The commit's number."""
        return self.commit.number

    @property
    def before(self) -> int:
        """The last commit before it."""
        return self.commit.number - 1

    @property
    def since_s(self) -> float | None:
        """For queries at now: the time that was shown before it; else None."""
        return None

    @property
    def at_s(self) -> float | None:
        """For queries at now: the time that is shown after it; else None."""
        return None

    @cached_property
    def events(self) -> tuple[EventChange, ...]:
        """What its events changed, in order."""
        return tuple(EventChange(event, self.vocabulary) for event in self.commit.events)

    @cached_property
    def touches_everything(self) -> bool:
        """Names and the class hierarchy may have changed, and so may any answer."""
        return any(change.may_declare for change in self.commit.statements)

    @property
    def moves_graphs(self) -> bool:
        """A named graph was created or dropped, perhaps an empty one."""
        return any(change.graph_event for change in self.commit.statements)

    @cached_property
    def outside_statements(self) -> list[Statement]:
        """The statements outside fluents that came or went."""
        return [
            statement_of(line)
            for change in self.commit.statements
            for text in (change.added, change.removed)
            for line in text.splitlines()
            if line.strip()
        ]

    def statements(self) -> Iterator[Statement]:
        """All statements that came or went."""
        for event in self.events:
            yield from event.statements
        yield from self.outside_statements
