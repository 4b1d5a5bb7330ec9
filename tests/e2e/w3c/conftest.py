"""The W3C test suites for SPARQL 1.1, read from their manifests, and a service to run them on."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx
import pyoxigraph as ox
import pytest

from fluentboard_modules.demo.service_process import ServiceProcess

_CHECKOUT = Path(__file__).resolve().parents[3]
_SHARED = os.environ.get("FLUENTBOARD_SHARED_DATA") or _CHECKOUT.parent / "shared" / "data"
SUITE = Path(_SHARED) / "sparql11"

# Where the suite lives on the web: what relative IRIs in it are relative to.
BASE = "http://www.w3.org/2009/sparql/docs/tests/data-sparql11/"
PREFIXES = {
    "rdf": "http://www.w3.org/1999/02/22-rdf-syntax-ns#",
    "rdfs": "http://www.w3.org/2000/01/rdf-schema#",
    "mf": "http://www.w3.org/2001/sw/DataAccess/tests/test-manifest#",
    "qt": "http://www.w3.org/2001/sw/DataAccess/tests/test-query#",
    "ut": "http://www.w3.org/2009/sparql/tests/test-update#",
}
_FORMATS = {
    ".ttl": ox.RdfFormat.TURTLE,
    ".nt": ox.RdfFormat.N_TRIPLES,
    ".rdf": ox.RdfFormat.RDF_XML,
}
# What would need a reasoner, or other endpoints on the web.
_LEFT_OUT = {"entailment", "service"}


class Node:
    """A node of a manifest, with its properties by prefixed name."""

    def __init__(self, store: ox.Store, term: Any) -> None:
        self._store = store
        self.term = term

    @property
    def value(self) -> str:
        return self.term.value

    def all(self, name: str) -> list[Node]:
        prefix, _, local = name.partition(":")
        predicate = ox.NamedNode(PREFIXES[prefix] + local if prefix in PREFIXES else name)
        return [
            Node(self._store, quad.object)
            for quad in self._store.quads_for_pattern(self.term, predicate, None, None)
        ]

    def get(self, name: str) -> Node | None:
        found = self.all(name)
        return found[0] if found else None

    def members(self) -> Iterator[Node]:
        """The members of the list that this node is."""
        here: Node | None = self
        while here is not None and here.value != PREFIXES["rdf"] + "nil":
            first = here.get("rdf:first")
            assert first is not None
            yield first
            here = here.get("rdf:rest")

    @property
    def path(self) -> Path:
        """The file that this node names."""
        return SUITE / self.value.removeprefix(BASE)


@dataclass(frozen=True)
class Case:
    """A test of the suite.

    Attributes:
        folder: of the suite.
        name: its local name.
        kind: its type in the manifest.
        node: what the manifest says of it.
    """

    folder: str
    name: str
    kind: str
    node: Node

    @property
    def identifier(self) -> str:
        return f"{self.folder}/{self.name}"


def _cases() -> list[Case]:
    found: list[Case] = []
    for file in sorted(SUITE.glob("*/manifest*.ttl")):
        folder = file.parent.name
        if folder in _LEFT_OUT:
            continue
        store = ox.Store()
        base = f"{BASE}{folder}/{file.name}"
        store.bulk_load(path=str(file), format=ox.RdfFormat.TURTLE, base_iri=base)
        entries = Node(store, ox.NamedNode(base)).get("mf:entries")
        for node in entries.members() if entries is not None else ():
            types = [kind.value.rpartition("#")[2] for kind in node.all("rdf:type")]
            local = node.value.rpartition("#")[2]
            found += [Case(folder, local, kind, node) for kind in types]
    return found


CASES = _cases()


# Arguments of tests, and the kinds of cases that they stand for.
_ARGUMENTS = {
    "evaluated_query": {"QueryEvaluationTest", "CSVResultFormatTest"},
    "evaluated_update": {"UpdateEvaluationTest"},
    "good_query": {"PositiveSyntaxTest11", "PositiveSyntaxTest"},
    "bad_query": {"NegativeSyntaxTest11", "NegativeSyntaxTest"},
    "good_update": {"PositiveUpdateSyntaxTest11"},
    "bad_update": {"NegativeUpdateSyntaxTest11"},
    "exchanges": {"ProtocolTest", "GraphStoreProtocolTest"},
    "description": {"ServiceDescriptionTest"},
}


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Runs a test with one of the arguments for every case of its kinds."""
    for argument in _ARGUMENTS.keys() & set(metafunc.fixturenames):
        chosen = [case for case in CASES if case.kind in _ARGUMENTS[argument]]
        if argument == "exchanges":
            # The others are prose.
            chosen = [case for case in chosen if case.node.get("mf:action") is not None]
        skip = pytest.mark.skip(reason=f"no suite in {SUITE}; set FLUENTBOARD_SHARED_DATA")
        metafunc.parametrize(
            argument,
            chosen or [pytest.param(None, marks=skip)],
            ids=[case.identifier for case in chosen] or ["none"],
        )


