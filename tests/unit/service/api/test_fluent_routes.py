from __future__ import annotations

from collections.abc import Callable
from typing import Any

import httpx
import pytest

from fluentboard.board.blackboard import Blackboard
from fluentboard.model.yaml_format import read_fluents

YAML = {"Content-Type": "application/yaml"}


def mug(name: str, **more: Any) -> dict[str, Any]:
    return {"name": name, "class": "Mug", "start": [10.0, 11.0], **more}


def code(reply: httpx.Response) -> str:
    assert reply.headers["content-type"] == "application/problem+json"
    problem = reply.json()
    assert problem["status"] == reply.status_code
    assert problem["type"].endswith("#" + problem["code"])
    assert problem["detail"] == problem["message"]
    return problem["code"]


def test_an_asserted_fluent_can_be_read(api: httpx.Client, name: str) -> None:
    reply = api.post("/fluents", json=mug(name), headers={"X-Author": "mapping"})
    read = api.get(f"/fluents/{name}")

    commit = int(reply.headers["x-commit"])
    assert reply.status_code == 201
    assert reply.json() == {
        "commit": commit,
        "fluents": [{"name": name, "version": commit, "created": commit}],
        "warnings": [],
    }
    assert reply.headers["location"] == f"/fluents/{name}"
    assert read.headers["etag"] == reply.headers["etag"] == f'"{commit}"'
    assert read.json()["author"] == "mapping"
    assert read.json()["start"] == [10.0, 11.0]
    assert read.json()["finish"] == [None, None]


def test_several_fluents_are_asserted_in_one_commit(api: httpx.Client, name: str) -> None:
    names = [f"{name}a", f"{name}b"]
    reply = api.post("/fluents", json={"fluents": [mug(n) for n in names]})
    assert [f["name"] for f in reply.json()["fluents"]] == names
    assert "location" not in reply.headers
    versions = {api.get(f"/fluents/{n}").json()["version"] for n in names}
    assert versions == {reply.json()["commit"]}


def test_a_list_and_json_lines_say_the_same(api: httpx.Client, name: str) -> None:
    as_list = api.post("/fluents", json=[mug(f"{name}a")])
    lines = f'{{"name": "{name}b", "class": "Mug"}}\n\n{{"name": "{name}c", "class": "Mug"}}\n'
    as_lines = api.post("/fluents", content=lines, headers={"Content-Type": "application/x-ndjson"})
    assert (as_list.status_code, as_lines.status_code) == (201, 201)
    assert len(as_lines.json()["fluents"]) == 2


def test_yaml_documents_are_asserted(api: httpx.Client, name: str) -> None:
    times = "StartTime: [0.0, 5.0]\nFinishTime: [0.0, 0.0]\nProperties: []\n"
    text = f"!Fluent\nClass_Instance: [Mug, {name}]\n{times}"
    assert api.post("/fluents", content=text, headers=YAML).status_code == 201
    assert api.get(f"/fluents/{name}").json()["start"] == [None, 5.0]


def test_what_may_be_a_mistake_is_remarked(api: httpx.Client, name: str) -> None:
    properties = [["hasPose", "Pose", f"{name}Nowhere"], ["hasHandels", "xsd:int", 1]]
    warnings = api.post("/fluents", json=mug(name, properties=properties)).json()["warnings"]
    assert any(f"{name}Nowhere" in warning for warning in warnings)
    assert any("hasHandels" in warning for warning in warnings)


def test_asserting_the_same_again_changes_nothing(api: httpx.Client, name: str) -> None:
    first = api.post("/fluents", json=mug(name))
    again = api.post("/fluents", json=mug(name))
    assert again.status_code == 200
    assert again.json()["fluents"] == first.json()["fluents"]


def test_asserting_something_else_of_a_name_is_a_conflict(api: httpx.Client, name: str) -> None:
    api.post("/fluents", json=mug(name))
    reply = api.post("/fluents", json={**mug(name), "start": [10.5, 11.0]})
    assert (reply.status_code, code(reply)) == (409, "fluent-exists")


def test_merging_refines_what_is_there(api: httpx.Client, name: str) -> None:
    api.post("/fluents", json=mug(name))
    narrower = {**mug(name), "start": [10.5, 11.0]}
    reply = api.post("/fluents", json=narrower, params={"merge": "true"})
    assert reply.status_code == 200
    assert api.get(f"/fluents/{name}").json()["start"] == [10.5, 11.0]


