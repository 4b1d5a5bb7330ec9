"""Finds the standing queries that a commit concerns, without asking each of them."""

from __future__ import annotations

from collections.abc import Iterator, Set
from dataclasses import dataclass, field

from fluentboard.board.subscriptions.changes import CommitChange, EventChange
from fluentboard.board.subscriptions.key_index import KeyIndex
from fluentboard.board.subscriptions.reevaluate import Reevaluation
from fluentboard.board.subscriptions.semi_naive import SemiNaive
from fluentboard.board.subscriptions.standing import Names, StandingQuery
from fluentboard.board.subscriptions.touch_index import TouchIndex
from fluentboard.model.interval import Certainty


@dataclass(frozen=True, slots=True)
class Concerned:
    """The standing queries that a commit concerns, each in one of three ways.

    Attributes:
        touched: the footprint is touched, so the query is to be evaluated again.
        candidates: incremental queries, with the events that may change their result.
        told: the result holds a fluent that changed, though the footprint is not touched.
    """

    touched: dict[StandingQuery, None] = field(default_factory=dict[StandingQuery, None])
    candidates: dict[StandingQuery, list[EventChange]] = field(
        default_factory=dict[StandingQuery, list[EventChange]]
    )
    told: dict[StandingQuery, None] = field(default_factory=dict[StandingQuery, None])


class Router:
    """Indexes over the standing queries that see the same.

    Args:
        at: with which certainty a fluent must hold now to be seen; None for the whole history.
    """

    def __init__(self, at: Certainty | None = None) -> None:
        self.at = at
        self._queries: dict[str, StandingQuery] = {}
        self._by_event: TouchIndex[StandingQuery] = TouchIndex()
        self._by_outside: TouchIndex[StandingQuery] = TouchIndex()
        self._by_key: KeyIndex[StandingQuery] = KeyIndex()
        # For those that tell events: which results hold a fluent.
        self._holders: dict[str, dict[StandingQuery, None]] = {}

    def __len__(self) -> int:
        return len(self._queries)

    def __iter__(self) -> Iterator[StandingQuery]:
        return iter(list(self._queries.values()))

    def find(self, text: str) -> StandingQuery | None:
        """The standing query of that text."""
        return self._queries.get(text)

    def add(self, standing: StandingQuery) -> None:
        """Has commits lead to the query."""
        self._queries[standing.query.text] = standing
        plan, shapes = standing.plan, standing.query.footprint.shapes
        self._by_outside.add(standing, shapes)
        if isinstance(plan, Reevaluation | SemiNaive):
            self._by_event.add(standing, shapes)
        else:
            self._by_key.add(standing, plan.keys)

    def remove(self, standing: StandingQuery) -> None:
        """Undoes `add`; call it before the plan is changed, and `add` after."""
        self._queries.pop(standing.query.text, None)
        plan, shapes = standing.plan, standing.query.footprint.shapes
        self._by_outside.remove(standing, shapes)
        if isinstance(plan, Reevaluation | SemiNaive):
            self._by_event.remove(standing, shapes)
        else:
            self._by_key.remove(standing, plan.keys)

    def update_names(self, standing: StandingQuery, names: Names) -> None:
        """Notes which fluents came into the result of a query that tells events, and left it."""
        for name in names.come:
            self._holders.setdefault(name, {})[standing] = None
        for name in names.gone:
            holders = self._holders.get(name)
            if holders is not None:
                holders.pop(standing, None)
                if not holders:
                    del self._holders[name]

    def concerned(self, change: CommitChange, spoken_of: Set[str]) -> Concerned:
        """The standing queries that a commit concerns.

        Args:
            change: what it changed.
            spoken_of: fluents that are spoken of outside their events, too: what those contribute
                to an incremental query does not follow from their events alone.
        """
        found = Concerned()
        if change.touches_everything:
            found.touched.update(dict.fromkeys(self._queries.values()))
            return found
        if change.moves_graphs:
            found.touched.update((s, None) for s in self if s.query.reads_graphs)
        if change.commit.statements:
            found.touched.update(self._by_outside.touched(change.outside_statements))
        for event in change.events:
            if spoken_of and event.event.after.name in spoken_of:
                found.touched.update(self._by_outside.touched(event.statements))
            elif len(self._by_event):
                found.touched.update(self._by_event.touched(event.statements))
            if len(self._by_key):
                for standing in self._by_key.candidates(event):
                    found.candidates.setdefault(standing, []).append(event)
            if self._holders:
                found.told.update(self._holders.get(event.event.after.name, {}))
        return found
