"""Footprint: which statements a query's answer can depend on (pure).

A footprint is a set of *shapes*: triples in which None stands for any term. A commit that adds or
removes no statement of such a shape cannot change the answer. Where it cannot be told, the
footprint is everything.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, cast

from rdflib import BNode, Literal, URIRef, Variable
from rdflib.namespace import XSD
from rdflib.paths import AlternativePath, InvPath, MulPath, NegatedPath, Path, SequencePath
from rdflib.plugins.sparql.parserutils import CompValue

Shape = tuple[str | None, str | None, str | None]
"""Subject, predicate and object in N-Triples syntax; None matches any term."""

ANYTHING: Shape = (None, None, None)


@dataclass(frozen=True, slots=True)
class Footprint:
    """What a query depends on.

    Attributes:
        shapes: a change to a statement of one of these shapes may change the answer.
        why_everything: why the footprint is unbounded, or "" if it is not.
    """

    shapes: frozenset[Shape]
    why_everything: str = ""

    @property
    def is_everything(self) -> bool:
        """Any change may matter."""
        return ANYTHING in self.shapes

    @classmethod
    def everything(cls, why: str) -> Footprint:
        """The footprint of a query that nothing is known about."""
        return cls(frozenset({ANYTHING}), why)


class _Unbounded(Exception):
    """Raised within this file where a pattern may match any statement."""


def footprint_of(tree: Any) -> Footprint:
    """The footprint of a query.

    Args:
        tree: rdflib's syntax tree of the query, or any part of it.
    """
    try:
        return Footprint(frozenset(_shapes(tree)))
    except _Unbounded as reason:
        return Footprint.everything(str(reason))


def _shapes(node: Any) -> Iterator[Shape]:
    if isinstance(node, CompValue):
        name = str(node.name)
        if name == "GraphGraphPattern" and not _has_triples(node):
            raise _Unbounded("GRAPH with an empty pattern lists the graphs themselves")
        for key, part in cast("Mapping[str, Any]", node).items():
            if key == "triples":
                yield from _triples_shapes(part)
            # A template says what comes out, not what is looked up.
            elif key not in ("template", "datasetClause"):
                yield from _shapes(part)
    elif isinstance(node, Mapping):
        for part in cast("Mapping[Any, Any]", node).values():
            yield from _shapes(part)
    elif isinstance(node, (list, tuple, set, frozenset)):
        for part in cast("Iterable[Any]", node):
            yield from _shapes(part)
    elif not isinstance(node, str | int | float | None):
        raise _Unbounded(f"the query has a part of unknown kind {type(node).__name__}")


def _has_triples(node: Any) -> bool:
    if isinstance(node, CompValue):
        return any(
            bool(part) if key == "triples" else _has_triples(part)
            for key, part in cast("Mapping[str, Any]", node).items()
        )
    if isinstance(node, (list, tuple)):
        return any(_has_triples(part) for part in cast("Iterable[Any]", node))
    return False


def triples_of(part: Any) -> list[tuple[Any, Any, Any]]:
    """The triple patterns of a basic graph pattern.

    rdflib gives them as flat lists of subject, predicate, object, subject, ...
    """
    found: list[tuple[Any, Any, Any]] = []
    for entry in cast("Iterable[Any]", part):
        terms = list(cast("Iterable[Any]", entry))
        if len(terms) % 3:
            raise _Unbounded("a pattern is not made of triples")
        found += [tuple(terms[i : i + 3]) for i in range(0, len(terms), 3)]
    return found


def _triples_shapes(part: Any) -> Iterator[Shape]:
    triples = triples_of(part)
    for here, (subject, predicate, target) in enumerate(triples):
        if isinstance(predicate, Path) and _is_nullable(predicate):
            # A path of length zero relates every term of the graph to itself. Oxigraph asks that a
            # constant, too, occurs in the graph.
            constants = [end for end in (subject, target) if _is_constant(end)]
            for end in constants:
                yield _text(end), None, None
                yield None, None, _text(end)
            others = triples[:here] + triples[here + 1 :]
            if not constants and not any(_is_anchored(end, others) for end in (subject, target)):
                raise _Unbounded("a path that may have length zero has two open ends")
        yield from _path_shapes(subject, predicate, target)


def _path_shapes(subject: Any, path: Any, target: Any) -> Iterator[Shape]:
    if isinstance(path, URIRef):
        yield _text(subject), _text(path), _text(target)
    elif isinstance(path, Variable | BNode):
        shape = _text(subject), None, _text(target)
        if shape == ANYTHING:
            raise _Unbounded("a pattern has variables in all three places")
        yield shape
    elif isinstance(path, InvPath):
        yield from _path_shapes(target, path.arg, subject)
    elif isinstance(path, AlternativePath):
        for choice in cast("list[Any]", path.args):
            yield from _path_shapes(subject, choice, target)
    elif isinstance(path, SequencePath):
        steps = cast("list[Any]", path.args)
        for number, step in enumerate(steps):
            # A step of length zero hands an end on to its neighbour: no step is tied to an end.
            begin = subject if number == 0 and not _is_nullable(step) else None
            end = target if number == len(steps) - 1 and not _is_nullable(step) else None
            yield from _path_shapes(begin, step, end)
    elif isinstance(path, MulPath):
        yield from _path_shapes(None, path.path, None)
    elif isinstance(path, NegatedPath):
        raise _Unbounded("a negated property set matches nearly all predicates")
    else:
        raise _Unbounded(f"a predicate of unknown kind {type(path).__name__}")


def _is_nullable(path: Any) -> bool:
    """The path may have length zero."""
    if isinstance(path, MulPath):
        return path.mod in ("*", "?") or _is_nullable(path.path)
    if isinstance(path, SequencePath):
        return all(_is_nullable(step) for step in cast("list[Any]", path.args))
    if isinstance(path, AlternativePath):
        return any(_is_nullable(choice) for choice in cast("list[Any]", path.args))
    if isinstance(path, InvPath):
        return _is_nullable(path.arg)
    return False


def _is_constant(term: Any) -> bool:
    return isinstance(term, URIRef | Literal)


def _is_anchored(variable: Any, triples: Iterable[tuple[Any, Any, Any]]) -> bool:
    """Another pattern beside it binds the variable to a term of the graph."""
    return any(
        variable in (subject, target) and not (isinstance(path, Path) and _is_nullable(path))
        for subject, path, target in triples
    )


def _text(term: Any) -> str | None:
    """A constant in N-Triples syntax; None for what may match several terms.

    Oxigraph compares numbers by value, so a literal counts only if it has one spelling.
    """
    if isinstance(term, URIRef):
        return f"<{term}>"
    if isinstance(term, Literal) and not term.language and term.datatype in (None, XSD.string):
        text = str(term)
        if text.isprintable() and not any(sign in text for sign in '"\\'):
            return f'"{text}"'
    return None
