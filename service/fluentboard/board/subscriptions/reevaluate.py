"""Tier 4: evaluate the whole query again and compare; correct for every query.

It runs only for commits that touch the query's footprint, and once for all commits that have
piled up meanwhile.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal, Protocol

from fluentboard.board.events import Commit
from fluentboard.board.store import QueryResults
from fluentboard.board.subscriptions.query import ParsedQuery
from fluentboard.board.subscriptions.results import Bag, bag_of
from fluentboard.board.subscriptions.view import View
from fluentboard.board.time_view import Perspective, TimeView
from fluentboard.board.time_views import TimedResults
from fluentboard.board.vocabulary import Vocabulary
from fluentboard.clock import Clock
from fluentboard.errors import InvalidQuery
from fluentboard.model.fluent import Fluent
from fluentboard.model.interval import Certainty


class Board(Protocol):
    """What standing queries need of the blackboard."""

    @property
    def commit(self) -> int:
        """Number of the last commit that is visible to queries."""
        ...

    @property
    def vocabulary(self) -> Vocabulary:
        """What the loaded ontologies declare; replaced, never changed."""
        ...

    @property
    def clock(self) -> Clock:
        """Where the present comes from."""
        ...

    def fluent(self, name: str, as_of: int | None = None) -> Fluent:
        """A fluent as it stands, or as it stood after a commit."""
        ...

    def coming(self, certainty: Certainty, at_s: float, as_of: int) -> Iterable[tuple[float, str]]:
        """When fluents begin or cease to hold after a time, as believed after a commit."""
        ...

    def timed_query(self, sparql: str, *, at: Literal["now"], certainty: Certainty) -> TimedResults:
        """The results of a query on what holds now, with the commit and the time they show."""
        ...

    def past_query(
        self, sparql: str, commit: int, at_s: float | None, certainty: Certainty | None
    ) -> QueryResults:
        """The results of a query as they were after a commit and, for one at now, at a time."""
        ...

    def commit_at(self, wall_s: float) -> int:
        """Number of the last commit made at or before a wall-clock time."""
        ...

    def own_view(self, perspective: Perspective) -> TimeView:
        """A view of the past that nobody else uses."""
        ...

    def bring_up(self, view: TimeView, commit: int, now_s: float) -> None:
        """Makes such a view exact at a commit and a time."""
        ...

    def snapshot_query(self, sparql: str) -> tuple[int, QueryResults]:
        """The results of a query and the commit that they are exact at."""
        ...

    def commits(self, after: int, up_to: int | None = None) -> Iterator[Commit]:
        """The commits in (after, up_to], in order."""
        ...

    def listen(self, callback: Callable[[Sequence[Commit]], None]) -> Callable[[], None]:
        """Calls back with every group of commits; the function returned ends it."""
        ...


@dataclass(frozen=True, slots=True)
class Reevaluation:
    """The tier of queries that are evaluated again as a whole.

    Attributes:
        query: the query.
        reason: why no cheaper tier is sound for the query.
    """

    query: ParsedQuery
    reason: str
    tier: ClassVar[int] = 4

    @property
    def view(self) -> View:
        """The result is what the store answers."""
        return View(self.query.text, self.query.variables, "bag")

    def support_of(self, solutions: Bag) -> Bag:
        """The result itself."""
        return solutions


def evaluate(
    board: Board,
    text: str,
    *,
    certainty: Certainty | None = None,
    relabel: bool = False,
    limit: int | None = None,
) -> tuple[int, float | None, Bag]:
    """The present answer to a query, with the commit and the time that it is exact at.

    Args:
        board: what is asked.
        text: the query.
        certainty: ask what holds now with that certainty; None asks the whole history.
        relabel: the query makes blank nodes.
        limit: how many solutions it may have.

    Raises:
        TooLarge: it has more solutions than `limit`.
        InvalidQuery: the store cannot evaluate it, for example for an unknown function.
    """
    try:
        if certainty is None:
            commit, results = board.snapshot_query(text)
            return commit, None, bag_of(results, relabel=relabel, limit=limit)
        timed = board.timed_query(text, at="now", certainty=certainty)
        return timed.commit, timed.at_s, bag_of(timed.results, relabel=relabel, limit=limit)
    except (ValueError, OSError, RuntimeError) as problem:
        raise InvalidQuery(f"the query cannot be evaluated: {problem}") from None
