"""Whole graphs over HTTP."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import httpx
import pyoxigraph as ox
import pytest

TURTLE = {"Content-Type": "text/turtle"}
STORE = "/rdf-graph-store"


@pytest.fixture
def graph(name: str) -> dict[str, str]:
    return {"graph": f"urn:{name}"}


def triples(reply: httpx.Response, form: ox.RdfFormat = ox.RdfFormat.TURTLE) -> set[str]:
    return {str(quad.triple) for quad in ox.parse(reply.content, format=form)}


def test_graph_that_was_put_is_read_back(api: httpx.Client, graph: dict[str, str]) -> None:
    assert api.get(STORE, params=graph).status_code == 404
    made = api.put(STORE, params=graph, content="<urn:a> <urn:b> 1, 2 .", headers=TURTLE)
    assert (made.status_code, made.json()["added"]) == (201, 2)
    reply = api.get(STORE, params=graph)
    assert reply.headers["content-type"] == "text/turtle; charset=utf-8"
    assert len(triples(reply)) == 2
    assert api.head(STORE, params=graph).status_code == 200


def test_put_replaces_and_post_adds(api: httpx.Client, graph: dict[str, str]) -> None:
    api.put(STORE, params=graph, content="<urn:a> <urn:b> 1, 2 .", headers=TURTLE)
    again = api.put(STORE, params=graph, content="<urn:a> <urn:b> 2, 3 .", headers=TURTLE)
    assert again.status_code == 204
    more = api.post(STORE, params=graph, content="<urn:a> <urn:b> 3, 4 .", headers=TURTLE)
    assert (more.status_code, more.json()["added"]) == (200, 1)
    assert len(triples(api.get(STORE, params=graph))) == 3


def test_empty_graph_is_there(api: httpx.Client, graph: dict[str, str]) -> None:
    assert api.put(STORE, params=graph, content="", headers=TURTLE).status_code == 201
    assert api.get(STORE, params=graph).status_code == 200
    assert api.delete(STORE, params=graph).status_code == 200
    assert api.head(STORE, params=graph).status_code == 404
    assert api.delete(STORE, params=graph).status_code == 404


@pytest.mark.parametrize(
    "form",
    [
        ox.RdfFormat.TURTLE,
        ox.RdfFormat.N_TRIPLES,
        ox.RdfFormat.RDF_XML,
        ox.RdfFormat.JSON_LD,
        ox.RdfFormat.N3,
    ],
    ids=str,
)
def test_formats_go_in_and_out(
    api: httpx.Client, graph: dict[str, str], form: ox.RdfFormat
) -> None:
    node = ox.NamedNode("http://ex/a")
    body = ox.serialize([ox.Triple(node, node, ox.Literal("ü", language="de"))], format=form)
    media_type = form.media_type
    api.put(STORE, params=graph, content=body, headers={"Content-Type": media_type})
    reply = api.get(STORE, params=graph, headers={"Accept": media_type})
    assert reply.headers["content-type"].partition(";")[0] == media_type
    assert triples(reply, form) == {'<http://ex/a> <http://ex/a> "ü"@de'}


def test_direct_address_is_the_name_of_its_graph(api: httpx.Client, name: str) -> None:
    path = f"{STORE}/rooms/{name}.ttl"
    assert api.put(path, content="<> a <#Room> .", headers=TURTLE).status_code == 201
    address = f"http://board{path}"
    assert triples(api.get(path)) == triples(api.get(STORE, params={"graph": address}))
    assert f"<{address}>" in str(triples(api.get(path)))


def test_posting_to_the_store_makes_a_graph(api: httpx.Client) -> None:
    reply = api.post(STORE, content="<> <urn:b> 1 .", headers=TURTLE)
    assert reply.status_code == 201
    assert len(triples(api.get(reply.headers["location"]))) == 1


def test_repeated_request_makes_one_graph(api: httpx.Client, name: str) -> None:
    headers = {**TURTLE, "Idempotency-Key": name}
    first = api.post(STORE, content="<urn:a> <urn:b> 1 .", headers=headers)
    again = api.post(STORE, content="<urn:a> <urn:b> 1 .", headers=headers)
    assert again.headers["location"] == first.headers["location"]


def test_form_of_documents_is_one_graph(api: httpx.Client, graph: dict[str, str]) -> None:
    documents = [
        ("one", ("one.ttl", "<urn:a> <urn:b> 1 .", "text/turtle")),
        ("two", ("two.nt", "<urn:a> <urn:b> <urn:c> .", "application/n-triples")),
    ]
    assert api.post(STORE, params=graph, files=documents).status_code == 201
    assert len(triples(api.get(STORE, params=graph))) == 2


def test_default_graph_is_read_whole_and_can_be_sent_back(api: httpx.Client, name: str) -> None:
    api.post("/fluents", json={"name": name, "class": "Mug"})
    before = api.get(STORE, params={"default": ""}, headers={"Accept": "application/n-triples"})
    assert name in before.text
    headers = {"Content-Type": "application/n-triples"}
    reply = api.put(STORE, params={"default": ""}, content=before.content, headers=headers)
    assert reply.status_code in (201, 204)
    after = api.get(STORE, params={"default": ""}, headers={"Accept": "application/n-triples"})
    assert sorted(after.text.splitlines()) == sorted(before.text.splitlines())


def test_fluents_survive_deleting_the_default_graph(api: httpx.Client, name: str) -> None:
    api.post("/fluents", json={"name": name, "class": "Mug"})
    api.post(STORE, params={"default": ""}, content="<urn:a> <urn:b> 1 .", headers=TURTLE)
    assert api.delete(STORE, params={"default": ""}).status_code == 200
    text = api.get(STORE, params={"default": ""}).text
    assert name in text
    assert "urn:b" not in text


def test_new_statement_about_a_fluent_is_refused(api: httpx.Client) -> None:
    body = "<https://w3id.org/fluentboard/fluent/mug9> <urn:b> 1 ."
    reply = api.post(STORE, params={"default": ""}, content=body, headers=TURTLE)
    assert (reply.status_code, reply.json()["code"]) == (403, "fluents-are-read-only")


@pytest.mark.parametrize(
    ("options", "status", "code"),
    [
        ({"content": "<urn:a> <urn:b>", "headers": TURTLE}, 400, "invalid-rdf"),
        ({"content": "x", "headers": {"Content-Type": "image/png"}}, 415, "unsupported-media-type"),
        ({"content": "<urn:a> <urn:b> 1 ."}, 415, "unsupported-media-type"),
        (
            {
                "content": "<urn:g> { <urn:a> <urn:b> 1 }",
                "headers": {"Content-Type": "application/trig"},
            },
            400,
            "invalid-rdf",
        ),
        (
            {"content": "--x", "headers": {"Content-Type": "multipart/form-data"}},
            400,
            "invalid-rdf",
        ),
    ],
)
def test_body_that_is_no_graph_is_refused(
    api: httpx.Client, graph: dict[str, str], options: dict[str, Any], status: int, code: str
) -> None:
    reply = api.put(STORE, params=graph, **options)
    assert (reply.status_code, reply.json()["code"]) == (status, code)
    assert api.head(STORE, params=graph).status_code == 404


@pytest.mark.parametrize(
    "parameters", [{}, {"graph": "urn:g", "default": ""}, {"graph": "no iri <>"}, {"grph": "urn:g"}]
)
def test_request_must_name_one_graph(api: httpx.Client, parameters: dict[str, str]) -> None:
    assert api.get(STORE, params=parameters).status_code == 422


def test_readers_may_not_write(make_api: Callable[..., httpx.Client]) -> None:
    api = make_api(security__tokens=[{"name": "r", "role": "read", "token": "a secret of readers"}])
    headers = {**TURTLE, "Authorization": "Bearer a secret of readers"}
    assert api.put(STORE, params={"graph": "urn:g"}, headers=headers).status_code == 403
    assert api.get(STORE, params={"default": ""}, headers=headers).status_code == 200


def test_empty_prefixes_and_fragments_of_names_are_kept(api: httpx.Client, name: str) -> None:
    for iri in (f"http://ex/{name}#", f"http://ex/{name}/", f"http://ex/{name}"):
        api.put(STORE, params={"graph": iri}, content=f"<urn:a> <urn:b> '{iri}' .", headers=TURTLE)
    for iri in (f"http://ex/{name}#", f"http://ex/{name}/", f"http://ex/{name}"):
        assert iri in api.get(STORE, params={"graph": iri}).text
