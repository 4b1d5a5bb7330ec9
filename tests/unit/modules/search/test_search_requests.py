"""Requests as fluents, claims and progress as fluents, and probabilities from memory."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fluentboard.errors import InvalidInput, UnreachableView
from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.geometry import BoundingBox, Pose
from fluentboard.model.interval import Interval
from fluentboard_modules.geometry_fluents import box_fluents
from fluentboard_modules.search.config import SearchConfig
from fluentboard_modules.search.cooccurrence import Sighting, probabilities_from_memory
from fluentboard_modules.search.map_robot import MapRobot, costmap_of
from fluentboard_modules.search.occupancy import OccupancyMap
from fluentboard_modules.search.octomap_files import write_octomap
from fluentboard_modules.search.record import Moment, SearchStep
from fluentboard_modules.search.region import SearchVolume
from fluentboard_modules.search.request import (
    read_request,
    request_fluents,
    volumes_over,
)
from fluentboard_modules.search.run import ask_for
from fluentboard_modules.search.search_fluents import SearchFluents
from fluentboard_modules.search.volume_text import volume_of_text
from fluentboard_modules.search.worlds import open_world
from fluentboard_modules.simulation.robots import PR2, ROBOTS, View
from fluentboard_modules.statements import Ending

BOX = BoundingBox(Pose.from_rpy(2.0, 1.0, 0.9, yaw=0.3), 0.8, 0.6, 0.3)
NOW = Interval.at(100.0)


def asked(**what: object) -> tuple[Fluent, dict[str, Fluent]]:
    fluents = request_fluents("search1", start=NOW, **what)  # type: ignore[arg-type]
    return fluents[-1], {f.name: f for f in fluents}


def test_a_request_is_read_as_it_was_asked() -> None:
    activity, others = asked(
        target_class="race:Mug",
        volumes=[SearchVolume("table", BOX, 0.4)],
        settings={
            "hasTimeBudget": 60.0,
            "hasProbabilityThreshold": 0.1,
            "hasDetectorRecall": 0.8,
            "hasDetectorRange": 2.0,
            "hasMinimumConfidence": 0.6,
        },
        is_afresh=True,
    )
    request = read_request(activity, others, SearchConfig())
    assert request.target_class == "Mug"
    assert request.source == "user"
    assert request.config.time_budget_s == 60.0
    assert request.config.threshold == 0.1
    assert request.config.recall == 0.8
    assert request.config.detector_range_m == 2.0
    assert request.config.confidence_min == 0.6
    assert request.is_afresh
    assert not read_request(*asked(target_class="Mug"), SearchConfig()).is_afresh
    ((name, box, probability),) = request.volumes
    assert (name, probability) == ("table", 0.4)
    assert box.sizes == pytest.approx(BOX.sizes)
    assert box.pose.yaw_rad == pytest.approx(0.3, abs=1e-5)


@pytest.mark.parametrize(
    ("what", "message"),
    [
        ({}, "names no target"),
        ({"target_class": "Mug", "source": "hearsay"}, "hearsay"),
        ({"target_class": "Mug", "settings": {"hasDetectorRecall": 2.0}}, "recall"),
        ({"target_class": "Mug", "settings": {"hasDetectorRange": 0.0}}, "detector_range"),
    ],
)
def test_requests_that_make_no_sense_are_refused(what: dict[str, object], message: str) -> None:
    activity, others = asked(**what)
    with pytest.raises(InvalidInput, match=message):
        read_request(activity, others, SearchConfig())


def test_a_volume_without_a_box_is_refused() -> None:
    activity, others = asked(target_class="Mug", volumes=[SearchVolume("table", BOX, 0.4)])
    del others["table"]
    with pytest.raises(InvalidInput, match="no bounding box"):
        read_request(activity, others, SearchConfig())


def test_volumes_stand_on_the_placing_areas() -> None:
    flat = BoundingBox(Pose.from_rpy(2.0, 1.0, 0.74, yaw=0.3), 0.8, 0.6, 0.0)
    parts = box_fluents("bBox1", "pose1", flat, NOW)
    area = Fluent(
        "placingArea1",
        "PlacingArea",
        properties=(Property("hasBoundingBox", "BBox", "bBox1"),),
    )
    ((name, box, over),) = volumes_over([area], {f.name: f for f in parts})
    assert name == "searchVolumePlacingArea1"
    assert over == "placingArea1"
    assert box.pose.z - 0.5 * box.z_size == pytest.approx(0.74, abs=1e-5)


def test_volumes_can_be_written_on_the_command_line() -> None:
    volume = volume_of_text("table:0.4:2,1,0.9:0.8,0.6,0.3:0.3")
    assert volume.probability == 0.4
    assert volume.box.corners() == pytest.approx(BOX.corners())
    for text in ("table", "table:x:1,2,3:1,1,1", "a:0.2:1,2:1,1,1", ":0.2:1,2,3:1,1,1"):
        with pytest.raises(InvalidInput, match="NAME:P"):
            volume_of_text(text)


def step(number: int, reached: bool = True) -> SearchStep:
    return SearchStep(
        View(1.0, 2.0, 0.0),
        reached,
        (),
        30.0,
        0.4,
        0.2,
        (),
        np.zeros(0),
        100,
        90,
        500,
        0.5,
        np.zeros((0, 2)),
        Moment(10.0 * number, 0.1, 0.1 * number),
        100.0 + 10.0 * number,
    )


def test_a_claim_ends_when_the_view_was_taken_and_progress_follows_progress() -> None:
    told = SearchFluents("search1", "pr2", PR2)
    claimed = told.claim(step(1), 101.0)
    (view,) = (s for s in claimed if isinstance(s, Fluent) and s.class_name == "View")
    assert view.values("hasRobot") == ("pr2",) or list(view.values("hasRobot")) == ["pr2"]
    assert view.finish.is_unknown
    first = told.done(step(1))
    assert view.name in [s.name for s in first if isinstance(s, Ending)]
    told.claim(step(2), 112.0)
    second = told.done(step(2, reached=False))
    (before,) = (s for s in first if isinstance(s, Fluent) and s.class_name == "SearchProgress")
    assert before.name in [s.name for s in second if isinstance(s, Ending)]
    last = told.result("found", 130.0, Fluent("mug1", "Mug"))
    assert isinstance(last[-1], Ending)
    assert last[-1].name == "search1"


def test_a_robot_that_leaves_releases_its_claim() -> None:
    told = SearchFluents("search1", "pr2", PR2)
    told.claim(step(1), 101.0)
    left = told.leave(105.0)
    assert [type(s) for s in left] == [Fluent, Ending, Ending]


def seen(name: str, cls: str, x: float, present: bool = True) -> Sighting:
    return Sighting(name, frozenset({cls, "PassiveObject"}), np.array([x, 0.0, 1.0]), present)


def test_memory_prefers_places_that_are_like_those_where_the_target_was() -> None:
    boxes = [BoundingBox(Pose(x, 0.0, 1.0), 1.0, 1.0, 1.0) for x in (0.0, 2.0, 4.0, 6.0)]
    sightings = [
        seen("mug1", "Mug", 0.0, present=False),
        seen("saucer1", "Saucer", 0.1),
        seen("saucer2", "Saucer", 2.0),
        seen("book1", "Book", 4.0),
    ]
    was_there, like_it, unlike, nothing = probabilities_from_memory("Mug", boxes, sightings)
    assert was_there > like_it > unlike
    assert nothing == pytest.approx(0.2)
    assert unlike == pytest.approx(0.1)


def test_a_robot_searches_in_a_map() -> None:
    room = OccupancyMap(0.1)
    room.set_cells(room.cells_in(BoundingBox(Pose(2.0, 2.0, 0.9), 4.0, 4.0, 1.8)), -1.0)
    wall = room.cells_in(BoundingBox(Pose(3.55, 2.0, 0.9), 0.1, 4.0, 1.8))
    room.set_cells(wall, 1.0)
    assert costmap_of(room, PR2).is_free(1.0, 2.0)
    robot = MapRobot(PR2, room, View(1.0, 2.0, 0.0))
    frame = robot.sense()
    middle = frame.depth_m[frame.camera.height // 2, frame.camera.width // 2]
    assert middle == pytest.approx(3.55 - (1.0 - 0.07), abs=0.06)
    assert robot.move_to(View(1.0, 3.0, 0.0)) > 5.0
    with pytest.raises(UnreachableView):
        robot.move_to(View(3.5, 2.0, 0.0))


def test_a_floor_plan_reaches_as_far_as_the_map_knows_what_a_robot_could_hit() -> None:
    room = OccupancyMap(0.1)
    room.set_cells(np.array([[-13, 4, 5], [21, -30, 12]]), -1.0)
    room.set_cells(np.array([[90, 4, -3], [-70, 4, 60]]), 1.0)  # in the floor, above the robot
    plan = costmap_of(room, PR2)
    assert plan.cost.shape == (4 + 30 + 1, 21 + 13 + 1)
    assert plan.origin == pytest.approx((-1.3, -3.0))
    with pytest.raises(InvalidInput, match="knows nothing"):
        costmap_of(room, PR2, floor_z_m=20.0)


@pytest.mark.parametrize("name", list(ROBOTS))
def test_every_robot_stands_in_a_map_as_it_can(name: str, tmp_path: Path) -> None:
    room = OccupancyMap(0.1)
    room.set_cells(room.cells_in(BoundingBox(Pose(2.0, 2.0, 0.9), 4.0, 4.0, 1.8)), -1.0)
    write_octomap(room, tmp_path / "room.bt")
    robot = open_world(str(tmp_path / "room.bt"), name).robot
    robot.model.check(robot.view)
    seconds = robot.predicted_time_s(robot.view, replace(robot.view, x=2.0, y=2.0))
    assert robot.model.acquisition_s <= seconds < 60.0
    assert robot.sense().sensor == name


@pytest.mark.parametrize("source", ["sim:kitchen", "sim:search?seed=x", "room.txt"])
def test_unknown_worlds_are_refused(source: str) -> None:
    with pytest.raises(InvalidInput, match="sim:search"):
        open_world(source)
    with pytest.raises(InvalidInput, match="no robot"):
        open_world("sim:search", "Marvin")


@pytest.mark.parametrize(
    ("source", "recall", "message"),
    [("rumour", 0.9, "give one of"), ("", 1.5, "recall")],
)
def test_what_no_robot_would_serve_is_not_asked(source: str, recall: float, message: str) -> None:
    nowhere = "http://127.0.0.1:9"  # nothing is sent
    with pytest.raises(InvalidInput, match=message):
        ask_for(nowhere, target_class="Mug", source=source, settings={"hasDetectorRecall": recall})
