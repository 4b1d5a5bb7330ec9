"""Costmaps and ways over the floor."""

from __future__ import annotations

import numpy as np
import pytest

from fluentboard.errors import UnreachableView
from fluentboard.model.geometry import Pose
from fluentboard_modules.simulation.furniture import floor, wall
from fluentboard_modules.simulation.mesh import box
from fluentboard_modules.simulation.navigation import (
    INSCRIBED,
    LETHAL,
    Costmap,
    costmap,
)
from fluentboard_modules.simulation.scene import Instance, Model, Scene

FREE = Costmap(np.zeros((40, 60), dtype=np.uint8), 0.05, (1.0, 2.0))


def blocked(columns: slice, rows: slice) -> Costmap:
    cost = np.zeros((40, 60), dtype=np.uint8)
    cost[rows, columns] = LETHAL
    return Costmap(cost, 0.05, (1.0, 2.0))


def test_a_position_lies_in_its_cell():
    assert FREE.cell(*FREE.position(7, 31)) == (7, 31)


def test_a_metre_of_free_floor_costs_a_thousand():
    # navfn: 50 per cell of 5 cm.
    assert FREE.path((1.525, 3.0), (2.525, 3.0)).cost == pytest.approx(1000.0)


def test_a_way_leads_from_start_to_goal():
    way = FREE.path((1.1, 2.1), (3.5, 3.6))
    assert np.linalg.norm(way.points[0] - (1.1, 2.1)) < 0.05
    assert np.linalg.norm(way.points[-1] - (3.5, 3.6)) < 0.05


def test_a_way_goes_around_an_obstacle():
    room = blocked(slice(28, 32), slice(0, 35))
    way = room.path((1.5, 2.5), (3.5, 2.5))
    assert way.length_m > 3.4
    assert all(room.is_free(x, y) for x, y in way.points)


def test_no_way_through_a_wall_is_an_error():
    with pytest.raises(UnreachableView, match="no way"):
        blocked(slice(28, 32), slice(None)).path((1.5, 2.5), (3.5, 2.5))


@pytest.mark.parametrize(("x", "complaint"), [(2.5, "obstacle"), (99.0, "outside")])
def test_a_goal_where_nobody_can_stand_is_an_error(x: float, complaint: str):
    with pytest.raises(UnreachableView, match=complaint):
        blocked(slice(28, 32), slice(0, 35)).path((1.5, 2.5), (x, 2.5))


def test_ways_cost_the_same_in_both_directions():
    room = blocked(slice(28, 32), slice(0, 35))
    there, back = room.path((1.5, 2.5), (3.5, 2.5)), room.path((3.5, 2.5), (1.5, 2.5))
    assert there.cost == pytest.approx(back.cost)


def test_an_obstacle_is_inflated_by_the_radius_of_the_robot():
    block = Model("block", "Box", box(0.4, 0.4, 1.0))
    room = costmap(
        Scene(
            (
                Instance("floor", floor(4.0, 4.0), Pose(2.0, 2.0, 0.0)),
                Instance("block", block, Pose(2.0, 2.0, 0.0)),
            )
        ),
        robot_radius_m=0.3,
    )
    assert not room.is_free(2.0 + 0.2 + 0.25, 2.0)
    assert room.is_free(2.0 + 0.2 + 0.36, 2.0)
    assert room.cost[room.cell(2.0 + 0.2 + 0.36, 2.0) or (0, 0)] > 0
    assert room.cost[room.cell(3.2, 0.8) or (0, 0)] == 0
    assert room.cost.max() == LETHAL
    assert (room.cost == INSCRIBED).any()


def test_what_hangs_above_the_robot_is_no_obstacle():
    lamp = Model("lamp", "Lamp", box(0.4, 0.4, 0.3))
    room = costmap(
        Scene(
            (
                Instance("floor", floor(3.0, 3.0), Pose(1.5, 1.5, 0.0)),
                Instance("lamp", lamp, Pose(1.5, 1.5, 1.9)),
            )
        ),
        robot_radius_m=0.3,
        robot_height_m=1.6,
    )
    assert room.is_free(1.5, 1.5)


def test_a_wall_is_solid_over_its_whole_length():
    room = costmap(
        Scene(
            (
                Instance("floor", floor(3.0, 3.0), Pose(1.5, 1.5, 0.0)),
                Instance("wall", wall(2.0), Pose(1.5, 1.5, 0.0)),
            )
        ),
        robot_radius_m=0.0,
    )
    cells = [room.cell(1.5, y) or (0, 0) for y in np.arange(0.55, 2.45, 0.05)]
    assert all(
        room.cost[cell] == LETHAL or room.cost[cell[0], cell[1] - 1] == LETHAL for cell in cells
    )
