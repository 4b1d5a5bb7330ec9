"""Results as bags of solutions, their differences, and their SPARQL JSON (pure).

A solution is a tuple of terms, one per variable, None where unbound; a bag counts how often each
occurs. ASK is the bag of one empty solution if the answer is true; CONSTRUCT is a set of
(subject, predicate, object). The order of an ORDER BY is not part of a bag.
"""

from __future__ import annotations

import hashlib
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import islice
from typing import Any, cast

import pyoxigraph as ox

from fluentboard.board.store import QueryResults
from fluentboard.board.triples import fluent_name
from fluentboard.errors import TooLarge

Term = ox.NamedNode | ox.BlankNode | ox.Literal | ox.Triple
Solution = tuple[Term | None, ...]
Bag = dict[Solution, int]
"""How often each solution occurs; only counts above zero are kept."""

_ROUNDS = 8


@dataclass(frozen=True, slots=True)
class Difference:
    """How one bag becomes another.

    Attributes:
        added: solutions, each with the number of times that it came.
        removed: solutions, each with the number of times that it went.
    """

    added: Bag
    removed: Bag

    def __bool__(self) -> bool:
        return bool(self.added or self.removed)

    def __len__(self) -> int:
        return sum(self.added.values()) + sum(self.removed.values())


NO_DIFFERENCE = Difference({}, {})


def bag_of(results: QueryResults, *, relabel: bool = False, limit: int | None = None) -> Bag:
    """The bag of a query's results; consumes them.

    Args:
        results: what the store answered.
        relabel: the query makes blank nodes, whose labels differ at each evaluation: name them
            after what is said about them instead.
        limit: how many solutions to take at most.

    Raises:
        TooLarge: there are more.
    """
    if isinstance(results, ox.QueryBoolean):
        return {(): 1} if results else {}
    some = results if limit is None else islice(results, limit + 1)
    if isinstance(results, ox.QueryTriples):
        triples = cast("Iterable[ox.Triple]", some)
        rows: Iterable[Solution] = {(t.subject, t.predicate, t.object) for t in triples}
    else:
        rows = map(tuple, cast("Iterable[ox.QuerySolution]", some))
    if relabel:
        rows = _with_stable_labels(list(rows))
    bag = dict(Counter(rows))
    if limit is not None and sum(bag.values()) > limit:
        raise TooLarge(
            f"the result has more than {limit} solutions, which is more than a standing query may "
            "have; narrow the query, or count instead of listing",
            limit=limit,
        )
    return bag


def difference(before: Mapping[Solution, int], after: Mapping[Solution, int]) -> Difference:
    """What turns one bag into the other."""
    if not before:
        return Difference(dict(after), {})
    if not after:
        return Difference({}, dict(before))
    added = {
        solution: count - before.get(solution, 0)
        for solution, count in after.items()
        if count > before.get(solution, 0)
    }
    removed = {
        solution: count - after.get(solution, 0)
        for solution, count in before.items()
        if count > after.get(solution, 0)
    }
    return Difference(added, removed)


def apply(bag: Bag, change: Difference) -> bool:
    """Changes the bag in place.

    Returns:
        False, with the bag left as it was, if a solution should go that is not there.
    """
    if any(bag.get(solution, 0) < count for solution, count in change.removed.items()):
        return False
    for solution, count in change.removed.items():
        if bag[solution] == count:
            del bag[solution]
        else:
            bag[solution] -= count
    for solution, count in change.added.items():
        bag[solution] = bag.get(solution, 0) + count
    return True


def fluents_in(solution: Solution) -> Iterator[str]:
    """Names of the fluents whose IRIs occur in a solution."""
    for term in solution:
        if isinstance(term, ox.NamedNode):
            name = fluent_name(term.value)
            if name is not None:
                yield name


def term_to_json(term: Term) -> dict[str, Any]:
    """A term as SPARQL 1.1 Query Results JSON encodes it."""
    if isinstance(term, ox.NamedNode):
        return {"type": "uri", "value": term.value}
    if isinstance(term, ox.BlankNode):
        return {"type": "bnode", "value": term.value}
    if isinstance(term, ox.Triple):
        parts = {"subject": term.subject, "predicate": term.predicate, "object": term.object}
        return {
            "type": "triple",
            "value": {place: term_to_json(part) for place, part in parts.items()},
        }
    if term.language:
        return {"type": "literal", "value": term.value, "xml:lang": term.language}
    datatype = term.datatype.value
    if datatype == "http://www.w3.org/2001/XMLSchema#string":
        return {"type": "literal", "value": term.value}
    return {"type": "literal", "value": term.value, "datatype": datatype}


def bindings_to_json(
    variables: tuple[str, ...], bag: Mapping[Solution, int]
) -> list[dict[str, Any]]:
    """The solutions of a bag as bindings, each as often as it occurs."""
    found: list[dict[str, Any]] = []
    for solution, count in bag.items():
        binding = {
            variable: term_to_json(term)
            for variable, term in zip(variables, solution, strict=True)
            if term is not None
        }
        found.extend([binding] * count)
    return found


def _with_stable_labels(rows: list[Solution]) -> list[Solution]:
    """The rows with each blank node named after what the rows say about it.

    Nodes are told apart by hashing their neighbourhood a few rounds; those that remain alike are
    numbered. The outcome is the same graph whatever the numbering, and equal parts of two
    results mostly get equal names, which keeps differences small.
    """
    places: defaultdict[ox.BlankNode, list[tuple[int, int]]] = defaultdict(list)
    for number, row in enumerate(rows):
        for column, term in enumerate(row):
            if isinstance(term, ox.BlankNode):
                places[term].append((number, column))
    if not places:
        return rows
    colours = dict.fromkeys(places, "")
    for _ in range(_ROUNDS):
        colours = {
            node: _digest(
                sorted(
                    f"{column}:"
                    + " ".join(
                        "_" if term == node else colours.get(term, str(term))  # type: ignore[arg-type]
                        for term in rows[number]
                    )
                    for number, column in here
                )
            )
            for node, here in places.items()
        }
    taken: Counter[str] = Counter()
    names: dict[ox.BlankNode, ox.BlankNode] = {}
    for node, colour in colours.items():
        names[node] = ox.BlankNode(f"b{colour}n{taken[colour]}")
        taken[colour] += 1
    return [
        tuple(names[term] if isinstance(term, ox.BlankNode) else term for term in row)
        for row in rows
    ]


def _digest(parts: list[str]) -> str:
    return hashlib.blake2b("\n".join(parts).encode(), digest_size=8).hexdigest()
