"""The service description: what `GET /sparql` answers without a query."""

from __future__ import annotations

import pyoxigraph as ox

from fluentboard.board.blackboard import Blackboard
from fluentboard.board.time_functions import FUNCTIONS
from fluentboard_ontology import FB, FLUENT, PREFIXES

_SD = "http://www.w3.org/ns/sparql-service-description#"
_VOID = "http://rdfs.org/ns/void#"
_FORMATS = "http://www.w3.org/ns/formats/"
_RESULT_FORMATS = (
    "SPARQL_Results_JSON",
    "SPARQL_Results_XML",
    "SPARQL_Results_CSV",
    "SPARQL_Results_TSV",
    "Turtle",
    "N-Triples",
    "JSON-LD",
    "RDF_XML",
    "TriG",
    "N-Quads",
    "N3",
)
_INPUT_FORMATS = ("Turtle", "N-Triples", "JSON-LD", "RDF_XML", "TriG", "N-Quads", "N3")
_INTEGER = ox.NamedNode(PREFIXES["xsd"] + "integer")
# A description is read by people too.
_NAMED_GRAPHS_MAX = 1_000

_A = ox.NamedNode(PREFIXES["rdf"] + "type")
_COMMENT = ox.NamedNode(PREFIXES["rdfs"] + "comment")

DESCRIPTION_PREFIXES = {
    "sd": _SD,
    "void": _VOID,
    "formats": _FORMATS,
    "fb": FB,
    "rdfs": PREFIXES["rdfs"],
}


def service_description(board: Blackboard, endpoint: str) -> list[ox.Triple]:
    """The service in the vocabularies of SPARQL 1.1 Service Description and VoID.

    Args:
        board: what is served.
        endpoint: the address of the SPARQL endpoint.
    """
    service, dataset, graph = (ox.BlankNode(name) for name in ("service", "dataset", "graph"))
    triples = [
        ox.Triple(service, _A, _sd("Service")),
        ox.Triple(service, _sd("endpoint"), ox.NamedNode(endpoint)),
        ox.Triple(service, _sd("supportedLanguage"), _sd("SPARQL11Query")),
        ox.Triple(service, _sd("supportedLanguage"), _sd("SPARQL11Update")),
        ox.Triple(service, _sd("feature"), _sd("EmptyGraphs")),
        ox.Triple(service, _sd("defaultDataset"), dataset),
        ox.Triple(dataset, _A, _sd("Dataset")),
        ox.Triple(dataset, _A, _void("Dataset")),
        ox.Triple(dataset, _void("sparqlEndpoint"), ox.NamedNode(endpoint)),
        ox.Triple(dataset, _void("uriSpace"), ox.Literal(FLUENT)),
        ox.Triple(dataset, _void("entities"), ox.Literal(str(len(board)), datatype=_INTEGER)),
        ox.Triple(dataset, _sd("defaultGraph"), graph),
        ox.Triple(graph, _A, _sd("Graph")),
    ]
    for property_name, formats in (
        ("resultFormat", _RESULT_FORMATS),
        ("inputFormat", _INPUT_FORMATS),
    ):
        triples += [
            ox.Triple(service, _sd(property_name), ox.NamedNode(_FORMATS + name))
            for name in formats
        ]
    for name, what in FUNCTIONS.items():
        function = ox.NamedNode(FB + name)
        triples += [
            ox.Triple(service, _sd("extensionFunction"), function),
            ox.Triple(function, _A, _sd("Function")),
            ox.Triple(function, _COMMENT, ox.Literal(what)),
        ]
    for number, name in enumerate(board.graphs.named_graphs()[:_NAMED_GRAPHS_MAX]):
        named, contents = ox.BlankNode(f"named{number}"), ox.BlankNode(f"graph{number}")
        triples += [
            ox.Triple(dataset, _sd("namedGraph"), named),
            ox.Triple(named, _A, _sd("NamedGraph")),
            ox.Triple(named, _sd("name"), name),
            ox.Triple(named, _sd("graph"), contents),
            ox.Triple(contents, _A, _sd("Graph")),
        ]
    return triples


def _sd(name: str) -> ox.NamedNode:
    return ox.NamedNode(_SD + name)


def _void(name: str) -> ox.NamedNode:
    return ox.NamedNode(_VOID + name)
