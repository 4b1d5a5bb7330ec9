"""Whether a query's answer is the sum of what single fluents contribute (pure).

Choose a *pivot*: a variable, or the IRI of one fluent. Where every pattern says something of the
pivot, or of the class hierarchy, which no fluent changes, each solution comes from one fluent
alone, and

    answer(board) = answer(hierarchy + fluent 1) + answer(hierarchy + fluent 2) + ...

so an event changes the answer by the difference of its own fluent's term. This file decides where
that equation holds. Each pattern is in one of three conditions:

- BOUND: each of its solutions binds the pivot, so it is such a sum;
- STATIC: it speaks of the class hierarchy only (or of nothing), and is the same in every term;
- MIXED: a union of both.

A join with a BOUND pattern is BOUND. The left side of OPTIONAL and MINUS, and whatever EXISTS is
asked of, must be BOUND: otherwise a solution could come from one fluent and meet another's.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from enum import Enum

from fluentboard.board.subscriptions.footprint import ANYTHING, Shape
from fluentboard.board.subscriptions.patterns import (
    Bind,
    Const,
    Expression,
    Filter,
    Group,
    Minus,
    Optional,
    Pattern,
    Place,
    Select,
    Triples,
    Union,
    Values,
    Var,
)
from fluentboard.board.subscriptions.schema import CLOSURE, Schema
from fluentboard.board.triples import ENDPOINTS
from fluentboard.board.vocabulary import RDF_TYPE
from fluentboard_ontology import FB

TYPE = f"<{RDF_TYPE}>"

_ON_EVERY_FLUENT = frozenset({TYPE, *(f"<{iri}>" for iri in ENDPOINTS)})
_CLASS_KEYS_MAX = 500
# What these say of their first argument depends on no other fluent, whatever the second is.
_OF_ONE_FLUENT = frozenset(
    ("holdsAt", "possiblyHoldsAt", "certainlyHoldsAt", "certaintyAt", "durationMin", "durationMax")
)


class NotASum(Exception):
    """The equation does not hold for the pivot; the message says why."""


class _Condition(Enum):
    STATIC = "static"
    MIXED = "mixed"
    BOUND = "bound"


def pivots(select: Select) -> Iterator[Place]:
    """Subjects of the query's patterns that may be the pivot."""
    seen: dict[Place, None] = {}
    for part in select.where.all_parts():
        if isinstance(part, Triples):
            seen.update(dict.fromkeys(pattern.subject for pattern in part.patterns))
    yield from seen


def require_sum(select: Select, pivot: Place) -> None:
    """Checks that the answer is the sum over single fluents.

    Raises:
        NotASum: it is not, or cannot be told to be.
    """
    if isinstance(pivot, Const):
        # The query asks of one fluent: whatever it computes from that is one term.
        for part in select.where.all_parts():
            if not isinstance(part, Triples | Optional | Minus | Union | Filter | Bind | Values):
                raise NotASum(f"{part.kind} looks beyond the fluent")
            if isinstance(part, Filter | Bind):
                _require_own(part.expression, pivot)
            if isinstance(part, Triples):
                for pattern in part.patterns:
                    _require_about(pattern, pivot)
        for expression in select.computed:
            _require_own(expression, pivot)
        if "FROM" in select.obstacles:
            raise NotASum("FROM names other graphs")
        return
    if select.obstacles:
        raise NotASum(f"{select.obstacles[0]} needs all solutions at once")
    if _condition(select.where, pivot) is not _Condition.BOUND:
        raise NotASum(f"not every solution binds ?{pivot.name}")
    for expression in select.computed:
        _require_own(expression, pivot)


def required_keys(group: Group, pivot: Place, schema: Schema) -> frozenset[Shape]:
    """Shapes of which every fluent that contributes has a statement, as few as possible."""
    if isinstance(pivot, Const):
        return frozenset({(pivot.text, None, None)})
    best = frozenset({ANYTHING})
    rank = 9
    for part in group.parts:
        if isinstance(part, Triples):
            for pattern in part.patterns:
                keys, worth = _keys_of(pattern, pivot, part.patterns, schema)
                if worth < rank:
                    best, rank = keys, worth
        elif isinstance(part, Union) and all(
            _condition(inner, pivot) is _Condition.BOUND for inner in part.groups
        ):
            keys = frozenset[Shape]().union(
                *(required_keys(inner, pivot, schema) for inner in part.groups)
            )
            worth = max(_rank(key) for key in keys)
            if worth < rank:
                best, rank = keys, worth
    return best


