from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

import httpx
import pytest
from prometheus_client.parser import text_string_to_metric_families

from fluentboard import __version__
from fluentboard.api.app import BoardApp, create_app
from fluentboard.api.exchange import Call, Reply
from fluentboard.api.operations import Operation
from fluentboard.board.blackboard import Blackboard
from fluentboard.config import Settings

TOKEN = {"name": "viewer", "role": "read", "token": "reader-secret-0001"}


def test_the_process_is_up(api: httpx.Client) -> None:
    assert api.get("/health").json() == {"status": "up", "version": __version__}


def test_the_board_is_ready(api: httpx.Client, board: Blackboard) -> None:
    ready = api.get("/ready")
    assert ready.status_code == 200
    assert ready.json() == {
        "status": "ready",
        "commit": board.commit,
        "fluents": len(board),
        "failure": None,
    }


def test_classes_are_listed_with_all_above_them(api: httpx.Client) -> None:
    classes = {entry["name"]: entry for entry in api.get("/classes").json()["classes"]}
    assert "Kitchenware" in classes["Mug"]["superclasses"]
    assert "Mug" not in classes["Mug"]["superclasses"]
    assert classes["Mug"]["iri"].endswith("race#Mug")


def test_the_index_lists_the_routes(api: httpx.Client) -> None:
    routes = {(r["method"], r["path"]) for r in api.get("/").json()["routes"]}
    assert {("GET", "/sparql"), ("POST", "/fluents"), ("GET", "/subscriptions")} <= routes


def test_browsers_get_the_index_as_a_page(api: httpx.Client) -> None:
    reply = api.get("/", headers={"Accept": "text/html,application/xhtml+xml,*/*;q=0.8"})
    assert reply.headers["content-type"].startswith("text/html")
    assert "/fluents/{name}" in reply.text
    assert "default-src 'none'" in reply.headers["content-security-policy"]


def test_metrics_are_read_by_prometheus(api: httpx.Client, board: Blackboard) -> None:
    api.get("/health")
    families = {f.name: f for f in text_string_to_metric_families(api.get("/metrics").text)}
    requests = {
        (s.labels["operation"], s.labels["status"]): s.value
        for s in families["fluentboard_http_requests"].samples
    }
    assert requests["getHealth", "200"] >= 1
    assert families["fluentboard_commit"].samples[0].value == board.commit
    assert families["fluentboard_http_request_seconds"].type == "histogram"


def test_metrics_come_as_openmetrics_on_request(api: httpx.Client) -> None:
    reply = api.get("/metrics", headers={"Accept": "application/openmetrics-text"})
    assert reply.headers["content-type"].startswith("application/openmetrics-text")
    assert reply.text.endswith("# EOF\n")


@pytest.mark.parametrize("path", ["/nowhere", "/fluents/", "/fluents/a/b", "/fluents/a/end/b"])
def test_a_path_nobody_serves_is_a_problem(api: httpx.Client, path: str) -> None:
    reply = api.get(path)
    assert reply.status_code == 404
    assert reply.json()["code"] == "unknown-resource"
    assert reply.headers["content-type"] == "application/problem+json"


@pytest.mark.parametrize(
    ("method", "path", "allowed"),
    [
        ("DELETE", "/fluents", "GET, HEAD, OPTIONS, POST"),
        ("POST", "/fluents/mug1", "GET, HEAD, OPTIONS, PATCH, PUT"),
        ("PUT", "/openapi.json", "GET"),
    ],
)
def test_a_method_that_is_not_served_is_a_problem(
    api: httpx.Client, method: str, path: str, allowed: str
) -> None:
    reply = api.request(method, path)
    assert reply.status_code == 405
    assert reply.json()["code"] == "method-not-allowed"
    assert set(reply.headers["allow"].split(", ")) >= set(allowed.split(", "))


def test_options_tell_what_is_served(api: httpx.Client) -> None:
    reply = api.options("/fluents")
    assert reply.status_code == 204
    assert reply.headers["allow"] == "GET, HEAD, OPTIONS, POST"
    assert "access-control-allow-methods" not in reply.headers


