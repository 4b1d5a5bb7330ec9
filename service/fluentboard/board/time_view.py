"""A time view: what holds at a time, as believed after a commit, as an RDF store of its own.

Every form of query is exact on it (paths, negation, aggregates, named graphs), because what does
not hold is not there: the store has all statements outside fluents, and all triples of the fluents
that hold.
"""

from __future__ import annotations

import threading
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal

import pyoxigraph as ox

from fluentboard.board.background import Background
from fluentboard.board.believed import Believed
from fluentboard.board.coming import Coming, next_change_s, next_changes
from fluentboard.board.intervals import Outline
from fluentboard.board.projections import Projections
from fluentboard.board.store import EmbeddedStore, QueryResults
from fluentboard.board.triples import fluent_iri
from fluentboard.board.vocabulary import Vocabulary
from fluentboard.model.interval import Certainty
from fluentboard.model.relations import Bounds, holding_period, holding_periods

# In memory a fluent takes about 4 kB.
_IN_MEMORY_MAX = 200_000


@dataclass(frozen=True, slots=True)
class Perspective:
    """Which part of the board's history a query sees.

    Attributes:
        at: what holds at this time in seconds, or at the time of the clock; None for all times.
        as_of: as believed after this commit; None for the present belief.
        certainty: POSSIBLE shows what may hold, CERTAIN only what surely does.
    """

    at: float | Literal["now"] | None = None
    as_of: int | None = None
    certainty: Certainty = Certainty.POSSIBLE


