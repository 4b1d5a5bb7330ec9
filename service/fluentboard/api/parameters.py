"""Parameters: the values in a query string, as what they mean."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Literal

from fluentboard.clock import Clock
from fluentboard.errors import InvalidInput, InvalidTime
from fluentboard.model.interval import Certainty

Values = Mapping[str, Sequence[str]]

_TRUE = frozenset({"", "true", "1", "yes"})
_FALSE = frozenset({"false", "0", "no"})


def text(values: Values, name: str) -> str | None:
    """The value of a parameter, or None if it is not there.

    Raises:
        InvalidInput: it is there twice.
    """
    found = values.get(name)
    if not found:
        return None
    if len(found) > 1:
        raise InvalidInput(f"the parameter {name!r} is given {len(found)} times; give it once")
    return found[0]


def flag(values: Values, name: str) -> bool | None:
    """Whether a flag is set; alone, as in `?certainly`, means true. None if it is not there.

    Raises:
        InvalidInput: its value is neither true nor false.
    """
    value = text(values, name)
    if value is None:
        return None
    if value.lower() in _TRUE:
        return True
    if value.lower() in _FALSE:
        return False
    raise InvalidInput(f"the parameter {name} is {value!r}; give true or false")


def number(
    values: Values, name: str, *, least: int = 0, most: int = 2**63 - 1, default: int = 0
) -> int:
    """A whole number.

    Raises:
        InvalidInput: it is none, or out of range.
    """
    found = optional_number(values, name, least=least, most=most)
    return default if found is None else found


def optional_number(
    values: Values, name: str, *, least: int = 0, most: int = 2**63 - 1
) -> int | None:
    """A whole number, or None if the parameter is not there.

    Raises:
        InvalidInput: it is none, or out of range.
    """
    value = text(values, name)
    if value is None:
        return None
    if not value.isascii() or not value.isdigit() or not least <= int(value) <= most:
        allowed = f"from {least} to {most}" if most < 2**63 - 1 else f"of at least {least}"
        raise InvalidInput(f"the parameter {name} is {value!r}; give a whole number {allowed}")
    return int(value)


def time_s(values: Values, name: str, clock: Clock) -> float | None:
    """A time in seconds on the board's axis; `now` is the board's present.

    Raises:
        InvalidTime: it is neither.
    """
    value = text(values, name)
    if value is None:
        return None
    return clock.now_s() if value == "now" else seconds(value, name)


def time_or_now(values: Values, name: str) -> float | Literal["now"] | None:
    """A time in seconds on the board's axis, or `now` as it stands.

    Raises:
        InvalidTime: it is neither.
    """
    value = text(values, name)
    return None if value is None else "now" if value == "now" else seconds(value, name)


def certainty(values: Values) -> Certainty:
    """What the flags `certainly` and `possibly` ask for; by default what is possible.

    Raises:
        InvalidInput: both are set.
    """
    certainly, possibly = flag(values, "certainly"), flag(values, "possibly")
    if certainly and possibly:
        raise InvalidInput("certainly and possibly exclude each other; give one of them")
    return Certainty.CERTAIN if certainly else Certainty.POSSIBLE


def check_commit(asked: int, last: int) -> None:
    """Refuses a commit that has not been made.

    Raises:
        InvalidInput: it is later than the last.
    """
    if asked > last:
        raise InvalidInput(f"commit {asked} has not been made yet; the last is {last}", commit=last)


def window_s(values: Values, name: str) -> tuple[float, float] | None:
    """A window of time, given as `from,to`.

    Raises:
        InvalidTime: it is not two times, the earlier first.
    """
    value = text(values, name)
    if value is None:
        return None
    ends = value.split(",")
    if len(ends) != 2:
        raise InvalidTime(f"the parameter {name} is {value!r}; give two times such as 100.0,160.5")
    begin, end = seconds(ends[0], name), seconds(ends[1], name)
    if begin >= end:
        raise InvalidTime(f"the window {name} ends at {end} s, not after it begins at {begin} s")
    return begin, end


def seconds(value: str, name: str) -> float:
    """A finite number of seconds.

    Raises:
        InvalidTime: the text is none.
    """
    try:
        found = float(value)
    except ValueError:
        found = math.nan
    if not math.isfinite(found):
        raise InvalidTime(f"the parameter {name} is {value!r}; give a finite number of seconds")
    return found
