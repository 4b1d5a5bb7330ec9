"""Recorded transforms: chains, interpolation, gaps, and which frame poses are given in."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fluentboard.errors import InvalidFrame
from fluentboard.model.geometry import Pose, Transform
from fluentboard_modules.frames.ros_transforms import TransformTree, interpolated


def at(x: float, y: float = 0.0, yaw: float = 0.0) -> Transform:
    return Pose.from_rpy(x, y, 0.0, yaw=yaw).to_transform()


@pytest.fixture
def tree() -> TransformTree:
    """A robot that drives 1 m along x in a second and turns by 90 degrees; its camera is ahead."""
    tree = TransformTree()
    tree.add("/odom", "base", 11.0, at(1.0, yaw=math.pi / 2), is_static=False)
    tree.add("odom", "base", 10.0, at(0.0), is_static=False)
    tree.add("base", "camera", 0.0, at(0.5), is_static=True)
    return tree


def test_pose_between_two_stamps_is_interpolated(tree: TransformTree) -> None:
    T_odom_camera = tree.lookup("odom", "camera", 10.5)
    half = math.sqrt(0.5)
    assert np.allclose(T_odom_camera.translation, [0.5 + 0.5 * half, 0.5 * half, 0.0])
    assert np.allclose(T_odom_camera.rotation[:, 0], [half, half, 0.0])


def test_chain_is_followed_in_both_directions(tree: TransformTree) -> None:
    T_camera_odom = tree.lookup("camera", "odom", 11.0)
    assert np.allclose(T_camera_odom.apply(np.array([1.0, 0.5, 0.0])), 0.0, atol=1e-12)
    tree.add("base", "lamp", 0.0, at(0.5, 0.25), is_static=True)
    assert np.allclose(tree.lookup("camera", "lamp", 10.3).translation, [0.0, 0.25, 0.0])


def test_stamp_a_little_after_the_last_one_is_served(tree: TransformTree) -> None:
    assert tree.lookup("odom", "base", 11.05) == at(1.0, yaw=math.pi / 2)


@pytest.mark.parametrize("stamp_s", [9.8, 11.2])
def test_stamp_outside_the_recording_is_an_error(tree: TransformTree, stamp_s: float) -> None:
    with pytest.raises(InvalidFrame, match=r"'odom' -> 'base' is recorded from 10.000 to 11.000 s"):
        tree.lookup("odom", "base", stamp_s)


def test_long_gap_is_not_bridged(tree: TransformTree) -> None:
    tree.add("odom", "base", 30.0, at(5.0), is_static=False)
    with pytest.raises(InvalidFrame, match=r"has a gap of 19.0 s around 20.000 s"):
        tree.lookup("odom", "base", 20.0)


def test_unconnected_frames_are_listed(tree: TransformTree) -> None:
    with pytest.raises(InvalidFrame, match="frames of the recording are base, camera, odom"):
        tree.lookup("odom", "arm", 10.0)


def test_map_is_preferred_to_odom_and_to_the_root(tree: TransformTree) -> None:
    assert tree.fixed_frame("camera") == "odom"
    tree.add("map", "odom", 0.0, at(7.0), is_static=True)
    tree.add("earth", "map", 0.0, at(1e6), is_static=True)
    assert tree.fixed_frame("camera") == "map"
    assert tree.fixed_frame("earth") == "earth"


def test_root_serves_where_no_frame_has_a_usual_name() -> None:
    tree = TransformTree()
    tree.add("vicon", "camera", 0.0, at(1.0), is_static=True)
    assert tree.fixed_frame("camera") == "vicon"
    assert not tree.moves("camera")


def test_circle_is_an_error(tree: TransformTree) -> None:
    tree.add("camera", "odom", 0.0, at(1.0), is_static=True)
    with pytest.raises(InvalidFrame, match="go in a circle: odom -> camera -> base -> odom"):
        tree.lookup("odom", "camera", 10.0)


def test_rotation_takes_the_short_way() -> None:
    before, after = at(0.0, yaw=math.radians(170)), at(0.0, yaw=math.radians(-170))
    assert np.allclose(interpolated(before, after, 0.5).rotation[0, 0], -1.0)
