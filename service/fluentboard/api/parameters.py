"""Parameters: the values in a query string, as what they mean."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from datetime import datetime
from typing import Literal

from fluentboard.board.blackboard import Blackboard
from fluentboard.clock import Clock
from fluentboard.errors import InvalidInput, InvalidTime
from fluentboard.model.interval import Certainty
from fluentboard.model.relations import Bounds, Relation, window

Values = Mapping[str, Sequence[str]]

RELATIONS = tuple(relation.value for relation in Relation)
"""Names of the relations of intervals."""

NUMBER_MAX = 2**63 - 1
"""Numbers of commits, frames and the like are smaller: SQLite keeps no larger ones."""

_DIGITS_MAX = 19

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
    values: Values, name: str, *, least: int = 0, most: int = NUMBER_MAX, default: int = 0
) -> int:
    """A whole number.

    Raises:
        InvalidInput: it is none, or out of range.
    """
    found = optional_number(values, name, least=least, most=most)
    return default if found is None else found


def optional_number(
    values: Values, name: str, *, least: int = 0, most: int = NUMBER_MAX
) -> int | None:
    """A whole number, or None if the parameter is not there.

    Raises:
        InvalidInput: it is none, or out of range.
    """
    value = text(values, name)
    if value is None:
        return None
    found = whole_number(value)
    if found is None or not least <= found <= most:
        allowed = f"from {least} to {most}" if most < NUMBER_MAX else f"of at least {least}"
        raise InvalidInput(f"the parameter {name} is {value!r}; give a whole number {allowed}")
    return found


def whole_number(text: str) -> int | None:
    """What decimal digits stand for; None if there is something else, or too many of them."""
    is_plain = text.isascii() and text.isdigit() and len(text) <= _DIGITS_MAX
    return int(text) if is_plain else None


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


def as_of(values: Values, board: Blackboard, name: str = "asof") -> int | None:
    """The commit that a belief is asked of, or None if the parameter is not there.

    A whole number is the commit itself. A date and time with a zone, or seconds with a decimal
    point on the axis of the board's clock, stand for the last commit that was made by then.

    Raises:
        InvalidInput: it is none of these, or a commit that has not been made.
    """
    value = text(values, name)
    if value is None:
        return None
    if not value.isdigit():
        return board.commit_at(_wall_s(value, name))
    asked, last = number(values, name), board.commit
    if asked > last:
        raise InvalidInput(f"commit {asked} has not been made yet; the last is {last}", commit=last)
    return asked


def _wall_s(value: str, name: str) -> float:
    try:
        # The sign of a zone is a space in an address that was not encoded.
        moment = datetime.fromisoformat(value.replace(" ", "+") if "T" in value else value)
        if moment.tzinfo is not None:
            return moment.timestamp()
    except ValueError:
        with suppress(ValueError):
            if math.isfinite(wall_s := float(value)) and "." in value:
                return wall_s
    raise InvalidInput(
        f"the parameter {name} is {value!r}; give the number of a commit, a time such as "
        "2026-05-01T12:00:00Z, or seconds such as 1777636800.0"
    )


def relation(values: Values) -> tuple[Relation, Bounds | str] | None:
    """The relation that is asked for by `relation` and `to`, or None.

    `to` is the name of a fluent, an instant in seconds, or a window `from,to`. What reads as a
    number is a time, even if a fluent has that name.

    Raises:
        InvalidInput: one of the two is missing, or there is no such relation.
        InvalidTime, IntervalReversed: the window is none.
    """
    name, other = text(values, "relation"), text(values, "to")
    if name is None and other is None:
        return None
    if name is None or other is None:
        raise InvalidInput("relation and to are given together: the relation, and what to")
    if name not in RELATIONS:
        raise InvalidInput(f"the relation is {name!r}; give one of {', '.join(RELATIONS)}")
    ends = other.split(",")
    if len(ends) == 2:
        return Relation(name), window(seconds(ends[0], "to"), seconds(ends[1], "to"))
    with suppress(InvalidTime):
        instant_s = seconds(other, "to")
        return Relation(name), window(instant_s, instant_s)
    return Relation(name), other


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
