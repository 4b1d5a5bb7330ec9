"""Interval index, a projection: which fluents hold at a time, or overlap a window.

One row per fluent in order of its first assertion, in flat arrays: a scan over a million rows takes
a few milliseconds, and every filter is exact because the arrays hold all four endpoints.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fluentboard.model.fluent import Fluent
from fluentboard.model.interval import Certainty


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
    """

    class_name: str | None = None
    at_s: float | None = None
    during: tuple[float, float] | None = None
    certainty: Certainty = Certainty.POSSIBLE
    property_name: str | None = None
    property_value: str | None = None
    is_open: bool | None = None
    as_of: int | None = None


class IntervalIndex:
    """Endpoints, class and versions of every fluent, one row each."""

    def __init__(self) -> None:
        self._guard = threading.Lock()
        self._row_of: dict[str, int] = {}
        self._names: list[str] = []
        self._class_ids: dict[str, int] = {}
        self._bounds = np.zeros((4, 1024))
        self._class_of = np.zeros(1024, dtype=np.int32)
        self._created = np.zeros(1024, dtype=np.int64)
        self._version = np.zeros(1024, dtype=np.int64)

    def __len__(self) -> int:
        return len(self._names)

    def __contains__(self, name: str) -> bool:
        return name in self._row_of

    def name(self, row: int) -> str:
        """The fluent of a row."""
        return self._names[row]

    def put(self, fluents: Iterable[tuple[Fluent, int]]) -> None:
        """Takes over fluents as they stand, each with the commit that changed it."""
        with self._guard:
            for fluent, commit in fluents:
                bounds = (*fluent.start_bounds, *fluent.finish_bounds)
                self._put(fluent.name, fluent.class_name, bounds, commit)

    def put_outline(
        self, name: str, class_name: str, bounds: tuple[float, float, float, float], commit: int
    ) -> None:
        """Takes over one change, given as its four bounds (-inf and inf where unknown)."""
        with self._guard:
            self._put(name, class_name, bounds, commit)

    def _put(
        self, name: str, class_name: str, bounds: tuple[float, float, float, float], commit: int
    ) -> None:
        row = self._row_of.get(name)
        if row is None:
            row = len(self._names)
            if row == self._version.size:
                self._grow()
            self._names.append(name)
            self._row_of[name] = row
            self._created[row] = commit
        class_id = self._class_ids.setdefault(class_name, len(self._class_ids))
        self._bounds[:, row] = bounds
        self._class_of[row] = class_id
        self._version[row] = commit

    def _grow(self) -> None:
        size = 2 * self._version.size
        self._bounds = np.concatenate([self._bounds, np.zeros_like(self._bounds)], axis=1)
        self._class_of = np.resize(self._class_of, size)
        self._created = np.resize(self._created, size)
        self._version = np.resize(self._version, size)

    def rows(
        self, wanted: FluentFilter, is_wanted_class: Callable[[str], bool]
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Rows that pass the filter, and rows that must be looked up one by one.

        The second are fluents that changed after `as_of`: the arrays hold their later state.

        Args:
            wanted: the filter; its property part is not looked at here.
            is_wanted_class: whether a class name is the wanted class or below it.
        """
        with self._guard:
            count = len(self._names)
            s1, s2, f1, f2 = self._bounds[:, :count]
            keep: NDArray[np.bool_] = np.ones(count, dtype=np.bool_)
            if wanted.class_name is not None:
                ids = [i for name, i in self._class_ids.items() if is_wanted_class(name)]
                keep &= np.isin(self._class_of[:count], ids)
            certain = wanted.certainty is Certainty.CERTAIN
            if wanted.at_s is not None:
                start, finish = (s2, f1) if certain else (s1, f2)
                keep &= (start <= wanted.at_s) & (wanted.at_s < finish)
            if wanted.during is not None:
                begin, end = wanted.during
                keep &= _overlaps(s1, s2, f1, f2, begin, end, certain=certain)
            if wanted.is_open is not None:
                keep &= (f1 == np.inf) == wanted.is_open
            if wanted.as_of is None:
                return np.flatnonzero(keep), np.zeros(0, dtype=np.int64)
            existed = self._created[:count] <= wanted.as_of
            changed = existed & (self._version[:count] > wanted.as_of)
            return np.flatnonzero(keep & existed & ~changed), np.flatnonzero(changed)


def _overlaps(
    s1: NDArray[np.float64],
    s2: NDArray[np.float64],
    f1: NDArray[np.float64],
    f2: NDArray[np.float64],
    begin: float,
    end: float,
    *,
    certain: bool,
) -> NDArray[np.bool_]:
    """Which fluents hold at some moment of [begin, end).

    The fluent holds during [s, f) with s in [s1, s2] and f in [f1, f2]; the two half-open ranges
    share a moment iff max(s, begin) < min(f, end).
    """
    if begin >= end:
        return np.zeros(s1.shape, dtype=bool)
    start, finish = (s2, f1) if certain else (s1, f2)
    return (start < end) & (finish > begin) & (start < finish)


def passes(fluent: Fluent, wanted: FluentFilter, is_wanted_class: Callable[[str], bool]) -> bool:
    """Whether one fluent passes the class and time parts of a filter."""
    index = IntervalIndex()
    index.put([(fluent, 0)])
    found, _ = index.rows(
        FluentFilter(
            wanted.class_name,
            wanted.at_s,
            wanted.during,
            wanted.certainty,
            is_open=wanted.is_open,
        ),
        is_wanted_class,
    )
    return found.size == 1
