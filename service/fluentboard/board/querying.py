"""Querying: what can be asked of a board in SPARQL, now, of a time and of the past."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Literal

import pyoxigraph as ox

from fluentboard.board.coming import next_changes
from fluentboard.board.projections import Projections
from fluentboard.board.projector import Projector
from fluentboard.board.store import EmbeddedStore, GraphName, QueryResults
from fluentboard.board.time_functions import functions_for, mentions_functions
from fluentboard.board.time_view import Perspective, TimeView
from fluentboard.board.time_views import TimedResults, TimeViews
from fluentboard.board.vocabulary import Vocabulary
from fluentboard.clock import Clock
from fluentboard.errors import TooLarge
from fluentboard.model.interval import Certainty
from fluentboard_ontology import PREFIXES

_LOOK_BACK_MAX = 200_000
"""Fluents; to build a view of the past takes about a second per 100,000."""


class Querying:
    """The part of a board that answers queries. Safe to use from any thread.

    Args:
        projections: of the journal.
        projector: brings the RDF store up.
        clock: where `now` comes from.

    Attributes:
        clock: where transaction times and `now` come from.
    """

    def __init__(self, projections: Projections, projector: Projector, clock: Clock) -> None:
        self._projections = projections
        self._projector = projector
        self._views = TimeViews(projections, projector, clock)
        self.clock = clock

    def __len__(self) -> int:
        """How many fluents there are."""
        return len(self._projections.index)

    @property
    def commit(self) -> int:
        """Number of the last commit; every read that starts now sees it."""
        return self._projections.remembered

    @property
    def vocabulary(self) -> Vocabulary:
        """What the loaded ontologies declare."""
        return self._projections.vocabulary

    def query(
        self,
        sparql: str,
        *,
        at: float | Literal["now"] | None = None,
        as_of: int | None = None,
        certainty: Certainty = Certainty.POSSIBLE,
        default_graphs: Sequence[GraphName] | None = None,
        named_graphs: Sequence[ox.NamedNode | ox.BlankNode] | None = None,
    ) -> QueryResults:
        """The results of a SPARQL query, by default over the whole history of facts.

        Args:
            sparql: the query; it may call the functions of `time_functions`.
            at: sees only the fluents that hold at this time in seconds, or at the clock's.
            as_of: sees what was believed after this commit.
            certainty: whether `at` shows what may hold or only what surely does.
            default_graphs: merged into the default graph; by default the board's own.
            named_graphs: what `GRAPH` sees; by default all.

        Raises:
            InvalidQuery: it does not parse, or cannot be evaluated.
            InvalidTime: `at` is NaN.
        """
        if at is not None or as_of is not None or mentions_functions(sparql):
            return self.timed_query(
                sparql,
                at=at,
                as_of=as_of,
                certainty=certainty,
                default_graphs=default_graphs,
                named_graphs=named_graphs,
            ).results
        if default_graphs is None:
            sparql = self._rewritten(sparql)
        self._projector.wait_for(self.commit)
        return self._projections.store.query(sparql, default_graphs, named_graphs)

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
        """Like `query`, with the commit and the time that the results are exact at."""
        if at is not None or as_of is not None:
            perspective = Perspective(at, as_of, certainty)
            return self._views.query(sparql, perspective, default_graphs, named_graphs)
        if self._needs_view(sparql):
            return self._views.query(sparql, Perspective(), default_graphs, named_graphs)
        self._projector.wait_for(self.commit)
        commit, is_exact, results = self._projections.store.marked_query(
            self._rewritten(sparql) if default_graphs is None else sparql,
            functions_at=functions_for(sparql, self._projections.index, self.clock),
            default_graphs=default_graphs,
            named_graphs=named_graphs,
        )
        return TimedResults(results, commit, is_exact=is_exact)

    def point_query(self, sparql: str, *, has_prefixes: bool) -> tuple[int, QueryResults] | None:
        """The results of a query that is surely cheap, with the commit that they are exact at.

        It does not wait for commits. None if the query is not answered so: `query` it.

        Args:
            sparql: patterns about one constant subject, and nothing else.
            has_prefixes: it may use well-known prefixes.
        """
        store = self._projections.store
        if not isinstance(store, EmbeddedStore):
            return None
        return store.point_query(sparql, PREFIXES if has_prefixes else {})

    def snapshot_query(self, sparql: str) -> tuple[int, QueryResults]:
        """The results of a query, with the number of the commit that they are exact at.

        It does not wait: the commit may be one that is not the last any more.
        """
        if self._needs_view(sparql):
            timed = self._views.query(sparql, Perspective())
            return timed.commit, timed.results
        # The rewritten query is right only where the class hierarchy of this vocabulary is stored.
        self._projector.wait_for(self._projections.vocabulary_commit)
        return self._projections.store.snapshot_query(
            self._rewritten(sparql),
            functions_at=functions_for(sparql, self._projections.index, self.clock),
        )

    def past_query(
        self, sparql: str, commit: int, at_s: float | None, certainty: Certainty | None
    ) -> QueryResults:
        """The results of a query as they were after a commit and, for one at now, at a time.

        Raises:
            TooLarge: the board has too many fluents to look back in between.
        """
        if len(self) > _LOOK_BACK_MAX:
            raise TooLarge(
                f"a board of {len(self)} fluents is too large to look back", limit=_LOOK_BACK_MAX
            )
        certainty = certainty or Certainty.POSSIBLE
        return self.query(sparql, at=at_s, as_of=commit, certainty=certainty)

    def own_view(self, perspective: Perspective) -> TimeView:
        """A view that nobody else uses; whoever asked for it brings it up and closes it."""
        return self._views.own_view(perspective)

    def bring_up(self, view: TimeView, commit: int, now_s: float) -> None:
        """Makes such a view exact at a commit and, if it follows a clock, at a time."""
        self._projector.wait_for(commit)
        with view.lock:
            view.bring_up(commit, now_s)

    def next_change_s(self, certainty: Certainty = Certainty.POSSIBLE) -> float:
        """When the clock alone changes next what holds now, in seconds; infinite if it does not.

        A commit may bring it forward or put it off.
        """
        return self._views.next_change_s(certainty)

    def coming(self, certainty: Certainty, at_s: float, as_of: int) -> Iterator[tuple[float, str]]:
        """When the clock alone changes what holds after a time, in seconds, and the fluent's name.

        Args:
            certainty: with which a fluent must hold.
            at_s: the time, in seconds.
            as_of: what was believed after this commit.
        """
        index = self._projections.index
        for time_s, row in next_changes(index.outline(as_of), certainty, at_s):
            yield time_s, index.name(row)

    def _needs_view(self, sparql: str) -> bool:
        """It calls functions that the store does not have; a view in this process has them."""
        return not self._projections.store.has_functions and mentions_functions(sparql)

    def _rewritten(self, sparql: str) -> str:
        return self._projections.prepared.rewritten(sparql, self.vocabulary)
