"""Turtle to `RuleSet`: the only file of the mapping module that speaks RDF.

Deviates from STYLE section 1 (algorithms do not import rdflib): the thresholds live in the ontology
file only, and somebody has to parse it. It happens once, at start-up.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator

from rdflib import OWL, RDF, RDFS, Graph, Literal, Namespace, Node, URIRef
from rdflib.collection import Collection

from fluentboard.errors import InvalidOntology
from fluentboard_modules.mapping.rule_language import (
    And,
    Atom,
    ClassAtom,
    ComparisonAtom,
    Expression,
    FeatureAtom,
    FurnitureClass,
    Named,
    Or,
    RelationAtom,
    RelationProperties,
    Rule,
    RuleSet,
    Some,
    Term,
    Variable,
)

FURNITURE = Namespace("https://w3id.org/fluentboard/furniture#")
SWRL = Namespace("http://www.w3.org/2003/11/swrl#")
SWRLB = Namespace("http://www.w3.org/2003/11/swrlb#")

_TOLERANCES = (
    "minimumRise",
    "minimumDepth",
    "maximumDepth",
    "minimumOverlap",
    "angleTolerance",
    "maximumGap",
)
_COMPARISONS = (
    "greaterThan",
    "greaterThanOrEqual",
    "lessThan",
    "lessThanOrEqual",
    "equal",
    "notEqual",
)


def read_rules(turtle: str) -> RuleSet:
    """The rules, definitions and annotations of a furniture ontology.

    Args:
        turtle: the text of the ontology file.

    Raises:
        InvalidOntology: it does not parse, or uses a construct the classifier has no meaning for.
    """
    graph = Graph()
    try:
        graph.parse(data=turtle, format="turtle")
    except Exception as error:  # rdflib's parsers raise whatever they stumble over
        raise InvalidOntology(f"the furniture ontology is not Turtle: {_first(error)}") from error
    definitions: dict[str, list[Expression]] = defaultdict(list)
    subclasses: dict[str, list[str]] = defaultdict(list)
    for child, parent in graph.subject_objects(RDFS.subClassOf):
        if isinstance(child, URIRef) and isinstance(parent, URIRef):
            subclasses[_name(parent)].append(_name(child))
        elif isinstance(
            parent, URIRef
        ):  # an anonymous class below a named one is sufficient for it
            definitions[_name(parent)].append(_expression(graph, child))
    for left, right in graph.subject_objects(OWL.equivalentClass):
        for named, other in ((left, right), (right, left)):
            if isinstance(named, URIRef):
                definitions[_name(named)].append(_expression(graph, other))
    return RuleSet(
        rules=tuple(sorted(_rules(graph), key=lambda rule: rule.name)),
        definitions={name: tuple(parts) for name, parts in definitions.items()},
        subclasses={name: tuple(sorted(names)) for name, names in subclasses.items()},
        furniture=_furniture(graph, subclasses, definitions),
        relations=_relations(graph),
        features=frozenset(_name(p) for p in graph.subjects(RDF.type, OWL.DatatypeProperty)),
        labels={
            _name(subject): str(label)
            for subject, label in graph.subject_objects(RDFS.label)
            if isinstance(subject, URIRef)
        },
    )


def _name(node: Node) -> str:
    """The local name of an IRI."""
    return str(node).rpartition("#")[2].rpartition("/")[2]


def _furniture(
    graph: Graph, subclasses: dict[str, list[str]], definitions: dict[str, list[Expression]]
) -> dict[str, FurnitureClass]:
    below: list[str] = []
    pending = ["Furniture"]
    while pending:
        for child in subclasses.get(pending.pop(), []):
            if child not in below:
                below.append(child)
                pending.append(child)
    furniture: dict[str, FurnitureClass] = {}
    for name in sorted(below):
        if name not in definitions:
            continue  # a class that only groups others
        node = FURNITURE[name]
        main_planes = tuple(sorted(_name(o) for o in graph.objects(node, FURNITURE.mainPlane)))
        if not main_planes:
            raise InvalidOntology(
                f"furniture class {name} is defined but has no furniture:mainPlane; name the label "
                "of the plane its definition starts from"
            )
        furniture[name] = FurnitureClass(
            name=name,
            main_planes=main_planes,
            back_planes=tuple(sorted(_name(o) for o in graph.objects(node, FURNITURE.backPlane))),
            symmetry_order=int(_number(graph, node, FURNITURE.symmetryOrder, 1.0)),
            priority=_number(graph, node, FURNITURE.priority, 0.0),
            typical_depth_m=_number(graph, node, FURNITURE.typicalDepth, 0.0),
            front_planes=tuple(sorted(_name(o) for o in graph.objects(node, FURNITURE.frontPlane))),
            side_planes=tuple(sorted(_name(o) for o in graph.objects(node, FURNITURE.sidePlane))),
            has_room_below=str(graph.value(node, FURNITURE.hasRoomBelow)) in ("true", "1"),
            hanging_height_m=_number(graph, node, FURNITURE.hangingHeight, 0.0),
        )
    return furniture


def _relations(graph: Graph) -> dict[str, RelationProperties]:
    sub_relations: dict[str, list[str]] = defaultdict(list)
    for child, parent in graph.subject_objects(RDFS.subPropertyOf):
        sub_relations[_name(parent)].append(_name(child))
    inverses: dict[str, list[str]] = defaultdict(list)
    for left, right in graph.subject_objects(OWL.inverseOf):
        inverses[_name(left)].append(_name(right))
        inverses[_name(right)].append(_name(left))
    relations: dict[str, RelationProperties] = {}
    for node in graph.subjects(RDF.type, OWL.ObjectProperty):
        name = _name(node)
        relations[name] = RelationProperties(
            name=name,
            tolerances={
                key: _number(graph, node, FURNITURE[key])
                for key in _TOLERANCES
                if (node, FURNITURE[key], None) in graph
            },
            sub_relations=tuple(sorted(sub_relations[name])),
            inverses=tuple(sorted(inverses[name])),
            is_symmetric=(node, RDF.type, OWL.SymmetricProperty) in graph,
        )
    return relations


def _number(graph: Graph, node: Node, predicate: URIRef, default: float | None = None) -> float:
    value = graph.value(node, predicate, any=True)
    if value is None:
        if default is None:
            raise InvalidOntology(f"{_name(node)} has no {_name(predicate)}")
        return default
    try:
        return float(str(value))
    except ValueError as error:
        raise InvalidOntology(
            f"{_name(predicate)} of {_name(node)} is {value}, which is not a number"
        ) from error


def _expression(graph: Graph, node: Node) -> Expression:
    if isinstance(node, URIRef):
        return Named(_name(node))
    for predicate, kind in ((OWL.intersectionOf, And), (OWL.unionOf, Or)):
        members = graph.value(node, predicate)
        if members is not None:
            return kind(tuple(_expression(graph, part) for part in Collection(graph, members)))
    relation = graph.value(node, OWL.onProperty)
    filler = graph.value(node, OWL.someValuesFrom)
    if relation is not None and filler is not None:
        return Some(_name(relation), _expression(graph, filler))
    used = ", ".join(sorted(_name(predicate) for predicate in graph.predicates(node)))
    raise InvalidOntology(
        f"a class expression with {used} cannot be compiled; use intersectionOf, unionOf, "
        "someValuesFrom, or classify with a reasoner"
    )


def _rules(graph: Graph) -> Iterator[Rule]:
    for node in graph.subjects(RDF.type, SWRL.Imp):
        name = _name(node)
        body_list, head_list = graph.value(node, SWRL.body), graph.value(node, SWRL.head)
        if body_list is None or head_list is None:
            raise InvalidOntology(f"rule {name} has no body or no head")
        body = tuple(_atom(graph, name, atom) for atom in Collection(graph, body_list))
        for head_node in Collection(graph, head_list):  # a rule with two heads is two rules
            head = _atom(graph, name, head_node)
            if not isinstance(head, ClassAtom | RelationAtom):
                raise InvalidOntology(f"rule {name}: its head must be a class or a relation")
            yield Rule(name, head, body)


def _atom(graph: Graph, rule: str, node: Node) -> Atom:
    kind = graph.value(node, RDF.type)
    if kind == SWRL.ClassAtom:
        class_node = graph.value(node, SWRL.classPredicate)
        if not isinstance(class_node, URIRef):
            raise InvalidOntology(f"rule {rule}: a class atom must name its class")
        return ClassAtom(_name(class_node), _variable(graph, rule, node, SWRL.argument1))
    if kind == SWRL.IndividualPropertyAtom:
        return RelationAtom(
            _predicate(graph, rule, node),
            _variable(graph, rule, node, SWRL.argument1),
            _variable(graph, rule, node, SWRL.argument2),
        )
    if kind == SWRL.DatavaluedPropertyAtom:
        return FeatureAtom(
            _predicate(graph, rule, node),
            _variable(graph, rule, node, SWRL.argument1),
            _term(rule, graph.value(node, SWRL.argument2)),
        )
    if kind == SWRL.BuiltinAtom:
        builtin, arguments = graph.value(node, SWRL.builtin), graph.value(node, SWRL.arguments)
        terms = [] if arguments is None else [_term(rule, t) for t in Collection(graph, arguments)]
        name = "" if builtin is None else _name(builtin)
        if name not in _COMPARISONS or len(terms) != 2:
            raise InvalidOntology(
                f"rule {rule}: built-in {name} with {len(terms)} arguments cannot be compiled; "
                f"use one of {', '.join(_COMPARISONS)} with two, or classify with a reasoner"
            )
        return ComparisonAtom(name, terms[0], terms[1])
    raise InvalidOntology(f"rule {rule}: an atom of type {kind} cannot be compiled")


def _predicate(graph: Graph, rule: str, node: Node) -> str:
    predicate = graph.value(node, SWRL.propertyPredicate)
    if predicate is None:
        raise InvalidOntology(f"rule {rule}: a property atom must name its property")
    return _name(predicate)


def _variable(graph: Graph, rule: str, node: Node, place: URIRef) -> Variable:
    term = graph.value(node, place)
    if not isinstance(term, URIRef) or (term, RDF.type, SWRL.Variable) not in graph:
        raise InvalidOntology(
            f"rule {rule}: {term} must be declared a swrl:Variable; rules about single individuals "
            "cannot be compiled"
        )
    return Variable(_name(term))


def _term(rule: str, node: Node | None) -> Term:
    if isinstance(node, Literal):
        try:
            return float(str(node))
        except ValueError as error:
            raise InvalidOntology(f"rule {rule}: {node} is not a number") from error
    if node is None:
        raise InvalidOntology(f"rule {rule}: an atom lacks an argument")
    return Variable(_name(node))


def check_turtle(text: str, name: str) -> None:
    """Refuses a text that is not Turtle, and says where.

    Args:
        text: the text.
        name: what to call it in messages.

    Raises:
        InvalidOntology: it does not parse.
    """
    try:
        Graph().parse(data=text, format="turtle")
    except Exception as error:  # rdflib's parsers raise whatever they stumble over
        raise InvalidOntology(f"ontology {name} is not Turtle: {_first(error)}") from error


def _first(error: Exception) -> str:
    """What a parser complains of, without its excerpt of the text."""
    said = [line.strip() for line in str(error).splitlines()[:2]]
    return " ".join(said).removesuffix(" at ^ in:").replace(" of <>", "")
