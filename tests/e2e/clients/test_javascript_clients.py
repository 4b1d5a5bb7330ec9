"""Clients from npm, unmodified, against a board."""

from __future__ import annotations

import json
from collections.abc import Callable

MUGS = [f"https://w3id.org/fluentboard/fluent/mug{number}" for number in (1, 2)]


def test_fetch_sparql_endpoint_asks_and_updates(
    address: str, run_script: Callable[..., str]
) -> None:
    found = json.loads(run_script("fetch-sparql-endpoint.mjs", address + "/sparql"))
    assert (found["mugs"], found["triples"]) == (MUGS, 2)
    assert found["asked"]
    assert found["written"]
    assert "400" in found["refused"]


def test_comunica_finds_out_what_it_talks_to(address: str, run_script: Callable[..., str]) -> None:
    found = json.loads(run_script("comunica.mjs", address + "/sparql"))
    assert (found["mugs"], found["size"], found["quads"]) == (MUGS, "0.1", 2)
    assert found["asked"]
    assert found["written"]


def test_sparql_http_client_asks_updates_and_stores_graphs(
    address: str, run_script: Callable[..., str]
) -> None:
    found = json.loads(
        run_script("sparql-http-client.mjs", address + "/sparql", address + "/rdf-graph-store")
    )
    assert found["mugs"] == MUGS
    assert (found["made"], found["stored"], found["streamed"]) == (2, 2, 2)
    assert found["asked"]
    assert found["written"]
    assert found["raw"]


def test_sepa_js_hears_what_comes_and_goes(address: str, run_script: Callable[..., str]) -> None:
    told = json.loads(run_script("sepa.mjs", address + "/subscribe"))
    assert told == [
        {"query": 0},
        {"sequence": 0, "added": [], "removed": []},
        {"sequence": 1, "added": ["urn:cup1"], "removed": []},
        {"sequence": 2, "added": [], "removed": ["urn:cup1"]},
    ]


def test_yasgui_shows_what_a_query_finds(address: str, run_script: Callable[..., str]) -> None:
    shown = json.loads(run_script("yasgui.mjs", address + "/sparql"))
    assert shown["mugs"] == [f"{row}<{mug}>" for row, mug in enumerate(MUGS, start=1)]
    assert shown["asked"]
    # The page shows what the board says of a mistake.
    assert "the prefix 'nowhere' is not declared" in shown["complaint"]
    requests = [(request["method"], request["status"]) for request in shown["requests"]]
    assert requests == [("POST", 200), ("POST", 200), ("POST", 400)]
    assert all(request["asks"] for request in shown["requests"])


def test_client_written_from_the_documents_misses_nothing(
    address: str, run_script: Callable[..., str]
) -> None:
    told = json.loads(run_script("from-the-documents.mjs", address))
    assert told == {
        "repeated": True,
        "finish": [3, 4],
        "refused": "version-mismatch",
        "heard": ["snapshot", "delta", "resumed", "delta"],
        "fresh": 3,
    }