def test_a_batch_with_one_mistake_stores_nothing(api: httpx.Client, name: str) -> None:
    reply = api.post("/fluents", json=[mug(name), {**mug(f"{name}b"), "class": "Mugg"}])
    assert (reply.status_code, code(reply)) == (422, "unknown-class")
    assert api.get(f"/fluents/{name}").status_code == 404


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"start": [12.0, 11.0]}, "interval-reversed"),
        ({"start": [0.0, 11.0]}, "invalid-time"),
        ({"start": "soon"}, "invalid-input"),
        ({"start": [1, 2, 3]}, "invalid-input"),
        ({"class": "Mugg"}, "unknown-class"),
        ({"name": "a b"}, "invalid-name"),
        ({"name": 7}, "invalid-name"),
        ({"colour": "red"}, "invalid-input"),
        ({"properties": [["hasX", "xsd:float", "far"]]}, "invalid-value"),
        ({"properties": "none"}, "invalid-input"),
    ],
)
def test_a_wrong_fluent_is_refused_with_the_reason(
    api: httpx.Client, name: str, change: dict[str, Any], expected: str
) -> None:
    reply = api.post("/fluents", json={**mug(name), **change})
    assert (reply.status_code, code(reply)) == (422, expected)


@pytest.mark.parametrize(
    ("content", "media_type", "status", "expected"),
    [
        (b"{", "application/json", 422, "invalid-input"),
        (b'"mug1"', "application/json", 422, "invalid-input"),
        (b'{"fluents": 3}', "application/json", 422, "invalid-input"),
        (b'{"fluents": [], "more": 1}', "application/json", 422, "invalid-input"),
        (b'{"name": "a\xff"}', "application/json", 422, "invalid-input"),
        (b"{}", "text/plain", 415, "unsupported-media-type"),
        (b"{}", "", 415, "unsupported-media-type"),
        (b"!Fluent\nClass_Instance: 3\n", "application/yaml", 422, "invalid-yaml"),
        (b'{"name": "a", "class": "Mug"}\nx', "application/x-ndjson", 422, "invalid-input"),
    ],
)
def test_a_wrong_body_is_refused_with_the_reason(
    api: httpx.Client, content: bytes, media_type: str, status: int, expected: str
) -> None:
    reply = api.post("/fluents", content=content, headers={"Content-Type": media_type})
    assert (reply.status_code, code(reply)) == (status, expected)


def test_a_batch_longer_than_the_limit_is_refused(
    make_api: Callable[..., httpx.Client], name: str
) -> None:
    reply = make_api(limits__batch_max=2).post(
        "/fluents", json=[mug(f"{name}{n}") for n in range(3)]
    )
    assert (reply.status_code, code(reply)) == (413, "too-large")
    assert "POST /import" in reply.json()["detail"]


def test_a_body_longer_than_the_limit_is_refused(
    make_api: Callable[..., httpx.Client], name: str
) -> None:
    reply = make_api(limits__body_max_bytes=50).post("/fluents", json=mug(name))
    assert (reply.status_code, code(reply)) == (413, "too-large")
    assert reply.json()["limit_bytes"] == 50


def test_the_same_key_gives_the_first_answer_again(api: httpx.Client, name: str) -> None:
    headers = {"Idempotency-Key": f"key of {name}"}
    first = api.post("/fluents", json=mug(name), headers=headers)
    again = api.post("/fluents", json=mug(name), headers=headers)
    assert again.json()["commit"] == first.json()["commit"]
    assert again.headers["x-commit"] == first.headers["x-commit"]


@pytest.mark.parametrize("body", [{}, {"at": "now"}])
def test_ending_now_again_with_the_same_key_gives_the_first_end(
    api: httpx.Client, name: str, body: dict[str, str]
) -> None:
    api.post("/fluents", json=mug(name))
    headers = {"Idempotency-Key": f"end of {name}"}
    first = api.post(f"/fluents/{name}/end", json=body, headers=headers)
    again = api.post(f"/fluents/{name}/end", json=body, headers=headers)
    assert (first.status_code, again.json()) == (200, first.json())
    other = api.post(f"/fluents/{name}/end", json={"at": 5.0}, headers=headers)
    assert code(other) == "idempotency-conflict"


def test_a_correction_sent_again_with_the_same_key_is_done_once(
    api: httpx.Client, name: str
) -> None:
    etag = api.post("/fluents", json=mug(name)).headers["etag"]
    headers = {"Idempotency-Key": f"correction of {name}", "If-Match": etag}
    corrected, why = {**mug(name), "class": "Plate"}, {"reason": "mixed up"}
    first = api.put(f"/fluents/{name}", json=corrected, params=why, headers=headers)
    again = api.put(f"/fluents/{name}", json=corrected, params=why, headers=headers)
    assert (first.status_code, again.json()) == (200, first.json())


def test_a_key_used_for_another_request_is_a_conflict(api: httpx.Client, name: str) -> None:
    headers = {"Idempotency-Key": f"key of {name}"}
    api.post("/fluents", json=mug(name), headers=headers)
    reply = api.post("/fluents", json=mug(f"{name}b"), headers=headers)
    assert (reply.status_code, code(reply)) == (409, "idempotency-conflict")


