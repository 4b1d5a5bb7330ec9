"""A query's pattern as plain dataclasses, for the tiers to reason about (pure).

What they cannot reason about anyway (sub-selects, GRAPH, unusual paths) is kept as `Other`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, cast

import pyoxigraph as ox
from rdflib import BNode, Literal, URIRef, Variable
from rdflib.namespace import XSD
from rdflib.paths import Path, SequencePath
from rdflib.plugins.sparql.parserutils import CompValue

_EXACT_LITERALS = frozenset(
    {None, XSD.string, XSD.integer, XSD.float, XSD.double, XSD.boolean, XSD.decimal}
)


@dataclass(frozen=True, slots=True)
class Var:
    """A variable, or a blank node, which matches like a variable that is never projected."""

    name: str
    is_blank: bool = False


@dataclass(frozen=True, slots=True)
class Const:
    """A constant.

    Attributes:
        text: in N-Triples syntax.
        is_exact: the text says the same as the query; rdflib rewrites literals of some types.
    """

    text: str
    is_exact: bool = True


Place = Var | Const


@dataclass(frozen=True, slots=True)
class Pattern:
    """A triple pattern with a simple predicate; None stands for a path of another kind."""

    subject: Place
    predicate: Place | None
    target: Place


@dataclass(frozen=True, slots=True)
class Call:
    """A call of a function by its IRI.

    Attributes:
        function: the IRI.
        arguments: variables and constants; None for what is computed.
    """

    function: str
    arguments: tuple[Place | None, ...]


@dataclass(frozen=True, slots=True)
class Expression:
    """An expression, as far as it matters.

    Attributes:
        variables: used in it, outside EXISTS.
        exists: the patterns of its EXISTS and NOT EXISTS.
        calls: functions called by IRI, casts to XSD types aside; not those within EXISTS.
        names: functions, operators and aggregates in it, as rdflib calls them.
    """

    variables: frozenset[str]
    exists: tuple[Group, ...]
    calls: tuple[Call, ...]
    names: frozenset[str]

    @property
    def is_aggregate(self) -> bool:
        """It computes over groups of solutions."""
        return any(name.startswith("Aggregate_") for name in self.names)


@dataclass(frozen=True, slots=True)
class Triples:
    """A basic graph pattern."""

    patterns: tuple[Pattern, ...]


@dataclass(frozen=True, slots=True)
class Optional:
    """OPTIONAL { ... }."""

    group: Group


@dataclass(frozen=True, slots=True)
class Minus:
    """MINUS { ... }."""

    group: Group


@dataclass(frozen=True, slots=True)
class Union:
    """{ ... } UNION { ... }; a nested group is a union of one."""

    groups: tuple[Group, ...]


@dataclass(frozen=True, slots=True)
class Filter:
    """FILTER ( ... )."""

    expression: Expression


@dataclass(frozen=True, slots=True)
class Bind:
    """BIND ( ... AS ?variable )."""

    variable: str
    expression: Expression


@dataclass(frozen=True, slots=True)
class Values:
    """VALUES of some variables."""

    variables: frozenset[str]


@dataclass(frozen=True, slots=True)
class Other:
    """GRAPH, SERVICE, a sub-select, or something unknown."""

    kind: str


Part = Triples | Optional | Minus | Union | Filter | Bind | Values | Other


@dataclass(frozen=True, slots=True)
class Group:
    """{ ... }: parts in their order; filters apply to the whole."""

    parts: tuple[Part, ...]

    def all_parts(self) -> Iterator[Part]:
        """The parts, and those of nested groups; not those within EXISTS."""
        for part in self.parts:
            yield part
            if isinstance(part, Optional | Minus):
                yield from part.group.all_parts()
            elif isinstance(part, Union):
                for group in part.groups:
                    yield from group.all_parts()


@dataclass(frozen=True, slots=True)
class Select:
    """The query as a whole, ASK and CONSTRUCT included.

    Attributes:
        where: the pattern; a VALUES clause at the end of the query is its last part.
        projected: plain variables of the SELECT clause; None for `*`, ASK and CONSTRUCT.
        computed: expressions of the SELECT clause, and of GROUP BY, HAVING and ORDER BY.
        makes_values: the SELECT clause has expressions.
        is_distinct: SELECT DISTINCT.
        obstacles: what the query has besides a pattern: LIMIT, aggregates, REDUCED, FROM.
        template: triples of a CONSTRUCT, or None.
    """

    where: Group
    projected: frozenset[str] | None
    computed: tuple[Expression, ...]
    makes_values: bool
    is_distinct: bool
    obstacles: tuple[str, ...]
    template: tuple[Pattern, ...] | None


def select_of(tree: Any) -> Select:
    """The query that a syntax tree of rdflib's stands for."""
    obstacles: list[str] = []
    modifier = str(_value(tree, "modifier", ""))
    if modifier == "REDUCED":
        obstacles.append("REDUCED")
    if "datasetClause" in tree:
        obstacles.append("FROM")
    if "groupby" in tree or "having" in tree:
        obstacles.append("GROUP BY")
    if "limitoffset" in tree:
        obstacles.append("LIMIT or OFFSET")
    projected: set[str] | None = None
    computed: list[Expression] = []
    makes_values = False
    if "projection" in tree:
        projected = set()
        for item in tree["projection"]:
            if "expr" in item:
                computed.append(_expression(item["expr"]))
                makes_values = True
            else:
                projected.add(str(item["var"]))
    if any(expression.is_aggregate for expression in computed):
        obstacles.append("an aggregate")
    clauses = [tree[key] for key in ("groupby", "having", "orderby") if key in tree]
    computed += map(_expression, clauses)
    where = _group(tree["where"])
    if "valuesClause" in tree:
        where = Group((*where.parts, _part(tree["valuesClause"])))
    template = _patterns(tree["template"]) if "template" in tree else None
    if template is None and str(tree.name) == "ConstructQuery":
        template = tuple(
            pattern
            for part in where.parts
            if isinstance(part, Triples)
            for pattern in part.patterns
        )
    return Select(
        where,
        None if projected is None else frozenset(projected),
        tuple(computed),
        makes_values,
        modifier == "DISTINCT",
        tuple(obstacles),
        template,
    )


