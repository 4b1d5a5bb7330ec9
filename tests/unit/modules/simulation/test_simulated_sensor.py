"""The simulated camera: depth along the axis, labels that agree with it, colour registered."""

from __future__ import annotations

import numpy as np
import pytest

from fluentboard.errors import InvalidConfiguration, InvalidInput
from fluentboard.model.geometry import Pose
from fluentboard_modules.frames.sensor_frame import Camera, SensorFrame
from fluentboard_modules.simulation.mesh import box
from fluentboard_modules.simulation.noise import NoiseConfig, axial_sigma_m
from fluentboard_modules.simulation.scene import Instance, Model, Scene
from fluentboard_modules.simulation.sensor import BACKGROUND_COLOUR, RgbdSensor
from fluentboard_modules.simulation.table_scenes import table_scene
from fluentboard_modules.simulation.viewpoint import kinect_camera, look_at, optical_pose

CAMERA = kinect_camera(80)
WALL = Instance("wall", Model("wall", "Wall", box(0.1, 9.0, 9.0)), Pose(3.05, 0.0, -4.0))
BLOCK = Instance("block", Model("block", "Box", box(0.4, 0.4, 0.4), (200, 0, 0)), Pose(2.2, 0, 0.8))
SCENE = Scene((WALL, BLOCK))
AHEAD = optical_pose(0.0, 0.0, 1.0, 0.0, 0.0)


def look(scene: Scene = SCENE, noise: NoiseConfig | None = None, seed: int = 0) -> SensorFrame:
    sensor = RgbdSensor(CAMERA, noise, range_m=(0.4, 5.0))
    return sensor.look(scene, AHEAD, 7.5, np.random.default_rng(seed), index=3)


def test_a_flat_wall_has_one_depth_everywhere():
    depth = look(Scene((WALL,))).depth_m
    assert np.allclose(depth, 3.0, atol=1e-5)


def test_the_depth_of_the_block_is_that_of_its_front():
    assert look().depth_m[30, 40] == pytest.approx(2.0, abs=1e-5)


def test_labels_mark_the_block_and_not_the_wall():
    frame = look()
    assert frame.labels is not None
    assert ((frame.labels == SCENE["block"].label) == (frame.depth_m < 2.5)).all()
    assert set(np.unique(frame.labels)) == {0, SCENE["block"].label}


def test_points_lie_on_the_block_in_the_map():
    frame = look()
    points = frame.points_map()[(np.asarray(frame.labels) == SCENE["block"].label)]
    assert BLOCK.box.contains(points * (1.0 + 1e-6)).all()


def test_colour_shows_the_block_where_the_labels_do():
    frame = look()
    assert frame.colour is not None
    reddish = frame.colour[..., 0].astype(int) - frame.colour[..., 2] > 50
    assert (reddish == (np.asarray(frame.labels) == SCENE["block"].label)).all()


def test_nothing_in_range_is_depth_zero_and_label_zero():
    sensor = RgbdSensor(CAMERA, range_m=(0.4, 1.5))
    frame = sensor.look(SCENE, AHEAD, 1.0, np.random.default_rng(0))
    assert not frame.valid.any()
    assert not np.any(frame.labels)


def test_the_sky_has_its_own_colour_and_no_depth():
    frame = look(Scene((BLOCK,)))
    assert frame.colour is not None
    assert frame.depth_m[0, 0] == 0.0
    assert tuple(frame.colour[0, 0]) == BACKGROUND_COLOUR


def test_a_frame_carries_its_stamp_pose_and_number():
    frame = look()
    assert (frame.stamp_s, frame.index, frame.sensor) == (7.5, 3, "camera")
    assert frame.T_map_sensor == AHEAD


def test_a_changed_scene_is_seen_changed_by_the_same_sensor():
    sensor = RgbdSensor(CAMERA)
    first = sensor.look(SCENE, AHEAD, 1.0, np.random.default_rng(0))
    second = sensor.look(SCENE.without("block"), AHEAD, 2.0, np.random.default_rng(0))
    assert first.depth_m[30, 40] == pytest.approx(2.0, abs=1e-5)
    assert second.depth_m[30, 40] == pytest.approx(3.0, abs=1e-5)


def test_noisy_labels_are_zero_where_the_depth_is():
    frame = look(noise=NoiseConfig(dropout=0.2))
    assert (~frame.valid).any()
    assert not np.any(np.asarray(frame.labels)[~frame.valid])


@pytest.mark.parametrize("noise", [NoiseConfig.none(), NoiseConfig()])
def test_labelled_points_lie_on_their_things_in_a_laid_room(noise: NoiseConfig):
    scene = table_scene(3).scene
    table = scene["table1"].bounds_map.mean(axis=0)
    eye = (float(table[0]) - 1.3, float(table[1]), 1.5)
    frame = RgbdSensor(kinect_camera(160), noise).look(
        scene, look_at(eye, table), 1.0, np.random.default_rng(1)
    )
    labels, points = np.asarray(frame.labels), frame.points_map()
    assert not labels[frame.depth_m == 0.0].any()
    for thing in scene.objects:
        own = points[labels == thing.label]
        off = np.maximum(thing.bounds_map[0] - own, own - thing.bounds_map[1]).max(axis=1)
        # Nguyen's axial deviation is 4 mm at 1.6 m, the lateral one a pixel, here of 12 mm.
        assert (off < (1e-4 if noise.is_exact else 0.06)).all(), thing.name
    assert len(np.unique(labels)) > 6


@pytest.mark.parametrize("tilt_deg", [0.0, 40.0, 60.0])
def test_a_wall_is_as_noisy_as_nguyen_measured(tilt_deg: float):
    only_axial = NoiseConfig.none().model_copy(update={"axial": 1.0})
    tilt = np.deg2rad(tilt_deg)
    wall = Instance("wall", WALL.model, Pose.from_rpy(2.0, 0.0, 0.0, yaw=tilt))
    camera = Camera(120, 90, 3000.0, 3000.0, 59.5, 44.5)  # narrow: one depth, one incidence
    sensor, clean = RgbdSensor(camera, only_axial), RgbdSensor(camera)
    rng = np.random.default_rng(0)
    eye = optical_pose(0.0, 0.0, 2.0, 0.0, 0.0)
    noisy, true = (s.look(Scene((wall,)), eye, 1.0, rng).depth_m for s in (sensor, clean))
    expected = axial_sigma_m(true.astype(np.float64), np.full(true.shape, tilt))
    assert float(((noisy - true) / expected).std()) == pytest.approx(1.0, abs=0.03)


def test_an_empty_scene_cannot_be_seen():
    with pytest.raises(InvalidInput, match="empty"):
        look(Scene())


def test_an_empty_range_is_refused():
    with pytest.raises(InvalidConfiguration, match="range"):
        RgbdSensor(CAMERA, range_m=(2.0, 1.0))
