from __future__ import annotations

import json
import re
from collections.abc import Iterator
from typing import Any

import httpx
import jsonschema
import pytest

from fluentboard.api.app import create_app
from fluentboard.board.blackboard import Blackboard
from fluentboard.config import Settings


@pytest.fixture(scope="module")
def document(api: httpx.Client) -> dict[str, Any]:
    return api.get("/openapi.json").json()


def operations(document: dict[str, Any]) -> Iterator[tuple[str, str, dict[str, Any]]]:
    for path, item in document["paths"].items():
        for method, operation in item.items():
            yield method, path, operation


def check(document: dict[str, Any], schema: dict[str, Any], instance: Any) -> None:
    validator: Any = jsonschema.Draft202012Validator({**document, **schema})
    assert not [f"{list(e.path)}: {e.message}" for e in validator.iter_errors(instance)]


def test_the_document_is_openapi_3_1(document: dict[str, Any]) -> None:
    assert document["openapi"].startswith("3.1")
    assert set(document) >= {"info", "paths", "components", "tags"}


def test_every_route_is_in_it(document: dict[str, Any], board: Blackboard) -> None:
    served = {(o.method.lower(), o.path) for o in create_app(board, Settings()).operations}
    assert {(method, path) for method, path, _ in operations(document)} == served


def test_every_operation_says_what_it_does_and_what_it_answers(document: dict[str, Any]) -> None:
    seen: set[str] = set()
    for method, path, operation in operations(document):
        assert operation["summary"], (method, path)
        assert any(status.startswith("2") for status in operation["responses"]), (method, path)
        assert operation["operationId"] not in seen
        seen.add(operation["operationId"])
        declared = {p["name"] for p in operation["parameters"] if p["in"] == "path"}
        assert declared == set(re.findall(r"\{(\w+)\}", path))


def test_problems_are_problem_documents(document: dict[str, Any]) -> None:
    for method, path, operation in operations(document):
        for status, answer in operation["responses"].items():
            if status.startswith(("4", "50")) and path != "/ready":
                assert "application/problem+json" in answer["content"], (method, path, status)


def test_every_reference_leads_somewhere(document: dict[str, Any]) -> None:
    for name in re.findall(r'"#/components/schemas/(\w+)"', json.dumps(document)):
        assert name in document["components"]["schemas"]


def test_every_example_fits_its_schema(document: dict[str, Any]) -> None:
    for _, _, operation in operations(document):
        contents = [*operation["responses"].values(), operation.get("requestBody", {})]
        for content in (c for holder in contents for c in holder.get("content", {}).values()):
            if "example" in content and "schema" in content:
                check(document, content["schema"], content["example"])
        for parameter in operation["parameters"]:
            if "example" in parameter:
                check(document, parameter["schema"], parameter["example"])


def test_replies_fit_their_schemas(api: httpx.Client, document: dict[str, Any], name: str) -> None:
    fluent = {
        "name": name,
        "class": "Mug",
        "start": [1, None],
        "properties": [["hasPose", "Pose", "pose1"], ["hasX", "xsd:double", 1.5]],
    }
    batch = {"commands": [{"op": "end", "name": name, "finish": 30.0}]}
    exchanges: list[tuple[str, str, str, dict[str, Any]]] = [
        ("post", "/fluents", "/fluents", {"json": fluent}),
        ("patch", "/fluents/{name}", f"/fluents/{name}", {"json": {"start": [1, 2]}}),
        ("get", "/fluents/{name}", f"/fluents/{name}", {}),
        ("get", "/fluents", "/fluents?limit=1", {}),
        ("post", "/fluents/{name}/end", f"/fluents/{name}/end", {"json": {"at": [20, 30]}}),
        ("post", "/commands", "/commands", {"json": batch}),
        ("get", "/fluents/{name}/history", f"/fluents/{name}/history", {}),
        ("get", "/classes", "/classes", {}),
        ("get", "/health", "/health", {}),
        ("get", "/ready", "/ready", {}),
        ("get", "/subscriptions", "/subscriptions", {}),
        ("get", "/fluents/{name}", "/fluents/nobody", {}),
    ]
    for method, path, address, options in exchanges:
        reply = api.request(method.upper(), address, **options)
        answers = document["paths"][path][method]["responses"]
        content = answers[str(reply.status_code)]["content"]
        check(document, content[reply.headers["content-type"]]["schema"], reply.json())
