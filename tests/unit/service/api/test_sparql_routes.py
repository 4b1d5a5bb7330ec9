from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any
from urllib.parse import urlencode

import httpx
import pyoxigraph as ox
import pytest

from fluentboard.api.app import BoardApp, create_app
from fluentboard.board.blackboard import Blackboard
from fluentboard.board.time_functions import FUNCTIONS
from fluentboard.config import Settings
from fluentboard_ontology import FB, FLUENT

MUGS = "SELECT ?mug WHERE { ?mug a race:Mug } ORDER BY ?mug"
POINT = "SELECT ?class WHERE { fluent:mug1 a ?class }"
GRAPH = "CONSTRUCT { ?mug a race:Mug } WHERE { ?mug a race:Mug }"
SLOW = "SELECT (COUNT(*) AS ?n) WHERE { ?a ?b ?c . ?d ?e ?f FILTER(?c = ?f) }"


@pytest.fixture(scope="module")
def board() -> Iterator[Blackboard]:
    with Blackboard.open(None) as opened:
        yield opened


@pytest.fixture(scope="module")
def api(board: Blackboard, client_of: Callable[[BoardApp], httpx.Client]) -> httpx.Client:
    asking = client_of(create_app(board, Settings()))
    mugs = [{"name": f"mug{n}", "class": "Mug"} for n in (1, 2, 3)]
    assert asking.post("/fluents", json=mugs).status_code == 201
    return asking


def ask(api: httpx.Client, query: str, accept: str | None = None) -> httpx.Response:
    headers = {} if accept is None else {"Accept": accept}
    return api.get("/sparql", params={"query": query}, headers=headers)


def mugs(reply: httpx.Response) -> list[str]:
    assert reply.status_code == 200, reply.text
    bindings = reply.json()["results"]["bindings"]
    return [row["mug"]["value"].removeprefix(FLUENT) for row in bindings]


def code(reply: httpx.Response) -> tuple[int, str]:
    assert reply.headers["content-type"] == "application/problem+json"
    return reply.status_code, reply.json()["code"]


def test_a_query_is_asked_by_get(api: httpx.Client) -> None:
    assert mugs(ask(api, MUGS)) == ["mug1", "mug2", "mug3"]


def test_a_query_is_asked_by_form(api: httpx.Client) -> None:
    assert mugs(api.post("/sparql", data={"query": MUGS})) == ["mug1", "mug2", "mug3"]


def test_a_query_is_asked_by_direct_post(api: httpx.Client) -> None:
    headers = {"Content-Type": "application/sparql-query; charset=utf-8"}
    reply = api.post("/sparql", content=MUGS, headers=headers)
    assert mugs(reply) == ["mug1", "mug2", "mug3"]


@pytest.mark.parametrize(
    ("accept", "media_type"),
    [
        (None, "application/sparql-results+json"),
        ("application/json", "application/json"),
        ("application/sparql-results+xml", "application/sparql-results+xml"),
        ("text/csv", "text/csv"),
        ("text/tab-separated-values", "text/tab-separated-values"),
        ("text/csv;q=0.2, application/sparql-results+xml;q=0.3", "application/sparql-results+xml"),
    ],
)
@pytest.mark.parametrize("query", [MUGS, POINT, "ASK { fluent:mug1 a ?class }"])
def test_solutions_come_as_the_client_wants(
    api: httpx.Client, query: str, accept: str | None, media_type: str
) -> None:
    reply = ask(api, query, accept)
    assert reply.status_code == 200
    assert reply.headers["content-type"] == in_utf8(media_type)


@pytest.mark.parametrize(
    ("accept", "form"),
    [
        ("text/turtle", ox.RdfFormat.TURTLE),
        ("application/n-triples", ox.RdfFormat.N_TRIPLES),
        ("application/ld+json", ox.RdfFormat.JSON_LD),
        ("application/rdf+xml", ox.RdfFormat.RDF_XML),
        ("application/trig", ox.RdfFormat.TRIG),
        ("application/n-quads", ox.RdfFormat.N_QUADS),
        ("text/n3", ox.RdfFormat.N3),
    ],
)
def test_graphs_come_as_the_client_wants(
    api: httpx.Client, accept: str, form: ox.RdfFormat
) -> None:
    reply = ask(api, GRAPH, accept)
    assert reply.headers["content-type"] == in_utf8(accept)
    assert len(list(ox.parse(reply.content, format=form))) == 3


