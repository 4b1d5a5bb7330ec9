"""Coming: which fluents begin or cease to hold by the clock alone, and when (pure)."""

from __future__ import annotations

import heapq
import math
from collections.abc import Hashable, Iterable
from typing import Generic, TypeVar

import numpy as np

from fluentboard.board.intervals import Outline
from fluentboard.model.interval import Certainty
from fluentboard.model.relations import Bounds, holding_period, holding_periods

Key = TypeVar("Key", bound=Hashable)


class Coming(Generic[Key]):
    """The times at which something changes, one per key, the earliest first."""

    def __init__(self, times: Iterable[tuple[float, Key]] = ()) -> None:
        self._time_of: dict[Key, float] = {key: time_s for time_s, key in times}
        self._heap: list[tuple[float, int, Key]] = []
        self._count = 0
        self._tidy()

    def put(self, key: Key, time_s: float | None) -> None:
        """Replaces the time of a key; None if nothing comes any more."""
        if time_s is None:
            self._time_of.pop(key, None)
        elif self._time_of.get(key) != time_s:
            self._time_of[key] = time_s
            self._count += 1
            heapq.heappush(self._heap, (time_s, self._count, key))
            if len(self._heap) > 2 * len(self._time_of) + 1_000:
                self._tidy()

    def next_s(self) -> float:
        """The earliest of the times; infinite if there is none."""
        heap = self._heap
        while heap and self._time_of.get(heap[0][2]) != heap[0][0]:
            heapq.heappop(heap)
        return heap[0][0] if heap else math.inf

    def pop(self, up_to_s: float) -> list[Key]:
        """Takes out the keys whose time has come."""
        found: list[Key] = []
        while self.next_s() <= up_to_s:
            _, _, key = heapq.heappop(self._heap)
            del self._time_of[key]
            found.append(key)
        return found

    def _tidy(self) -> None:
        self._heap = [
            (time_s, number, key) for number, (key, time_s) in enumerate(self._time_of.items())
        ]
        self._count = len(self._heap)
        heapq.heapify(self._heap)


def next_change_s(bounds: Bounds, certainty: Certainty, at_s: float) -> float | None:
    """When a fluent begins or ceases to hold after a time, in seconds; None if never."""
    begin, end = holding_period(bounds, certainty)
    next_s = begin if at_s < begin else end
    return next_s if begin < end and at_s < next_s < math.inf else None


def next_changes(outline: Outline, certainty: Certainty, at_s: float) -> list[tuple[float, int]]:
    """For every fluent that will: when it begins or ceases to hold after a time, and its row."""
    begin, end = holding_periods(outline.bounds, certainty)
    next_s = np.where(begin > at_s, begin, end)
    comes = (begin < end) & (next_s > at_s) & (next_s < math.inf)
    return list(zip(next_s[comes].tolist(), outline.rows[comes].tolist(), strict=True))
