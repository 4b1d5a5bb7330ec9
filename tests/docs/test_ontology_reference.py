"""docs/reference/ontology.md and glossary.md say what the ontology files say."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import rdflib
from rdflib.collection import Collection
from rdflib.namespace import OWL, RDF, RDFS
from rdflib.term import Node

from fluentboard_ontology import FURNITURE, ONTOLOGIES, PREFIXES, RACE, SWRL, UPPER, read

REFERENCE = Path(__file__).resolve().parents[2] / "docs" / "reference"
KINDS = {OWL.Class, OWL.ObjectProperty, OWL.DatatypeProperty, OWL.AnnotationProperty}
TOLERANCES = (
    "minimumRise",
    "minimumDepth",
    "maximumDepth",
    "minimumOverlap",
    "angleTolerance",
    "maximumGap",
)


@pytest.fixture(scope="module")
def ontologies() -> rdflib.Graph:
    graph = rdflib.Graph()
    for name in ONTOLOGIES:
        graph.parse(data=read(name), format="turtle")
    return graph


@pytest.fixture(scope="module")
def page() -> str:
    return (REFERENCE / "ontology.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def glossary() -> str:
    return (REFERENCE / "glossary.md").read_text(encoding="utf-8")


def local_name(node: object) -> str:
    return str(node).rpartition("#")[2]


def blocks(text: str, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.DOTALL | re.MULTILINE)


def tree(graph: rdflib.Graph, top: Node, depth: int = 0) -> list[str]:
    below = sorted(graph.subjects(RDFS.subClassOf, top), key=local_name)
    lines = ["  " * depth + local_name(top)]
    for node in below:
        lines += tree(graph, node, depth + 1)
    return lines


def manchester(graph: rdflib.Graph, expression: Node, inside: bool = False) -> str:
    """A class expression in Manchester syntax, bracketed as in the thesis."""
    if isinstance(expression, rdflib.URIRef):
        return local_name(expression)
    filler = graph.value(expression, OWL.someValuesFrom)
    if filler is not None:
        relation = local_name(graph.value(expression, OWL.onProperty))
        text = f"{relation} some {manchester(graph, filler, inside=True)}"
    else:
        both = graph.value(expression, OWL.intersectionOf)
        parts = both or graph.value(expression, OWL.unionOf)
        assert parts is not None
        word = " and " if both else " or "
        text = word.join(manchester(graph, p, inside=True) for p in Collection(graph, parts))
    return f"({text})" if inside else text


def rule_row(graph: rdflib.Graph, rule: Node) -> str | None:
    """The row of the table of labels, or None for rules about orientation or relations."""

    def value(node: Node, name: str) -> Node:
        (found,) = graph.objects(node, rdflib.URIRef(SWRL + name))
        return found

    body = list(Collection(graph, value(rule, "body")))
    (head,) = Collection(graph, value(rule, "head"))
    measured: dict[Node, str] = {}
    bounds: dict[str, list[str]] = {}
    base = ""
    for atom in body:
        match local_name(graph.value(atom, RDF.type)):
            case "ClassAtom":
                base = local_name(value(atom, "classPredicate"))
            case "DatavaluedPropertyAtom":
                measured[value(atom, "argument2")] = local_name(value(atom, "propertyPredicate"))
            case "BuiltinAtom":
                variable, bound = Collection(graph, value(atom, "arguments"))
                side = "lessThan" in str(value(atom, "builtin"))
                bounds.setdefault(measured[variable], ["", ""])[side] = str(bound)
            case _:
                return None
    if "hasInclination" in bounds:
        return None
    ranges = (
        " to ".join(bound for bound in bounds.get(name, ["", ""]) if bound)
        if all(bounds.get(name, ["", ""]))
        else "".join(
            word + bound
            for word, bound in zip(("> ", "< "), bounds.get(name, ["", ""]), strict=True)
            if bound
        )
        for name in ("hasPosY", "hasSize", "hasWidth", "hasLength")
    )
    orientation = "horizontal" if base == "HorizontalPlane" else "vertical"
    cells = (local_name(value(head, "classPredicate")), orientation, *ranges)
    return "| " + " | ".join(cells) + " |"


def test_class_tree_is_the_one_of_the_files(ontologies: rdflib.Graph, page: str) -> None:
    (shown,) = [block for block in blocks(page, "text") if block.startswith("Fluent\n")]
    assert shown.splitlines() == tree(ontologies, rdflib.URIRef(UPPER + "Fluent"))


def test_every_property_is_explained(ontologies: rdflib.Graph, page: str) -> None:
    for kind in KINDS - {OWL.Class}:
        for term in ontologies.subjects(RDF.type, kind):
            assert f"`{local_name(term)}`" in page, term


def test_table_of_labels_has_the_ranges_of_the_rules(ontologies: rdflib.Graph, page: str) -> None:
    rules = ontologies.subjects(RDF.type, rdflib.URIRef(SWRL + "Imp"))
    rows = {row for rule in rules if (row := rule_row(ontologies, rule))}
    assert len(rows) == 25
    shown = set(re.findall(r"^\| \w+Plane \| (?:horizontal|vertical) \|.*\|$", page, re.MULTILINE))
    assert shown == rows


def test_table_of_definitions_has_the_expressions(ontologies: rdflib.Graph, page: str) -> None:
    rows: set[str] = set()
    for piece in ontologies.subjects(RDFS.subClassOf, rdflib.URIRef(FURNITURE + "Furniture")):
        expression = ontologies.value(piece, OWL.equivalentClass)
        if expression is not None:
            numbers = [
                str(ontologies.value(piece, rdflib.URIRef(FURNITURE + name)))
                for name in ("priority", "symmetryOrder")
            ]
            cells = (local_name(piece), manchester(ontologies, expression), *numbers)
            rows.add("| " + " | ".join(cells) + " |")
    assert rows == set(re.findall(r"^\| \w+ \| .* \| \d+ \| \d+ \|$", page, re.MULTILINE))


def test_table_of_relations_has_the_tolerances(ontologies: rdflib.Graph, page: str) -> None:
    for name in TOLERANCES:
        for relation, limit in ontologies.subject_objects(rdflib.URIRef(FURNITURE + name)):
            row = rf"^\| `{local_name(relation)}` \|.*`{name}` {re.escape(str(limit))}\b"
            assert re.search(row, page, re.MULTILINE), (relation, name)


def test_turtle_examples_parse_and_use_declared_terms(ontologies: rdflib.Graph, page: str) -> None:
    prefixes = "".join(f"@prefix {name}: <{iri}> .\n" for name, iri in PREFIXES.items())
    examples = blocks(page, "turtle")
    assert examples
    for example in examples:
        graph = rdflib.Graph().parse(data=prefixes + example, format="turtle")
        own = set(graph.subjects())
        for triple in graph:
            for node in triple:
                if str(node).startswith((UPPER, RACE, FURNITURE)) and node not in own:
                    assert ontologies.value(node, RDF.type) in KINDS, node


def test_queries_of_the_page_parse(ontologies: rdflib.Graph, page: str) -> None:
    examples = blocks(page, "sparql")
    assert examples
    for example in examples:
        list(ontologies.query(example, initNs=dict(PREFIXES)))


def test_glossary_names_declared_terms_only(ontologies: rdflib.Graph, glossary: str) -> None:
    kinds = {*KINDS, rdflib.URIRef(SWRL + "Imp")}
    declared = {local_name(term) for kind in kinds for term in ontologies.subjects(RDF.type, kind)}
    named = set(re.findall(r"`(?:upper|race|furniture):(\w+)`", glossary))
    assert named
    assert named - declared == set()


def test_glossary_explains_each_word_once_and_in_order(glossary: str) -> None:
    words = re.findall(r"^\| \*\*(.+?)\*\*", glossary, re.MULTILINE)
    assert len(words) > 40
    assert len(set(words)) == len(words)
    sections = re.split(r"^## ", glossary, flags=re.MULTILINE)[1:]
    for section in sections:
        in_section = re.findall(r"^\| \*\*(.+?)\*\*", section, re.MULTILINE)
        assert in_section == sorted(in_section, key=str.casefold)
