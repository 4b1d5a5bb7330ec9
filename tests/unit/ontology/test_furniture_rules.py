"""The rules and definitions of the furniture ontology, as the thesis states them and we promise."""

from __future__ import annotations

import pytest
import rdflib
from rdflib.collection import Collection
from rdflib.namespace import OWL, RDF, RDFS, XSD
from rdflib.term import Node

from fluentboard_ontology import FURNITURE, SWRL, SWRLB

LOW_SHELF_PLANE_RULE = (
    "LowShelfPlane(?p) ← HorizontalPlane(?p)"
    " ∧ hasSize(?p, ?s) ∧ swrlb:greaterThan(?s, 0.01) ∧ swrlb:lessThan(?s, 0.5)"
    " ∧ hasPosY(?p, ?h) ∧ swrlb:greaterThan(?h, 0.08) ∧ swrlb:lessThan(?h, 0.18)"
)  # Section 3.2.2, as printed
RULE_COUNT = 32
ALLOWED_ATOMS = {
    "ClassAtom",
    "DatavaluedPropertyAtom",
    "IndividualPropertyAtom",
    "BuiltinAtom",
}


def short(node: object) -> str:
    text = str(node)
    return text.replace(SWRLB, "swrlb:").replace(FURNITURE, "").replace("urn:swrl:var#", "?")


def one(graph: rdflib.Graph, subject: Node, name: str) -> Node:
    (value,) = graph.objects(subject, rdflib.URIRef(SWRL + name))
    return value


def atoms(graph: rdflib.Graph, rule: Node, side: str) -> list[Node]:
    return list(Collection(graph, one(graph, rule, side)))


def kind(graph: rdflib.Graph, atom: Node) -> str:
    (found,) = graph.objects(atom, RDF.type)
    return str(found).removeprefix(SWRL)


def as_text(graph: rdflib.Graph, atom: Node) -> str:
    match kind(graph, atom):
        case "ClassAtom":
            predicate = one(graph, atom, "classPredicate")
            arguments = [one(graph, atom, "argument1")]
        case "BuiltinAtom":
            predicate = one(graph, atom, "builtin")
            arguments = list(Collection(graph, one(graph, atom, "arguments")))
        case _:
            predicate = one(graph, atom, "propertyPredicate")
            arguments = [one(graph, atom, "argument1"), one(graph, atom, "argument2")]
    return f"{short(predicate)}({', '.join(short(a) for a in arguments)})"


def rule_text(graph: rdflib.Graph, rule: Node) -> str:
    head, body = (
        " ∧ ".join(as_text(graph, atom) for atom in atoms(graph, rule, side))
        for side in ("head", "body")
    )
    return f"{head} ← {body}"


@pytest.fixture(scope="module")
def furniture(graphs: dict[str, rdflib.Graph]) -> rdflib.Graph:
    return graphs["furniture"]


@pytest.fixture(scope="module")
def rules(furniture: rdflib.Graph) -> list[Node]:
    return sorted(furniture.subjects(RDF.type, rdflib.URIRef(SWRL + "Imp")), key=str)


def term(name: str) -> rdflib.URIRef:
    return rdflib.URIRef(FURNITURE + name)


def test_rule_of_the_low_shelf_plane_is_the_printed_one(furniture: rdflib.Graph) -> None:
    assert rule_text(furniture, term("LowShelfPlaneRule")) == LOW_SHELF_PLANE_RULE


def test_no_other_rule_labels_low_shelf_planes(furniture: rdflib.Graph, rules: list[Node]) -> None:
    heads = [rule_text(furniture, rule).split(" ← ")[0] for rule in rules]
    assert heads.count("LowShelfPlane(?p)") == 1


def test_rules_are_named_and_counted(rules: list[Node]) -> None:
    assert len(rules) == RULE_COUNT
    assert all(short(rule).endswith("Rule") for rule in rules)


def test_rules_are_written_with_four_kinds_of_atoms_and_two_comparisons(
    furniture: rdflib.Graph, rules: list[Node]
) -> None:
    for rule in rules:
        for atom in atoms(furniture, rule, "body") + atoms(furniture, rule, "head"):
            assert kind(furniture, atom) in ALLOWED_ATOMS
            if kind(furniture, atom) == "BuiltinAtom":
                comparison = short(one(furniture, atom, "builtin"))
                assert comparison in {"swrlb:greaterThan", "swrlb:lessThan"}
                _, bound = Collection(furniture, one(furniture, atom, "arguments"))
                assert isinstance(bound, rdflib.Literal)


