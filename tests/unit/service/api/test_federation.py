from __future__ import annotations

import httpx
import pytest

from fluentboard.api.federation import check_services
from fluentboard.errors import NotAllowed

ALLOWED = {"https://lab.example/sparql"}


@pytest.mark.parametrize(
    "query",
    [
        "SELECT ?s { ?s ?p ?o }",
        "SELECT ?service { ?service ?p 'SERVICE <http://x/>' } # SERVICE <http://x/>",
        "SELECT ?s { SERVICE <https://lab.example/sparql> { ?s ?p ?o } }",
        "SELECT ?s { service silent<https://lab.example/sparql>{ ?s ?p ?o } }",
    ],
)
def test_endpoints_that_are_named_may_be_asked(query: str) -> None:
    check_services(query, ALLOWED)


@pytest.mark.parametrize(
    "query",
    [
        "SELECT ?s { SERVICE <http://169.254.169.254/> { ?s ?p ?o } }",
        "SELECT ?s { SERVICE SILENT <http://localhost:8080/sparql> { ?s ?p ?o } }",
        "SELECT ?s { ?x ?y ?e SERVICE ?e { ?s ?p ?o } }",
        "PREFIX x: <https://lab.example/> SELECT ?s { SERVICE x:sparql { ?s ?p ?o } }",
        "BASE <https://lab.example/> SELECT ?s { SERVICE <sparql> { ?s ?p ?o } }",
        "SELECT ?s { FILTER(?a<?b)SERVICE<http://x/>{ ?s ?p ?o } FILTER(?c>?d) }",
        "SELECT ?s { SERVICE <https://lab.example/sparql> { SERVICE <http://x/> { ?s ?p ?o } } }",
        "SELECT ?s { SERVICE",
    ],
)
def test_no_other_endpoint_may_be_asked(query: str) -> None:
    with pytest.raises(NotAllowed, match="SERVICE"):
        check_services(query, ALLOWED)


def test_the_board_asks_nobody_by_default(api: httpx.Client) -> None:
    query = "SELECT ?s { SERVICE <https://lab.example/sparql> { ?s ?p ?o } }"
    reply = api.get("/sparql", params={"query": query})
    assert (reply.status_code, reply.json()["code"]) == (403, "not-allowed")
    assert reply.json()["service"] == "<https://lab.example/sparql>"