def test_a_fluent_nobody_asserted_is_not_found(api: httpx.Client) -> None:
    reply = api.get("/fluents/nobody")
    assert (reply.status_code, code(reply)) == (404, "unknown-fluent")
    assert reply.json()["name"] == "nobody"


def test_a_fluent_is_read_as_yaml_on_request(api: httpx.Client, name: str) -> None:
    api.post("/fluents", json=mug(name))
    reply = api.get(f"/fluents/{name}", headers={"Accept": "application/yaml"})
    assert [fluent.name for fluent in read_fluents(reply.text)] == [name]


def test_a_fluent_in_no_acceptable_form_is_406(api: httpx.Client, name: str) -> None:
    api.post("/fluents", json=mug(name))
    reply = api.get(f"/fluents/{name}", headers={"Accept": "image/png"})
    assert (reply.status_code, code(reply)) == (406, "not-acceptable")


def test_a_version_that_is_held_is_not_sent_again(api: httpx.Client, name: str) -> None:
    etag = api.post("/fluents", json=mug(name)).headers["etag"]
    reply = api.get(f"/fluents/{name}", headers={"If-None-Match": etag})
    assert (reply.status_code, reply.content) == (304, b"")
    api.post(f"/fluents/{name}/end", json={"at": 20.0})
    assert api.get(f"/fluents/{name}", headers={"If-None-Match": etag}).status_code == 200


def test_head_tells_what_get_would_without_the_body(api: httpx.Client, name: str) -> None:
    api.post("/fluents", json=mug(name))
    head, get = api.head(f"/fluents/{name}"), api.get(f"/fluents/{name}")
    assert head.content == b""
    assert head.headers["etag"] == get.headers["etag"]
    assert head.headers["content-length"] == str(len(get.content))


def test_refining_narrows_and_adds(api: httpx.Client, name: str) -> None:
    api.post("/fluents", json=mug(name))
    change = {"start": [10.5, 11.0], "properties": [["hasX", "xsd:double", 1.5]]}
    reply = api.patch(f"/fluents/{name}", json=change)
    assert reply.status_code == 200
    assert reply.json()["fluent"]["start"] == [10.5, 11.0]
    assert reply.json()["fluent"]["version"] == reply.json()["commit"]
    assert reply.headers["etag"] == f'"{reply.json()["commit"]}"'
    assert reply.headers["x-commit"] == str(reply.json()["commit"])


def test_widening_is_a_conflict(api: httpx.Client, name: str) -> None:
    api.post("/fluents", json=mug(name))
    reply = api.patch(f"/fluents/{name}", json={"start": [9.0, 11.0]})
    assert (reply.status_code, code(reply)) == (409, "not-a-refinement")


@pytest.mark.parametrize("body", [[], {"begin": [1, 2]}, {"start": [0, 1]}, {"start": "x"}])
def test_a_wrong_refinement_is_refused(api: httpx.Client, name: str, body: Any) -> None:
    api.post("/fluents", json=mug(name))
    assert api.patch(f"/fluents/{name}", json=body).status_code == 422


@pytest.mark.parametrize(
    ("at", "finish"),
    [(20.5, [20.5, 20.5]), ([20.0, 21.0], [20.0, 21.0]), ([20.0, None], [20.0, None])],
)
def test_ending_takes_a_time_or_an_interval(
    api: httpx.Client, name: str, at: Any, finish: list[float | None]
) -> None:
    api.post("/fluents", json=mug(name))
    reply = api.post(f"/fluents/{name}/end", json={"at": at})
    assert reply.status_code == 200
    assert reply.json()["fluent"]["finish"] == finish


@pytest.mark.parametrize("body", [None, {}, {"at": "now"}])
def test_ending_without_a_time_means_now(
    api: httpx.Client, board: Blackboard, name: str, body: dict[str, str] | None
) -> None:
    api.post("/fluents", json=mug(name))
    before = board.clock.now_s()
    finish = api.post(f"/fluents/{name}/end", json=body).json()["fluent"]["finish"]
    assert before <= finish[0] == finish[1] <= board.clock.now_s()


def test_ending_at_an_unknown_time_is_refused(api: httpx.Client, name: str) -> None:
    api.post("/fluents", json=mug(name))
    reply = api.post(f"/fluents/{name}/end", json={"at": None})
    assert (reply.status_code, code(reply)) == (422, "invalid-time")


def test_ending_twice_at_different_times_is_a_conflict(api: httpx.Client, name: str) -> None:
    api.post("/fluents", json=mug(name))
    api.post(f"/fluents/{name}/end", json={"at": 20.0})
    reply = api.post(f"/fluents/{name}/end", json={"at": 21.0})
    assert (reply.status_code, code(reply)) == (409, "not-a-refinement")