@pytest.mark.parametrize(("query", "accept"), [(MUGS, "text/turtle"), (GRAPH, "text/csv")])
def test_a_form_that_the_result_cannot_have_is_406(
    api: httpx.Client, query: str, accept: str
) -> None:
    assert code(ask(api, query, accept)) == (406, "not-acceptable")


def test_a_result_is_exact_at_the_commit_it_names(api: httpx.Client, board: Blackboard) -> None:
    assert ask(api, MUGS).headers["x-commit"] == str(board.commit)


def test_a_write_is_seen_by_the_same_query_asked_again(api: httpx.Client) -> None:
    plates = "SELECT ?mug WHERE { ?mug a race:Plate }"
    assert mugs(ask(api, plates)) == []
    assert api.post("/fluents", json={"name": "plate1", "class": "Plate"}).status_code == 201
    assert mugs(ask(api, plates)) == ["plate1"]


def test_a_query_asked_again_has_the_same_answer_byte_by_byte(api: httpx.Client) -> None:
    assert ask(api, POINT).content == ask(api, POINT).content


@pytest.mark.parametrize("function", ["RAND()", "STRUUID()"])
def test_a_random_answer_is_a_new_one_each_time(api: httpx.Client, function: str) -> None:
    query = f"SELECT ({function} AS ?x) {{}}"
    assert ask(api, query).content != ask(api, query).content


def test_a_query_that_does_not_parse_is_refused_with_its_place(api: httpx.Client) -> None:
    reply = ask(api, "SELECT ?mug WHERE {\n  ?mug a race:Mug .\n  ?mug upper:hasPose")
    problem = reply.json()
    assert code(reply) == (400, "invalid-query")
    assert problem["line"] == 3
    assert "upper:hasPose" in problem["detail"]
    assert len(problem["detail"]) < 500


def test_an_unknown_prefix_is_refused(api: httpx.Client) -> None:
    assert code(ask(api, "SELECT ?x { ?x a nowhere:Thing }")) == (400, "invalid-query")


@pytest.mark.parametrize(
    ("params", "expected"),
    [
        ({}, ["cup1", "cup2"]),
        ({"at": "15"}, ["cup1"]),
        ({"at": "25", "certainly": "true"}, []),
        ({"at": "25", "possibly": "true"}, ["cup1", "cup2"]),
        ({"at": "now"}, ["cup2"]),
    ],
)
def test_a_time_narrows_what_is_seen(
    api: httpx.Client, params: dict[str, str], expected: list[str]
) -> None:
    cups = [
        {"name": "cup1", "class": "Spoon", "start": 10, "finish": [20, 30]},
        {"name": "cup2", "class": "Spoon", "start": [20, 30]},
    ]
    assert api.post("/fluents", json=cups).is_success
    query = "SELECT ?mug WHERE { ?mug a race:Spoon } ORDER BY ?mug"
    reply = api.get("/sparql", params={"query": query, **params})
    assert mugs(reply) == expected
    assert ("x-at" in reply.headers) == ("at" in params)


def test_a_commit_narrows_what_is_seen(api: httpx.Client, board: Blackboard) -> None:
    query, before = "SELECT ?mug WHERE { ?mug a race:Fork }", board.commit
    assert api.post("/fluents", json={"name": "fork1", "class": "Fork"}).is_success
    assert mugs(ask(api, query)) == ["fork1"]
    past = api.get("/sparql", params={"query": query, "asof": before})
    assert mugs(past) == []
    assert past.headers["x-commit"] == str(before)


def test_the_future_cannot_be_asked(api: httpx.Client, board: Blackboard) -> None:
    params = {"query": MUGS, "asof": board.commit + 1}
    assert code(api.get("/sparql", params=params)) == (422, "invalid-input")


def test_a_dataset_of_the_protocol_replaces_that_of_the_board(api: httpx.Client) -> None:
    graph = "https://example.org/graph"
    reply = api.get("/sparql", params={"query": MUGS, "default-graph-uri": graph})
    assert mugs(reply) == []
    reply = api.get("/sparql", params={"query": MUGS, "named-graph-uri": graph})
    assert mugs(reply) == []


def test_a_dataset_that_is_no_iri_is_refused(api: httpx.Client) -> None:
    params = {"query": MUGS, "default-graph-uri": "not an iri"}
    assert code(api.get("/sparql", params=params)) == (400, "invalid-query")


