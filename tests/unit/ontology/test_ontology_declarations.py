"""The ontologies are complete, documented and tidy."""

from __future__ import annotations

from importlib.resources import files

import rdflib
from rdflib.namespace import OWL, RDF, RDFS
from rdflib.term import Node

from fluentboard_ontology import FURNITURE, ONTOLOGIES, RACE, UPPER, ontology_iri

OURS = (UPPER, RACE, FURNITURE)
PROPERTY_TYPES = (OWL.ObjectProperty, OWL.DatatypeProperty, OWL.AnnotationProperty)
SWRL_IMP = rdflib.URIRef("http://www.w3.org/2003/11/swrl#Imp")


def classes(graph: rdflib.Graph) -> set[rdflib.URIRef]:
    found = graph.subjects(RDF.type, OWL.Class)
    return {node for node in found if isinstance(node, rdflib.URIRef)}


def properties(graph: rdflib.Graph) -> set[rdflib.URIRef]:
    found = (node for kind in PROPERTY_TYPES for node in graph.subjects(RDF.type, kind))
    return {node for node in found if isinstance(node, rdflib.URIRef)}


def local_name(node: Node) -> str:
    return str(node).rpartition("#")[2]


def test_every_class_property_and_rule_has_one_label_and_one_comment(
    everything: rdflib.Graph,
) -> None:
    rules = set(everything.subjects(RDF.type, SWRL_IMP))
    for term in classes(everything) | properties(everything) | rules:
        assert len(list(everything.objects(term, RDFS.label))) == 1, term
        (comment,) = everything.objects(term, RDFS.comment)
        assert str(comment).endswith("."), term


def test_every_term_that_is_used_is_declared(everything: rdflib.Graph) -> None:
    declared: set[Node] = set(everything.subjects(RDF.type, SWRL_IMP))
    declared |= classes(everything) | properties(everything)
    used = {node for triple in everything for node in triple if str(node).startswith(OURS)}
    assert used - declared == set()


def test_terms_live_in_the_ontology_of_their_namespace(graphs: dict[str, rdflib.Graph]) -> None:
    for name in ONTOLOGIES:
        for term in classes(graphs[name]) | properties(graphs[name]):
            assert term.startswith(ontology_iri(name) + "#")


def test_local_names_are_unique_so_that_yaml_needs_no_prefix(everything: rdflib.Graph) -> None:
    terms = classes(everything) | properties(everything)
    assert len({local_name(term) for term in terms}) == len(terms)


def test_every_class_is_a_kind_of_fluent(everything: rdflib.Graph) -> None:
    fluent = rdflib.URIRef(UPPER + "Fluent")
    for term in classes(everything):
        assert fluent in everything.transitive_objects(term, RDFS.subClassOf), term


def test_every_property_that_fluents_carry_has_a_range(everything: rdflib.Graph) -> None:
    for term in properties(everything) - set(everything.subjects(RDF.type, OWL.AnnotationProperty)):
        assert everything.value(term, RDFS.range) is not None, term


def test_imports_point_down_and_name_our_ontologies(graphs: dict[str, rdflib.Graph]) -> None:
    for place, name in enumerate(ONTOLOGIES):
        imported = set(graphs[name].objects(rdflib.URIRef(ontology_iri(name)), OWL.imports))
        below = {rdflib.URIRef(ontology_iri(other)) for other in ONTOLOGIES[:place]}
        assert imported <= below
        assert imported or name == "upper"


def test_an_ontology_uses_only_what_it_imports(graphs: dict[str, rdflib.Graph]) -> None:
    allowed = {
        "upper": (UPPER,),
        "furniture": (UPPER, FURNITURE),
        "race": (UPPER, FURNITURE, RACE),
    }
    for name, graph in graphs.items():
        used = {str(node) for triple in graph for node in triple if str(node).startswith(OURS)}
        assert {iri for iri in used if not iri.startswith(allowed[name])} == set()


def test_protege_finds_the_imports_beside_the_files() -> None:
    text = (files("fluentboard_ontology") / "catalog-v001.xml").read_text(encoding="utf-8")
    for name in ONTOLOGIES:
        assert f'name="{ontology_iri(name)}" uri="{name}.ttl"' in text
