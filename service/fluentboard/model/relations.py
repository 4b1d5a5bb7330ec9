"""How uncertain intervals lie to each other and to a time: three-valued and exact (pure).

A fluent holds from an actual start s to an actual finish f. Known is only that s lies in [s1, s2],
that f lies in [f1, f2], and that s <= f. A statement about fluents is CERTAIN if every admissible
choice of the actual end points satisfies it, POSSIBLE if some does, and IMPOSSIBLE if none does.
End points of different fluents are chosen independently of each other.

End points are extended real numbers: "since ever" is -inf and "until further notice" is inf, as
`Fluent.start_bounds` and `Fluent.finish_bounds` have it. So two open fluents finish together, and a
side that is half known, such as [None, 5], includes -inf.

The relations are conjunctions of comparisons of end points, taken literally. For intervals that
last (s < f) exactly one of Allen's thirteen holds. A fluent that finishes as it starts (s = f) may
satisfy two at once: the instant 3 both *meets* and *starts* the interval from 3 to 5.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from enum import Enum
from typing import Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fluentboard.errors import IntervalReversed, InvalidTime
from fluentboard.model.fluent import Fluent
from fluentboard.model.interval import Certainty

Bounds = tuple[float, float, float, float]
"""Earliest and latest start, earliest and latest finish, in seconds; infinite where unknown."""

FloatArray = NDArray[np.float64]


class Relation(Enum):
    """A relation of one interval A to another B; the value is its name in REST and on the CLI.

    The first thirteen are Allen's. Of the others, INTERSECTS says that some moment belongs to both
    (half-open, so intervals that meet do not intersect), COVERS that A holds throughout B, and
    WITHIN that B covers A.
    """

    BEFORE = "before"
    AFTER = "after"
    MEETS = "meets"
    MET_BY = "met-by"
    OVERLAPS = "overlaps"
    OVERLAPPED_BY = "overlapped-by"
    STARTS = "starts"
    STARTED_BY = "started-by"
    DURING = "during"
    CONTAINS = "contains"
    FINISHES = "finishes"
    FINISHED_BY = "finished-by"
    EQUALS = "equals"
    INTERSECTS = "intersects"
    COVERS = "covers"
    WITHIN = "within"

    @property
    def camel(self) -> str:
        """The name as part of a SPARQL function, such as `MetBy` of `fb:certainlyMetBy`."""
        return "".join(word.capitalize() for word in self.value.split("-"))

    @property
    def owl_time(self) -> str | None:
        """The local name of OWL-Time's property for it, such as `intervalMetBy`, if any."""
        return f"interval{self.camel}" if self in ALLEN else None

    @property
    def inverse(self) -> Relation:
        """The relation of B to A."""
        return _INVERSE[self]


ALLEN: Final = tuple(Relation)[:13]
"""Allen's thirteen relations."""

# The four end points of a comparison; A's come first in `Bounds` order.
_A_START, _A_FINISH, _B_START, _B_FINISH = range(4)
_Comparison = tuple[int, Literal["<", "=", "<="], int]

_MEANING: Final[dict[Relation, tuple[_Comparison, ...]]] = {
    Relation.BEFORE: ((_A_FINISH, "<", _B_START),),
    Relation.MEETS: ((_A_FINISH, "=", _B_START),),
    Relation.OVERLAPS: (
        (_A_START, "<", _B_START),
        (_B_START, "<", _A_FINISH),
        (_A_FINISH, "<", _B_FINISH),
    ),
    Relation.STARTS: ((_A_START, "=", _B_START), (_A_FINISH, "<", _B_FINISH)),
    Relation.DURING: ((_B_START, "<", _A_START), (_A_FINISH, "<", _B_FINISH)),
    Relation.FINISHES: ((_B_START, "<", _A_START), (_A_FINISH, "=", _B_FINISH)),
    Relation.EQUALS: ((_A_START, "=", _B_START), (_A_FINISH, "=", _B_FINISH)),
    Relation.INTERSECTS: (
        (_A_START, "<", _A_FINISH),
        (_A_START, "<", _B_FINISH),
        (_B_START, "<", _A_FINISH),
        (_B_START, "<", _B_FINISH),
    ),
    Relation.COVERS: ((_A_START, "<=", _B_START), (_B_FINISH, "<=", _A_FINISH)),
}
_INVERSE: Final[dict[Relation, Relation]] = {
    Relation.BEFORE: Relation.AFTER,
    Relation.MEETS: Relation.MET_BY,
    Relation.OVERLAPS: Relation.OVERLAPPED_BY,
    Relation.STARTS: Relation.STARTED_BY,
    Relation.DURING: Relation.CONTAINS,
    Relation.FINISHES: Relation.FINISHED_BY,
    Relation.EQUALS: Relation.EQUALS,
    Relation.INTERSECTS: Relation.INTERSECTS,
    Relation.COVERS: Relation.WITHIN,
}
for _one, _other in tuple(_INVERSE.items()):
    _INVERSE[_other] = _one
    _MEANING[_other] = tuple(
        ((left + 2) % 4, sign, (right + 2) % 4) for left, sign, right in _MEANING[_one]
    )


