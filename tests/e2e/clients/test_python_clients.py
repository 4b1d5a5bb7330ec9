"""Clients from PyPI, unmodified, against a board."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any
from urllib.error import HTTPError

import httpx
import pytest
from prometheus_client.parser import text_string_to_metric_families
from rdflib import RDF, BNode, Dataset, Graph, Literal, URIRef
from rdflib.contrib.rdf4j.client import RDF4JClient
from rdflib.plugins.stores.sparqlstore import SPARQLStore, SPARQLUpdateStore
from SPARQLWrapper import CSV, JSON, POST, TURTLE, XML, SPARQLWrapper  # type: ignore[import-untyped]
from SPARQLWrapper.SPARQLExceptions import QueryBadFormed  # type: ignore[import-untyped]

RACE, FLUENT = "https://w3id.org/fluentboard/race#", "https://w3id.org/fluentboard/fluent/"
MUG1, MUG2 = URIRef(FLUENT + "mug1"), URIRef(FLUENT + "mug2")
A, P = URIRef("urn:a"), URIRef("urn:p")
MUGS = f"PREFIX race: <{RACE}> SELECT ?mug WHERE {{ ?mug a race:Mug }} ORDER BY ?mug"


def test_rdflib_reads_the_board_as_a_graph(address: str) -> None:
    graph = Graph(SPARQLStore(address + "/sparql"))
    assert set(graph.subjects(RDF.type, URIRef(RACE + "Mug"))) == {MUG1, MUG2}
    rows: Any = graph.query(MUGS)
    assert [row.mug for row in rows] == [MUG1, MUG2]
    assert graph.query("ASK { ?mug a race:Mug }").askAnswer
    (size,) = graph.objects(MUG1, URIRef("https://w3id.org/fluentboard/upper#hasXSize"))
    assert isinstance(size, Literal)
    assert size.toPython() == pytest.approx(0.1)


def test_rdflib_writes_to_named_graphs(address: str) -> None:
    store = SPARQLUpdateStore(address + "/sparql", address + "/sparql")
    dataset = Dataset(store)
    graph = dataset.graph(URIRef("urn:rdflib"))
    graph.add((A, P, Literal("text", lang="en")))
    graph.addN((A, P, Literal(number), graph) for number in range(3))
    store.commit()
    assert len(graph) == 4
    graph.remove((A, P, Literal(1)))
    store.commit()
    assert set(graph.objects(A, P)) == {Literal("text", lang="en"), Literal(0), Literal(2)}
    store.update("DROP GRAPH <urn:rdflib>")
    store.commit()
    assert len(graph) == 0


def test_rdflib_is_told_that_fluents_are_not_its_to_change(address: str) -> None:
    store = SPARQLUpdateStore(address + "/sparql", address + "/sparql")
    with pytest.raises(HTTPError, match="Forbidden"):
        store.update(f"INSERT DATA {{ <{MUG1}> <urn:p> 1 }}")


def test_sparqlwrapper_gets_every_format(address: str) -> None:
    asking: Any = SPARQLWrapper(address + "/sparql")
    asking.setQuery(MUGS)
    asking.setReturnFormat(JSON)
    answer = asking.queryAndConvert()
    assert [row["mug"]["value"] for row in answer["results"]["bindings"]] == [str(MUG1), str(MUG2)]
    asking.setReturnFormat(CSV)
    assert str(MUG2).encode() in asking.queryAndConvert()
    asking.setReturnFormat(XML)
    assert len(asking.queryAndConvert().getElementsByTagName("result")) == 2
    asking.setQuery("CONSTRUCT WHERE { ?mug a race:Mug }")
    asking.setReturnFormat(TURTLE)
    graph = Graph().parse(data=asking.queryAndConvert(), format="turtle")
    assert len(graph) == 2


def test_sparqlwrapper_updates_by_post_and_learns_of_mistakes(address: str) -> None:
    asking: Any = SPARQLWrapper(address + "/sparql")
    asking.setMethod(POST)
    asking.setQuery("INSERT DATA { GRAPH <urn:wrapper> { <urn:a> <urn:p> 1 } }")
    asking.query()
    asking.setReturnFormat(JSON)
    asking.setQuery("ASK { GRAPH <urn:wrapper> { ?s ?p 1 } }")
    answer = asking.queryAndConvert()
    assert answer["boolean"] is True
    asking.setQuery("SELECT nonsense")
    with pytest.raises(QueryBadFormed):
        asking.query()


# rdflib's own client calls what rdflib deprecates.
@pytest.mark.filterwarnings("ignore:Dataset.default_context:DeprecationWarning")
def test_rdf4j_client_finds_a_repository(address: str) -> None:
    with RDF4JClient(address + "/rdf4j-server") as client:
        assert client.protocol >= 12
        (listed,) = client.repositories.list()
        repository: Any = client.repositories.get(listed.identifier)
        assert repository.health()
        graph = URIRef("urn:rdf4j")
        mine = Graph()
        mine.add((A, P, Literal("one")))
        mine.add((BNode(), P, A))
        repository.graphs.overwrite(graph, mine)
        assert repository.size(graph) == 2
        assert graph in repository.graph_names()
        repository.upload("<urn:b> <urn:p> 2 .", content_type="text/turtle")
        got = repository.get(subj=URIRef("urn:b"))
        assert [quad[2] for quad in got.quads()] == [Literal(2)]
        assert len(repository.query(MUGS)) == 2
        repository.update("DELETE DATA { <urn:b> <urn:p> 2 }")
        repository.namespaces.set("kitchen", "urn:kitchen:")
        assert repository.namespaces.get("kitchen") == "urn:kitchen:"
        repository.namespaces.remove("kitchen")
        with repository.transaction() as transaction:
            transaction.upload("<urn:c> <urn:p> 3 .", content_type="text/turtle")
            assert len(transaction.query("SELECT * { <urn:c> ?p ?o }")) == 1
        assert len(repository.query("SELECT * { <urn:c> ?p ?o }")) == 1
        repository.delete(subj=URIRef("urn:c"))
        repository.graphs.clear(graph)
        assert repository.size(graph) == 0


def test_sepy_hears_what_comes_and_goes(address: str) -> None:
    """In a process of its own: sepy configures the logging of the whole program."""
    script = Path(__file__).with_name("hear_with_sepy.py")
    done = subprocess.run(
        [sys.executable, "-W", "ignore", str(script), address],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == [
        {"queried": 0},
        {"added": [], "removed": []},
        {"added": ["urn:cup1"], "removed": []},
        {"added": [], "removed": ["urn:cup1"]},
    ]


def test_prometheus_reads_the_metrics(address: str) -> None:
    reply = httpx.get(address + "/metrics", trust_env=False)
    families = {family.name: family for family in text_string_to_metric_families(reply.text)}
    (fluents,) = families["fluentboard_fluents"].samples
    listed = httpx.get(address + "/fluents", params={"limit": 1000}, trust_env=False)
    assert fluents.value == len(listed.json()["fluents"]) >= 2
    assert {"fluentboard_http_requests", "fluentboard_http_request_seconds"} <= families.keys()
    openmetrics = httpx.get(
        address + "/metrics", headers={"Accept": "application/openmetrics-text"}, trust_env=False
    )
    assert openmetrics.text.endswith("# EOF\n")


def test_an_editor_in_a_browser_may_ask(address: str) -> None:
    """What YASGUI sends: a preflight where it has headers of its own, then the query as a form."""
    origin = "https://yasgui.example.org"
    asked = {
        "Origin": origin,
        "Access-Control-Request-Method": "POST",
        "Access-Control-Request-Headers": "authorization,content-type",
    }
    preflight = httpx.options(address + "/sparql", headers=asked, trust_env=False)
    assert preflight.status_code == 204
    assert preflight.headers["access-control-allow-origin"] == origin
    assert "POST" in preflight.headers["access-control-allow-methods"]
    allowed = preflight.headers["access-control-allow-headers"].lower()
    assert "authorization" in allowed
    assert "content-type" in allowed
    accept = "application/sparql-results+json,*/*;q=0.9"
    headers = {"Origin": origin, "Accept": accept}
    for reply in (
        httpx.post(address + "/sparql", data={"query": MUGS}, headers=headers, trust_env=False),
        httpx.get(address + "/sparql", params={"query": MUGS}, headers=headers, trust_env=False),
    ):
        assert reply.headers["access-control-allow-origin"] == origin
        assert len(reply.json()["results"]["bindings"]) == 2
    foreign = {**headers, "Origin": "https://evil.example"}
    reply = httpx.get(address + "/sparql", params={"query": MUGS}, headers=foreign, trust_env=False)
    assert "access-control-allow-origin" not in reply.headers


def test_a_followed_feed_tells_commits_as_they_are_made(address: str) -> None:
    with httpx.Client(base_url=address, trust_env=False, timeout=20.0) as client:
        last = client.get("/ready").json()["commit"]
        with client.stream("GET", "/changes", params={"since": last, "follow": "true"}) as feed:
            lines = feed.iter_lines()
            for number in (1, 2):
                update = f"INSERT DATA {{ GRAPH <urn:feed> {{ <urn:a> <urn:p> {number} }} }}"
                assert httpx.post(
                    address + "/sparql", data={"update": update}, trust_env=False
                ).is_success
                heading, begin, added, end = (next(lines) for _ in range(4))
                assert heading.startswith(f"# commit {last + number} by anonymous at ")
                assert (begin, end) == ("TX .", "TC .")
                assert added.startswith("A <urn:a> <urn:p> ")
                assert added.endswith(" <urn:feed> .")