@pytest.mark.parametrize(
    ("content", "media_type", "expected"),
    [
        (urlencode({"query": ""}), "application/x-www-form-urlencoded", (400, "invalid-query")),
        (urlencode({"q": MUGS}), "application/x-www-form-urlencoded", (400, "invalid-query")),
        (
            urlencode([("query", MUGS), ("query", MUGS)]),
            "application/x-www-form-urlencoded",
            (400, "invalid-query"),
        ),
        (MUGS, "text/plain", (415, "unsupported-media-type")),
        ("", "application/sparql-query", (400, "invalid-query")),
        (b"\xff", "application/sparql-query", (422, "invalid-input")),
        ("query=%ff", "application/x-www-form-urlencoded", (422, "invalid-input")),
    ],
)
def test_a_request_without_one_query_is_refused(
    api: httpx.Client, content: bytes | str, media_type: str, expected: tuple[int, str]
) -> None:
    reply = api.post("/sparql", content=content, headers={"Content-Type": media_type})
    assert code(reply) == expected


@pytest.mark.parametrize("form", ["form", "body"])
def test_an_update_says_what_came_and_went(api: httpx.Client, name: str, form: str) -> None:
    text = f"INSERT DATA {{ GRAPH <urn:{name}> {{ <urn:a> <urn:b> 1, 2 }} }}"
    reply = post_update(api, text, form)
    assert reply.status_code == 200
    assert reply.json() == {"commit": int(reply.headers["x-commit"]), "added": 2, "removed": 0}
    found = api.get("/sparql", params={"query": f"ASK {{ GRAPH <urn:{name}> {{ ?s ?p 2 }} }}"})
    assert found.json()["boolean"] is True


@pytest.mark.parametrize("form", ["form", "body"])
def test_an_update_of_fluents_is_refused_with_what_to_call_instead(
    api: httpx.Client, form: str
) -> None:
    reply = post_update(api, "INSERT DATA { fluent:mug1 a race:Plate }", form)
    assert code(reply) == (403, "fluents-are-read-only")
    assert "/fluents" in reply.json()["detail"]


def test_an_update_cannot_be_a_link(api: httpx.Client) -> None:
    assert code(api.get("/sparql", params={"update": "CLEAR ALL"})) == (400, "invalid-query")


def test_an_update_needs_the_role_write(make_api: Callable[..., httpx.Client]) -> None:
    tokens = [
        {"name": name, "role": name, "token": f"secret of the {name}r"}
        for name in ("read", "write")
    ]
    api = make_api(security__tokens=tokens)
    data = {"update": "INSERT DATA { <urn:by> <urn:token> 1 }"}
    for role, status in (("read", 403), ("write", 200)):
        headers = {"Authorization": f"Bearer secret of the {role}r"}
        assert api.post("/sparql", data=data, headers=headers).status_code == status


def test_pages_of_others_cannot_update(api: httpx.Client) -> None:
    headers = {"Origin": "http://evil.example"}
    reply = api.post("/sparql", data={"update": "CLEAR ALL"}, headers=headers)
    assert code(reply) == (403, "not-allowed")


def test_mistake_in_an_update_is_located(api: httpx.Client) -> None:
    reply = post_update(api, "CLEAR ALL ;\nPREFIX a: <urn:a> CLEAR XYZ", "body")
    assert code(reply) == (400, "invalid-query")
    assert (reply.json()["line"], reply.json()["column"]) == (2, 28)


def test_same_key_updates_once(api: httpx.Client, name: str) -> None:
    headers = {"Idempotency-Key": name, "Content-Type": "application/sparql-update"}
    content = f"INSERT {{ [] <urn:{name}> 1 }} WHERE {{}}"
    first = api.post("/sparql", content=content, headers=headers)
    assert api.post("/sparql", content=content, headers=headers).json() == first.json()


def test_relative_iris_are_relative_to_the_endpoint(api: httpx.Client, name: str) -> None:
    post_update(api, f"INSERT DATA {{ <{name}> <urn:p> <other> }}", "body")
    found = api.get("/sparql", params={"query": f"SELECT ?o {{ <{name}> <urn:p> ?o }}"})
    assert found.json()["results"]["bindings"][0]["o"]["value"] == "http://board/other"
    mistake = api.get("/sparql", params={"query": f"SELECT * {{ <{name}> <urn:p> }}"})
    assert mistake.json()["column"] == len(f"SELECT * {{ <{name}> <urn:p> }}")