def test_a_writer_with_an_old_version_is_told(api: httpx.Client, name: str) -> None:
    old = api.post("/fluents", json=mug(name)).headers["etag"]
    current = api.patch(f"/fluents/{name}", json={"start": [10.5, 11.0]}).headers["etag"]
    headers = {"If-Match": old}
    reply = api.post(f"/fluents/{name}/end", json={"at": 20.0}, headers=headers)
    assert (reply.status_code, code(reply)) == (412, "version-mismatch")
    assert f'"{reply.json()["version"]}"' == current
    headers = {"If-Match": current}
    assert api.post(f"/fluents/{name}/end", json={"at": 20.0}, headers=headers).status_code == 200


def test_a_version_that_is_none_never_matches(api: httpx.Client, name: str) -> None:
    api.post("/fluents", json=mug(name))
    reply = api.patch(f"/fluents/{name}", json={}, headers={"If-Match": '"latest"'})
    assert (reply.status_code, code(reply)) == (412, "version-mismatch")


def test_changing_nothing_gives_no_new_version(api: httpx.Client, name: str) -> None:
    etag = api.post("/fluents", json=mug(name)).headers["etag"]
    assert api.patch(f"/fluents/{name}", json={}).headers["etag"] == etag


def test_a_correction_needs_a_reason(api: httpx.Client, name: str) -> None:
    api.post("/fluents", json=mug(name))
    reply = api.put(f"/fluents/{name}", json={**mug(name), "class": "Plate"})
    assert (reply.status_code, code(reply)) == (422, "invalid-input")


def test_a_correction_with_a_reason_goes_against_the_rules(api: httpx.Client, name: str) -> None:
    api.post("/fluents", json=mug(name))
    corrected = {**mug(name), "class": "Plate", "start": [1.0, 2.0]}
    reply = api.put(f"/fluents/{name}", json=corrected, params={"reason": "mixed up"})
    assert reply.json()["fluent"]["class"] == "Plate"
    history = api.get(f"/fluents/{name}/history").json()["history"]
    assert (history[-1]["event"], history[-1]["reason"]) == ("corrected", "mixed up")


def test_a_correction_cannot_rename(api: httpx.Client, name: str) -> None:
    api.post("/fluents", json=mug(name))
    reply = api.put(f"/fluents/{name}", json=mug(f"{name}b"), params={"reason": "why not"})
    assert (reply.status_code, code(reply)) == (422, "invalid-input")


def test_a_correction_notices_another_writer(api: httpx.Client, name: str) -> None:
    old = api.post("/fluents", json=mug(name)).headers["etag"]
    api.patch(f"/fluents/{name}", json={"start": [10.5, 11.0]})
    reply = api.put(
        f"/fluents/{name}", json=mug(name), params={"reason": "x"}, headers={"If-Match": old}
    )
    assert (reply.status_code, code(reply)) == (412, "version-mismatch")


def test_the_history_tells_every_change(api: httpx.Client, name: str) -> None:
    api.post("/fluents", json=mug(name), headers={"X-Author": "mapping"})
    api.post(f"/fluents/{name}/end", json={"at": 20.0}, headers={"X-Author": "anchoring"})
    history = api.get(f"/fluents/{name}/history").json()["history"]
    assert [(h["event"], h["author"]) for h in history] == [
        ("added", "mapping"),
        ("ended", "anchoring"),
    ]
    assert history[0]["fluent"]["finish"] == [None, None]
    assert history[1]["fluent"]["finish"] == [20.0, 20.0]
    assert history[0]["commit"] < history[1]["commit"]


def test_the_past_can_be_read(api: httpx.Client, name: str) -> None:
    commit = api.post("/fluents", json=mug(name)).json()["commit"]
    api.post(f"/fluents/{name}/end", json={"at": 20.0})
    past = api.get(f"/fluents/{name}", params={"asof": commit})
    assert past.json()["finish"] == [None, None]
    before = api.get(f"/fluents/{name}", params={"asof": commit - 1})
    assert (before.status_code, code(before)) == (404, "unknown-fluent")


def test_the_future_cannot_be_read(api: httpx.Client, board: Blackboard, name: str) -> None:
    reply = api.get("/fluents", params={"asof": board.commit + 1})
    assert (reply.status_code, code(reply)) == (422, "invalid-input")


def test_an_author_with_control_characters_is_refused(api: httpx.Client, name: str) -> None:
    reply = api.post("/fluents", json=mug(name), headers={"X-Author": "a\tb"})
    assert (reply.status_code, code(reply)) == (422, "invalid-input")
