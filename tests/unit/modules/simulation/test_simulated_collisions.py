"""Collisions: exact for boxes, and blind to mere contact."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fluentboard.model.geometry import Pose
from fluentboard_modules.simulation.collision import all_collisions, is_free, penetration_m
from fluentboard_modules.simulation.furniture import chair, table
from fluentboard_modules.simulation.mesh import box
from fluentboard_modules.simulation.scene import Instance, Model, Scene
from fluentboard_modules.simulation.solids import convex_outline

BLOCK = Model("block", "Box", box(1.0, 1.0, 1.0))


def block(name: str, x: float, y: float = 0.0, z: float = 0.0, yaw: float = 0.0) -> Instance:
    return Instance(name, BLOCK, Pose.from_rpy(x, y, z, yaw=yaw))


def test_the_depth_of_two_blocks_is_their_overlap():
    assert penetration_m(block("a", 0.0), block("b", 0.7)) == pytest.approx(0.3)


def test_blocks_apart_have_a_negative_depth():
    assert penetration_m(block("a", 0.0), block("b", 1.4)) == pytest.approx(-0.4)


def test_a_block_on_another_touches_and_does_not_collide():
    assert is_free(block("b", 0.2, z=1.0), Scene((block("a", 0.0),)))


def test_a_turned_block_fits_where_its_box_would_not():
    # Corner to corner, the axis-aligned boxes overlap by 0.2 m and the blocks do not.
    a, b = block("a", 0.0, yaw=math.pi / 4), block("b", 1.05, 1.05, yaw=math.pi / 4)
    assert is_free(b, Scene((a,)))


def test_a_chair_fits_under_a_table():
    under = Instance("chair1", chair(), Pose(-0.5, 0.0, 0.0))
    assert is_free(under, Scene((Instance("table1", table(), Pose(0.0, 0.0, 0.0)),)))


def test_a_chair_pushed_in_to_its_back_collides():
    inside = Instance("chair1", chair(), Pose(-0.1, 0.0, 0.0))
    scene = Scene((Instance("table1", table(), Pose(0.0, 0.0, 0.0)), inside))
    assert [(a, b) for a, b, _ in all_collisions(scene)] == [("chair1", "table1")]


def test_a_building_collides_with_nothing():
    hollow = Instance("walls", Model("walls", "Building", box(9.0, 9.0, 3.0)), Pose(0.0, 0.0, 0.0))
    assert is_free(block("a", 0.0), Scene((hollow,)))


def test_the_outline_of_points_is_convex_and_counter_clockwise():
    points = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0], [1.0, 1.0], [1.0, 0.0]])
    outline = convex_outline(points)
    x, y = outline.T
    area = 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))
    assert len(outline) == 4
    assert area == pytest.approx(4.0)
