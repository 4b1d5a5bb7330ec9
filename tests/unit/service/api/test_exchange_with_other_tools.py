"""Datasets, OWL-Time and the change feed, read by rdflib; ontologies of others as knowledge."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import httpx
import orjson
import pytest
from rdflib import RDF, TIME, Dataset, Graph, Literal, URIRef

from fluentboard.api.app import BoardApp, create_app
from fluentboard.board.blackboard import Blackboard
from fluentboard.config import Settings

FLUENT, FB = "https://w3id.org/fluentboard/fluent/", "https://w3id.org/fluentboard/board#"
NOTES = """
INSERT DATA { <urn:a> <urn:p> "default" . GRAPH <urn:notes> { <urn:a> <urn:p> "named", 1.5 } }
"""


@pytest.fixture
def board() -> Iterator[Blackboard]:
    with Blackboard.open(None) as opened:
        yield opened


@pytest.fixture
def api(board: Blackboard, client_of: Callable[[BoardApp], httpx.Client]) -> httpx.Client:
    return client_of(create_app(board, Settings()))


def put(api: httpx.Client, *fluents: dict[str, Any]) -> int:
    reply = api.post("/fluents", json=list(fluents))
    assert reply.is_success, reply.text
    return reply.json()["commit"]


def update(api: httpx.Client, text: str) -> None:
    assert api.post("/sparql", data={"update": text}).status_code == 200


def mug(name: str, start: Any = None, finish: Any = None) -> dict[str, Any]:
    return {"name": name, "class": "Mug", "start": start, "finish": finish}


def read(text: str, form: str) -> set[Any]:
    """The quads of a document, as rdflib reads them."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # rdflib's readers call each other so
        dataset = Dataset()
        dataset.parse(data=text, format=form)
        return set(dataset.quads())


@pytest.mark.parametrize(("form", "name"), [("trig", "trig"), ("nquads", "nquads")])
def test_an_export_as_a_dataset_has_everything(api: httpx.Client, form: str, name: str) -> None:
    put(api, mug("mug1", 1.0))
    update(api, NOTES)
    found = read(api.get("/export", params={"format": form}).text, name)
    said = {str(value): graph for subject, _, value, graph in found if str(subject) == "urn:a"}
    default = URIRef("urn:x-rdflib:default")
    assert said == {"default": default, "named": URIRef("urn:notes"), "1.5": URIRef("urn:notes")}
    assert any(str(subject) == FLUENT + "mug1" for subject, *_ in found)


@pytest.mark.parametrize("form", ["trig", "nquads", "jsonld"])
def test_a_dataset_can_be_brought_to_another_board(
    api: httpx.Client, client_of: Callable[[BoardApp], httpx.Client], form: str
) -> None:
    put(api, mug("mug1", 1.0), mug("mug2", [1.0, 2.0], 5.0))
    update(api, NOTES)
    exported = api.get("/export", params={"format": form})
    headers = {"Content-Type": exported.headers["content-type"]}
    with Blackboard.open(None) as other:
        copy = client_of(create_app(other, Settings()))
        refused = copy.post("/import", content=exported.content, headers=headers)
        assert "?graph=IRI" in refused.json()["detail"]
        for statements in (3, 0):  # sent again, it says nothing new
            reply = copy.post("/import?default", content=exported.content, headers=headers)
            assert (reply.json()["fluents"], reply.json()["statements"]) == (2, statements)
        again = copy.get("/export", params={"format": form})
        assert read(again.text, _NAMES[form]) == read(exported.text, _NAMES[form])


_NAMES = {"trig": "trig", "nquads": "nquads", "jsonld": "json-ld"}


def test_an_export_as_of_a_commit_has_the_graphs_of_that_commit(api: httpx.Client) -> None:
    commit = put(api, mug("mug1"))
    update(api, NOTES)
    exported = api.get("/export", params={"format": "nquads", "asof": commit})
    assert "urn:notes" not in exported.text
    assert "mug1" in exported.text


