"""Tier 4: evaluate the whole query again and compare; correct for every query.

It runs only for commits that touch the query's footprint, and once for all commits that have
piled up meanwhile.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import ClassVar, Protocol

from fluentboard.board.events import Commit
from fluentboard.board.store import QueryResults
from fluentboard.board.subscriptions.query import ParsedQuery
from fluentboard.board.subscriptions.results import Bag, bag_of
from fluentboard.board.subscriptions.view import View
from fluentboard.board.vocabulary import Vocabulary
from fluentboard.errors import InvalidQuery


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
    board: Board, text: str, *, relabel: bool = False, limit: int | None = None
) -> tuple[int, Bag]:
    """The present answer to a query, and the commit it is exact at.

    Raises:
        TooLarge: it has more solutions than `limit`.
        InvalidQuery: the store cannot evaluate it, for example for an unknown function.
    """
    try:
        commit, results = board.snapshot_query(text)
        return commit, bag_of(results, relabel=relabel, limit=limit)
    except (ValueError, OSError, RuntimeError) as problem:
        raise InvalidQuery(f"the query cannot be evaluated: {problem}") from None
