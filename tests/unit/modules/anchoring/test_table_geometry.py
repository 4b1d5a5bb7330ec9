"""Distances to the border and the centre of a table that need not be convex."""

from __future__ import annotations

import numpy as np
import pytest

from fluentboard_modules.anchoring.table_geometry import (
    angle_about,
    border_distance,
    inside,
    inward_direction,
)

# An L: the square from 0 to 2 without its upper right quarter.
L_SHAPE = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]])


def test_the_distance_to_the_border_respects_the_notch() -> None:
    points = np.array([[0.9, 0.9], [1.5, 0.5], [0.25, 1.0]])
    assert border_distance(L_SHAPE, points) == pytest.approx([np.hypot(0.1, 0.1), 0.5, 0.25])


def test_what_juts_out_over_the_edge_has_a_negative_distance() -> None:
    assert border_distance(L_SHAPE, np.array([[1.5, 1.5], [-0.1, 1.0]])) == pytest.approx(
        [-0.5, -0.1]
    )


def test_the_notch_does_not_belong_to_the_table() -> None:
    points = np.array([[0.5, 0.5], [1.5, 1.5], [1.5, 0.5], [3.0, 0.5]])
    assert inside(L_SHAPE, points).tolist() == [True, False, True, False]


def test_inward_is_away_from_the_nearest_edge_on_both_sides_of_it() -> None:
    points = np.array([[1.5, 0.1], [1.5, -0.1]])
    assert inward_direction(L_SHAPE, points) == pytest.approx(np.array([[0.0, 1.0], [0.0, 1.0]]))


def test_the_angle_about_the_centre_is_signed() -> None:
    centre, east, north = np.zeros((1, 2)), np.array([[1.0, 0.0]]), np.array([[0.0, 2.0]])
    assert angle_about(centre, east, north) == pytest.approx([np.pi / 2.0])
    assert angle_about(centre, north, east) == pytest.approx([-np.pi / 2.0])
