"""Time views: answers queries on what holds at a time, keeping the few views that are in use."""

from __future__ import annotations

import logging
import math
import threading
from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import pyoxigraph as ox

from fluentboard.board.believed import Believed
from fluentboard.board.projections import Projections
from fluentboard.board.store import GraphName, QueryResults
from fluentboard.board.time_functions import mentions_functions, time_functions
from fluentboard.board.time_view import Perspective, TimeView
from fluentboard.clock import Clock
from fluentboard.errors import InvalidTime
from fluentboard.model.interval import Certainty

logger = logging.getLogger(__name__)

_VIEWS_MAX = 8
_FLUENTS_MAX = 400_000


class BroughtUp(Protocol):
    """Whoever brings the RDF store up to a commit."""

    def wait_for(self, commit: int) -> None:
        """Returns when the RDF store has applied a commit."""
        ...


@dataclass(frozen=True, slots=True)
class TimedResults:
    """The results of a query, with what they are exact at.

    Attributes:
        results: of the query.
        commit: what was believed after this commit.
        at_s: what holds at this time, in seconds; None for all times.
        next_change_s: when the clock alone may change the results; infinite if it does not.
        is_exact: no later commit is in the results. They may be inexact where a long query over
            the whole history met with commits.
    """

    results: QueryResults
    commit: int
    at_s: float | None = None
    next_change_s: float = math.inf
    is_exact: bool = True


class TimeViews:
    """The views of a board. Safe to use from any thread.

    A view that was asked for before costs what has changed since; a new one costs all the fluents
    in it. Views that nobody has asked for cost nothing, on writing as on reading.
    """

    def __init__(self, projections: Projections, projector: BroughtUp, clock: Clock) -> None:
        self._projections = projections
        self._projector = projector
        self._clock = clock
        self._believed = Believed(projections)
        self._guard = threading.Lock()
        self._views: OrderedDict[Perspective, TimeView] = OrderedDict()

    def query(
        self,
        sparql: str,
        perspective: Perspective,
        default_graphs: Sequence[GraphName] | None = None,
        named_graphs: Sequence[ox.NamedNode | ox.BlankNode] | None = None,
    ) -> TimedResults:
        """The results of a query on what a perspective shows.

        Raises:
            InvalidQuery: the query does not parse, or cannot be evaluated.
            InvalidTime: the time is NaN.
        """
        view = self._brought_up(perspective)
        try:
            commit, at_s = view.commit, view.at_s
            options: dict[str, Any] = {}
            if mentions_functions(sparql):
                now_s = at_s if perspective.at == "now" else None
                options["custom_functions"] = time_functions(
                    sparql,
                    lambda name: view.bounds_of(name, commit),
                    self._clock.now_s() if now_s is None else now_s,
                )
            if default_graphs is None:
                sparql = self._projections.prepared.rewritten(sparql, view.vocabulary)
            results = view.query(
                sparql, default_graphs=default_graphs, named_graphs=named_graphs, **options
            )
            return TimedResults(results, commit, at_s, view.next_change_s)
        finally:
            view.lock.release()

    def next_change_s(self, certainty: Certainty) -> float:
        """When the clock alone changes next what holds now; infinite if it does not."""
        view = self._brought_up(Perspective("now", None, certainty))
        try:
            return view.next_change_s
        finally:
            view.lock.release()

    def own_view(self, perspective: Perspective) -> TimeView:
        """A view that nobody else uses; whoever asked for it brings it up and closes it."""
        return TimeView(self._projections, self._believed, perspective)

    def close(self) -> None:
        """Lets go of all views."""
        with self._guard:
            views = list(self._views.values())
            self._views.clear()
        for view in views:
            with view.lock:
                view.close()

    def _brought_up(self, perspective: Perspective) -> TimeView:
        """The view, exact at what was asked, with its lock held."""
        if isinstance(perspective.at, float) and math.isnan(perspective.at):
            raise InvalidTime("cannot tell what holds at NaN; give a number of seconds")
        as_of, last = perspective.as_of, self._projections.remembered
        if as_of is None or as_of >= last:
            # The view that follows the commits will do, unless another thread has taken it beyond.
            view = self._locked(replace(perspective, as_of=None))
            if as_of is None or view.commit <= as_of:
                return self._at(view, max(last, view.commit))
            view.lock.release()
        return self._at(self._locked(perspective), as_of)

    def _at(self, view: TimeView, commit: int) -> TimeView:
        is_new = view.commit < 0
        try:
            self._projector.wait_for(commit)
            view.bring_up(commit, self._clock.now_s())
        except BaseException:
            view.lock.release()
            raise
        if is_new:
            logger.info("built %s with %s fluents at commit %s", view, view.size, commit)
        return view

    def _locked(self, perspective: Perspective) -> TimeView:
        while True:
            with self._guard:
                view = self._views.get(perspective)
                if view is None or view.is_closed:
                    view = TimeView(self._projections, self._believed, perspective)
                    self._views[perspective] = view
                self._views.move_to_end(perspective)
                self._make_room()
            view.lock.acquire()
            if not view.is_closed:
                return view
            view.lock.release()

    def _make_room(self) -> None:
        """Closes the views that were not asked for the longest, but none that is in use."""
        total = sum(view.size for view in self._views.values())
        for perspective in list(self._views)[:-1]:
            if len(self._views) <= _VIEWS_MAX and total <= _FLUENTS_MAX:
                return
            view = self._views[perspective]
            if view.lock.acquire(blocking=False):
                total -= view.size
                view.close()
                del self._views[perspective]
                view.lock.release()