def test_no_page_of_another_origin_reads_by_default(api: httpx.Client) -> None:
    reply = api.get("/fluents", headers={"Origin": "https://lab.example"})
    assert "access-control-allow-origin" not in reply.headers


def test_pages_of_an_allowed_origin_read(make_api: Callable[..., httpx.Client]) -> None:
    allowing = make_api(security__cors_origins=["https://lab.example"])
    origin = {"Origin": "https://lab.example"}
    preflight = allowing.options(
        "/fluents", headers={**origin, "Access-Control-Request-Method": "POST"}
    )
    assert preflight.headers["access-control-allow-origin"] == "https://lab.example"
    assert "POST" in preflight.headers["access-control-allow-methods"]
    assert "Idempotency-Key" in preflight.headers["access-control-allow-headers"]
    for reply in (
        allowing.get("/health", headers=origin),
        allowing.get("/fluents/nobody", headers=origin),
    ):
        assert reply.headers["access-control-allow-origin"] == "https://lab.example"
        assert "X-Commit" in reply.headers["access-control-expose-headers"]


def test_a_closed_board_asks_for_a_token(make_api: Callable[..., httpx.Client]) -> None:
    closed = make_api(security__tokens=[TOKEN])
    refused = closed.get("/fluents")
    assert (refused.status_code, refused.json()["code"]) == (401, "not-authenticated")
    assert refused.headers["www-authenticate"].startswith("Bearer")
    token = {"Authorization": f"Bearer {TOKEN['token']}"}
    assert closed.get("/fluents", headers=token).status_code == 200
    written = closed.post("/fluents", json=[], headers=token)
    assert (written.status_code, written.json()["code"]) == (403, "not-allowed")


def test_commits_carry_the_name_of_the_token(
    make_api: Callable[..., httpx.Client], name: str
) -> None:
    closed = make_api(security__tokens=[{**TOKEN, "name": "mapping", "role": "write"}])
    headers = {"Authorization": f"Bearer {TOKEN['token']}", "X-Author": "somebody else"}
    closed.post("/fluents", json={"name": name, "class": "Mug"}, headers=headers)
    assert closed.get(f"/fluents/{name}", headers=headers).json()["author"] == "mapping"


@pytest.mark.parametrize("path", ["/", "/health", "/ready"])
def test_a_closed_board_says_without_a_token_that_it_is_there(
    make_api: Callable[..., httpx.Client], path: str
) -> None:
    assert make_api(security__tokens=[TOKEN]).get(path).status_code == 200


def test_a_failure_nobody_foresaw_tells_nothing_but_where_to_look(
    board: Blackboard,
    client_of: Callable[[BoardApp], httpx.Client],
    caplog: pytest.LogCaptureFixture,
) -> None:
    async def fail(call: Call) -> Reply:
        raise RuntimeError("password in /etc/board")

    app = create_app(board, Settings())
    operations = [*app.operations, Operation("GET", "/fail", fail, "fail", "Fails")]
    failing = BoardApp(
        operations,
        app.guard,
        app.metrics,
        app.live,
        app.frames,
        app.changes,
        app.sepa,
        app.sparql,
    )
    reply = client_of(failing).get("/fail")

    problem: dict[str, Any] = reply.json()
    assert (reply.status_code, problem["code"]) == (500, "error")
    assert "password" not in reply.text
    assert problem["incident"] in caplog.text
    assert "password in /etc/board" in caplog.text


def test_a_root_path_is_no_part_of_the_routes(board: Blackboard) -> None:
    app = create_app(board, Settings())
    sent: list[dict[str, Any]] = []

    async def receive() -> dict[str, Any]:
        return {"type": "http.request", "body": b"", "more_body": False}

    async def send(message: Any) -> None:
        sent.append(message)

    scope = {
        "type": "http",
        "method": "GET",
        "path": "/board/health",
        "root_path": "/board",
        "query_string": b"",
        "headers": [(b"host", b"localhost")],
    }
    asyncio.run(app(scope, receive, send))
    assert sent[0]["status"] == 200
