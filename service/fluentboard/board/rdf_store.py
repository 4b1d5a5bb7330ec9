"""What the board needs of an RDF store, whichever holds the statements."""

from __future__ import annotations

import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import pyoxigraph as ox

from fluentboard.board.events import StatementsChanged
from fluentboard.board.oxigraph_query import GraphName, QueryResults

FunctionsAt = Callable[[int], Mapping[ox.NamedNode, Any]]

_ATTEMPTS = 4
_PATIENCE_S = 0.02


class RdfStore(ABC):
    """A projection of the journal that answers SPARQL.

    Reads see whole groups of commits: each `apply` is one transaction, and every query runs on the
    snapshot taken when it starts. Only one thread applies.
    """

    has_functions = True
    """It evaluates the extension functions of time itself."""

    def __init__(self) -> None:
        self._applying = threading.Lock()
        # Odd while a group is applied: lets a reader prove that its snapshot is of one commit.
        self._sequence = 0
        self._applied = 0

    @property
    def applied(self) -> int:
        """Number of the last commit applied."""
        return self._applied

    @property
    def moment(self) -> int | None:
        """Differs whenever the statements may; None in the middle of a change."""
        sequence = self._sequence
        return sequence if sequence % 2 == 0 else None

    @property
    @abstractmethod
    def may_be_ahead(self) -> bool:
        """A process that did not fsync its journal stopped without closing the store.

        After a loss of power the store may then hold statements that the journal has lost.
        """

    @abstractmethod
    def apply(self, added: str, removed: str, commit: int) -> None:
        """Adds and removes statements of the default graph in one transaction.

        Args:
            added: N-Triples text without blank nodes.
            removed: N-Triples text without blank nodes.
            commit: number of the last commit that this brings the store to.

        Raises:
            StorageFailed: the store cannot be written; the transaction left no trace.
        """

    @abstractmethod
    def apply_statements(
        self,
        added: Iterable[ox.Quad],
        removed: Iterable[ox.Quad],
        commit: int,
        *,
        created: Iterable[ox.NamedNode] = (),
        dropped: Iterable[ox.NamedNode] = (),
    ) -> None:
        """Removes and then adds quads; unlike `apply` it keeps the names of blank nodes.

        Args:
            added: statements.
            removed: statements.
            commit: number of the last commit that this brings the store to.
            created: named graphs that are there afterwards, even if they are empty.
            dropped: named graphs that go, with their statements.

        Raises:
            StorageFailed: the store cannot be written; the transaction left no trace.
        """

    @abstractmethod
    def bulk_load(self, lines: Sequence[str]) -> None:
        """Adds many N-Triples lines to the default graph, fast and without a transaction."""

    @abstractmethod
    def clear(self) -> None:
        """Removes everything; used before a rebuild."""

    @abstractmethod
    def mark(self, *, state: str) -> None:
        """Notes durably which commit the store is at.

        Args:
            state: durability of the journal while a process writes, "closed" after it stopped.
        """

    def note_said(self, changes: Sequence[StatementsChanged]) -> None:
        """Takes note of a commit that the store has applied before it was opened."""
        return  # most stores have kept that themselves

    @abstractmethod
    def query(
        self,
        sparql: str,
        default_graphs: Sequence[GraphName] | None = None,
        named_graphs: Sequence[ox.NamedNode | ox.BlankNode] | None = None,
        **extra: Any,
    ) -> QueryResults:
        """The results of a query on the snapshot of this moment.

        Args:
            sparql: SPARQL 1.1 text; well-known prefixes need no declaration.
            default_graphs: merged into the default graph; by default the store's own.
            named_graphs: what `GRAPH` sees; by default all but the board's own notes.
            extra: further options (base_iri, custom_functions).

        Raises:
            InvalidQuery: it does not parse, or cannot be evaluated.
        """

    def snapshot_query(
        self, sparql: str, *, functions_at: FunctionsAt | None = None, **options: Any
    ) -> tuple[int, QueryResults]:
        """The results of a query, with the number of the commit they are exact at.

        Args:
            sparql: the query.
            functions_at: gives the extension functions for a query of that commit.
            options: as for `query`.
        """
        for _ in range(_ATTEMPTS):
            commit, is_exact, results = self._attempt(sparql, functions_at, options)
            if is_exact:
                return commit, results
        with self._applying:
            commit, _, results = self._attempt(sparql, functions_at, options)
            return commit, results

    def marked_query(
        self, sparql: str, *, functions_at: FunctionsAt | None = None, **options: Any
    ) -> tuple[int, bool, QueryResults]:
        """The results of a query, with a commit, and whether they are exact at it.

        Results that are not have some later commits too. That happens only where a query took so
        long that to repeat it, or to keep commits out meanwhile, would do harm.
        """
        for _ in range(_ATTEMPTS):
            began_s = time.monotonic()
            commit, is_exact, results = self._attempt(sparql, functions_at, options)
            if is_exact or time.monotonic() - began_s > _PATIENCE_S:
                return commit, is_exact, results
        with self._applying:
            commit, _, results = self._attempt(sparql, functions_at, options)
            return commit, True, results

    def _attempt(
        self, sparql: str, functions_at: FunctionsAt | None, options: Mapping[str, Any]
    ) -> tuple[int, bool, QueryResults]:
        sequence, commit = self._sequence, self._applied
        if functions_at is None:
            results = self.query(sparql, **options)
        else:
            results = self.query(sparql, custom_functions=dict(functions_at(commit)), **options)
        return commit, sequence % 2 == 0 and self._sequence == sequence, results

    @abstractmethod
    def subjects(
        self, predicate: str, value: ox.NamedNode | ox.Literal | None = None, *, limit: int
    ) -> list[str]:
        """IRIs of at most `limit` subjects with that value, or any, in the default graph."""

    @abstractmethod
    def named_graphs(self) -> list[ox.NamedNode]:
        """The named graphs, the board's own notes left out."""

    @abstractmethod
    def has_graph(self, graph: ox.NamedNode) -> bool:
        """There is a named graph of that name, if only an empty one."""

    @abstractmethod
    def __contains__(self, quad: ox.Quad) -> bool: ...

    @abstractmethod
    def says(self, quad: ox.Quad) -> bool:
        """An update has said this statement of the default graph, and none has unsaid it."""

    @abstractmethod
    def matching(
        self,
        subject: ox.NamedNode | ox.BlankNode | None,
        predicate: ox.NamedNode | None,
        target: ox.NamedNode | ox.BlankNode | ox.Literal | ox.Triple | None,
        graph: GraphName | None,
    ) -> Iterator[ox.Quad]:
        """The statements that match, as they are at this moment; None matches any term."""

    @abstractmethod
    def about(self, iri: str) -> list[ox.Quad] | None:
        """All statements of the default graph with that subject, at this moment.

        None if asking for them takes longer than to read the journal.
        """

    @abstractmethod
    def everything(self) -> Iterator[ox.Quad]:
        """All statements of all graphs, at this moment."""

    def checkpoint(self, folder: Path) -> int | None:
        """Makes a store of its own in a folder; None if this kind of store cannot."""
        return None

    @abstractmethod
    def close(self) -> None:
        """Marks the store as closed in order and lets go of it."""