def test_owl_time_says_when_a_fluent_holds(api: httpx.Client) -> None:
    put(api, mug("mug1", 10.5, [20.0, 30.0]), mug("mug2"), mug("mug3", [None, 4.0]))
    text = api.get("/export", params={"format": "turtle", "vocabulary": "owl-time"}).text
    graph = Graph().parse(data=text, format="turtle")

    def position(instant: Any) -> Any:
        place = graph.value(instant, TIME.inTimePosition)
        assert graph.value(place, TIME.hasTRS) == URIRef(FB + "timeAxis")
        number = graph.value(place, TIME.numericPosition)
        assert isinstance(number, Literal)
        return float(number)

    interval = graph.value(URIRef(FLUENT + "mug1"), TIME.hasTime)
    assert (interval, RDF.type, TIME.ProperInterval) in graph
    assert position(graph.value(interval, TIME.hasBeginning)) == 10.5
    finish = graph.value(interval, TIME.hasEnd)
    assert graph.value(finish, TIME.inTimePosition) is None
    (bounds,) = graph.subjects(TIME.inside, finish)
    assert position(graph.value(bounds, TIME.hasBeginning)) == 20.0
    assert position(graph.value(bounds, TIME.hasEnd)) == 30.0

    unknown = graph.value(URIRef(FLUENT + "mug2"), TIME.hasTime)
    assert graph.value(unknown, TIME.hasBeginning) is None
    half = graph.value(graph.value(URIRef(FLUENT + "mug3"), TIME.hasTime), TIME.hasBeginning)
    (bounds,) = graph.subjects(TIME.inside, half)
    assert graph.value(bounds, TIME.hasBeginning) is None
    assert position(graph.value(bounds, TIME.hasEnd)) == 4.0


def test_relations_that_certainly_hold_have_their_names_of_owl_time(api: httpx.Client) -> None:
    put(api, mug("a", 1.0, 3.0), mug("b", [4.0, 5.0], 9.0), mug("c", [1.0, 3.5], 9.0))
    params = {"format": "ntriples", "vocabulary": "owl-time", "relations": ""}
    graph = Graph().parse(data=api.get("/export", params=params).text, format="nt")
    found = {
        (str(s)[len(FLUENT)], str(p).rpartition("#")[2], str(o)[len(FLUENT)])
        for s, p, o in graph
        if "#interval" in str(p)
    }
    assert found == {
        ("a", "intervalBefore", "b"),
        ("b", "intervalAfter", "a"),
        ("b", "intervalFinishes", "c"),
        ("c", "intervalFinishedBy", "b"),
    }


@pytest.mark.parametrize(
    "params",
    [
        {"format": "yaml", "vocabulary": "owl-time"},
        {"format": "turtle", "vocabulary": "dublin"},
        {"format": "turtle", "relations": "true"},
        {"format": "xml"},
    ],
)
def test_an_export_that_makes_no_sense_is_refused(
    api: httpx.Client, params: dict[str, str]
) -> None:
    assert api.get("/export", params=params).json()["code"] == "invalid-input"


def test_a_class_and_a_window_narrow_an_export(api: httpx.Client) -> None:
    put(api, mug("mug1", 1.0, 3.0), mug("mug2", 5.0), {"name": "plate1", "class": "Plate"})
    params = {"format": "jsonl", "class": "Mug", "during": "4,6"}
    lines = api.get("/export", params=params).text.splitlines()
    assert [orjson.loads(line)["name"] for line in lines] == ["mug2"]


def test_a_patch_turns_what_was_said_into_what_is_said(api: httpx.Client) -> None:
    """Through additions, ends, refinements, forced corrections, graph updates and drops."""
    put(api, mug("mug1", [1.0, 2.0]), mug("mug2", 1.0))
    update(api, NOTES)
    since = put(api, mug("mug3"))
    before = everything(api)
    assert api.post("/fluents/mug1/end", json={"at": [7.0, 8.0]}).status_code == 200
    refined = {"start": 1.5, "properties": [["hasXSize", "xsd:double", 0.25]]}
    assert api.patch("/fluents/mug1", json=refined).status_code == 200
    corrected = api.put("/fluents/mug2", params={"reason": "it was a plate"}, json=plate("mug2"))
    assert corrected.status_code == 200, corrected.text
    update(api, 'DELETE DATA { <urn:a> <urn:p> "default" } ; DROP GRAPH <urn:notes>')
    update(api, "INSERT DATA { GRAPH <urn:more> { <urn:b> <urn:p> <urn:c> } }")
    patch = api.get("/changes", params={"since": since})
    assert patch.headers["content-type"] == "application/rdf-patch"
    assert patch.text.count("TX .") == patch.text.count("TC .") == 5
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        dataset = Dataset()
        dataset.parse(data=before, format="nquads")
        dataset.parse(data=patch.text, format="patch")
        found = set(dataset.quads())
    assert found == read(everything(api), "nquads")


