"""A follower: the board in a process of its own, for reading.

It has projections of its own: an RDF store that began as a checkpoint of the board's, and an
interval index. It follows the journal, which the board's process writes, up to the commit that a
reader asks for, so its answers are as fresh as the board's. It can be killed at any moment: nothing
but the answer that somebody waits for is lost.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import pyoxigraph as ox

from fluentboard.board.events import Commit
from fluentboard.board.graphs import evaluation_on, previewed
from fluentboard.board.intervals import IntervalIndex
from fluentboard.board.oxigraph_query import ask
from fluentboard.board.projections import Projections
from fluentboard.board.sqlite_journal import SqliteJournal
from fluentboard.board.store import EmbeddedStore, GraphName
from fluentboard.board.time_functions import functions_for
from fluentboard.board.time_view import Perspective
from fluentboard.board.time_views import TimedResults, TimeViews
from fluentboard.board.update_operations import Operation
from fluentboard.clock import Clock
from fluentboard.model.interval import Certainty

_GROUP_EVENTS_MAX = 20_000


class Follower:
    """Answers queries from projections of its own. Used by one thread.

    Args:
        journal: file of the board's journal.
        store: folder of a checkpoint of the board's RDF store, for this follower alone.
        applied: a commit that the checkpoint surely has; it may have some later ones too.
        clock: where `now` comes from.

    Raises:
        StorageFailed: the journal or the checkpoint cannot be opened.
    """

    def __init__(self, journal: Path, store: Path, applied: int, clock: Clock) -> None:
        self._journal = SqliteJournal(journal, read_only=True)
        self._projections = Projections(
            self._journal, EmbeddedStore(store, applied=applied), IntervalIndex(), "process"
        )
        self._clock = clock
        self._projections.recover(is_trusted=True)
        self._views = TimeViews(self._projections, self, clock)

    @property
    def commit(self) -> int:
        """Number of the last commit that the projections have."""
        return self._projections.remembered

    def wait_for(self, commit: int) -> None:
        """Brings the projections at least to a commit, which is in the journal."""
        if self._projections.remembered >= commit:
            return
        group: list[Commit] = []
        events = 0
        for one in self._journal.commits(self._projections.remembered, self._journal.last):
            group.append(one)
            events += len(one.events)
            if events >= _GROUP_EVENTS_MAX:
                self._take_over(group)
                group, events = [], 0
        if group:
            self._take_over(group)

    def timed_query(
        self,
        sparql: str,
        *,
        at: float | Literal["now"] | None = None,
        as_of: int | None = None,
        certainty: Certainty = Certainty.POSSIBLE,
        default_graphs: Sequence[GraphName] | None = None,
        named_graphs: Sequence[ox.NamedNode | ox.BlankNode] | None = None,
    ) -> TimedResults:
        """The results of a query at the commit that the projections are at.

        See `Blackboard.timed_query`; here the results are always exact, because nothing is applied
        while a query is evaluated.

        Raises:
            InvalidQuery: it does not parse, or cannot be evaluated.
            InvalidTime: `at` is NaN.
        """
        if at is not None or as_of is not None:
            perspective = Perspective(at, as_of, certainty)
            return self._views.query(sparql, perspective, default_graphs, named_graphs)
        projections = self._projections
        if default_graphs is None:
            sparql = projections.prepared.rewritten(sparql, projections.vocabulary)
        commit, results = projections.store.snapshot_query(
            sparql,
            functions_at=functions_for(sparql, projections.index, self._clock),
            default_graphs=default_graphs,
            named_graphs=named_graphs,
        )
        return TimedResults(results, commit)

    def rehearse(self, operations: Sequence[Operation], query: str | None) -> None:
        """Evaluates an update, and a query on what it leads to, and forgets what comes of it.

        Raises:
            FluentboardError: as carrying it out would.
        """
        if query is None:
            evaluation_on(self._projections).changes(operations)
            return
        view, named = previewed(self._projections, operations, query)
        results = ask(view, query, None, None, lambda: named)
        if not isinstance(results, ox.QueryBoolean):
            for _ in results:
                pass

    def named_graphs(self) -> list[ox.NamedNode]:
        """Names of all named graphs, the board's own notes left out."""
        return self._projections.store.named_graphs()

    def close(self) -> None:
        """Lets go of all files."""
        self._views.close()
        self._projections.close()

    def _take_over(self, group: Sequence[Commit]) -> None:
        self._projections.remember(group)
        self._projections.project(group)
