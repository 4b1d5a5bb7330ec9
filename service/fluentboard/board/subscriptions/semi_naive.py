"""Tier 3: for joins of several fluents, find only the solutions that use a new statement.

The query is a conjunction of triple patterns, so a solution exists while all the statements that it
instantiates exist. The tier keeps the solutions. Where statements went, the solutions that use one
of them go; where statements came, the query is asked once more with one of its patterns bound to
them (by VALUES, which the store's planner starts from), for each pattern in turn. The cost follows
the change and not the size of the board.

Semi-naive evaluation is due to Bancilhon and Ramakrishnan (1986).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import ClassVar

from fluentboard.board.subscriptions.changes import CommitChange
from fluentboard.board.subscriptions.partition import NotASum, admitted_classes
from fluentboard.board.subscriptions.patterns import (
    Const,
    Filter,
    Pattern,
    Place,
    Select,
    Triples,
    Var,
)
from fluentboard.board.subscriptions.query import ParsedQuery
from fluentboard.board.subscriptions.results import Bag, Difference, Solution, Term, difference
from fluentboard.board.subscriptions.schema import CLOSURE, Schema
from fluentboard.board.subscriptions.sparql_text import filter_texts, prologue
from fluentboard.board.subscriptions.terms import term_of
from fluentboard.board.subscriptions.view import View, view_of
from fluentboard.board.vocabulary import Statement

_NEW_STATEMENTS_MAX = 500

Binding = dict[str, Term]


@dataclass(frozen=True, slots=True)
class Moves:
    """Statements that a run of commits added and removed in the end."""

    added: list[Statement]
    removed: list[Statement]


@dataclass(slots=True)
class SemiNaive:
    """The tier of joins.

    Attributes:
        reason: why it is sound.
        view: how the result follows from the solutions of all variables.
        head: the prologue of the query text.
        body: its patterns and filters.
        patterns: those that fluents can match, with the classes admitted for their object.
    """

    reason: str
    view: View
    head: str
    body: str
    patterns: tuple[tuple[Pattern, frozenset[str] | None], ...]
    tier: ClassVar[int] = 3
    _solutions: set[Solution] = field(default_factory=set[Solution], init=False)
    # Solutions by the subjects they use; made when the first statement goes.
    _by_subject: dict[Term, set[Solution]] | None = field(default=None, init=False)

    def support_of(self, solutions: Bag) -> Bag:
        """The support that the solutions of `view.text` give; they are kept."""
        self._solutions = set(solutions)
        self._by_subject = None
        return self.view.support(solutions)

    def question(self, moves: Moves) -> str | None:
        """A query for all solutions that use an added statement.

        Returns:
            The query, "" if no pattern matches an added statement, or None if so many do that a
            full evaluation is cheaper.
        """
        branches: list[str] = []
        for pattern, classes in self.patterns:
            rows: dict[tuple[str, ...], None] = {}
            variables = _variables(pattern)
            for statement in moves.added:
                if classes is not None and statement[2] not in classes:
                    continue
                bound = _match(pattern, statement)
                if bound is not None:
                    rows[tuple(str(bound[name]) for name in variables)] = None
            if not rows:
                continue
            if not variables or len(rows) > _NEW_STATEMENTS_MAX:
                return None
            names = " ".join(f"?{name}" for name in variables)
            table = " ".join(f"({' '.join(row)})" for row in rows)
            branches.append(f"{{ VALUES ({names}) {{ {table} }} {self.body} }}")
        if not branches:
            return ""
        columns = " ".join(f"?{name}" for name in self.view.variables)
        return f"{self.head} SELECT {columns} WHERE {{ {' UNION '.join(branches)} }}"

    def advance(self, moves: Moves, found: Iterable[Solution]) -> Difference:
        """Moves the solutions on.

        Args:
            moves: what was added and removed.
            found: the answer to `question(moves)`, after all moves.

        Returns:
            How the support of the result changes.
        """
        gone = {solution for statement in moves.removed for solution in self._using(statement)}
        come = set(found)
        lost, new = gone - come, come - self._solutions
        self._solutions -= lost
        self._solutions |= new
        if self._by_subject is not None:
            for solution in lost:
                for term in self._subjects(solution):
                    self._by_subject[term].discard(solution)
            for solution in new:
                for term in self._subjects(solution):
                    self._by_subject.setdefault(term, set()).add(solution)
        return difference(
            self.view.support(dict.fromkeys(lost, 1)), self.view.support(dict.fromkeys(new, 1))
        )

    def _using(self, statement: Statement) -> Iterator[Solution]:
        """The solutions in which a pattern became this statement."""
        for pattern, _ in self.patterns:
            bound = _match(pattern, statement)
            if bound is None:
                continue
            columns = [(self.view.variables.index(name), term) for name, term in bound.items()]
            for solution in self._candidates(pattern.subject, statement):
                if all(solution[column] == term for column, term in columns):
                    yield solution

    def _candidates(self, subject: Place, statement: Statement) -> Iterable[Solution]:
        if isinstance(subject, Const):
            return list(self._solutions)
        if self._by_subject is None:
            self._by_subject = {}
            for solution in self._solutions:
                for term in self._subjects(solution):
                    self._by_subject.setdefault(term, set()).add(solution)
        return list(self._by_subject.get(term_of(statement[0]), ()))

    def _subjects(self, solution: Solution) -> set[Term]:
        names = {p.subject.name for p, _ in self.patterns if isinstance(p.subject, Var)}
        terms = (solution[self.view.variables.index(name)] for name in names)
        return {term for term in terms if term is not None}


def moves_of(changes: Sequence[CommitChange]) -> Moves:
    """What the events of some commits added and removed in the end."""
    last: dict[Statement, bool] = {}
    for change in changes:
        for event in change.events:
            last.update(dict.fromkeys(event.removed, False))
            last.update(dict.fromkeys(event.added, True))
    return Moves(
        [statement for statement, came in last.items() if came],
        [statement for statement, came in last.items() if not came],
    )


def semi_naive(query: ParsedQuery, select: Select, schema: Schema) -> SemiNaive:
    """The plan of a query for this tier.

    Args:
        query: the query as the client wrote it.
        select: its pattern over the materialised class hierarchy.
        schema: the class hierarchy.

    Raises:
        NotASum: the query is not a conjunction of triple patterns and filters.
    """
    if select.obstacles:
        raise NotASum(f"{select.obstacles[0]} needs all solutions at once")
    if select.makes_values or query.makes_blank_nodes or not query.is_timeless:
        raise NotASum("it computes values")
    filters: list[Filter] = []
    patterns: list[Pattern] = []
    for part in select.where.parts:
        if isinstance(part, Triples):
            patterns += part.patterns
        elif isinstance(part, Filter) and not part.expression.exists:
            if part.expression.calls:
                raise NotASum("its filters look at fluents that the join may not use")
            filters.append(part)
        else:
            raise NotASum("it is more than a conjunction of triple patterns and filters")
    named = {place: _named(place, number) for number, place in enumerate(_places(patterns))}
    texts = filter_texts(query.text)
    if len(texts) != len(filters):
        raise NotASum("its filters are not told apart")
    renamed = [_renamed(pattern, named) for pattern in patterns]
    variables = tuple(dict.fromkeys(name for pattern in renamed for name in _variables(pattern)))
    head = prologue(query.text)
    body = " ".join([f"{_text(pattern)} ." for pattern in renamed] + texts)
    columns = " ".join(f"?{name}" for name in variables)
    found = view_of(query, select)
    if found is None or not variables:
        raise NotASum("the template of CONSTRUCT cannot be filled in here")
    view = View(
        f"{head} SELECT {columns} WHERE {{ {body} }}",
        variables,
        found.kind,
        found.template,
        query.variables if query.form == "select" else None,
    )
    moving = tuple(
        (
            pattern,
            admitted_classes(pattern.target, renamed, schema)
            if isinstance(pattern.target, Var)
            else None,
        )
        for pattern in renamed
        if not (isinstance(pattern.predicate, Const) and pattern.predicate.text in CLOSURE)
    )
    return SemiNaive(
        "a join of triple patterns: only solutions that use a changed statement are looked for",
        view,
        head,
        body,
        moving,
    )


def _places(patterns: Iterable[Pattern]) -> dict[Var, None]:
    found: dict[Var, None] = {}
    for pattern in patterns:
        for place in (pattern.subject, pattern.predicate, pattern.target):
            if place is None:
                raise NotASum("it follows a property path")
            if isinstance(place, Var):
                found[place] = None
            elif not place.is_exact:
                raise NotASum(f"{place.text} may be spelt in several ways")
    return found


def _named(place: Var, number: int) -> Var:
    """The variable under which a blank node takes part in a solution."""
    return Var(f"unnamed__{number}") if place.is_blank else place


def _renamed(pattern: Pattern, named: dict[Var, Var]) -> Pattern:
    subject, predicate, target = (
        named[place] if isinstance(place, Var) else place
        for place in (pattern.subject, pattern.predicate, pattern.target)
    )
    assert subject is not None
    assert target is not None
    return Pattern(subject, predicate, target)


def _variables(pattern: Pattern) -> tuple[str, ...]:
    places = (pattern.subject, pattern.predicate, pattern.target)
    return tuple(dict.fromkeys(place.name for place in places if isinstance(place, Var)))


def _text(pattern: Pattern) -> str:
    places = (pattern.subject, pattern.predicate, pattern.target)
    return " ".join(
        f"?{place.name}" if isinstance(place, Var) else place.text
        for place in places
        if place is not None
    )


def _match(pattern: Pattern, statement: Statement) -> Binding | None:
    """What the pattern's variables become if it is this statement; None if it cannot be."""
    bound: Binding = {}
    # The predicate first: it tells most statements apart.
    for place, text in (
        (pattern.predicate, statement[1]),
        (pattern.subject, statement[0]),
        (pattern.target, statement[2]),
    ):
        if isinstance(place, Const):
            if place.text != text and (
                text.startswith("<") or term_of(place.text) != term_of(text)
            ):
                return None
        elif place is not None:
            term = term_of(text)
            if bound.setdefault(place.name, term) != term:
                return None
    return bound