def test_text_in_another_encoding_is_refused(api: httpx.Client) -> None:
    headers = {"Content-Type": "application/sparql-query; charset=UTF-16"}
    reply = api.post("/sparql", content="ASK {}".encode("utf-16"), headers=headers)
    assert code(reply) == (415, "unsupported-media-type")


def in_utf8(media_type: str) -> str:
    return f"{media_type}; charset=utf-8" if media_type.startswith("text/") else media_type


def post_update(api: httpx.Client, text: str, form: str) -> httpx.Response:
    if form == "form":
        return api.post("/sparql", data={"update": text})
    return api.post("/sparql", content=text, headers={"Content-Type": "application/sparql-update"})


def test_without_a_query_the_service_describes_itself(api: httpx.Client) -> None:
    reply = api.get("/sparql")
    sd = "http://www.w3.org/ns/sparql-service-description#"
    triples = [q.triple for q in ox.parse(reply.content, format=ox.RdfFormat.TURTLE)]
    endpoints = [t.object for t in triples if t.predicate.value == sd + "endpoint"]
    assert reply.headers["content-type"] == "text/turtle; charset=utf-8"
    assert endpoints == [ox.NamedNode("http://board/sparql")]


def test_the_description_names_the_extension_functions(api: httpx.Client) -> None:
    named = "http://www.w3.org/ns/sparql-service-description#extensionFunction"
    quads = ox.parse(api.get("/sparql").content, format=ox.RdfFormat.TURTLE)
    functions = {str(q.object)[1:-1] for q in quads if q.predicate.value == named}
    assert functions == {FB + name for name in FUNCTIONS}


def test_the_description_comes_as_the_client_wants(api: httpx.Client) -> None:
    reply = api.get("/sparql", headers={"Accept": "application/rdf+xml"})
    assert list(ox.parse(reply.content, format=ox.RdfFormat.RDF_XML))


def test_head_answers_without_a_body(api: httpx.Client) -> None:
    reply = api.head("/sparql", params={"query": MUGS})
    assert (reply.status_code, reply.content) == (200, b"")


@pytest.mark.parametrize(
    ("settings", "query"),
    [
        ({"limits__result_rows_max": 2}, MUGS),
        ({"limits__result_max_bytes": 50}, MUGS),
        ({"limits__result_max_bytes": 50}, POINT),
        ({"limits__body_max_bytes": 10}, MUGS),
    ],
)
def test_a_result_or_a_query_longer_than_its_limit_is_refused(
    api: httpx.Client, make_api: Callable[..., httpx.Client], settings: dict[str, Any], query: str
) -> None:
    assert code(make_api(**settings).post("/sparql", data={"query": query})) == (413, "too-large")


def test_a_long_result_is_streamed_whole(
    api: httpx.Client, make_api: Callable[..., httpx.Client]
) -> None:
    query = "SELECT * WHERE { ?a ?b ?c }"
    streaming = make_api(limits__result_memory_max_bytes=1_000, limits__result_cache_bytes=0)
    reply = ask(streaming, query)
    assert reply.content == ask(api, query).content
    assert int(reply.headers["content-length"]) == len(reply.content)


def test_a_query_that_takes_too_long_is_given_up(make_api: Callable[..., httpx.Client]) -> None:
    hurried = make_api(limits__query_timeout_s=0.001)
    reply = ask(hurried, SLOW)
    assert code(reply) == (503, "query-timeout")
    assert reply.json()["timeout_s"] == 0.001


def test_undeclared_prefix_is_named(api: httpx.Client) -> None:
    reply = api.get("/sparql", params={"query": "SELECT * { ?a foaf:knows ?b . ?b a race:Mug }"})
    assert reply.status_code == 400
    assert "the prefix 'foaf' is not declared" in reply.json()["detail"]
    assert reply.json()["undeclared"] == ["foaf"]


@pytest.mark.parametrize("query", ["", " \n"])
def test_an_empty_query_is_said_to_be_empty(api: httpx.Client, query: str) -> None:
    reply = api.post("/sparql", data={"query": query})
    assert (reply.status_code, reply.json()["code"]) == (400, "invalid-query")
    assert reply.json()["message"].startswith("the query is empty; send one such as SELECT")
