from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any
from urllib.parse import parse_qsl, urlsplit

import httpx
import orjson
import pytest

from fluentboard.api.app import BoardApp, create_app
from fluentboard.board.blackboard import Blackboard
from fluentboard.clock import ReplayClock
from fluentboard.config import Settings
from fluentboard.model.yaml_format import read_fluents


@pytest.fixture(scope="module")
def api(client_of: Callable[[BoardApp], httpx.Client]) -> Iterator[httpx.Client]:
    """A board at 50 s of an episode with two mugs, a plate and a table."""
    with Blackboard.open(None, clock=ReplayClock(50.0)) as board:
        asking = client_of(create_app(board, Settings()))
        fluents = [
            {"name": "mug1", "class": "Mug", "start": [10, 20], "finish": [30, 40]},
            {"name": "mug2", "class": "Mug", "start": [45, 55]},
            {"name": "plate1", "class": "Plate", "start": [5, 5], "finish": [60, 60]},
            {
                "name": "table1",
                "class": "Table",
                "properties": [["hasX", "xsd:double", 1.5], ["hasPose", "Pose", "pose1"]],
            },
        ]
        assert asking.post("/fluents", json=fluents).status_code == 201
        yield asking


def names(api: httpx.Client, **params: Any) -> list[str]:
    reply = api.get("/fluents", params=params)
    assert reply.status_code == 200, reply.text
    return [fluent["name"] for fluent in reply.json()["fluents"]]


@pytest.mark.parametrize(
    ("params", "expected"),
    [
        ({}, ["mug1", "mug2", "plate1", "table1"]),
        ({"class": "Mug"}, ["mug1", "mug2"]),
        ({"class": "Kitchenware"}, ["mug1", "mug2", "plate1"]),
        ({"at": "35"}, ["mug1", "plate1", "table1"]),
        ({"at": "35", "certainly": ""}, ["plate1", "table1"]),
        ({"at": "25", "certainly": "true"}, ["mug1", "plate1", "table1"]),
        ({"at": "now"}, ["mug2", "plate1", "table1"]),
        ({"at": "now", "certainly": "true", "class": "Mug"}, []),
        ({"during": "41,44"}, ["plate1", "table1"]),
        ({"during": "39,46", "class": "Mug"}, ["mug1", "mug2"]),
        ({"open": "true"}, ["mug2", "table1"]),
        ({"open": "false"}, ["mug1", "plate1"]),
        ({"property": "hasX"}, ["table1"]),
        ({"property": "hasPose", "value": "pose1"}, ["table1"]),
        ({"property": "hasPose", "value": "pose2"}, []),
        ({"relation": "within", "to": "4,61"}, ["mug1", "plate1"]),
        ({"relation": "during", "to": "plate1", "certainly": ""}, ["mug1"]),
        ({"relation": "before", "to": "45"}, ["mug1"]),
        ({"relation": "equals", "to": "mug2", "certainly": ""}, ["mug2"]),
        ({"asof": "50.0"}, ["mug1", "mug2", "plate1", "table1"]),
        ({"asof": "49.5"}, []),
        ({"asof": "1970-01-01T00:00:50Z", "class": "Mug"}, ["mug1", "mug2"]),
        ({"asof": "1970-01-01T01:00:00+01:00"}, []),
    ],
)
def test_all_filters_that_are_given_hold(
    api: httpx.Client, params: dict[str, str], expected: list[str]
) -> None:
    assert names(api, **params) == expected


def test_pages_together_are_the_whole(api: httpx.Client) -> None:
    found: list[str] = []
    params: dict[str, Any] = {"limit": 3}
    while True:
        page = api.get("/fluents", params=params).json()
        found += [fluent["name"] for fluent in page["fluents"]]
        if page["next"] is None:
            break
        params["cursor"] = page["next"]
    assert found == names(api)


def test_a_page_links_to_the_next(api: httpx.Client) -> None:
    link = api.get("/fluents", params={"limit": 1, "class": "Mug"}).headers["link"]
    address, _, relation = link.partition("; ")
    following = dict(parse_qsl(urlsplit(address.strip("<>")).query))
    assert relation == 'rel="next"'
    assert names(api, **following) == ["mug2"]


def test_a_listing_comes_as_yaml_or_json_lines_on_request(api: httpx.Client) -> None:
    as_yaml = api.get("/fluents", headers={"Accept": "application/yaml"})
    as_lines = api.get("/fluents", headers={"Accept": "application/x-ndjson"})
    assert [f.name for f in read_fluents(as_yaml.text)] == names(api)
    assert [orjson.loads(line)["name"] for line in as_lines.text.splitlines()] == names(api)


def test_a_relation_to_nobody_is_not_found(api: httpx.Client) -> None:
    reply = api.get("/fluents", params={"relation": "during", "to": "nobody"})
    assert (reply.status_code, reply.json()["code"]) == (404, "unknown-fluent")


@pytest.mark.parametrize(
    ("params", "code"),
    [
        ({"clas": "Mug"}, "invalid-input"),
        ({"class": "Mugg"}, "unknown-class"),
        ({"at": "soon"}, "invalid-time"),
        ({"during": "2,1"}, "invalid-time"),
        ({"certainly": "true", "possibly": "true"}, "invalid-input"),
        ({"value": "3"}, "invalid-input"),
        ({"limit": "0"}, "invalid-input"),
        ({"limit": "1000000"}, "invalid-input"),
        ({"cursor": "x"}, "invalid-input"),
        ({"asof": "-1"}, "invalid-input"),
        ({"asof": "yesterday"}, "invalid-input"),
        ({"asof": "2026-05-01T12:00:00"}, "invalid-input"),
        ({"relation": "during"}, "invalid-input"),
        ({"to": "1,2"}, "invalid-input"),
        ({"relation": "near", "to": "1,2"}, "invalid-input"),
        ({"relation": "during", "to": "2,1"}, "interval-reversed"),
    ],
)
def test_a_wrong_filter_is_refused(api: httpx.Client, params: dict[str, str], code: str) -> None:
    reply = api.get("/fluents", params=params)
    assert (reply.status_code, reply.json()["code"]) == (422, code)