def _condition(group: Group, pivot: Place) -> _Condition:
    so_far = _Condition.STATIC
    filters: list[Expression] = []
    for part in group.parts:
        if isinstance(part, Triples):
            so_far = _joined(so_far, _condition_of_triples(part, pivot))
        elif isinstance(part, Union):
            so_far = _joined(so_far, _condition_of_union(part, pivot))
        elif isinstance(part, Optional | Minus):
            if so_far is not _Condition.BOUND:
                raise NotASum("OPTIONAL or MINUS stands before the pivot is bound")
            _condition(part.group, pivot)
        elif isinstance(part, Filter):
            filters.append(part.expression)
        elif isinstance(part, Bind):
            if part.expression.exists and so_far is not _Condition.BOUND:
                raise NotASum("EXISTS stands before the pivot is bound")
            _require_own(part.expression, pivot)
        elif not isinstance(part, Values):
            raise NotASum(f"{part.kind} looks beyond single fluents")
    for expression in filters:
        if expression.exists and so_far is not _Condition.BOUND:
            raise NotASum("EXISTS is asked where the pivot is not bound")
        _require_own(expression, pivot)
    return so_far


def _condition_of_triples(part: Triples, pivot: Place) -> _Condition:
    own = [_require_about(pattern, pivot) for pattern in part.patterns]
    return _Condition.BOUND if any(own) else _Condition.STATIC


def _condition_of_union(part: Union, pivot: Place) -> _Condition:
    conditions = {_condition(group, pivot) for group in part.groups}
    return conditions.pop() if len(conditions) == 1 else _Condition.MIXED


def _joined(one: _Condition, other: _Condition) -> _Condition:
    if _Condition.BOUND in (one, other):
        return _Condition.BOUND
    return _Condition.MIXED if _Condition.MIXED in (one, other) else _Condition.STATIC


def _require_about(pattern: Pattern, pivot: Place) -> bool:
    """True if the pattern is about the pivot, False if about the class hierarchy."""
    if pattern.predicate is None:
        raise NotASum("a property path leads from one fluent to others")
    if isinstance(pattern.predicate, Const) and pattern.predicate.text in CLOSURE:
        return False
    if pattern.subject != pivot:
        raise NotASum("patterns are about more than one subject")
    return True


def _require_own(expression: Expression, pivot: Place) -> None:
    for call in expression.calls:
        first, *others = call.arguments or (None,)
        name = call.function.removeprefix(FB)
        if name in _OF_ONE_FLUENT:
            own = first == pivot
        else:
            own = all(
                place == pivot or (isinstance(place, Const) and not place.text.startswith("<"))
                for place in (first, *others)
            )
        if not own:
            raise NotASum(f"fb:{name} may look at other fluents")
    for group in expression.exists:
        if _condition(group, pivot) is not _Condition.BOUND:
            raise NotASum("EXISTS is about something else than the pivot")


def _keys_of(
    pattern: Pattern, pivot: Place, beside: tuple[Pattern, ...], schema: Schema
) -> tuple[frozenset[Shape], int]:
    predicate, target = pattern.predicate, pattern.target
    if pattern.subject != pivot or not isinstance(predicate, Const):
        return frozenset({ANYTHING}), 9
    if predicate.text in CLOSURE:
        return frozenset({ANYTHING}), 9
    if isinstance(target, Const) and target.text.startswith("<"):
        key: Shape = (None, predicate.text, target.text)
        return frozenset({key}), _rank(key)
    if predicate.text == TYPE and isinstance(target, Var):
        classes = admitted_classes(target, beside, schema)
        if classes is not None and len(classes) <= _CLASS_KEYS_MAX:
            return frozenset((None, TYPE, name) for name in classes), 2
    key = (None, predicate.text, None)
    return frozenset({key}), _rank(key)


def admitted_classes(
    variable: Var, patterns: Iterable[Pattern], schema: Schema
) -> frozenset[str] | None:
    """Classes that closure patterns beside it admit for a type variable; None for all."""
    found: frozenset[str] | None = None
    for pattern in patterns:
        if (
            pattern.subject == variable
            and isinstance(pattern.predicate, Const)
            and pattern.predicate.text in CLOSURE
            and isinstance(pattern.target, Const)
        ):
            below = schema.below(pattern.predicate.text, pattern.target.text)
            found = below if found is None else found & below
    return found


def _rank(key: Shape) -> int:
    """Smaller for keys that fewer fluents have."""
    _, predicate, target = key
    if predicate is None:
        return 9
    if target is not None:
        return 2 if predicate == TYPE else 1
    return 4 if predicate in _ON_EVERY_FLUENT else 3
