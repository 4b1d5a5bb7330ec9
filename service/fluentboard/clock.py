"""Where the time comes from: the system, or a replayed recording."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Protocol

_LOOK_AGAIN_S = 1.0


class Clock(Protocol):
    """Gives the present on the board's time axis."""

    def now_s(self) -> float:
        """Seconds: since the Unix epoch when live, of the episode in a replay."""
        ...

    def wait_s(self, until_s: float) -> float | None:
        """How long to sleep, in real seconds, before it is worth looking whether a time has come.

        None means that it does not come by waiting: the clock tells its listeners when it moves.
        """
        ...

    def listen(self, callback: Callable[[], None]) -> Callable[[], None]:
        """Calls back when the clock is set; the function returned ends it."""
        ...


class SystemClock:
    """The wall clock in seconds since the Unix epoch."""

    def now_s(self) -> float:
        """Seconds since 1970-01-01 UTC."""
        return time.time()

    def wait_s(self, until_s: float) -> float | None:
        """The time left, but at most a second: the system's clock may be set meanwhile."""
        return min(max(0.0, until_s - time.time()), _LOOK_AGAIN_S)

    def listen(self, callback: Callable[[], None]) -> Callable[[], None]:
        """Does nothing: the system does not tell when its clock is set."""
        return lambda: None


class ReplayClock:
    """A clock that stands where it was last set."""

    def __init__(self, now_s: float = 1.0) -> None:
        self._now_s = now_s
        self._listeners: tuple[Callable[[], None], ...] = ()

    def now_s(self) -> float:
        """The time last set, in seconds."""
        return self._now_s

    def set(self, now_s: float) -> None:
        """Moves the clock to `now_s`, and tells those who listen."""
        self._now_s = now_s
        for callback in self._listeners:
            callback()

    def wait_s(self, until_s: float) -> float | None:
        """None: it moves only when it is set."""
        return None

    def listen(self, callback: Callable[[], None]) -> Callable[[], None]:
        """Calls back whenever it is set; the function returned ends it."""
        self._listeners = (*self._listeners, callback)

        def stop() -> None:
            self._listeners = tuple(one for one in self._listeners if one is not callback)

        return stop
