"""Fluent and Property: a fact that holds within an uncertain time interval, never removed.

Names in this file are short names such as `Mug` and `mug1`; `fluentboard.board.vocabulary` knows
their IRIs.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

from fluentboard.errors import (
    IntervalReversed,
    InvalidName,
    InvalidTime,
    InvalidValue,
    NotARefinement,
)
from fluentboard.model.interval import UNKNOWN, Certainty, Interval

Value = str | int | float | bool

# Word characters of any script and a few signs that stand unescaped in an IRI path and in Turtle.
_NAME = re.compile(r"[\w.:@+~-]{1,256}")
_TERM = re.compile(r"[^\s<>\"{}|\\^`]{1,512}")

_INTEGER_TYPES = frozenset(
    [
        "integer",
        "long",
        "int",
        "short",
        "byte",
        "nonNegativeInteger",
        "positiveInteger",
        "nonPositiveInteger",
        "negativeInteger",
        "unsignedLong",
        "unsignedInt",
        "unsignedShort",
        "unsignedByte",
    ]
)
_LEXICAL = {
    "decimal": re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)"),
    "dateTime": re.compile(r"-?\d{4,}-\d\d-\d\dT\d\d:\d\d:\d\d(\.\d+)?(Z|[+-]\d\d:\d\d)?"),
    "date": re.compile(r"-?\d{4,}-\d\d-\d\d(Z|[+-]\d\d:\d\d)?"),
    "time": re.compile(r"\d\d:\d\d:\d\d(\.\d+)?(Z|[+-]\d\d:\d\d)?"),
    "duration": re.compile(r"-?P(?=.)(\d+Y)?(\d+M)?(\d+D)?(T(?=.)(\d+H)?(\d+M)?(\d+(\.\d+)?S)?)?"),
    "anyURI": re.compile(r"[^\s<>\"{}|\\^`]*"),
    "string": re.compile(r".*", re.DOTALL),
}
XSD_TYPES = frozenset({"boolean", "float", "double", *_INTEGER_TYPES, *_LEXICAL})
"""Local names of the XSD types that a property value may have."""


@dataclass(frozen=True, slots=True)
class Property:
    """One statement about a fluent: property, type of the value, value.

    Attributes:
        name: short name or IRI of the property, such as `hasArm`.
        type: `xsd:...` for a literal, else the class of the fluent that the value names.
        value: the literal as bool, int, float or str, or the name of the other fluent.

    Raises:
        InvalidValue: the value is not of the declared XSD type.
        InvalidName: the property, class or fluent name cannot be part of an IRI.
    """

    name: str
    type: str
    value: Value

    def __post_init__(self) -> None:
        if type(self.name) is not str or not _TERM.fullmatch(self.name):
            raise InvalidName(f"property name {self.name!r} is not a name or an IRI")
        if type(self.type) is not str or not _TERM.fullmatch(self.type):
            raise InvalidName(
                f"property {self.name} has type {self.type!r}; give an XSD type such as xsd:float, "
                "or the class of the fluent it refers to"
            )
        if self.type.startswith("xsd:"):
            if type(self.value) is float and self.type in ("xsd:float", "xsd:double"):
                if -1e38 < self.value < 1e38:
                    return
            object.__setattr__(self, "value", literal_value(self.name, self.type, self.value))
        elif type(self.value) is not str or not _NAME.fullmatch(self.value):
            raise InvalidName(
                f"property {self.name} refers to {self.value!r}; a fluent's name has letters, "
                "digits and . : @ + ~ - _ only, and at most 256 of them"
            )

    @property
    def is_reference(self) -> bool:
        """The value names another fluent."""
        return not self.type.startswith("xsd:")


def literal_value(name: str, xsd_type: str, value: Any) -> Value:
    """The value as the Python type of its XSD type; text is parsed.

    Raises:
        InvalidValue: the type is not supported, or the value is not one of it.
    """
    local = xsd_type.removeprefix("xsd:")
    if local not in XSD_TYPES:
        raise InvalidValue(
            f"property {name} has type {xsd_type}, which is not supported; use one of "
            + ", ".join(f"xsd:{known}" for known in sorted(XSD_TYPES))
        )
    problem = InvalidValue(f"property {name} has value {value!r}, which is not an {xsd_type}")
    if local == "boolean":
        if isinstance(value, bool):
            return value
        text = str(value).strip().lower()
        if text in ("true", "1", "false", "0"):
            return text in ("true", "1")
        raise problem
    if local in ("float", "double"):
        if isinstance(value, bool):
            raise problem
        try:
            number = float(value)
        except (TypeError, ValueError, OverflowError):
            raise problem from None
        largest = 3.4028234663852886e38 if local == "float" else math.inf
        if not math.isfinite(number) or abs(number) > largest:
            raise InvalidValue(
                f"property {name} has value {value!r}; an {xsd_type} on the board is finite"
            )
        return number
    if local in _INTEGER_TYPES:
        if isinstance(value, bool) or (isinstance(value, float) and not value.is_integer()):
            raise problem
        try:
            return int(value)
        except (TypeError, ValueError, OverflowError):
            raise problem from None
    text = value if isinstance(value, str) else str(value)
    if not _LEXICAL[local].fullmatch(text):
        raise problem
    return text


@dataclass(frozen=True, slots=True)
class Fluent:
    """A fact: an individual of a class, with properties, that holds from a start to a finish.

    Attributes:
        name: unique name of the individual, such as `mug1`.
        class_name: its class, such as `Mug`.
        start: when it began to hold; unknown: since before the record began.
        finish: when it ceased to hold; unknown: it holds until further notice.
        properties: statements about it; a repeated statement is kept once.
        version: number of the commit that changed it last; 0 while it is not on a board.
        author: who made that commit.
        created: number of the commit that asserted it; 0 while it is not on a board.

    Raises:
        InvalidName: the name or the class cannot be part of an IRI.
        IntervalReversed: it would finish before it can have started.
    """

    name: str
    class_name: str
    start: Interval = UNKNOWN
    finish: Interval = UNKNOWN
    properties: tuple[Property, ...] = ()
    version: int = 0
    author: str = ""
    created: int = 0

    def __post_init__(self) -> None:
        if type(self.name) is not str or not _NAME.fullmatch(self.name):
            raise InvalidName(
                f"fluent name {self.name!r}: use letters, digits and . : @ + ~ - _ only, and at "
                "most 256 of them"
            )
        if type(self.class_name) is not str or not _TERM.fullmatch(self.class_name):
            raise InvalidName(
                f"class {self.class_name!r} of fluent {self.name!r} is not a class name"
            )
        begins, ends = self.start.earliest, self.finish.latest
        if begins is not None and ends is not None and begins > ends:
            raise IntervalReversed(
                f"fluent {self.name!r} finishes before it can have started (start.earliest "
                f"{begins} s, finish.latest {ends} s); correct one of the two"
            )
        unique = tuple(dict.fromkeys(self.properties))
        if len(unique) != len(self.properties) or type(self.properties) is not tuple:
            object.__setattr__(self, "properties", unique)

    @property
    def start_bounds(self) -> tuple[float, float]:
        """Earliest and latest start as plain numbers; a wholly unknown start is -inf, -inf."""
        if self.start.is_unknown:
            return -math.inf, -math.inf
        earliest, latest = self.start.earliest, self.start.latest
        return (
            -math.inf if earliest is None else earliest,
            math.inf if latest is None else latest,
        )

    @property
    def finish_bounds(self) -> tuple[float, float]:
        """Earliest and latest finish as plain numbers; a wholly unknown finish is inf, inf."""
        if self.finish.is_unknown:
            return math.inf, math.inf
        earliest, latest = self.finish.earliest, self.finish.latest
        return (
            -math.inf if earliest is None else earliest,
            math.inf if latest is None else latest,
        )

    @property
    def is_open(self) -> bool:
        """It holds until further notice: nothing is known about its finish."""
        return self.finish.is_unknown

    def holds_at(self, time_s: float) -> Certainty:
        """Whether it holds at a time: certainly, possibly or impossibly.

        With start [s1, s2] and finish [f1, f2] it certainly holds iff s2 <= t < f1 and possibly
        iff s1 <= t < f2.

        Raises:
            InvalidTime: the time is NaN.
        """
        if math.isnan(time_s):
            raise InvalidTime("cannot tell what holds at NaN; give a number of seconds")
        s1, s2 = self.start_bounds
        f1, f2 = self.finish_bounds
        if s2 <= time_s < f1:
            return Certainty.CERTAIN
        return Certainty.POSSIBLE if s1 <= time_s < f2 else Certainty.IMPOSSIBLE

    def values(self, name: str) -> tuple[Value, ...]:
        """All values of a property, in the order in which they were added."""
        return tuple(p.value for p in self.properties if p.name == name)

    def ended(self, at: float | Interval) -> Fluent:
        """The fluent with its finish set.

        Args:
            at: the finish in seconds, or the interval it lies in.

        Raises:
            NotARefinement: it has ended already, at another time.
            IntervalReversed: the end lies before the earliest start.
            InvalidTime: the interval is wholly unknown.
        """
        finish = at if isinstance(at, Interval) else Interval.at(at)
        if finish.is_unknown:
            raise InvalidTime(f"the end of {self.name!r} is unknown; say when it ended, in seconds")
        return self.refined(finish=finish)

    def refined(
        self,
        start: Interval | None = None,
        finish: Interval | None = None,
        properties: Iterable[Property] = (),
    ) -> Fluent:
        """The fluent with narrower intervals and more properties.

        Raises:
            NotARefinement: an interval would widen.
            IntervalReversed: it would finish before it can have started.
        """
        for what, old, new in (("start", self.start, start), ("finish", self.finish, finish)):
            if new is not None and not old.admits(new):
                raise NotARefinement(
                    f"{what} of {self.name!r} is known to lie in [{old.earliest}, {old.latest}] s; "
                    f"[{new.earliest}, {new.latest}] s would widen it. Facts are only narrowed: "
                    "assert a new fluent for what happened later, or have an admin force the "
                    "correction with a reason",
                    name=self.name,
                )
        return replace(
            self,
            start=self.start if start is None else start,
            finish=self.finish if finish is None else finish,
            properties=(*self.properties, *properties),
        )

    def merged(self, other: Fluent) -> Fluent:
        """This fluent refined by all that a second account of it says.

        What the other account leaves unknown stays as it is here.

        Raises:
            NotARefinement: the accounts contradict each other in class or intervals.
        """
        if other.class_name != self.class_name:
            raise NotARefinement(
                f"fluent {self.name!r} is a {self.class_name}; it cannot become a "
                f"{other.class_name}. End it and assert a new fluent",
                name=self.name,
            )
        return self.refined(
            _intersection(self.start, other.start),
            _intersection(self.finish, other.finish),
            other.properties,
        )


def _intersection(known: Interval, said: Interval) -> Interval | None:
    """What `said` adds to `known`, or None if it says nothing."""
    if said.is_unknown:
        return None
    return Interval(
        known.earliest if said.earliest is None else said.earliest,
        known.latest if said.latest is None else said.latest,
    )
