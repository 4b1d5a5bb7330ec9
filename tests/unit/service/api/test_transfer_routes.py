from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import httpx
import orjson
import pytest

from fluentboard.api.app import BoardApp, create_app
from fluentboard.board.blackboard import Blackboard
from fluentboard.config import Settings, load_settings
from fluentboard.model.fluent import Fluent
from fluentboard.model.json_format import fluent_from_json
from fluentboard.model.yaml_format import read_fluents

FLUENTS = """!Fluent
Class_Instance: [Mug, mug1]
StartTime: [10.0, 20.0]
FinishTime: [30.0, 40.0]
Properties:
  - [hasPose, Pose, pose1]
  - [hasName, xsd:string, "a \\"mug\\""]
---
!Fluent
Class_Instance: [Pose, pose1]
StartTime: [10.0, 20.0]
FinishTime: [0.0, 0.0]
Properties:
  - [hasX, xsd:float, 1.5]
"""
MEDIA_TYPES = {
    "yaml": "application/yaml",
    "jsonl": "application/x-ndjson",
    "turtle": "text/turtle",
}


@pytest.fixture
def board() -> Iterator[Blackboard]:
    with Blackboard.open(None) as opened:
        yield opened


@pytest.fixture
def api(board: Blackboard, client_of: Callable[[BoardApp], httpx.Client]) -> httpx.Client:
    settings = load_settings(flags={"limits.import_batch": 3, "limits.import_max_bytes": 10_000})
    return client_of(create_app(board, settings))


def send(api: httpx.Client, content: str | bytes, form: str = "yaml") -> httpx.Response:
    return api.post("/import", content=content, headers={"Content-Type": MEDIA_TYPES[form]})


def yaml(name: str, class_name: str = "Mug", start: str = "[1.0, 2.0]", more: str = " []") -> str:
    return (
        f"!Fluent\nClass_Instance: [{class_name}, {name}]\nStartTime: {start}\n"
        f"FinishTime: [0.0, 0.0]\nProperties:{more}\n"
    )


def statements(fluents: list[Fluent]) -> list[Any]:
    return [(f.name, f.class_name, f.start, f.finish, set(f.properties)) for f in fluents]


def test_an_import_is_committed_in_batches(api: httpx.Client, board: Blackboard) -> None:
    before = board.commit
    reply = send(api, "---\n".join(yaml(f"mug{n}") for n in range(7)))
    assert reply.status_code == 200
    assert reply.json() == {
        "commit": before + 3,
        "commits": 3,
        "fluents": 7,
        "changed": 7,
        "statements": 0,
        "warnings": [],
    }
    assert reply.headers["x-commit"] == str(before + 3)
    assert len(board) == 7


def test_importing_again_changes_nothing(api: httpx.Client, board: Blackboard) -> None:
    send(api, FLUENTS)
    commit = board.commit
    again = send(api, FLUENTS).json()
    assert (again["commits"], again["changed"], again["commit"]) == (0, 0, commit)


@pytest.mark.parametrize("form", list(MEDIA_TYPES))
def test_what_is_exported_can_be_imported(
    api: httpx.Client, client_of: Callable[[BoardApp], httpx.Client], form: str
) -> None:
    send(api, FLUENTS)
    exported = api.get("/export", params={"format": form})
    with Blackboard.open(None) as other:
        copy = client_of(create_app(other, Settings()))
        assert send(copy, exported.content, form).status_code == 200
        copied = [other.fluent("mug1"), other.fluent("pose1")]
    assert exported.headers["content-type"] == MEDIA_TYPES[form]
    assert statements(copied) == statements(list(read_fluents(FLUENTS)))


def test_an_export_is_negotiated(api: httpx.Client) -> None:
    send(api, FLUENTS)
    reply = api.get("/export", headers={"Accept": "application/x-ndjson"})
    fluents = [fluent_from_json(orjson.loads(line)) for line in reply.content.splitlines()]
    assert [fluent.name for fluent in fluents] == ["mug1", "pose1"]


def test_an_export_of_a_time_has_what_may_hold_then(api: httpx.Client) -> None:
    send(api, FLUENTS)
    reply = api.get("/export", params={"at": "45"})
    assert [fluent.name for fluent in read_fluents(reply.text)] == ["pose1"]


def test_an_export_of_a_commit_has_what_was_believed_then(
    api: httpx.Client, board: Blackboard
) -> None:
    send(api, FLUENTS)
    commit = board.commit
    send(api, yaml("mug2"))
    reply = api.get("/export", params={"asof": commit})
    assert [fluent.name for fluent in read_fluents(reply.text)] == ["mug1", "pose1"]
    assert reply.headers["x-commit"] == str(commit)


def test_an_empty_board_exports_nothing(api: httpx.Client) -> None:
    assert api.get("/export", params={"format": "jsonl"}).content == b""


