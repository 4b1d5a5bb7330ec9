"""Where the time comes from: the system, or a replayed recording."""

from __future__ import annotations

import time
from typing import Protocol


class Clock(Protocol):
    """Gives the present on the board's time axis."""

    def now_s(self) -> float:
        """Seconds: since the Unix epoch when live, of the episode in a replay."""
        ...


class SystemClock:
    """The wall clock in seconds since the Unix epoch."""

    def now_s(self) -> float:
        """Seconds since 1970-01-01 UTC."""
        return time.time()


class ReplayClock:
    """A clock that stands where it was last set."""

    def __init__(self, now_s: float = 1.0) -> None:
        self._now_s = now_s

    def now_s(self) -> float:
        """The time last set, in seconds."""
        return self._now_s

    def set(self, now_s: float) -> None:
        """Moves the clock to `now_s`."""
        self._now_s = now_s
