"""Robots: published constants, joint limits, cameras, motion times."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fluentboard.errors import UnreachableView
from fluentboard_modules.simulation.robots import CALVIN, PR2, ROBOTS, TURTLEBOT, View
from fluentboard_modules.simulation.viewpoint import heading, look_at

HERE = View(0.0, 0.0, 0.0)


def test_driving_takes_the_published_time():
    # The original PR2: 0.00154359 s per unit of path cost and 5.940 s; 2000 is two metres.
    seconds = PR2.motion_time_s(HERE, View(2.0, 0.0, 1.0), 2000.0)
    assert seconds == pytest.approx(0.00154359 * 2000.0 + 5.940)


def test_base_and_torso_times_add_up():
    both = PR2.motion_time_s(HERE, View(2.0, 0.0, 0.0, torso_m=0.2), 2000.0)
    drive = PR2.motion_time_s(HERE, View(2.0, 0.0, 0.0), 2000.0)
    assert both - drive == pytest.approx(0.2 / 0.01)


def test_the_head_moves_while_the_base_drives():
    turned = View(2.0, 0.0, 0.0, pan_rad=2.0)
    assert PR2.motion_time_s(HERE, turned, 2000.0) == PR2.motion_time_s(
        HERE, View(2.0, 0.0, 0.0), 2000.0
    )


def test_the_head_counts_when_nothing_else_moves():
    assert PR2.motion_time_s(HERE, View(0.0, 0.0, 0.0, pan_rad=1.57), 0.0) == pytest.approx(0.5)


def test_staying_takes_no_time():
    assert PR2.motion_time_s(HERE, HERE, 0.0) == 0.0


def test_a_transition_includes_the_look():
    assert PR2.transition_time_s(HERE, HERE, 0.0) == 5.0


@pytest.mark.parametrize(
    "view",
    [
        View(0.0, 0.0, 0.0, torso_m=0.4),
        View(0.0, 0.0, 0.0, pan_rad=3.1),
        View(0.0, 0.0, 0.0, tilt_rad=-0.6),
    ],
)
def test_a_joint_beyond_its_limit_is_an_error(view: View):
    with pytest.raises(UnreachableView, match="PR2 cannot take"):
        PR2.check(view)


def test_calvin_cannot_tilt_its_camera():
    with pytest.raises(UnreachableView, match="tilt"):
        CALVIN.check(View(0.0, 0.0, 0.0, tilt_rad=0.0))


@pytest.mark.parametrize("name", ROBOTS)
def test_a_camera_has_its_published_field_of_view(name: str):
    model = ROBOTS[name]
    camera = model.camera()
    across = 2.0 * math.atan(0.5 * camera.width / camera.fx)
    upright = 2.0 * math.atan(0.5 * camera.height / camera.fy)
    assert across == pytest.approx(model.horizontal_fov_rad, abs=1e-6)
    assert upright == pytest.approx(model.vertical_fov_rad, abs=2e-3)


def test_the_camera_of_the_pr2_sits_behind_its_base_and_rises_with_the_torso():
    eye = PR2.T_map_sensor(View(1.0, 2.0, math.pi / 2, torso_m=0.3)).translation
    assert eye == pytest.approx([1.0, 2.0 - 0.07, 1.784])


def test_a_positive_tilt_looks_down_and_a_positive_pan_to_the_left():
    T_map_sensor = PR2.T_map_sensor(View(0.0, 0.0, 0.0, pan_rad=0.5, tilt_rad=0.4))
    forward = T_map_sensor.rotation[:, 2]
    assert forward[1] > 0.0
    assert forward[2] < 0.0
    assert heading(T_map_sensor) == pytest.approx((0.5, 0.4))


def test_a_turtlebot_is_low():
    assert TURTLEBOT.T_map_sensor(HERE).translation[2] < 0.4


def test_looking_at_a_point_puts_it_on_the_optical_axis():
    T_map_sensor = look_at((1.0, 2.0, 1.5), (3.0, 1.0, 0.7))
    x, y, z = T_map_sensor.inverse().apply(np.array([3.0, 1.0, 0.7]))
    assert (x, y) == pytest.approx((0.0, 0.0))
    assert z == pytest.approx(math.sqrt(4.0 + 1.0 + 0.64))
