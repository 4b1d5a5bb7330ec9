"""Poses and boxes survive the way to the board and back."""

from __future__ import annotations

import numpy as np
import pytest

from fluentboard.errors import InvalidGeometry
from fluentboard.model.geometry import BoundingBox, Pose
from fluentboard.model.interval import Interval
from fluentboard_modules.geometry_fluents import box_fluents, box_of, pose_fluent, pose_of

SINCE = Interval(None, 4.0)


def test_pose_survives_the_round_trip() -> None:
    pose = Pose.from_rpy(1.25, -2.5, 0.75, 0.1, -0.2, 3.0)
    back = pose_of(pose_fluent("pose1", pose, SINCE))
    assert np.allclose(back.to_transform().matrix, pose.to_transform().matrix, atol=1e-4)


def test_angles_of_zero_are_left_out() -> None:
    fluent = pose_fluent("pose1", Pose(1.0, 0.0, 0.0), SINCE)
    assert [p.name for p in fluent.properties] == ["hasX", "hasY", "hasZ"]


def test_box_survives_the_round_trip() -> None:
    box = BoundingBox(Pose.from_rpy(1.0, 2.0, 0.37, yaw=0.5), 1.2, 0.8, 0.74)
    fluent, pose = box_fluents("box1", "pose1", box, SINCE)
    back = box_of(fluent, {"pose1": pose})
    assert np.allclose(back.corners(), box.corners(), atol=1e-4)


def test_box_without_its_pose_is_refused() -> None:
    fluent, _ = box_fluents("box1", "pose1", BoundingBox(Pose(0.0, 0.0, 0.0), 1.0, 1.0, 1.0), SINCE)
    with pytest.raises(InvalidGeometry, match="box 'box1' has no pose"):
        box_of(fluent, {})