class TimeView:
    """What a perspective shows, kept in step with commits and with the clock.

    Used under `lock`, because bringing it up and querying it must not interleave. The results of a
    query may be read later: they are of the moment of the query.

    Attributes:
        lock: whoever uses the view holds it.
        perspective: what it shows.
        commit: the commit that it is exact at; -1 before it is built.
        at_s: the time that it shows, in seconds; None if it shows all times.
        size: how many fluents it holds.
        is_closed: it is not to be used any more.
    """

    def __init__(
        self, projections: Projections, believed: Believed, perspective: Perspective
    ) -> None:
        self.lock = threading.Lock()
        self.perspective = perspective
        self.commit = -1
        self.at_s = None if perspective.at == "now" else perspective.at
        self.size = 0
        self.is_closed = False
        self._projections = projections
        self._believed = believed
        self._background = Background()
        self._coming: Coming[int] = Coming()
        self._outline: Outline | None = None
        self._folder: TemporaryDirectory[str] | None = None
        self._store: EmbeddedStore | None = None

    def __repr__(self) -> str:
        seen = self.perspective
        return f"the view at={seen.at} as_of={seen.as_of} certainty={seen.certainty.name}"

    @property
    def vocabulary(self) -> Vocabulary:
        """What the ontologies declared at the view's commit."""
        return self._background.vocabulary

    @property
    def next_change_s(self) -> float:
        """When the clock alone changes the view next; infinite if never."""
        return self._coming.next_s()

    def bring_up(self, commit: int, now_s: float) -> None:
        """Makes the view exact at a commit and, if it follows the clock, at a time.

        Args:
            commit: not before the commit that the view is at; the RDF store has applied it.
            now_s: the time of the clock, in seconds.
        """
        is_of_now = self.perspective.at == "now"
        try:
            if self._store is None or (is_of_now and self.at_s is not None and now_s < self.at_s):
                self._build(commit, now_s)
                return
            touched = self._follow_commits(commit) if commit > self.commit else {}
            if is_of_now and now_s != self.at_s:
                self.at_s = now_s
                for row in self._coming.pop(now_s):
                    bounds = self._projections.index.bounds(row, self.commit)
                    assert bounds is not None
                    touched.setdefault(row, bounds)
            if touched:
                self._place(touched)
        except BaseException:
            # Half a step is not to be seen: the next to ask builds the view anew.
            self.close()
            raise

    def query(self, sparql: str, **options: Any) -> QueryResults:
        """The results of a query on the view, which has been brought up.

        Args:
            sparql: SPARQL 1.1 text, its class paths rewritten for `vocabulary`.
            options: as for `EmbeddedStore.query`.

        Raises:
            InvalidQuery: it does not parse, or cannot be evaluated.
        """
        assert self._store is not None
        return self._store.query(sparql, **options)

    def bounds_of(self, name: str, commit: int) -> Bounds | None:
        """What was believed of a fluent at the commit of a query; None if it was not there."""
        index, outline = self._projections.index, self._outline
        row = index.row(name)
        if row is None:
            return None
        if outline is None:
            return index.bounds(row, commit)
        if row >= outline.rows.size:
            return None
        s1, s2, f1, f2 = outline.bounds[:, row].tolist()
        return s1, s2, f1, f2

    def close(self) -> None:
        """Lets go of the store. Closing twice is harmless."""
        self.is_closed = True
        if self._store is not None:
            self._store.close()
            self._store = None
        if self._folder is not None:
            self._folder.cleanup()
            self._folder = None

    def _build(self, commit: int, now_s: float) -> None:
        """Makes the view from what the board has."""
        self.close()
        self.is_closed = False
        if commit > self.commit:
            statements = self._projections.journal.statements(self.commit, commit)
            self._background.apply(statements)
        self.commit = commit
        if self.perspective.at == "now":
            self.at_s = now_s
        outline = self._projections.index.outline(commit)
        rows = outline.rows
        if self.at_s is not None:
            begin, end = holding_periods(outline.bounds, self.perspective.certainty)
            rows = rows[(begin <= self.at_s) & (self.at_s < end)]
            if self.perspective.at == "now":
                changes = next_changes(outline, self.perspective.certainty, self.at_s)
                self._coming = Coming(changes)
        self._outline = outline if self.perspective.as_of is not None else None
        self.size = int(rows.size)
        if self.size > _IN_MEMORY_MAX:
            self._folder = TemporaryDirectory(prefix="fluentboard-view-")
        store = EmbeddedStore(None if self._folder is None else Path(self._folder.name))
        self._store = store
        quads = self._believed.quads(rows.tolist(), commit, self.vocabulary)
        store.bulk_extend(chain(self._background, quads))

    def _follow_commits(self, commit: int) -> dict[int, Bounds]:
        """Goes on to a commit, and gives the fluents that changed on the way."""
        assert self._store is not None
        statements = self._projections.journal.statements(self.commit, commit)
        added, removed = self._background.apply(statements)
        if added or removed:
            self._store.apply_statements(added, removed, commit)
        outline = self._projections.index.changed(self.commit, commit)
        self.commit = commit
        return {
            row: (s1, s2, f1, f2)
            for row, (s1, s2, f1, f2) in zip(
                outline.rows.tolist(), outline.bounds.T.tolist(), strict=True
            )
        }

    def _place(self, touched: dict[int, Bounds]) -> None:
        """Puts fluents in or out of the view, as they hold."""
        assert self._store is not None
        index = self._projections.index
        removed: list[ox.Quad] = []
        for row in touched:
            quads = self._store.about(fluent_iri(index.name(row)))
            own = [quad for quad in quads if quad not in self._background]
            self.size -= bool(own)
            removed += own
        present = [row for row, bounds in touched.items() if self._holds(row, bounds)]
        self.size += len(present)
        # First out, then in: the same number may be written in two ways.
        self._store.apply_statements((), removed, self.commit)
        added = self._believed.quads(present, self.commit, self.vocabulary)
        self._store.apply_statements(added, (), self.commit)

    def _holds(self, row: int, bounds: Bounds) -> bool:
        """Whether a fluent is in the view; notes when the clock will change that."""
        if self.at_s is None:
            return True
        begin, end = holding_period(bounds, self.perspective.certainty)
        if self.perspective.at == "now":
            self._coming.put(row, next_change_s(bounds, self.perspective.certainty, self.at_s))
        return begin <= self.at_s < end
