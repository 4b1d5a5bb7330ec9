"""Interval index, a projection: which fluents hold at a time, or stand in a relation to a window.

One row per fluent in order of its first assertion, in flat arrays: a scan over a million rows takes
a few milliseconds, and every filter is exact because the arrays hold all four end points. What a
change replaced is kept in a second table, so the same holds for what was believed at any commit.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fluentboard.model.fluent import Fluent
from fluentboard.model.interval import Certainty
from fluentboard.model.relations import (
    Bounds,
    FloatArray,
    Relation,
    bounds_of,
    own_certainty,
    related,
    window,
)

IntArray = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class FluentFilter:
    """Which fluents to list; every part that is given must hold.

    Attributes:
        class_name: the class or a superclass of it.
        at_s: holds at this time.
        during: holds at some moment of the window [from, to), in seconds.
        certainty: POSSIBLE lists what may hold, CERTAIN only what surely does.
        property_name: has a value of this property.
        property_value: has this value, as written in JSON (with `property_name`).
        is_open: nothing is known about the finish (True), or something is (False).
        as_of: as believed after this commit; by default the last.
        relation: stands in this relation to an interval, given by what is known of its end points,
            or to the fluent of that name.
    """

    class_name: str | None = None
    at_s: float | None = None
    during: tuple[float, float] | None = None
    certainty: Certainty = Certainty.POSSIBLE
    property_name: str | None = None
    property_value: str | None = None
    is_open: bool | None = None
    as_of: int | None = None
    relation: tuple[Relation, Bounds | str] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Outline:
    """What is known of the end points of some fluents, as believed after a commit.

    Attributes:
        rows: `(n,)`; increasing.
        bounds: `(4, n)`; earliest and latest start, earliest and latest finish, in seconds.
    """

    rows: IntArray
    bounds: FloatArray


class _Changes:
    """What changes replaced, in commit order: an undo log in flat arrays."""

    def __init__(self) -> None:
        self.count = 0
        self._commit = np.zeros(256, dtype=np.int64)
        self._row = np.zeros(256, dtype=np.int64)
        self._class_of = np.zeros(256, dtype=np.int32)
        self._bounds = np.zeros((4, 256))

    def put(self, commit: int, row: int, class_id: int, bounds: FloatArray) -> None:
        """Notes the state `(4,)` and class of a row that a commit replaces."""
        here = self.count
        if here == self._commit.size:
            size = 2 * here
            self._commit = np.resize(self._commit, size)
            self._row = np.resize(self._row, size)
            self._class_of = np.resize(self._class_of, size)
            self._bounds = np.concatenate([self._bounds, np.zeros_like(self._bounds)], axis=1)
        self._commit[here] = commit
        self._row[here] = row
        self._class_of[here] = class_id
        self._bounds[:, here] = bounds
        self.count = here + 1

    def _after(self, commit: int) -> int:
        return int(np.searchsorted(self._commit[: self.count], commit, side="right"))

    def rows(self, after: int, up_to: int) -> IntArray:
        """Rows that commits in (after, up_to] changed, each as often as it was changed."""
        return self._row[self._after(after) : self._after(up_to)]

    def replaced(self, as_of: int, count: int) -> tuple[IntArray, FloatArray]:
        """What was believed after a commit of the rows that were changed later.

        Args:
            as_of: the commit.
            count: only rows below this one.

        Returns:
            The rows `(n,)`, increasing, and their bounds `(4, n)`.
        """
        first = self._after(as_of)
        # The first change after the commit replaced what was believed then.
        changed = self._row[first : self.count]
        if changed.size < count // 64:
            rows, entries = np.unique(changed, return_index=True)
            rows, entries = rows[rows < count], entries[rows < count]
        else:
            # Without sorting: written from the newest to the oldest, so the oldest stays.
            entry_of = np.full(int(changed.max(initial=count)) + 1, -1, dtype=np.int64)
            entry_of[changed[::-1]] = np.arange(changed.size - 1, -1, -1)
            rows = np.flatnonzero(entry_of[:count] >= 0)
            entries = entry_of[rows]
        return rows, self._bounds[:, entries + first]

    def since(self, as_of: int) -> tuple[IntArray, FloatArray, NDArray[np.int32]]:
        """What changes after a commit replaced, oldest first: rows, bounds `(4, n)`, classes."""
        chosen = slice(self._after(as_of), self.count)
        return self._row[chosen], self._bounds[:, chosen], self._class_of[chosen]

    def bounds(self, as_of: int, row: int) -> FloatArray:
        """The bounds `(4,)` of one row, which was changed after a commit, as believed then."""
        return self._bounds[:, self._first(as_of, row)]

    def class_of(self, as_of: int, row: int) -> int:
        """The class of one row, which was changed after a commit, as believed then."""
        return int(self._class_of[self._first(as_of, row)])

    def _first(self, as_of: int, row: int) -> int:
        first = self._after(as_of)
        return first + int(np.argmax(self._row[first : self.count] == row))


@dataclass(frozen=True, slots=True)
class _Other:
    """The other side of a relation, and its row if it is a fluent."""

    bounds: Bounds | None
    itself: int | None = None


_NOTHING = _Other(None)


class IntervalIndex:
    """End points, class and versions of every fluent, one row each, with their past."""

    def __init__(self) -> None:
        self._guard = threading.Lock()
        self._row_of: dict[str, int] = {}
        self._names: list[str] = []
        self._class_ids: dict[str, int] = {}
        self._bounds = np.zeros((4, 1024))
        self._class_of = np.zeros(1024, dtype=np.int32)
        self._created = np.zeros(1024, dtype=np.int64)
        self._version = np.zeros(1024, dtype=np.int64)
        self._changes = _Changes()

    def __len__(self) -> int:
        return len(self._names)

    def __contains__(self, name: str) -> bool:
        return name in self._row_of

    def name(self, row: int) -> str:
        """The fluent of a row."""
        return self._names[row]

    def row(self, name: str) -> int | None:
        """The row of a fluent, the same for ever; None if there is no such fluent."""
        return self._row_of.get(name)

    def version(self, row: int) -> int:
        """The commit that changed a row last."""
        return int(self._version[row])

    def put(self, fluents: Iterable[tuple[Fluent, int]]) -> None:
        """Takes over fluents as they stand, each with the commit that changed it."""
        with self._guard:
            for fluent, commit in fluents:
                self._put(fluent.name, fluent.class_name, bounds_of(fluent), commit)

    def put_outline(self, name: str, class_name: str, bounds: Bounds, commit: int) -> None:
        """Takes over one change, given as its four bounds (-inf and inf where unknown)."""
        with self._guard:
            self._put(name, class_name, bounds, commit)

    def _put(self, name: str, class_name: str, bounds: Bounds, commit: int) -> None:
        row = self._row_of.get(name)
        if row is None:
            row = len(self._names)
            if row == self._version.size:
                self._grow()
            self._created[row] = commit
        else:
            self._changes.put(commit, row, int(self._class_of[row]), self._bounds[:, row])
        class_id = self._class_ids.setdefault(class_name, len(self._class_ids))
        self._bounds[:, row] = bounds
        self._class_of[row] = class_id
        self._version[row] = commit
        if row == len(self._names):
            # Last, because readers that hold no lock look here first.
            self._names.append(name)
            self._row_of[name] = row

    def _grow(self) -> None:
        size = 2 * self._version.size
        self._bounds = np.concatenate([self._bounds, np.zeros_like(self._bounds)], axis=1)
        self._class_of = np.resize(self._class_of, size)
        self._created = np.resize(self._created, size)
        self._version = np.resize(self._version, size)

    def rows(self, wanted: FluentFilter, is_wanted_class: Callable[[str], bool]) -> IntArray:
        """Rows that pass the filter, increasing.

        Args:
            wanted: the filter; its property part is not looked at here.
            is_wanted_class: whether a class name is the wanted class or below it.
        """
        with self._guard:
            count = self._count(wanted.as_of)
            bounds, classes = self._bounds[:, :count], self._class_of[:count]
            ids = None
            if wanted.class_name is not None:
                ids = np.array([is_wanted_class(name) for name in self._class_ids], dtype=np.bool_)
            other = self._other(wanted, count)
            keep: NDArray[np.bool_] = np.zeros(len(self._names), dtype=np.bool_)
            keep[:count] = _passing(wanted, bounds, classes, ids, other)
            if wanted.as_of is not None:
                # Written from the newest change to the oldest, so what was believed then stays.
                rows, bounds, classes = self._changes.since(wanted.as_of)
                keep[rows[::-1]] = _passing(wanted, bounds, classes, ids, other)[::-1]
            if other.itself is not None:
                keep[other.itself] = self._passes_itself(wanted, ids, other)
            return np.flatnonzero(keep[:count])

    def _passes_itself(
        self, wanted: FluentFilter, ids: NDArray[np.bool_] | None, other: _Other
    ) -> bool:
        """Whether the fluent that others are related to passes too."""
        assert wanted.relation is not None
        assert other.bounds is not None
        assert other.itself is not None
        row, as_of = other.itself, wanted.as_of
        class_id = int(self._class_of[row])
        if as_of is not None and self._version[row] > as_of:
            class_id = self._changes.class_of(as_of, row)
        rest = _passing(
            replace(wanted, relation=None),
            np.array([other.bounds]).T,
            np.array([class_id], dtype=np.int32),
            ids,
            _NOTHING,
        )
        own = own_certainty(wanted.relation[0], other.bounds)
        return own >= wanted.certainty and bool(rest[0])

    def _other(self, wanted: FluentFilter, count: int) -> _Other:
        """The other side of the wanted relation."""
        if wanted.relation is None:
            return _NOTHING
        _, other = wanted.relation
        if not isinstance(other, str):
            return _Other(other)
        row = self._row_of.get(other)
        if row is None or row >= count:
            return _NOTHING
        as_of = wanted.as_of
        if as_of is None or self._version[row] <= as_of:
            s1, s2, f1, f2 = self._bounds[:, row].tolist()
        else:
            s1, s2, f1, f2 = self._changes.bounds(as_of, row).tolist()
        return _Other((s1, s2, f1, f2), row)

    def bounds(self, row: int, as_of: int) -> Bounds | None:
        """What was believed of one row after a commit; None if it was not there yet."""
        with self._guard:
            if self._created[row] > as_of:
                return None
            is_same = self._version[row] <= as_of
            found = self._bounds[:, row] if is_same else self._changes.bounds(as_of, row)
            s1, s2, f1, f2 = found.tolist()
            return s1, s2, f1, f2

    def outline(self, as_of: int) -> Outline:
        """What was believed of all fluents after a commit."""
        with self._guard:
            count = self._count(as_of)
            bounds = self._bounds[:, :count].copy()
            later, before = self._changes.replaced(as_of, count)
            bounds[:, later] = before
            return Outline(np.arange(count, dtype=np.int64), bounds)

    def changed(self, after: int, up_to: int) -> Outline:
        """The fluents that commits in (after, up_to] made or changed, as believed afterwards."""
        with self._guard:
            count = self._count(up_to)
            made = np.arange(self._count(after), count, dtype=np.int64)
            rows = np.union1d(made, self._changes.rows(after, up_to))
            bounds = self._bounds[:, rows]
            later, before = self._changes.replaced(up_to, count)
            is_later = np.isin(rows, later, assume_unique=True)
            bounds[:, is_later] = before[:, np.isin(later, rows, assume_unique=True)]
            return Outline(rows, bounds)

    def _count(self, as_of: int | None) -> int:
        """How many rows there were; rows are in the order of the commits that made them."""
        created = self._created[: len(self._names)]
        return created.size if as_of is None else int(np.searchsorted(created, as_of, "right"))


def _passing(
    wanted: FluentFilter,
    bounds: FloatArray,
    classes: NDArray[np.int32],
    ids: NDArray[np.bool_] | None,
    other: _Other,
) -> NDArray[np.bool_]:
    """Which rows pass the class and time parts of a filter."""
    s1, s2, f1, f2 = bounds
    keep: NDArray[np.bool_] = np.ones(len(s1), dtype=np.bool_)
    if ids is not None:
        keep = ids[classes] if ids.size else keep
    if wanted.at_s is not None:
        start, finish = (s2, f1) if wanted.certainty is Certainty.CERTAIN else (s1, f2)
        keep &= (start <= wanted.at_s) & (wanted.at_s < finish)
    if wanted.during is not None:
        begin, end = wanted.during
        if begin < end:
            keep &= related(Relation.INTERSECTS, bounds, window(begin, end), wanted.certainty)
        else:
            keep[:] = False
    if wanted.relation is not None:
        relation, _ = wanted.relation
        if other.bounds is None:
            keep[:] = False
        else:
            keep &= related(relation, bounds, other.bounds, wanted.certainty)
    if wanted.is_open is not None:
        keep &= (f1 == np.inf) == wanted.is_open
    return keep