class _Bound(NamedTuple):
    """A necessary condition: the least value of one end point against the greatest of another."""

    low: int
    high: int
    is_strict: bool


_Conditions = tuple[_Bound, ...]


def _conditions(comparisons: Iterable[_Comparison], points: int) -> _Conditions | None:
    """When some choice satisfies all comparisons and start <= finish; None if never.

    Comparisons form a partial order of the end points. The choice that puts each point as low as
    its predecessors allow (a hair above them where they are strictly below it) fails only if some
    point's least value exceeds the greatest value of a point that must not lie below it. So looking
    at all pairs that the order connects is enough, and exact.
    """
    # above[i][j]: None if j may lie below i, else whether it must lie strictly above.
    above: list[list[bool | None]] = [[None] * points for _ in range(points)]

    def put(low: int, high: int, is_strict: bool) -> None:
        above[low][high] = bool(above[low][high]) or is_strict

    for start in range(0, points, 2):
        put(start, start + 1, False)
    for left, sign, right in comparisons:
        put(left, right, sign == "<")
        if sign == "=":
            put(right, left, False)
    for via in range(points):
        for low in range(points):
            for high in range(points):
                first, second = above[low][via], above[via][high]
                if first is not None and second is not None:
                    put(low, high, first or second)
    if any(above[point][point] for point in range(points)):
        return None
    return tuple(
        _Bound(low, high, is_strict)
        for low in range(points)
        for high in range(points)
        # That a start's least value does not exceed the finish's greatest is given.
        if low != high
        and (is_strict := above[low][high]) is not None
        and (is_strict or (low, high) not in ((0, 1), (2, 3)))
    )


def _negations(comparison: _Comparison) -> Iterable[_Comparison]:
    left, sign, right = comparison
    if sign == "<":
        return ((right, "<=", left),)
    if sign == "<=":
        return ((right, "<", left),)
    return ((left, "<", right), (right, "<", left))


class _Decision(NamedTuple):
    """What to look at to decide a relation.

    Attributes:
        possible: all must be met for some choice to satisfy it; None if no choice ever does.
        counterexamples: if one of these is met as a whole, some choice violates it.
    """

    possible: _Conditions | None
    counterexamples: tuple[_Conditions, ...]


def _decision(comparisons: tuple[_Comparison, ...], points: int) -> _Decision:
    against = (
        _conditions((negation,), points)
        for comparison in comparisons
        for negation in _negations(comparison)
    )
    return _Decision(
        _conditions(comparisons, points), tuple(one for one in against if one is not None)
    )


_DECISIONS: Final = {
    relation: _decision(comparisons, 4) for relation, comparisons in _MEANING.items()
}
# Of a fluent to itself: both sides have the same two end points.
_OWN_DECISIONS: Final = {
    relation: _decision(tuple((low % 2, sign, high % 2) for low, sign, high in comparisons), 2)
    for relation, comparisons in _MEANING.items()
}


def bounds_of(fluent: Fluent) -> Bounds:
    """What is known of a fluent's end points."""
    return (*fluent.start_bounds, *fluent.finish_bounds)


def window(begin_s: float, end_s: float) -> Bounds:
    """An interval known exactly; an instant if it ends as it begins.

    Raises:
        InvalidTime: a side is NaN.
        IntervalReversed: it ends before it begins.
    """
    if math.isnan(begin_s) or math.isnan(end_s):
        raise InvalidTime("a window of time has NaN for an end; give seconds as numbers")
    if begin_s > end_s:
        raise IntervalReversed(
            f"the window ends at {end_s} s, before it begins at {begin_s} s; swap the two values"
        )
    return begin_s, begin_s, end_s, end_s


