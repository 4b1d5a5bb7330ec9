"""Listing: pages of the fluents that pass a filter, as believed after one commit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from fluentboard.board.intervals import FluentFilter, IntArray
from fluentboard.board.projections import Projections
from fluentboard.board.projector import Projector
from fluentboard.board.triples import fluent_name, is_written, terms_written
from fluentboard.model.fluent import Fluent

_ROWS_AT_ONCE = 1_000
# Beyond this many, it is quicker to look whether a fluent has the property than who has it.
_CANDIDATES_MAX = 5_000


@dataclass(frozen=True, slots=True)
class Page:
    """A part of a listing.

    Attributes:
        fluents: as they stand, or stood, in the order of their first assertion.
        next: where the next page starts, or None after the last.
        commit: all of the page is as believed after this commit.
    """

    fluents: tuple[Fluent, ...]
    next: int | None
    commit: int = 0


class Listing:
    """Lists fluents. Safe to use from any thread."""

    def __init__(self, projections: Projections, projector: Projector) -> None:
        self._projections = projections
        self._projector = projector

    def page(self, wanted: FluentFilter, after: int, limit: int) -> Page:
        """The first fluents that pass a filter, from a row on.

        Raises:
            UnknownClass: the filter names a class that no ontology declares.
            UnknownFluent: it relates to a fluent that was not asserted (by then).
        """
        index, last = self._projections.index, self._projections.remembered
        as_of = last if wanted.as_of is None else min(wanted.as_of, last)
        if wanted.relation is not None and isinstance(wanted.relation[1], str):
            self._projections.fluent(wanted.relation[1], as_of)
        rows = index.rows(replace(wanted, as_of=as_of), self._class_test(wanted))
        rows = rows[np.searchsorted(rows, after) :]
        candidates = self._candidates(wanted, as_of)
        if candidates is not None and rows.size:
            place = np.minimum(np.searchsorted(rows, candidates), rows.size - 1)
            rows = candidates[rows[place] == candidates]
        found: list[Fluent] = []
        for start in range(0, rows.size, _ROWS_AT_ONCE):
            for row in rows[start : start + _ROWS_AT_ONCE].tolist():
                name = index.name(row)
                if len(found) == limit and wanted.property_name is None:
                    return Page(tuple(found), row, as_of)
                fluent = self._projections.fluent(name, as_of)
                if not self._has_property(fluent, wanted):
                    continue
                if len(found) == limit:
                    return Page(tuple(found), row, as_of)
                found.append(fluent)
        return Page(tuple(found), None, as_of)

    def _has_property(self, fluent: Fluent, wanted: FluentFilter) -> bool:
        if wanted.property_name is None:
            return True
        name = self._projections.vocabulary.property_name(wanted.property_name)
        values, text = fluent.values(name), wanted.property_value
        return bool(values) if text is None else any(is_written(v, text) for v in values)

    def _candidates(self, wanted: FluentFilter, as_of: int) -> IntArray | None:
        """Rows of the fluents that may have the wanted property; None if that would be many.

        Increasing.
        """
        if wanted.property_name is None:
            return None
        self._projector.wait_for(as_of)
        store, text = self._projections.store, wanted.property_value
        iri = self._projections.vocabulary.property_iri(wanted.property_name)
        # Values are only ever added, but for corrections: who has none now had none then.
        found = self._projections.journal.corrected(as_of)
        for value in [None] if text is None else terms_written(text):
            subjects = store.subjects(iri, value, limit=_CANDIDATES_MAX)
            if len(subjects) == _CANDIDATES_MAX:
                return None
            found.update(name for name in map(fluent_name, subjects) if name is not None)
        rows = (self._projections.index.row(name) for name in found)
        return np.array(sorted(row for row in rows if row is not None), dtype=np.int64)

    def _class_test(self, wanted: FluentFilter) -> Callable[[str], bool]:
        if wanted.class_name is None:
            return lambda _name: True
        vocabulary = self._projections.vocabulary
        below = vocabulary.subclasses(vocabulary.class_iri(wanted.class_name))
        return lambda name: vocabulary.class_iri(name) in below
