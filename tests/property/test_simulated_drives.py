"""Simulated drives and recordings: repeatable, on free floor, past everything, true on disk."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from fluentboard.errors import InvalidInput
from fluentboard_modules.frames.folders import open_folder
from fluentboard_modules.frames.simulated_sources import drive_of
from fluentboard_modules.simulation.drive import (
    SimulatedDrive,
    restaurant_demo_drive,
    room_drive,
    table_drive,
)
from fluentboard_modules.simulation.navigation import costmap
from fluentboard_modules.simulation.noise import NoiseConfig
from fluentboard_modules.simulation.picture import perspective
from fluentboard_modules.simulation.recording import record
from fluentboard_modules.simulation.restaurant import restaurant
from fluentboard_modules.simulation.robots import PR2
from fluentboard_modules.simulation.rooms import furnished_room
from fluentboard_modules.simulation.trajectories import Stop, fewer_stops, tour
from fluentboard_modules.simulation.viewpoint import kinect_camera

SMALL = kinect_camera(80)
SCENE = restaurant(np.random.default_rng(0))


@pytest.fixture(scope="module")
def drive() -> SimulatedDrive:
    return room_drive(SCENE, seed=5, frames=40, camera=SMALL)


def test_a_frame_is_the_same_alone_and_in_the_row(drive: SimulatedDrive):
    in_a_row = list(drive)[7]
    alone = drive.read(7)
    assert alone.depth_m.tobytes() == in_a_row.depth_m.tobytes()
    assert np.array_equal(np.asarray(alone.labels), np.asarray(in_a_row.labels))
    assert alone.stamp_s == in_a_row.stamp_s


def test_frames_are_numbered_and_stamped_in_order(drive: SimulatedDrive):
    frames = list(drive)
    assert len(frames) == len(drive) == 40
    assert [f.index for f in frames] == list(range(40))
    assert np.allclose(np.diff([f.stamp_s for f in frames]), 0.5)


def test_labels_agree_with_the_depth_of_the_scene(drive: SimulatedDrive):
    frame = SimulatedDrive(
        "exact", SCENE, drive.poses, camera=SMALL, noise=NoiseConfig.none()
    ).read(3)
    points, labels = frame.points_map(), np.asarray(frame.labels)
    assert not labels[~frame.valid].any()
    for label in np.unique(labels[labels > 0]):
        (thing,) = (i for i in SCENE.objects if i.label == label)
        low, high = thing.bounds_map
        inside = points[labels == label]
        assert (inside >= low - 1e-4).all()
        assert (inside <= high + 1e-4).all()


def test_a_drive_through_a_room_stays_on_free_floor(drive: SimulatedDrive):
    room = costmap(SCENE, PR2.radius_m)
    assert all(room.is_free(*pose.translation[:2]) for pose in drive.poses)


def test_a_drive_moves_smoothly(drive: SimulatedDrive):
    places = np.array([pose.translation for pose in drive.poses])
    assert np.linalg.norm(np.diff(places, axis=0), axis=1).max() < 1.5
    assert np.allclose(places[:, 2], PR2.camera_height_m)


@pytest.mark.parametrize("seed", range(2))
def test_the_demo_shows_every_piece_of_furniture_well(seed: int):
    demo = restaurant_demo_drive(seed)
    assert 60 <= len(demo) <= 90
    shown: dict[int, int] = {}
    small = SimulatedDrive("demo", demo.scene, demo.poses, camera=SMALL, noise=NoiseConfig.none())
    for frame in small:
        for label, count in zip(
            *np.unique(np.asarray(frame.labels), return_counts=True), strict=True
        ):
            shown[int(label)] = max(shown.get(int(label), 0), int(count))
    for thing in demo.scene.of_class("Table", "Chair", "Shelf", "Counter"):
        # 80x60 has 4800 pixels; 150 of them are 9,600 at full size.
        assert shown.get(thing.label, 0) > 150, thing.name


def test_a_drive_through_any_furnished_room_can_be_planned():
    scene = furnished_room(np.random.default_rng(3))
    assert len(room_drive(scene, seed=0, frames=60, camera=SMALL)) == 60


def test_a_drive_around_a_table_looks_at_its_top():
    around = table_drive(SCENE, "table1", seed=0, frames=8, camera=SMALL, noise=NoiseConfig.none())
    top = SCENE["table1"].T_map_model.apply(np.array([0.0, 0.0, 0.74]))
    for pose in around.poses:
        pixel = SMALL.project(pose.inverse().apply(top)[None])[0]
        assert pixel == pytest.approx((SMALL.cx, SMALL.cy), abs=1e-6)
    places = np.array([pose.translation for pose in around.poses])
    assert len(np.unique(np.round(places, 6), axis=0)) == 8


def test_a_drive_that_starts_at_the_reserved_time_is_refused(drive: SimulatedDrive):
    with pytest.raises(InvalidInput, match="reserved"):
        SimulatedDrive("x", SCENE, drive.poses, start_s=0.0)


def test_a_tour_needs_a_frame_per_stop():
    stops = [Stop(1.0, 1.0, 0.0, 0.2), Stop(1.5, 1.0, 0.0, 0.2)]
    with pytest.raises(InvalidInput, match="frames"):
        tour(stops, costmap(SCENE, 0.3), 1.4, 1)


def test_a_short_drive_looks_at_as_much_as_it_can():
    stops = [Stop(float(k), 0.0, 0.0, 0.2, name) for k, name in enumerate("aaabbc")]
    assert [s.target for s in fewer_stops(stops, 4)] == ["a", "a", "b", "c"]
    assert [s.target for s in fewer_stops(stops, 2)] == ["a", "b"]
    assert list(fewer_stops(stops, 9)) == stops
    assert len(room_drive(SCENE, seed=0, frames=3, camera=SMALL)) == 3


@pytest.fixture(scope="module")
def recorded(drive: SimulatedDrive, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("drive") / "recording"
    short = SimulatedDrive("short", SCENE, drive.poses[:4], seed=5, camera=SMALL)
    calls: list[tuple[int, int]] = []
    written = record(short, folder, SCENE, lambda done, of: calls.append((done, of)), colour="png")
    assert written == 4
    assert calls == [(1, 4), (2, 4), (3, 4), (4, 4)]
    return folder


def test_a_recording_is_read_back_to_the_millimetre(drive: SimulatedDrive, recorded: Path):
    for frame, again in zip(list(drive)[:4], open_folder(recorded), strict=True):
        assert np.abs(again.depth_m - frame.depth_m).max() <= 0.0005 + 1e-6
        assert again.T_map_sensor.matrix == pytest.approx(frame.T_map_sensor.matrix, abs=1e-8)
        assert again.camera.fx == pytest.approx(SMALL.fx)
        assert np.array_equal(np.asarray(again.colour), np.asarray(frame.colour))


def test_a_recording_carries_the_truth(recorded: Path):
    truth = json.loads((recorded / "truth.json").read_text(encoding="utf-8"))
    told = {entry["name"]: entry for entry in truth["instances"]}
    assert set(told) == {i.name for i in SCENE.instances}
    assert told["table1"]["cls"] == "Table"
    assert told["table1"]["label"] == SCENE["table1"].label


def test_a_recording_is_not_overwritten(drive: SimulatedDrive, recorded: Path):
    with pytest.raises(InvalidInput, match="already"):
        record(drive, recorded)


def test_pictures_have_the_size_asked_for_and_show_something():
    image = perspective(SCENE, width=64, height=40)
    assert image.shape == (40, 64, 3)
    assert len(np.unique(image.reshape(-1, 3), axis=0)) > 20


def test_the_race_world_is_driven_through_from_its_file(shared_data: Path):
    file = shared_data / "race_world" / "scene.json"
    drive = drive_of(f"sim:{file}", {"frames": "20", "width": "48"})
    seen: set[int] = set()
    for frame in drive:
        seen |= {int(label) for label in np.unique(np.asarray(frame.labels))}
    furniture = drive.scene.of_class("Table", "Counter", "Shelf", "Chair")
    assert len(furniture) >= 14
    assert {thing.label for thing in furniture} <= seen
    assert len(drive.scene.search_volumes) == 6
