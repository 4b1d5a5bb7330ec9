"""Transactions of RDF4J: collected within bounds, and committed once."""

from __future__ import annotations

from urllib.parse import urlsplit

import httpx
import pytest

REPOSITORY = "/repositories/fluentboard"
TURTLE = {"content-type": "text/turtle"}


def begun(api: httpx.Client) -> str:
    reply = api.post(f"{REPOSITORY}/transactions")
    assert reply.status_code == 201
    return urlsplit(reply.headers["location"]).path


def act(
    api: httpx.Client, transaction: str, action: str, body: str = "", graph: str = ""
) -> httpx.Response:
    contexts = f"&context=%3C{graph}%3E" if graph else ""
    return api.put(f"{transaction}?action={action}{contexts}", content=body, headers=TURTLE)


def size(api: httpx.Client, graph: str) -> int:
    return int(api.get(f"{REPOSITORY}/size?context=%3C{graph}%3E").text)


def test_what_is_collected_is_committed_as_one(api: httpx.Client) -> None:
    transaction = begun(api)
    act(api, transaction, "ADD", "<urn:a> <urn:p> 1, 2 .", "urn:one")
    act(api, transaction, "DELETE", "<urn:a> <urn:p> 2 .", "urn:one")
    assert size(api, "urn:one") == 0
    assert act(api, transaction, "COMMIT").status_code == 200
    assert size(api, "urn:one") == 1
    assert act(api, transaction, "COMMIT").status_code == 404


def test_commit_that_is_refused_leaves_the_transaction_open(api: httpx.Client) -> None:
    transaction = begun(api)
    act(api, transaction, "ADD", "<https://w3id.org/fluentboard/fluent/cup> <urn:p> 1 .")
    assert act(api, transaction, "COMMIT").json()["code"] == "fluents-are-read-only"
    assert act(api, transaction, "PING").status_code == 200
    assert api.delete(transaction).status_code == 204


def test_transaction_cannot_collect_more_than_can_be_committed(
    api: httpx.Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("fluentboard.api.rdf4j_transactions.CHANGES_MAX", 3)
    transaction = begun(api)
    assert act(api, transaction, "ADD", "<urn:a> <urn:p> 1, 2 .").status_code == 200
    assert act(api, transaction, "ADD", "<urn:a> <urn:p> 3, 4 .").json()["code"] == "too-large"
    assert act(api, transaction, "UPDATE", "CLEAR ALL").json()["code"] == "too-large"


def test_statements_count_in_each_graph_that_they_go_to(
    api: httpx.Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("fluentboard.api.rdf4j_transactions.CHANGES_MAX", 3)
    target = f"{begun(api)}?action=ADD&context=%3Curn:a%3E&context=%3Curn:b%3E"
    assert api.put(target, content="<urn:a> <urn:p> 1 .", headers=TURTLE).status_code == 200
    reply = api.put(target, content="<urn:a> <urn:p> 2 .", headers=TURTLE)
    assert reply.json()["code"] == "too-large"