@pytest.fixture
def prose() -> list[Case]:
    """The cases that are told rather than listed, in order."""
    found = [
        case
        for case in CASES
        if case.kind == "GraphStoreProtocolTest" and case.node.get("mf:action") is None
    ]
    if not found:
        pytest.skip(f"no suite in {SUITE}; set FLUENTBOARD_SHARED_DATA")
    return found


@pytest.fixture(scope="session")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[httpx.Client]:
    """A service without ontologies."""
    folder = tmp_path_factory.mktemp("w3c")
    settings = folder / "settings.yaml"
    settings.write_text("storage: {builtin_ontologies: false, durability: process}\n")
    with (
        ServiceProcess(folder / "board", arguments=("--config", str(settings))) as running,
        httpx.Client(base_url=running.address, trust_env=False, timeout=60.0) as client,
    ):
        yield client


@pytest.fixture
def endpoint(service: httpx.Client) -> httpx.Client:
    """The service, with nothing in it."""
    reply = service.post("/sparql", data={"update": "DROP ALL"})
    assert reply.status_code == 200, reply.text
    return service


@pytest.fixture(scope="session")
def dataset_of() -> Callable[[Node], dict[str, set[ox.Triple]]]:
    """Reads the files that a node of a manifest gives for the default and the named graphs."""

    def read(node: Node) -> dict[str, set[ox.Triple]]:
        graphs: dict[str, set[ox.Triple]] = {}
        for name in ("qt:data", "ut:data"):
            for data in node.all(name):
                graphs.setdefault("", set()).update(triples_of(data))
        for data in node.all("qt:graphData"):
            graphs[data.value] = triples_of(data)
        for data in node.all("ut:graphData"):
            graph, label = data.get("ut:graph"), data.get("rdfs:label")
            if graph is not None and label is not None:
                graphs[label.value] = triples_of(graph)
        return graphs

    return read


@pytest.fixture
def load(endpoint: httpx.Client) -> Callable[[Mapping[str, set[ox.Triple]]], None]:
    """Puts graphs into the service."""

    def put(graphs: Mapping[str, set[ox.Triple]]) -> None:
        for graph, triples in graphs.items():
            reply = endpoint.put(
                "/rdf-graph-store",
                params={"graph": graph} if graph else {"default": ""},
                content="".join(f"{triple} .\n" for triple in triples),
                headers={"Content-Type": "application/n-triples"},
            )
            assert reply.status_code in (201, 204), reply.text

    return put


@pytest.fixture(scope="session")
def canonical() -> Callable[[Iterable[ox.Triple]], set[str]]:
    """Names the blank nodes of triples by what is said of them, and numbers by their values."""

    def named(triples: Iterable[ox.Triple]) -> set[str]:
        store = ox.Store()
        store.extend(ox.Quad(t.subject, t.predicate, t.object) for t in triples)
        dataset = ox.Dataset(store)
        dataset.canonicalize(ox.CanonicalizationAlgorithm.UNSTABLE)
        return {str(quad) for quad in dataset}

    return named


def triples_of(node: Node) -> set[ox.Triple]:
    """The triples of a file that a manifest names; each file has blank nodes of its own."""
    path = node.path
    quads = ox.parse(
        path.read_bytes(),
        format=_FORMATS[path.suffix],
        base_iri=node.value,
        rename_blank_nodes=True,
    )
    return {quad.triple for quad in quads}
