"""Seats and settings: who sits where, and what lies left and right."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fluentboard.errors import InvalidInput
from fluentboard.model.geometry import Pose
from fluentboard_modules.simulation.furniture import table
from fluentboard_modules.simulation.scene import Instance
from fluentboard_modules.simulation.table_service import TableService
from fluentboard_modules.simulation.table_setting import Seat, capacity, seats

SMALL = Instance("table1", table(width=0.8), Pose(0.0, 0.0, 0.0))
LARGE = Instance("table2", table(width=1.6), Pose(0.0, 0.0, 0.0))


def test_two_guests_face_each_other_in_the_middle_of_the_sides():
    first, second = seats(LARGE, 2)
    assert (first.y, second.y) == (0.0, 0.0)
    assert first.x == -second.x
    assert math.isclose(abs(first.yaw_rad - second.yaw_rad), math.pi)


@pytest.mark.parametrize("count", range(7))
def test_a_table_seats_as_many_as_asked(count: int):
    assert len(seats(LARGE, count)) == count


def test_a_long_table_has_room_at_its_heads():
    assert capacity(LARGE) == 6
    assert capacity(SMALL) == 2


def test_too_many_guests_are_refused():
    with pytest.raises(InvalidInput, match="seats 2 guests, asked for 3"):
        seats(SMALL, 3)


def test_guests_have_room_for_their_elbows():
    at = np.array([(s.x, s.y) for s in seats(LARGE, 4)])
    apart = np.linalg.norm(at[:, None] - at[None], axis=2)[np.triu_indices(4, 1)]
    assert apart.min() >= 0.6


def test_right_is_to_the_right_of_a_guest_who_looks_along_x():
    x, y, yaw = Seat(-0.4, 0.0, 0.0).place(right=0.2, forward=0.1)
    assert (x, y, yaw) == pytest.approx((-0.3, -0.2, 0.0))


def test_an_unknown_shared_item_is_refused():
    with pytest.raises(InvalidInput, match="Piano"):
        TableService().model("Piano")