def _group(node: Any) -> Group:
    if str(node.name) == "SubSelect":
        return Group((Other("a sub-select"),))
    return Group(tuple(_part(part) for part in _value(node, "part", ())))


def _part(node: Any) -> Part:
    name = str(node.name)
    if name == "TriplesBlock":
        return Triples(_patterns(node["triples"]))
    if name == "OptionalGraphPattern":
        return Optional(_group(node["graph"]))
    if name == "MinusGraphPattern":
        return Minus(_group(node["graph"]))
    if name == "GroupOrUnionGraphPattern":
        return Union(tuple(_group(group) for group in node["graph"]))
    if name == "Filter":
        return Filter(_expression(node["expr"]))
    if name == "Bind":
        return Bind(str(node["var"]), _expression(node["expr"]))
    if name in ("InlineData", "ValuesClause"):
        return Values(frozenset(str(variable) for variable in node["var"]))
    return Other({"GraphGraphPattern": "GRAPH"}.get(name, name))


def _value(node: Any, key: str, default: Any) -> Any:
    """A part of a node; rdflib's own `get` gives back the key where there is none."""
    return node[key] if key in node else default  # noqa: SIM401


def _patterns(entries: Iterable[Iterable[Any]]) -> tuple[Pattern, ...]:
    found: list[Pattern] = []
    for entry in entries:
        terms = list(entry)
        for i in range(0, len(terms), 3):
            found += _steps(*terms[i : i + 3])
    return tuple(found)


def _steps(subject: Any, predicate: Any, target: Any) -> Iterator[Pattern]:
    """A pattern; a path `a/b/c` of plain predicates becomes a chain."""
    if isinstance(predicate, SequencePath):
        steps = cast("list[Any]", predicate.args)
        if all(isinstance(step, URIRef) for step in steps):
            here = _place(subject)
            for number, step in enumerate(steps):
                last = number == len(steps) - 1
                there = _place(target) if last else Var(BNode(), is_blank=True)
                yield Pattern(here, _place(step), there)
                here = there
            return
    path = None if isinstance(predicate, Path) else _place(predicate)
    yield Pattern(_place(subject), path, _place(target))


def _place(term: Any) -> Place:
    if isinstance(term, Variable):
        return Var(str(term))
    if isinstance(term, BNode):
        return Var(str(term), is_blank=True)
    if isinstance(term, URIRef):
        return Const(f"<{term}>")
    if isinstance(term, Literal):
        return _literal(term)
    return Const(str(term), is_exact=False)


def _literal(term: Literal) -> Const:
    datatype = None if term.datatype is None else ox.NamedNode(str(term.datatype))
    literal = (
        ox.Literal(str(term), language=term.language)
        if term.language
        else ox.Literal(str(term), datatype=datatype)
    )
    return Const(str(literal), not term.language and term.datatype in _EXACT_LITERALS)


def _expression(node: Any) -> Expression:
    variables: set[str] = set()
    exists: list[Group] = []
    calls: list[Call] = []
    names: set[str] = set()

    def visit(part: Any) -> None:
        if isinstance(part, Variable):
            variables.add(str(part))
        elif isinstance(part, CompValue):
            name = str(part.name)
            names.add(name)
            items = cast("Mapping[str, Any]", part)
            if name in ("Builtin_EXISTS", "Builtin_NOTEXISTS"):
                exists.append(_group(items["graph"]))
                return
            if name == "Function" and not str(items["iri"]).startswith(str(XSD)):
                arguments = cast("Iterable[Any]", _value(part, "expr", ()))
                calls.append(Call(str(items["iri"]), tuple(map(_argument, arguments))))
            for inner in items.values():
                visit(inner)
        elif isinstance(part, (list, tuple)):
            for inner in cast("Iterable[Any]", part):
                visit(inner)

    visit(node)
    return Expression(frozenset(variables), tuple(exists), tuple(calls), frozenset(names))


def _argument(node: Any) -> Place | None:
    """An argument that is a plain variable or constant, out of rdflib's precedence levels."""
    while isinstance(node, CompValue):
        items = dict(cast("Mapping[str, Any]", node))
        if list(items) != ["expr"]:
            return None
        node = items["expr"]
    return _place(node) if isinstance(node, Variable | URIRef | Literal) else None
