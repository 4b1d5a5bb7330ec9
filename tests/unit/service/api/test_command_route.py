from __future__ import annotations

from collections.abc import Callable
from typing import Any

import httpx
import pytest


def mug(name: str) -> dict[str, Any]:
    return {"name": name, "class": "Mug", "start": [10.0, 11.0]}


def run(api: httpx.Client, *commands: dict[str, Any]) -> Any:
    return api.post("/commands", json={"commands": list(commands)})


def test_a_mixed_batch_is_one_commit(api: httpx.Client, name: str) -> None:
    api.post("/fluents", json=[mug(f"{name}a"), mug(f"{name}b")])
    reply = run(
        api,
        {"op": "end", "name": f"{name}a", "finish": [20.0, 21.0]},
        {"op": "refine", "name": f"{name}b", "start": [10.5, 11.0]},
        {"op": "assert", "fluent": mug(f"{name}c")},
    )
    receipt = reply.json()
    assert reply.status_code == 200
    assert [event["event"] for event in receipt["events"]] == ["ended", "refined", "added"]
    assert {event["fluent"]["version"] for event in receipt["events"]} == {receipt["commit"]}
    assert reply.headers["x-commit"] == str(receipt["commit"])


def test_one_refused_command_stops_all(api: httpx.Client, name: str) -> None:
    reply = run(
        api,
        {"op": "assert", "fluent": mug(name)},
        {"op": "end", "name": "nobody", "finish": 20.0},
    )
    assert (reply.status_code, reply.json()["code"]) == (404, "unknown-fluent")
    assert api.get(f"/fluents/{name}").status_code == 404


def test_a_command_may_expect_a_version(api: httpx.Client, name: str) -> None:
    version = api.post("/fluents", json=mug(name)).json()["commit"]
    ending = {"op": "end", "name": name, "finish": 20.0}
    wrong = run(api, {**ending, "version": version - 1})
    assert (wrong.status_code, wrong.json()["code"]) == (412, "version-mismatch")
    assert run(api, {**ending, "version": version}).status_code == 200


def test_an_assertion_may_merge(api: httpx.Client, name: str) -> None:
    api.post("/fluents", json=mug(name))
    fluent = {**mug(name), "start": [10.5, 11.0]}
    assert run(api, {"op": "assert", "fluent": fluent}).status_code == 409
    assert run(api, {"op": "assert", "fluent": fluent, "merge": True}).status_code == 200


@pytest.mark.parametrize(
    ("command", "message"),
    [
        ({}, "command 1 has the op None"),
        ({"op": "delete", "name": "mug1"}, "the op 'delete'"),
        ({"op": ["end"]}, "the op"),
        ({"op": "assert"}, "the fluent of command 1"),
        ({"op": "assert", "fluent": mug("a"), "merge": "yes"}, "give true or false"),
        ({"op": "end", "name": "mug1"}, "has no finish"),
        ({"op": "end", "finish": 3.0}, "has the name None"),
        ({"op": "end", "name": "mug1", "finish": 3.0, "version": "3"}, "has version '3'"),
        ({"op": "end", "name": "mug1", "at": 3.0}, "unknown key 'at'"),
        ({"op": "refine", "name": "mug1", "start": "early"}, "start of 'mug1'"),
    ],
)
def test_a_wrong_command_is_named(api: httpx.Client, command: dict[str, Any], message: str) -> None:
    reply = run(api, command)
    assert reply.status_code == 422
    assert message in reply.json()["detail"]


@pytest.mark.parametrize("body", [[], {}, {"commands": 3}, {"commands": [], "more": 1}])
def test_a_body_without_commands_is_refused(api: httpx.Client, body: Any) -> None:
    assert api.post("/commands", json=body).status_code == 422


def test_a_batch_longer_than_the_limit_is_refused(
    make_api: Callable[..., httpx.Client], name: str
) -> None:
    commands = [{"op": "assert", "fluent": mug(f"{name}{n}")} for n in range(3)]
    assert run(make_api(limits__batch_max=2), *commands).status_code == 413


def test_an_empty_batch_changes_nothing(api: httpx.Client) -> None:
    assert run(api).json()["events"] == []
