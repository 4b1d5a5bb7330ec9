"""Scenes: names, labels, and things that carry others."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fluentboard.errors import InvalidInput, InvalidName
from fluentboard.model.geometry import Pose
from fluentboard_modules.simulation.furniture import floor, table
from fluentboard_modules.simulation.mesh import box
from fluentboard_modules.simulation.scene import Instance, Model, Scene
from fluentboard_modules.simulation.tableware import mug

TABLE = Instance("table1", table(), Pose(2.0, 3.0, 0.0))
MUG = Instance("mug1", mug(), Pose(2.1, 3.2, 0.74), on="table1", support="top")
SCENE = Scene((Instance("floor", floor(5.0, 5.0), Pose(2.5, 2.5, 0.0)), TABLE, MUG))


def test_things_get_labels_and_the_room_does_not():
    assert [i.label for i in SCENE.instances] == [0, 1, 2]


def test_a_label_is_never_given_twice():
    later = SCENE.without("mug1").with_instances([Instance("mug2", mug(), Pose(2.0, 3.0, 0.74))])
    assert later["mug2"].label == 3


def test_two_things_of_one_name_are_refused():
    with pytest.raises(InvalidName, match="mug1"):
        SCENE.with_instances([MUG])


def test_an_unknown_name_is_named_in_the_error():
    with pytest.raises(InvalidInput, match="mug7"):
        SCENE["mug7"]


def test_a_moved_table_takes_its_mug_along():
    T_table_mug = TABLE.T_map_model.inverse() @ MUG.T_map_model
    moved = SCENE.moved("table1", Pose.from_rpy(1.0, 1.0, 0.0, yaw=math.pi / 2))
    again = moved["table1"].T_map_model.inverse() @ moved["mug1"].T_map_model
    assert again.matrix == pytest.approx(T_table_mug.matrix)


def test_a_moved_mug_leaves_the_table_where_it_is():
    moved = SCENE.moved("mug1", Pose(0.5, 0.5, 0.0), on="")
    assert moved["table1"].pose == TABLE.pose
    assert moved["mug1"].on == ""


def test_a_removed_table_takes_its_mug_along():
    assert [i.name for i in SCENE.without("table1").instances] == ["floor"]


def test_things_that_stand_on_each_other_do_not_hang_the_program():
    block = Model("block", "Box", box(0.1, 0.1, 0.1))
    circle = Scene(
        (
            Instance("a", block, Pose(0.0, 0.0, 0.0), on="b"),
            Instance("b", block, Pose(0.0, 0.0, 0.1), on="a"),
        )
    )
    assert circle.moved("a", Pose(1.0, 0.0, 0.0))["b"].pose.x == pytest.approx(1.0)


def test_the_box_of_a_thing_is_placed_around_its_mesh():
    turned = Instance("mug", mug(), Pose.from_rpy(1.0, 2.0, 0.74, yaw=math.pi / 2))
    corners = turned.box.corners()
    assert np.allclose(corners.min(axis=0), turned.vertices_map.min(axis=0))
    assert np.allclose(corners.max(axis=0), turned.vertices_map.max(axis=0))
    assert turned.box.pose.z == pytest.approx(0.74 + 0.5 * 0.095)


def test_a_free_name_counts_on():
    assert SCENE.free_name("mug") == "mug2"


def test_an_empty_scene_has_no_bounds():
    with pytest.raises(InvalidInput, match="empty"):
        _ = Scene().bounds
