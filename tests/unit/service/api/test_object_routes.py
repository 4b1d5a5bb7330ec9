"""The route that tells where an object was."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterator
from typing import Any

import httpx
import pytest

from fluentboard.api.app import BoardApp, create_app
from fluentboard.api.schemas.trajectories import TrajectoryJson
from fluentboard.board.blackboard import Blackboard
from fluentboard.clock import ReplayClock
from fluentboard.config import Settings
from fluentboard_client import Client

PATH = "/objects/mug1/trajectory"


def pose(name: str, x: float, start: Any, finish: Any) -> dict[str, Any]:
    values = [["hasX", "xsd:double", x]]
    return {"name": name, "class": "Pose", "start": start, "finish": finish, "properties": values}


@pytest.fixture(scope="module")
def asking(client_of: Callable[[BoardApp], httpx.Client]) -> Iterator[httpx.Client]:
    """A mug that stood at x = 1 until 119 to 121 s, and at x = 4 since 160 to 162 s."""
    with Blackboard.open(None, clock=ReplayClock(170.0)) as board:
        api = client_of(create_app(board, Settings()))
        mug = {"name": "mug1", "class": "Mug", "properties": [["hasPose", "Pose", "pose3"]]}
        first = pose("pose3", 1.0, None, [119.0, 121.0])
        assert api.post("/fluents", json=[mug, first]).status_code == 201
        second = pose("pose9", 4.0, [160.0, 162.0], None)
        references = [["hasPose", "Pose", "pose9"], ["hasPose", "Pose", "lost"]]
        commands = [
            {"op": "assert", "fluent": second},
            {"op": "refine", "name": "mug1", "properties": references},
        ]
        assert api.post("/commands", json={"commands": commands}).status_code == 200
        yield api


def told(asking: httpx.Client, **params: str) -> dict[str, Any]:
    reply = asking.get(PATH, params=params)
    assert reply.status_code == 200, reply.text
    TrajectoryJson.model_validate(reply.json())
    assert reply.headers["x-commit"] == str(reply.json()["commit"])
    return reply.json()


def test_poses_come_with_their_uncertain_times_and_the_distance(asking: httpx.Client) -> None:
    found = told(asking)
    times = [(step["fluent"], step["start"], step["finish"]) for step in found["poses"]]
    assert times == [
        ("pose3", [None, None], [119.0, 121.0]),
        ("pose9", [160.0, 162.0], [None, None]),
    ]
    assert found["distance_m"] == 3.0
    assert found["missing"] == ["lost"]
    assert found["gaps"] == [
        {
            "before": "pose3",
            "after": "pose9",
            "possible": [119.0, 162.0],
            "certain": [121.0, 160.0],
        }
    ]


def test_positions_are_told_for_every_time_asked_for(asking: httpx.Client) -> None:
    found = told(asking, at="100, 120,140,now")
    positions = [
        (place["at"], [(pose["fluent"], pose["certainty"]) for pose in place["poses"]])
        for place in found["positions"]
    ]
    assert positions == [
        (100.0, [("pose3", "certain")]),
        (120.0, [("pose3", "possible")]),
        (140.0, []),
        (170.0, [("pose9", "certain")]),
    ]


def test_a_window_and_a_commit_narrow_the_trajectory(asking: httpx.Client) -> None:
    assert [step["fluent"] for step in told(asking, during="130,170")["poses"]] == ["pose9"]
    before = told(asking)["commit"] - 1
    assert [step["fluent"] for step in told(asking, asof=str(before))["poses"]] == ["pose3"]


def test_csv_has_a_line_for_every_pose(asking: httpx.Client) -> None:
    reply = asking.get(PATH, headers={"Accept": "text/csv"})
    first, second = csv.DictReader(reply.text.splitlines())
    assert (first["x"], first["start_earliest"], first["finish_latest"]) == ("1.0", "", "121.0")
    assert (second["fluent"], second["start_latest"]) == ("pose9", "162.0")


@pytest.mark.parametrize(
    ("path", "params", "status", "code"),
    [
        ("/objects/nobody/trajectory", {}, 404, "unknown-fluent"),
        (PATH, {"at": "soon"}, 422, "invalid-time"),
        (PATH, {"during": "160,100"}, 422, "invalid-time"),
        (PATH, {"asof": "99"}, 422, "invalid-input"),
        (PATH, {"from": "3"}, 422, "invalid-input"),
    ],
)
def test_what_makes_no_sense_is_refused(
    asking: httpx.Client, path: str, params: dict[str, str], status: int, code: str
) -> None:
    reply = asking.get(path, params=params)
    assert (reply.status_code, reply.json()["code"]) == (status, code)


def test_the_client_tells_the_same(asking: httpx.Client) -> None:
    def ask(request: httpx.Request) -> httpx.Response:
        reply = asking.get(request.url.raw_path.decode())
        return httpx.Response(reply.status_code, content=reply.content, headers=reply.headers)

    found = Client("http://board", transport=httpx.MockTransport(ask)).trajectory(
        "mug1", at=[120.0, "now"], during=(100.0, 170.0)
    )
    assert [held.pose.x for held in found.poses] == [1.0, 4.0]
    assert found.poses[0].finish.latest == 121.0
    assert found.gaps[0].certain_s == (121.0, 160.0)
    assert {time_s: len(places) for time_s, places in found.positions.items()} == {
        120.0: 1,
        170.0: 1,
    }
