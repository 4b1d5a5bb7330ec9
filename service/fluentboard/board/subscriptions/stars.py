"""Tier 1: match star patterns against the changed fluent in Python; no SPARQL is run.

A star is a basic graph pattern that says several things of one subject:

    ?x a race:Mug ; upper:onTop fluent:table1 ; upper:hasPose ?pose .

Constant predicates only, and for the class also `rdf:type/rdfs:subClassOf*` or a type variable with
`rdfs:subClassOf+` or `*` above it. The queries that an event can matter to are found by hashing
what the fluent says (`keys`), so those that it does not match cost nothing.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import ClassVar

from fluentboard.board.subscriptions.changes import EventChange
from fluentboard.board.subscriptions.footprint import Shape
from fluentboard.board.subscriptions.partition import (
    TYPE,
    NotASum,
    required_keys,
)
from fluentboard.board.subscriptions.patterns import (
    Const,
    Group,
    Pattern,
    Place,
    Select,
    Triples,
    Var,
)
from fluentboard.board.subscriptions.query import ParsedQuery
from fluentboard.board.subscriptions.results import (
    NO_DIFFERENCE,
    Bag,
    Difference,
    Solution,
    Term,
    difference,
)
from fluentboard.board.subscriptions.schema import CLOSURE, Schema
from fluentboard.board.subscriptions.terms import term_of
from fluentboard.board.subscriptions.view import View, view_of
from fluentboard.board.vocabulary import Statement


@dataclass(frozen=True, slots=True)
class _Ray:
    """One thing that the star says of its subject.

    Attributes:
        predicate: in N-Triples syntax.
        wanted: the object, or None if it is a variable.
        variable: name of that variable, or "".
        classes: for a type variable, the classes that are admitted; None for all.
    """

    predicate: str
    wanted: Term | None
    variable: str
    classes: frozenset[str] | None


@dataclass(frozen=True, slots=True)
class Star:
    """The tier of star patterns.

    Attributes:
        reason: why it is sound.
        keys: what a fluent must say to match.
        view: how the result follows from the matches.
        subject: the subject, or None if it is a variable.
        subject_variable: name of that variable, or "".
        rays: what is said of it.
    """

    reason: str
    keys: frozenset[Shape]
    view: View
    subject: str | None
    subject_variable: str
    rays: tuple[_Ray, ...]
    tier: ClassVar[int] = 1

    def support_of(self, solutions: Bag) -> Bag:
        """The support that the solutions of `view.text` give."""
        return self.view.support(solutions)

    def difference(self, change: EventChange) -> Difference:
        """How the event changes the support of the result."""
        after = self.matches(change.after)
        before = self.matches(change.before)
        if not (before or after):
            return NO_DIFFERENCE
        return difference(self.view.support(before), self.view.support(after))

    def matches(self, statements: Sequence[Statement]) -> Bag:
        """The solutions that a fluent with these statements contributes."""
        if not statements or (self.subject is not None and statements[0][0] != self.subject):
            return {}
        choices: list[list[Term]] = []
        for ray in self.rays:
            terms = [
                term_of(target)
                for _, predicate, target in statements
                if predicate == ray.predicate and (ray.classes is None or target in ray.classes)
            ]
            if ray.wanted is not None:
                terms = [term for term in terms if term == ray.wanted]
            if not terms:
                return {}
            # Two spellings of one number are one statement.
            choices.append(list(dict.fromkeys(terms)))
        first = {self.subject_variable: term_of(statements[0][0])} if self.subject_variable else {}
        rows = list(self._rows(first, choices, 0))
        return {rows[0]: 1} if len(rows) == 1 else dict(Counter(rows))

    def _rows(
        self, bound: dict[str, Term], choices: list[list[Term]], number: int
    ) -> Iterator[Solution]:
        if number == len(choices):
            yield tuple(bound.get(variable) for variable in self.view.variables)
            return
        variable = self.rays[number].variable
        for term in choices[number]:
            if not variable:
                yield from self._rows(bound, choices, number + 1)
            elif variable not in bound:
                yield from self._rows({**bound, variable: term}, choices, number + 1)
            elif bound[variable] == term:
                yield from self._rows(bound, choices, number + 1)


def star(query: ParsedQuery, select: Select, schema: Schema) -> Star:
    """The plan of a query for this tier.

    Args:
        query: the query as the client wrote it.
        select: its pattern over the materialised class hierarchy.
        schema: the class hierarchy.

    Raises:
        NotASum: the query is not a star.
    """
    if select.obstacles:
        raise NotASum(f"it has {select.obstacles[0]}")
    if select.makes_values:
        raise NotASum("it computes values")
    if query.makes_blank_nodes:
        raise NotASum("it makes blank nodes")
    patterns = _plain_patterns(select.where)
    own = [pattern for pattern in patterns if not _is_closure(pattern)]
    subjects = dict.fromkeys(pattern.subject for pattern in own)
    if len(subjects) != 1:
        raise NotASum("it is about several subjects, or none")
    subject = next(iter(subjects))
    types = {
        p.target
        for p in own
        if isinstance(p.predicate, Const) and p.predicate.text == TYPE and isinstance(p.target, Var)
    }
    classes: dict[Place, frozenset[str]] = {}
    for pattern in patterns:
        if not _is_closure(pattern):
            continue
        if pattern.subject not in types or not isinstance(pattern.target, Const):
            raise NotASum("it asks more of the class hierarchy than what is above a fluent's class")
        assert isinstance(pattern.predicate, Const)
        below = schema.below(pattern.predicate.text, pattern.target.text)
        known = classes.get(pattern.subject)
        classes[pattern.subject] = below if known is None else known & below
    view = view_of(query, select)
    if view is None:
        raise NotASum("the template of CONSTRUCT cannot be filled in here")
    return Star(
        "a star pattern on one subject, matched by hashing, without running SPARQL",
        required_keys(Group((Triples(patterns),)), subject, schema),
        view,
        subject.text if isinstance(subject, Const) else None,
        subject.name if isinstance(subject, Var) else "",
        tuple(_ray(pattern, classes) for pattern in own),
    )


def _plain_patterns(group: Group) -> tuple[Pattern, ...]:
    found: list[Pattern] = []
    for part in group.parts:
        if not isinstance(part, Triples):
            raise NotASum("it has more than triple patterns")
        found += part.patterns
    return tuple(found)


def _is_closure(pattern: Pattern) -> bool:
    return isinstance(pattern.predicate, Const) and pattern.predicate.text in CLOSURE


def _ray(pattern: Pattern, classes: dict[Place, frozenset[str]]) -> _Ray:
    if not isinstance(pattern.predicate, Const):
        raise NotASum("a predicate is a variable or a path")
    if isinstance(pattern.target, Const):
        if not pattern.target.is_exact:
            raise NotASum(f"{pattern.target.text} may be spelt in several ways")
        return _Ray(pattern.predicate.text, term_of(pattern.target.text), "", None)
    return _Ray(pattern.predicate.text, None, pattern.target.name, classes.get(pattern.target))
