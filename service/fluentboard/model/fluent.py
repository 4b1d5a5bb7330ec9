"""Fluent and Property: a fact that holds within an uncertain time interval, never removed.

Names in this file are short names such as `Mug` and `mug1`; `fluentboard.board.vocabulary` knows
their IRIs.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import lru_cache

from fluentboard.errors import (
    IntervalReversed,
    InvalidName,
    InvalidTime,
    NotARefinement,
)
from fluentboard.model.interval import UNKNOWN, Certainty, Interval
from fluentboard.model.literals import Value, literal_value, shown

# Word characters of any script and a few signs that stand unescaped in an IRI path and in Turtle;
# "." and ".." are taken: a path that ends in one means another path.
_NAME = re.compile(r"(?!\.\.?\Z)[\w.:@+~-]{1,256}")
_TERM = re.compile(r"[^\s\x00-\x20\x7f<>\"{}|\\^`\ud800-\udfff]+")


@lru_cache(maxsize=8192)  # the same few classes and properties are named again and again
def _is_term(text: str) -> bool:
    return _TERM.fullmatch(text) is not None


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
        name, kind, value = self.name, self.type, self.value
        if type(name) is not str or len(name) > 512 or not _is_term(name):
            raise InvalidName(
                f"property name {shown(name)} is not a name or an IRI of at most 512 characters"
            )
        if type(kind) is not str or len(kind) > 512 or not _is_term(kind):
            raise InvalidName(
                f"property {name} has type {shown(kind)}; give an XSD type such as xsd:float, or "
                "the class of the fluent it refers to"
            )
        if kind[:4] == "xsd:":
            if (
                type(value) is float
                and -1e38 < value < 1e38
                and kind in ("xsd:float", "xsd:double")
            ):
                return
            object.__setattr__(self, "value", literal_value(name, kind, value))
        elif type(value) is not str or not _NAME.fullmatch(value):
            raise InvalidName(
                f"property {name} refers to {shown(value)}; a fluent's name has letters, digits "
                "and . : @ + ~ - _ only, and at most 256 of them"
            )

    @property
    def is_reference(self) -> bool:
        """The value names another fluent."""
        return not self.type.startswith("xsd:")


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
                f"fluent name {shown(self.name)}: use letters, digits and . : @ + ~ - _ only, and "
                "at most 256 of them"
            )
        kind = self.class_name
        if type(kind) is not str or len(kind) > 512 or not _is_term(kind):
            raise InvalidName(
                f"class {shown(kind)} of fluent {self.name!r} is not a name or an IRI of at most "
                "512 characters"
            )
        begins, ends = self.start.earliest, self.finish.latest
        if begins is not None and ends is not None and begins > ends:
            raise IntervalReversed(
                f"fluent {self.name!r} finishes before it can have started (start.earliest "
                f"{begins} s, finish.latest {ends} s); correct one of the two"
            )
        statements = self.properties
        if type(statements) is not tuple:
            object.__setattr__(self, "properties", statements := tuple(statements))
        # Statements under different names differ, and names are cheaper to compare.
        if len({statement.name for statement in statements}) < len(statements):
            object.__setattr__(self, "properties", tuple(dict.fromkeys(statements)))

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

        What the other account leaves unknown, or says less precisely, stays as it is here, so an
        account that agrees is never an error and the order of agreeing accounts does not matter.

        Raises:
            NotARefinement: the accounts contradict each other: they name different fluents or
                classes, or their intervals do not overlap.
        """
        if other.name != self.name:
            raise NotARefinement(
                f"an account of {other.name!r} says nothing about {self.name!r}; merge accounts of "
                "the same fluent",
                name=self.name,
            )
        if other.class_name != self.class_name:
            raise NotARefinement(
                f"fluent {self.name!r} is a {self.class_name}; it cannot become a "
                f"{other.class_name}. End it and assert a new fluent",
                name=self.name,
            )
        start = _intersection(self.name, "start", self.start, other.start)
        finish = _intersection(self.name, "finish", self.finish, other.finish)
        begins, ends = start.earliest, finish.latest
        if begins is not None and ends is not None and begins > ends:
            raise NotARefinement(
                f"two accounts of {self.name!r} contradict each other: together they say that it "
                f"started at {begins} s at the earliest and finished at {ends} s at the latest. "
                "Correct one of them, or give it another name",
                name=self.name,
            )
        known = set(self.properties)
        added = [statement for statement in other.properties if statement not in known]
        if not added and start == self.start and finish == self.finish:
            return self
        return replace(self, start=start, finish=finish, properties=(*self.properties, *added))


def _intersection(name: str, what: str, known: Interval, said: Interval) -> Interval:
    """All times that both accounts admit; an unknown side admits everything."""
    if said.is_unknown or known == said:
        return known
    if known.is_unknown:
        return said
    earliest, latest = said.earliest, said.latest
    if earliest is None or (known.earliest is not None and known.earliest > earliest):
        earliest = known.earliest
    if latest is None or (known.latest is not None and known.latest < latest):
        latest = known.latest
    if earliest is not None and latest is not None and earliest > latest:
        raise NotARefinement(
            f"{what} of {name!r} is known to lie in [{known.earliest}, {known.latest}] s, which "
            f"[{said.earliest}, {said.latest}] s contradicts: no time lies in both. Assert a new "
            "fluent for what happened at another time, or have an admin force the correction with "
            "a reason",
            name=name,
        )
    return Interval(earliest, latest)
