"""From the solutions of a pattern to the result of the query (pure).

An incremental tier keeps the *support*: the bag of solutions before DISTINCT, ASK or CONSTRUCT make
a set of them. A result is in the set for as long as its support is above zero.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import pyoxigraph as ox

from fluentboard.board.subscriptions.patterns import Const, Pattern, Select, Var
from fluentboard.board.subscriptions.query import ParsedQuery, parse
from fluentboard.board.subscriptions.results import Bag, Difference, Solution, Term
from fluentboard.board.subscriptions.sparql_text import as_select_all, without_distinct
from fluentboard.board.subscriptions.terms import term_of

Kind = Literal["bag", "set", "any"]


@dataclass(frozen=True, slots=True)
class View:
    """How a query's result follows from its support.

    Attributes:
        text: SPARQL SELECT of the solutions that support the result.
        variables: columns of those solutions.
        kind: "bag": the support is the result; "set": each solution counts once; "any": the result
            is one empty solution if there is support.
        template: makes triples of the solutions (CONSTRUCT), or None.
        projected: columns of the result, where the solutions have more; None if they have not.
    """

    text: str
    variables: tuple[str, ...]
    kind: Kind
    template: tuple[Pattern, ...] | None = None
    projected: tuple[str, ...] | None = None

    def support(self, solutions: Mapping[Solution, int]) -> Bag:
        """The support that the solutions of `text` give."""
        if not solutions:
            return {}
        if self.kind == "any":
            count = sum(solutions.values())
            return {(): count} if count else {}
        made: Counter[Solution] = Counter()
        if self.template is None:
            if self.projected is None:
                return dict(solutions)
            columns = [
                self.variables.index(name) if name in self.variables else None
                for name in self.projected
            ]
            for solution, count in solutions.items():
                made[tuple(None if c is None else solution[c] for c in columns)] += count
            return dict(made)
        for solution, count in solutions.items():
            bound = dict(zip(self.variables, solution, strict=True))
            for pattern in self.template:
                triple = _instance(pattern, bound)
                if triple is not None:
                    made[triple] += count
        return dict(made)

    def result(self, support: Bag) -> Bag:
        """The result of the query."""
        return support if self.kind == "bag" else dict.fromkeys(support, 1)

    def difference(self, change: Difference, after: Mapping[Solution, int]) -> Difference:
        """The change of the result.

        Args:
            change: the change of the support.
            after: the support after it.
        """
        if self.kind == "bag":
            return change
        return Difference(
            {s: 1 for s, count in change.added.items() if after[s] == count},
            {s: 1 for s in change.removed if s not in after},
        )


def view_of(query: ParsedQuery, select: Select) -> View | None:
    """The view of a query, or None if its result does not follow from counted solutions."""
    if query.form == "select":
        text = without_distinct(query.text) if select.is_distinct else query.text
        return View(text, query.variables, "set" if select.is_distinct else "bag")
    text = as_select_all(query.text)
    if text is None:
        return None
    variables = _columns(text)
    if query.form == "ask":
        return View(text, variables, "any")
    template = select.template or ()
    if any(
        (isinstance(place, Var) and place.is_blank)
        or (isinstance(place, Const) and not place.is_exact)
        for pattern in template
        for place in (pattern.subject, pattern.predicate, pattern.target)
    ) or any(pattern.predicate is None for pattern in template):
        return None
    return View(text, variables, "set", template)


def _columns(text: str) -> tuple[str, ...]:
    return parse(text).variables


def _instance(pattern: Pattern, bound: Mapping[str, Term | None]) -> Solution | None:
    """A triple of the template, or None if it is none: something unbound, or a literal subject."""
    triple: list[Term] = []
    for place in (pattern.subject, pattern.predicate, pattern.target):
        term = bound.get(place.name) if isinstance(place, Var) else term_of(place.text)  # type: ignore[union-attr]
        if term is None:
            return None
        triple.append(term)
    subject, predicate, _ = triple
    if isinstance(subject, ox.Literal) or not isinstance(predicate, ox.NamedNode):
        return None
    return tuple(triple)