def relation_certainty(relation: Relation, one: Bounds, other: Bounds) -> Certainty:
    """Whether one interval stands in a relation to another, independent one.

    Args:
        relation: of the first to the second.
        one: what is known of the first.
        other: what is known of the second; see `window` for one known exactly.
    """
    low = (one[0], one[2], other[0], other[2])
    high = (one[1], one[3], other[1], other[3])
    return _decided(_DECISIONS[relation], low, high)


def own_certainty(relation: Relation, bounds: Bounds) -> Certainty:
    """Whether a fluent stands in a relation to itself: equals is certain, whatever is known."""
    return _decided(_OWN_DECISIONS[relation], (bounds[0], bounds[2]), (bounds[1], bounds[3]))


def related(
    relation: Relation, bounds: FloatArray, other: Bounds, certainty: Certainty
) -> NDArray[np.bool_]:
    """Which of many intervals stand in a relation to another one.

    Args:
        relation: of each of the many to the other.
        bounds: `(4, n)`; earliest and latest start, earliest and latest finish, in seconds.
        other: what is known of the other one.
        certainty: the least certainty that counts.

    Returns:
        `(n,)`.
    """
    count = len(bounds[0])
    low: list[FloatArray] = [bounds[0], bounds[2], *np.array([[other[0]], [other[2]]])]
    high: list[FloatArray] = [bounds[1], bounds[3], *np.array([[other[1]], [other[3]]])]

    def met(conditions: _Conditions) -> NDArray[np.bool_]:
        keep: NDArray[np.bool_] = np.ones(count, dtype=np.bool_)
        for one in conditions:
            least, greatest = low[one.low], high[one.high]
            keep &= least < greatest if one.is_strict else least <= greatest
        return keep

    decision = _DECISIONS[relation]
    if certainty is Certainty.IMPOSSIBLE:
        return np.ones(count, dtype=np.bool_)
    if decision.possible is None:
        return np.zeros(count, dtype=np.bool_)
    if certainty is Certainty.POSSIBLE:
        return met(decision.possible)
    keep: NDArray[np.bool_] = np.ones(count, dtype=np.bool_)
    for counterexample in decision.counterexamples:
        keep &= ~met(counterexample)
    return keep


def holding_certainty(bounds: Bounds, time_s: float) -> Certainty:
    """Whether a fluent holds at a time: certainly iff s2 <= t < f1, possibly iff s1 <= t < f2."""
    s1, s2, f1, f2 = bounds
    if s2 <= time_s < f1:
        return Certainty.CERTAIN
    return Certainty.POSSIBLE if s1 <= time_s < f2 else Certainty.IMPOSSIBLE


def holding_period(bounds: Bounds, certainty: Certainty) -> tuple[float, float]:
    """The times [begin, end) at which a fluent holds with at least some certainty, in seconds.

    It is empty (begin >= end) if there is no such time.
    """
    s1, s2, f1, f2 = bounds
    if certainty is Certainty.IMPOSSIBLE:
        return -math.inf, math.inf
    return (s2, f1) if certainty is Certainty.CERTAIN else (s1, f2)


def holding_periods(bounds: FloatArray, certainty: Certainty) -> tuple[FloatArray, FloatArray]:
    """The times [begin, end) `(n,)` of many fluents, given as `(4, n)`; see `holding_period`."""
    if certainty is Certainty.IMPOSSIBLE:
        ever = np.full(len(bounds[0]), math.inf)
        return -ever, ever
    return (bounds[1], bounds[2]) if certainty is Certainty.CERTAIN else (bounds[0], bounds[3])


def duration_bounds(bounds: Bounds) -> tuple[float, float]:
    """The least and the greatest time that a fluent may have held, in seconds.

    Where the difference of two infinite ends says nothing, the least is 0.
    """
    s1, s2, f1, f2 = bounds
    least = f1 - s2
    return (0.0 if math.isnan(least) else max(0.0, least)), f2 - s1


def _decided(decision: _Decision, low: tuple[float, ...], high: tuple[float, ...]) -> Certainty:
    if decision.possible is None or not _met(decision.possible, low, high):
        return Certainty.IMPOSSIBLE
    for counterexample in decision.counterexamples:
        if _met(counterexample, low, high):
            return Certainty.POSSIBLE
    return Certainty.CERTAIN


def _met(conditions: _Conditions, low: tuple[float, ...], high: tuple[float, ...]) -> bool:
    for low_at, high_at, is_strict in conditions:
        least, greatest = low[low_at], high[high_at]
        if least > greatest or (is_strict and least == greatest):
            return False
    return True
