"""A simulated robot: its clock, its view, and what it refuses."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fluentboard.errors import UnreachableView
from fluentboard.model.geometry import Pose
from fluentboard_modules.simulation.furniture import floor
from fluentboard_modules.simulation.mesh import box
from fluentboard_modules.simulation.robots import PR2, Robot, View
from fluentboard_modules.simulation.scene import Instance, Model, Scene
from fluentboard_modules.simulation.simulated_robot import SimulatedRobot

BLOCK = Instance("block", Model("block", "Box", box(0.3, 0.3, 1.2)), Pose(3.0, 2.0, 0.0))
SCENE = Scene((Instance("floor", floor(5.0, 4.0), Pose(2.5, 2.0, 0.0)), BLOCK))
START = View(1.0, 2.0, 0.0, tilt_rad=0.2)


@pytest.fixture
def robot(rng: np.random.Generator) -> SimulatedRobot:
    return SimulatedRobot(PR2, SCENE, START, rng, image_width=80, start_s=100.0)


def test_it_is_a_robot(robot: SimulatedRobot):
    real: Robot = robot
    assert real.view == START
    assert real.time_s == 100.0


def test_its_clock_advances_by_the_time_of_the_motion(robot: SimulatedRobot):
    seconds = robot.move_to(View(1.5, 3.0, 1.0))
    assert seconds > PR2.drive_start_s
    assert robot.time_s == pytest.approx(100.0 + seconds)


def test_the_prediction_is_what_moving_and_looking_takes(robot: SimulatedRobot):
    goal = View(1.5, 3.0, 1.0, torso_m=0.1)
    predicted = robot.predicted_time_s(robot.view, goal)
    robot.move_to(goal)
    assert robot.sense().stamp_s - 100.0 == pytest.approx(predicted)


def test_it_can_wait(robot: SimulatedRobot):
    robot.idle_until(90.0)
    assert robot.time_s == 100.0
    robot.idle_until(130.0)
    assert robot.time_s == 130.0
    assert robot.view == START


def test_it_sees_what_is_in_front_of_it(robot: SimulatedRobot):
    frame = robot.sense()
    assert SCENE["block"].label in np.asarray(frame.labels)
    assert frame.sensor == "PR2"


def test_it_sees_a_changed_scene(robot: SimulatedRobot):
    robot.scene = SCENE.without("block")
    assert not np.any(robot.sense().labels)


def test_it_does_not_drive_into_things(robot: SimulatedRobot):
    with pytest.raises(UnreachableView, match="obstacle"):
        robot.move_to(View(3.0, 2.3, 0.0))
    assert robot.view == START
    assert math.isinf(robot.predicted_time_s(START, View(3.0, 2.3, 0.0)))


def test_it_does_not_stretch_beyond_its_limits(robot: SimulatedRobot):
    with pytest.raises(UnreachableView, match="torso"):
        robot.move_to(View(1.0, 2.0, 0.0, torso_m=1.0))


def test_it_cannot_start_inside_an_obstacle(rng: np.random.Generator):
    with pytest.raises(UnreachableView, match="start"):
        SimulatedRobot(PR2, SCENE, View(3.0, 2.0, 0.0), rng, image_width=80)
