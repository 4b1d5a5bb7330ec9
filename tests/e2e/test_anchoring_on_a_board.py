"""Anchoring against a real board: names outlive a restart, grippers are believed, ends are ends."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pytest

from fluentboard.model.detection import ImageBox, ObjectDetection, detection_fluents
from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.geometry import BoundingBox, Pose
from fluentboard.model.interval import UNKNOWN, Interval
from fluentboard_client import Client
from fluentboard_modules.anchoring.config import (
    AnchoringConfig,
    DetectionsConfig,
    RecognitionConfig,
)
from fluentboard_modules.anchoring.worker import AnchoringModule
from fluentboard_modules.demo.service_process import ServiceProcess
from fluentboard_modules.frames.sensor_frame import SensorFrame
from fluentboard_modules.search.region import SearchVolume
from fluentboard_modules.search.request import request_fluents
from fluentboard_modules.simulation import furniture, tableware
from fluentboard_modules.simulation.noise import NoiseConfig
from fluentboard_modules.simulation.placement import placed_on, support_of
from fluentboard_modules.simulation.rooms import empty_room
from fluentboard_modules.simulation.scene import Instance, Scene
from fluentboard_modules.simulation.sensor import RgbdSensor
from fluentboard_modules.simulation.viewpoint import kinect_camera, look_at

EYE, TARGET = (2.0, 0.8, 1.5), (2.0, 2.0, 0.72)


@pytest.fixture(scope="module")
def scene() -> Scene:
    table = Instance("table1", furniture.table(1.2, 0.8, 0.74), Pose(2.0, 2.0, 0.0))
    room = empty_room(4.0, 4.0).with_instances([table])
    mug = placed_on(table, support_of(table), tableware.mug(), "cup", (0.15, 0.0, 0.3))
    return room.with_instances([mug])


@pytest.fixture
def board(tmp_path: Path) -> Iterator[Client]:
    with ServiceProcess(tmp_path / "board") as service, Client(service.address) as client:
        yield client


def looks(scene: Scene, first_s: float, count: int = 4) -> list[SensorFrame]:
    sensor = RgbdSensor(kinect_camera(320), NoiseConfig(), (0.4, 5.0), "camera")
    T_map_sensor = look_at(np.array(EYE), np.array(TARGET))
    return [
        sensor.look(scene, T_map_sensor, first_s + 0.5 * k, np.random.default_rng(k), k)
        for k in range(count)
    ]


def work(board: Client, module: AnchoringModule, frames: Sequence[SensorFrame]) -> None:
    for frame in frames:
        board.batch(module.process(frame))


def begun(board: Client) -> AnchoringModule:
    module = AnchoringModule()
    board.batch(module.begin(board))
    return module


def objects(board: Client) -> dict[str, Fluent]:
    found = (*board.fluents("Kitchenware"), *board.fluents("PersonalItem"))
    return {fluent.name: fluent for fluent in found}


def test_an_object_lives_on_the_board(board: Client, scene: Scene) -> None:
    module = begun(board)
    work(board, module, looks(scene, 10.0))
    (thing,) = objects(board).values()
    assert thing.start == Interval(None, 10.0)
    assert thing.is_open
    pose = board.fluent(str(thing.values("hasPose")[-1]))
    assert float(pose.values("hasX")[-1]) == pytest.approx(2.15, abs=0.03)
    (evidence,) = board.fluents("AssociationEvidence")
    assert evidence.values("isEvidenceFor") == (thing.name,)
    assert evidence.values("hasFunctionality") == ("Discover",)

    # A restart: the same name.
    module = begun(board)
    work(board, module, looks(scene, 20.0))
    assert list(objects(board)) == [thing.name]

    # A gripper holds it: its place is empty, and it stays.
    held = Property("hasPassiveObject", thing.class_name, thing.name)
    holding = Fluent("holding1", "Holding", Interval.at(25.0), UNKNOWN, (held,))
    board.assert_fluents([holding])
    module = begun(board)
    work(board, module, looks(scene.without("cup"), 30.0, 6))
    assert objects(board)[thing.name].is_open

    # It was put back, and then somebody took it away unseen.
    board.end("holding1", 35.0)
    module = begun(board)
    work(board, module, looks(scene, 40.0))
    assert list(objects(board)) == [thing.name]
    work(board, module, looks(scene.without("cup"), 50.0, 6))
    ended = objects(board)[thing.name]
    assert not ended.is_open
    assert ended.finish.earliest == pytest.approx(41.5)
    absent = [
        e for e in board.fluents("PresenceEvidence") if e.values("hasPresence") == ("absent",)
    ]
    assert absent


def test_an_external_detector_says_what_an_object_is(board: Client, scene: Scene) -> None:
    recognition = RecognitionConfig(
        recogniser="detections",
        detections=DetectionsConfig(names={"sugar bowl": "SugarPot"}, wait_s=0.0),
    )
    module = AnchoringModule(AnchoringConfig(recognition=recognition))
    board.batch(module.begin(board))
    label = next(thing.label for thing in scene.instances if thing.name == "cup")
    for frame in looks(scene, 10.0):
        assert frame.labels is not None
        rows, columns = np.nonzero(frame.labels == label)
        box = ImageBox(columns.min(), rows.min(), columns.max(), rows.max(), "depth")
        seen = ObjectDetection({"sugar bowl": 0.95, "Mug": 0.03}, box)
        board.assert_fluents(detection_fluents([seen], frame.stamp_s, frame.sensor))
        board.batch(module.process(frame))
    (thing,) = objects(board).values()
    assert thing.class_name == "SugarPot"
    (evidence,) = board.fluents("ClassEvidence", is_open=True)
    assert evidence.values("hasConfidence")[-1] == pytest.approx(0.95)


def test_context_answers_where_to_search(board: Client, scene: Scene) -> None:
    recognition = RecognitionConfig(recogniser="spin-images", context="tableware")
    over_table = BoundingBox(Pose(2.0, 2.0, 0.84), 0.8, 0.6, 0.2)
    on_floor = BoundingBox(Pose(0.5, 0.5, 0.1), 0.8, 0.6, 0.2)
    volumes = [SearchVolume("over_table", over_table, 0.2), SearchVolume("floor", on_floor, 0.2)]
    board.assert_fluents(
        request_fluents(
            "search1",
            target_class="SugarPot",
            volumes=volumes,
            source="context",
            start=Interval.at(1.0),
        )
    )
    module = AnchoringModule(AnchoringConfig(recognition=recognition))
    board.batch(module.begin(board))
    work(board, module, looks(scene, 10.0))
    beliefs = list(board.fluents("VolumeBelief", is_open=True))
    assert {str(b.values("isBeliefAbout")[-1]) for b in beliefs} == {"over_table", "floor"}
    assert all(0.0 < float(b.values("hasProbability")[-1]) < 1.0 for b in beliefs)
    # The search is over: so are the beliefs about it.
    board.end("search1", 20.0)
    module = AnchoringModule(AnchoringConfig(recognition=recognition))
    board.batch(module.begin(board))
    work(board, module, looks(scene, 30.0, 1))
    assert not list(board.fluents("VolumeBelief", is_open=True))