def plate(name: str) -> dict[str, Any]:
    return {**mug(name, 1.0), "class": "Plate"}


def everything(api: httpx.Client) -> str:
    return api.get("/export", params={"format": "nquads"}).text


def test_the_changes_of_all_commits_are_all_that_is_said(api: httpx.Client) -> None:
    """Ontologies and the class hierarchy included."""
    put(api, mug("mug1", 1.0))
    update(api, "INSERT DATA { <urn:Cup> a owl:Class ; rdfs:subClassOf race:Mug }")
    added: set[str] = set()
    for line in api.get("/changes").text.splitlines():
        if line.startswith("A "):
            added.add(line[2:])
        elif line.startswith("D "):
            added.discard(line[2:])
    whole = api.get("/sparql", params={"query": "SELECT (COUNT(*) AS ?n) { ?s ?p ?o }"}).json()
    assert len(added) == int(whole["results"]["bindings"][0]["n"]["value"])


def test_the_feed_comes_as_json_lines_and_ends_where_it_is_told(api: httpx.Client) -> None:
    first = put(api, mug("mug1"))
    put(api, mug("mug2"))
    params = {"since": first - 1, "until": first}
    reply = api.get("/changes", params=params, headers={"Accept": "application/x-ndjson"})
    (commit,) = map(orjson.loads, reply.text.splitlines())
    assert (commit["commit"], commit["author"]) == (first, "anonymous")
    assert [event["fluent"]["name"] for event in commit["events"]] == ["mug1"]


@pytest.mark.parametrize("params", [{"since": "999"}, {"since": "1", "until": "2", "follow": ""}])
def test_a_feed_that_cannot_be_is_refused(api: httpx.Client, params: dict[str, str]) -> None:
    assert api.get("/changes", params=params).json()["code"] == "invalid-input"


@pytest.mark.parametrize("file", ["kitchen.owl", "room.owl"])
def test_semantic_maps_are_knowledge_beside_the_fluents(
    api: httpx.Client, shared_data: Path, file: str
) -> None:
    content = (shared_data / "household_owl" / file).read_bytes()
    headers = {"Content-Type": "application/rdf+xml"}
    reply = api.post("/import?graph=urn:map", content=content, headers=headers)
    assert reply.status_code == 200, reply.text
    statements = reply.json()["statements"]
    assert statements == len(Graph().parse(data=content, format="xml"))
    again = api.post("/import?graph=urn:map", content=content, headers=headers)
    assert again.json()["statements"] == 0

    # What the map says of a piece of furniture, and what the robot saw there.
    query = (
        "SELECT ?thing ?class { GRAPH <urn:map> { ?thing a owl:NamedIndividual , ?class } "
        "FILTER(?class != owl:NamedIndividual) FILTER(CONTAINS(STR(?thing), '#')) } "
        "ORDER BY ?thing ?class LIMIT 1"
    )
    (row,) = ask(api, query)
    thing = row["thing"]["value"]
    put(api, mug("mug1", 10.0))
    put(api, {**mug("mug2", 10.0), "properties": [["isDescribedBy", "xsd:anyURI", thing]]})
    found = ask(
        api,
        "SELECT ?mug ?class { ?mug a race:Mug ; upper:isDescribedBy ?on . "
        "GRAPH <urn:map> { ?thing a ?class } FILTER(STR(?thing) = STR(?on)) }",
        at="now",
    )
    assert {r["mug"]["value"] for r in found} == {FLUENT + "mug2"}
    assert row["class"]["value"] in {r["class"]["value"] for r in found}


def ask(api: httpx.Client, query: str, **params: str) -> list[dict[str, Any]]:
    reply = api.get("/sparql", params={"query": query, **params})
    assert reply.status_code == 200, reply.text
    return reply.json()["results"]["bindings"]