def test_every_rule_has_one_conclusion_about_its_plane(
    furniture: rdflib.Graph, rules: list[Node]
) -> None:
    for rule in rules:
        (head,) = atoms(furniture, rule, "head")
        assert kind(furniture, head) in {"ClassAtom", "IndividualPropertyAtom"}
        assert short(one(furniture, head, "argument1")) == "?p"


def test_every_variable_that_is_compared_is_bound_to_a_measurement(
    furniture: rdflib.Graph, rules: list[Node]
) -> None:
    for rule in rules:
        body = atoms(furniture, rule, "body")
        bound = {
            one(furniture, atom, "argument2")
            for atom in body
            if kind(furniture, atom) == "DatavaluedPropertyAtom"
        }
        compared = {
            Collection(furniture, one(furniture, atom, "arguments"))[0]
            for atom in body
            if kind(furniture, atom) == "BuiltinAtom"
        }
        assert compared <= bound


def test_every_range_has_its_lower_bound_below_its_upper(
    furniture: rdflib.Graph, rules: list[Node]
) -> None:
    for rule in rules:
        lower: dict[str, float] = {}
        upper: dict[str, float] = {}
        for atom in atoms(furniture, rule, "body"):
            if kind(furniture, atom) == "BuiltinAtom":
                variable, bound = Collection(furniture, one(furniture, atom, "arguments"))
                greater = short(one(furniture, atom, "builtin")) == "swrlb:greaterThan"
                bounds = lower if greater else upper
                assert str(variable) not in bounds, rule
                bounds[str(variable)] = float(str(bound))
        for variable in lower.keys() & upper.keys():
            assert lower[variable] < upper[variable], rule


def test_every_leaf_label_of_a_plane_has_a_rule(furniture: rdflib.Graph, rules: list[Node]) -> None:
    labelled = {rule_text(furniture, rule).split("(")[0] for rule in rules}
    planes = set(furniture.transitive_subjects(RDFS.subClassOf, term("Plane")))
    leaves = {p for p in planes if furniture.value(predicate=RDFS.subClassOf, object=p) is None}
    assert {short(leaf) for leaf in leaves} <= labelled
    assert {"HorizontalPlane", "VerticalPlane"} <= labelled


def test_every_piece_of_furniture_says_where_its_first_pose_comes_from(
    furniture: rdflib.Graph,
) -> None:
    defined = set(furniture.subjects(RDFS.subClassOf, term("Furniture")))
    defined &= set(furniture.subjects(OWL.equivalentClass, None))
    assert {short(d) for d in defined} == {
        "Cabinet",
        "Chair",
        "CoffeeTable",
        "Counter",
        "Desk",
        "Shelf",
        "Table",
        "WallShelf",
    }
    planes = set(furniture.transitive_subjects(RDFS.subClassOf, term("Plane")))
    for piece in defined:
        assert set(furniture.objects(piece, term("mainPlane"))) <= planes
        assert furniture.value(piece, term("mainPlane")) is not None
        assert isinstance(furniture.value(piece, term("symmetryOrder")), rdflib.Literal)
        assert isinstance(furniture.value(piece, term("priority")), rdflib.Literal)


def test_planes_and_furniture_are_not_disjoint(everything: rdflib.Graph) -> None:
    planes = set(everything.transitive_objects(term("Plane"), RDFS.subClassOf))
    pieces = set(everything.transitive_objects(term("Furniture"), RDFS.subClassOf))
    for group in everything.subjects(RDF.type, OWL.AllDisjointClasses):
        (members,) = everything.objects(group, OWL.members)
        disjoint = set(Collection(everything, members))
        assert not (disjoint & planes and disjoint & pieces)
    for one_side, other in everything.subject_objects(OWL.disjointWith):
        assert not (one_side in planes and other in pieces)
        assert not (one_side in pieces and other in planes)


@pytest.mark.parametrize(
    ("relation", "tolerance"),
    [
        ("isLowerThan", "minimumRise"),
        ("isBelow", "minimumRise"),
        ("isBelow", "minimumOverlap"),
        ("isPerpendicularTo", "angleTolerance"),
        ("isParallelTo", "angleTolerance"),
        ("isAdjacentTo", "maximumGap"),
    ],
)
def test_relations_carry_their_tolerances(
    furniture: rdflib.Graph, relation: str, tolerance: str
) -> None:
    value = furniture.value(term(relation), term(tolerance))
    assert isinstance(value, rdflib.Literal)
    assert value.datatype == XSD.decimal
    assert float(value) > 0.0
