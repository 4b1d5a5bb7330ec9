"""Believed: the triples of fluents as they stood after any commit."""

from __future__ import annotations

import threading
from collections.abc import Iterable, Iterator, Sequence
from itertools import chain, islice
from typing import TypeVar

import pyoxigraph as ox

from fluentboard.board.background import fluents_spoken_of
from fluentboard.board.projections import Projections
from fluentboard.board.triples import fluent_iri, fluent_lines
from fluentboard.board.vocabulary import Vocabulary
from fluentboard.model.fluent import Fluent

Item = TypeVar("Item")

_AT_ONCE = 1_000
# One pass over the whole journal costs per fluent about a third of looking it up by name.
_PASS_SHARE = 1 / 3


class Believed:
    """Reads the triples of fluents as believed after a commit.

    A fluent that has not changed since is copied from the RDF store, the others are folded from the
    journal. Safe to use from any thread.
    """

    def __init__(self, projections: Projections) -> None:
        self._projections = projections
        self._guard = threading.Lock()
        self._spoken_of: set[str] = set()
        self._scanned = 0

    def quads(self, rows: Sequence[int], as_of: int, vocabulary: Vocabulary) -> Iterator[ox.Quad]:
        """The triples of some fluents.

        Args:
            rows: the fluents, as rows of the interval index.
            as_of: the commit; the RDF store has applied it.
            vocabulary: gives short names their IRIs.
        """
        index, store = self._projections.index, self._projections.store
        changed: list[str] = []
        for some in _batched(rows, _AT_ONCE):
            copies = [
                store.about(fluent_iri(index.name(row))) if index.version(row) <= as_of else None
                for row in some
            ]
            # Looked at only now: what was copied is what was believed if it is still unchanged.
            spoken_of = self._fluents_spoken_of()
            for row, copy in zip(some, copies, strict=True):
                name = index.name(row)
                if copy is None or index.version(row) > as_of or name in spoken_of:
                    changed.append(name)
                else:
                    yield from copy
        for fluents in _batched(self._folded(changed, as_of), _AT_ONCE):
            lines = chain.from_iterable(fluent_lines(fluent, vocabulary) for fluent in fluents)
            yield from ox.parse("".join(lines), format=ox.RdfFormat.N_TRIPLES)

    def _folded(self, names: Sequence[str], as_of: int) -> Iterator[Fluent]:
        if len(names) > _AT_ONCE and len(names) > _PASS_SHARE * len(self._projections.index):
            wanted = set(names)
            every = self._projections.journal.fluents(as_of)
            return (fluent for fluent in every if fluent.name in wanted)
        return (self._projections.fluent(name, as_of) for name in names)

    def _fluents_spoken_of(self) -> set[str]:
        """Fluents about which the RDF store may say what is none of their own triples."""
        journal = self._projections.journal
        with self._guard:
            last = journal.last
            if last > self._scanned:
                more = fluents_spoken_of(journal.statements(self._scanned, last))
                self._spoken_of = self._spoken_of | more if more else self._spoken_of
                self._scanned = last
            return self._spoken_of


def _batched(items: Iterable[Item], size: int) -> Iterator[list[Item]]:
    waiting = iter(items)
    while batch := list(islice(waiting, size)):
        yield batch
