"""Rooms: walls around a floor, a door, and shelves full of books."""

from __future__ import annotations

import numpy as np
import pytest

from fluentboard.model.geometry import Pose
from fluentboard_modules.simulation.belongings import book_catalogue
from fluentboard_modules.simulation.collision import all_collisions
from fluentboard_modules.simulation.furniture import shelf, table
from fluentboard_modules.simulation.rooms import empty_room, fill_shelf, with_floor
from fluentboard_modules.simulation.scene import Instance, Scene


def test_an_empty_room_has_a_floor_at_zero_and_walls_around_it():
    room = empty_room(4.0, 3.0)
    assert room["floor"].bounds_map[1, 2] == pytest.approx(0.0)
    assert room.bounds[:, :2] == pytest.approx(np.array([[-0.1, -0.1], [4.1, 3.1]]))
    assert all_collisions(room) == []


def test_an_empty_room_has_a_door():
    room = empty_room(4.0, 3.0)
    ends = room["wallSouth1"].bounds_map[1, 0], room["wallSouth2"].bounds_map[0, 0]
    assert ends[1] - ends[0] == pytest.approx(1.0)


def test_walls_face_the_room():
    room = empty_room(4.0, 3.0)
    for wall in room.of_class("Wall"):
        inwards = np.array([2.0, 1.5]) - wall.T_map_model.translation[:2]
        assert float(inwards @ wall.T_map_model.rotation[:2, 0]) > 0.0


def test_a_world_without_a_floor_gets_one():
    bare = Scene((Instance("table1", table(), Pose(5.0, 6.0, 0.0)),))
    floored = with_floor(bare, margin_m=0.5)
    (floor,) = floored.of_class("Floor")
    assert floor.label == 0
    assert floor.bounds_map[1, 2] == pytest.approx(0.0)
    assert (floor.bounds_map[0, :2] < bare.bounds[0, :2] - 0.4).all()


def test_books_fill_every_board_of_a_shelf_but_its_top(rng: np.random.Generator):
    bare = Scene(
        (Instance("shelf1", shelf(compartments=4), Pose.from_rpy(1.0, 1.0, 0.0, yaw=0.7)),)
    )
    filled = fill_shelf(bare, "shelf1", rng, book_catalogue(rng), filled=0.9)
    books = filled.standing_on("shelf1")
    assert {book.support for book in books} == {f"board{k}" for k in range(1, 5)}
    assert len({book.name for book in books}) == len(books) > 20
