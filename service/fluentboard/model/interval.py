"""Interval: what is known about one point in time, and three-valued answers about it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum
from numbers import Real
from typing import Any

from fluentboard.errors import IntervalReversed, InvalidTime


class Certainty(IntEnum):
    """A three-valued answer; `max` is *or*, `min` is *and*."""

    IMPOSSIBLE = 0
    POSSIBLE = 1
    CERTAIN = 2


def checked_time(value: Any, what: str) -> float | None:
    """The time as a float, or None for unknown.

    Args:
        value: seconds, or None.
        what: names the time in the error, for example "start.earliest of 'on4'".

    Raises:
        InvalidTime: not a number, NaN, infinite, or the reserved 0.0.
    """
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, Real):
        raise InvalidTime(f"{what} is {value!r}; give seconds as a number, or null for unknown")
    try:
        seconds = float(value)
    except OverflowError:
        seconds = math.inf
    if not math.isfinite(seconds):
        raise InvalidTime(
            f"{what} is {seconds}; give a finite number of seconds, or null for unknown"
        )
    if seconds == 0.0:
        raise InvalidTime(
            f"{what} is 0.0, which is reserved to mean unknown; use null for an unknown time, or "
            "shift the time axis so that it does not touch 0"
        )
    return seconds


@dataclass(frozen=True, slots=True)
class Interval:
    """The earliest and the latest value that one time point may have, in seconds.

    Either side may be None (unknown). `Interval.at(t)` is a point known exactly.

    Raises:
        InvalidTime: a side is NaN, infinite or 0.0.
        IntervalReversed: earliest > latest.
    """

    earliest: float | None = None
    latest: float | None = None

    def __post_init__(self) -> None:
        earliest, latest = self.earliest, self.latest
        # One comparison accepts the two common cases without a function call: a finite number
        # other than zero equals itself and differs from zero.
        if not (type(earliest) is float and -1e300 < earliest < 1e300 and earliest != 0.0):
            earliest = checked_time(earliest, "earliest")
            object.__setattr__(self, "earliest", earliest)
        if not (type(latest) is float and -1e300 < latest < 1e300 and latest != 0.0):
            latest = checked_time(latest, "latest")
            object.__setattr__(self, "latest", latest)
        if earliest is not None and latest is not None and earliest > latest:
            raise IntervalReversed(
                f"interval ends before it starts (earliest {earliest} s, latest {latest} s); "
                "swap the two values"
            )

    @classmethod
    def at(cls, time_s: float) -> Interval:
        """A time point known exactly."""
        return cls(time_s, time_s)

    @property
    def is_unknown(self) -> bool:
        """Neither side is known."""
        return self.earliest is None and self.latest is None

    def admits(self, other: Interval) -> bool:
        """`other` is this interval or a narrower one; unknown sides admit everything."""
        if self.earliest is not None and (other.earliest is None or other.earliest < self.earliest):
            return False
        return self.latest is None or (other.latest is not None and other.latest <= self.latest)


UNKNOWN = Interval()
"""The interval of which nothing is known: held since ever, or open until further notice."""