@pytest.mark.parametrize(
    ("content", "form", "status", "code"),
    [
        (yaml("a") + "---\n" + yaml("b", start="[2.0, 1.0]"), "yaml", 422, "interval-reversed"),
        (yaml("a") + "---\n" + yaml("b", "Mugg"), "yaml", 422, "unknown-class"),
        (yaml("a") + "---\n!Fluent\nnonsense\n", "yaml", 422, "invalid-yaml"),
        (yaml("a") + "---\n" + yaml("a", start="[5.0, 6.0]"), "yaml", 409, "not-a-refinement"),
        (yaml("a") + "---\n" + yaml("there", "Plate"), "yaml", 409, "not-a-refinement"),
        (yaml("a", more="\n  - [hasX, xsd:float, NaN]"), "yaml", 422, "invalid-value"),
        (yaml("a").encode() + b"\xff", "yaml", 422, "invalid-yaml"),
        ('{"name": "a", "class": "Mug"}\n{"name": "b"}\n', "jsonl", 422, "invalid-input"),
        ("<http://x/a> a <http://x/B> .", "turtle", 422, "invalid-input"),
        ("@prefix", "turtle", 400, "invalid-rdf"),
        (yaml("a") + "# " + "x" * 20_000, "yaml", 413, "too-large"),
    ],
)
def test_an_import_with_one_mistake_stores_nothing(
    api: httpx.Client,
    board: Blackboard,
    content: str | bytes,
    form: str,
    status: int,
    code: str,
) -> None:
    assert send(api, yaml("there")).status_code == 200
    before = board.commit
    reply = send(api, content, form)
    assert (reply.status_code, reply.json()["code"]) == (status, code)
    assert (board.commit, len(board)) == (before, 1)


def test_a_mistake_is_named_with_its_place(api: httpx.Client) -> None:
    detail = send(api, yaml("a") + "---\n" + yaml("b", "Mugg")).json()["detail"]
    assert "fluent 2 of the import ('b')" in detail
    assert "did you mean Mug" in detail


def test_a_fluent_described_twice_is_one(api: httpx.Client, board: Blackboard) -> None:
    narrower = yaml("a", start="[1.5, 2.0]", more="\n  - [hasX, xsd:double, 1.5]")
    reply = send(api, yaml("a") + "---\n" + narrower)
    assert (reply.json()["fluents"], reply.json()["changed"]) == (2, 1)
    assert board.fluent("a").start.earliest == 1.5
    assert board.fluent("a").values("hasX") == (1.5,)


def test_what_may_be_a_mistake_is_remarked(api: httpx.Client) -> None:
    more = "\n  - [hasPose, Pose, pose9]\n  - [hasPose, Pose, b]\n  - [hasHandels, xsd:int, 1]"
    warnings = send(api, yaml("a", more=more) + "---\n" + yaml("b", "Pose")).json()["warnings"]
    assert len(warnings) == 2
    assert any("pose9" in warning for warning in warnings)
    assert any("hasHandels" in warning for warning in warnings)


def test_names_with_prefixes_become_the_short_ones(api: httpx.Client, board: Blackboard) -> None:
    line = {
        "name": "a",
        "class": "race:Mug",
        "properties": [["upper:hasPose", "upper:Pose", "pose1"]],
    }
    assert send(api, orjson.dumps(line), "jsonl").status_code == 200
    fluent = board.fluent("a")
    assert fluent.class_name == "Mug"
    assert [(p.name, p.type) for p in fluent.properties] == [("hasPose", "Pose")]


def test_the_author_of_an_import_is_kept(api: httpx.Client, board: Blackboard) -> None:
    headers = {"Content-Type": "application/yaml", "X-Author": "archive"}
    api.post("/import", content=yaml("a"), headers=headers)
    assert board.fluent("a").author == "archive"


@pytest.mark.parametrize(
    ("params", "headers", "status", "code"),
    [
        ({"format": "xls"}, {}, 422, "invalid-input"),
        ({"at": "soon"}, {}, 422, "invalid-time"),
        ({"asof": "999999"}, {}, 422, "invalid-input"),
        ({}, {"Accept": "image/png"}, 406, "not-acceptable"),
    ],
)
def test_a_wrong_export_is_refused(
    api: httpx.Client, params: dict[str, str], headers: dict[str, str], status: int, code: str
) -> None:
    reply = api.get("/export", params=params, headers=headers)
    assert (reply.status_code, reply.json()["code"]) == (status, code)


def test_an_import_in_an_unknown_format_is_refused(api: httpx.Client) -> None:
    reply = api.post("/import", content="a,b", headers={"Content-Type": "text/csv"})
    assert (reply.status_code, reply.json()["code"]) == (415, "unsupported-media-type")
