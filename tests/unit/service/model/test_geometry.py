from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from fluentboard.errors import InvalidGeometry
from fluentboard.model.geometry import BoundingBox, Plane, Pose, Transform

QUARTER_TURN = Pose.from_rpy(1.0, 2.0, 3.0, yaw=math.pi / 2)


def test_a_pose_takes_its_own_coordinates_to_its_parent():
    point = QUARTER_TURN.to_transform().apply(np.array([1.0, 0.0, 0.0]))
    np.testing.assert_allclose(point, [1.0, 3.0, 3.0], atol=1e-12)


def test_directions_are_turned_but_not_shifted():
    direction = QUARTER_TURN.to_transform().rotate(np.array([1.0, 0.0, 0.0]))
    np.testing.assert_allclose(direction, [0.0, 1.0, 0.0], atol=1e-12)


def test_a_transform_applies_to_an_image_of_points():
    points = np.zeros((4, 5, 3))
    np.testing.assert_allclose(QUARTER_TURN.to_transform().apply(points)[2, 3], [1.0, 2.0, 3.0])


def test_the_inverse_takes_points_back():
    T_map_cup = QUARTER_TURN.to_transform()
    np.testing.assert_allclose((T_map_cup @ T_map_cup.inverse()).matrix, np.eye(4), atol=1e-12)


def test_in_a_product_the_right_transform_applies_first():
    shift = Transform.from_parts(np.eye(3), np.array([1.0, 0.0, 0.0]))
    point = (QUARTER_TURN.to_transform() @ shift).apply(np.zeros(3))
    np.testing.assert_allclose(point, [1.0, 3.0, 3.0], atol=1e-12)


def test_what_stands_upright_is_turned_and_shifted():
    upright = Transform.upright(1.0, 2.0, 3.0, math.pi / 2)

    assert upright.matrix == pytest.approx(QUARTER_TURN.to_transform().matrix)
    with pytest.raises(InvalidGeometry, match="nan"):
        Transform.upright(0.0, math.nan, 0.0, 0.0)


def test_equal_transforms_are_equal_and_hash_alike():
    assert Transform.identity() == Transform(np.eye(4))
    assert hash(Transform.identity()) == hash(Transform(np.eye(4)))
    assert Transform.identity() != QUARTER_TURN.to_transform()
    assert Transform.identity() != "identity"


def test_a_transform_does_not_change_with_the_array_it_was_made_from():
    matrix = np.eye(4)
    transform = Transform(matrix)
    matrix[0, 3] = 5.0
    assert transform == Transform.identity()
    assert not transform.matrix.flags.writeable


@pytest.mark.parametrize(
    ("matrix", "message"),
    [
        (np.eye(3), "4x4"),
        (np.full((4, 4), math.nan), "NaN"),
        (np.diag([2.0, 2.0, 2.0, 1.0]), "not a rotation"),
        (np.diag([1.0, 1.0, -1.0, 1.0]), "not a rotation"),
        (np.diag([1.0, 1.0, 1.0, 2.0]), "last row"),
    ],
)
def test_a_matrix_that_is_no_rigid_motion_is_refused(matrix: Any, message: str):
    with pytest.raises(InvalidGeometry, match=message):
        Transform(matrix)


def test_a_quaternion_printed_with_few_digits_is_normalised():
    pose = Pose(0.0, 0.0, 0.0, 0.0, 0.0, 0.7077, 0.7077)
    assert math.hypot(pose.qx, pose.qy, pose.qz, pose.qw) == pytest.approx(1.0, abs=1e-12)
    rotation = pose.to_transform().rotation
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)


@pytest.mark.parametrize("quaternion", [(0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 1.0, 1.0)])
def test_a_quaternion_of_another_length_is_refused(
    quaternion: tuple[float, float, float, float],
):
    with pytest.raises(InvalidGeometry, match="divide it by its length"):
        Pose(0.0, 0.0, 0.0, *quaternion)


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_a_coordinate_is_finite(value: float):
    with pytest.raises(InvalidGeometry, match="finite"):
        Pose(value, 0.0, 0.0)
    with pytest.raises(InvalidGeometry, match="finite"):
        Pose.from_rpy(0.0, 0.0, 0.0, yaw=value)


@pytest.mark.parametrize("pitch", [math.pi / 2, -math.pi / 2])
def test_at_gimbal_lock_the_turn_is_kept(pitch: float):
    pose = Pose.from_rpy(0.0, 0.0, 0.0, 0.3, pitch, 0.8)
    again = Pose.from_rpy(0.0, 0.0, 0.0, *pose.rpy)
    np.testing.assert_allclose(again.to_transform().matrix, pose.to_transform().matrix, atol=1e-7)


def test_the_yaw_is_the_turn_about_the_vertical():
    assert Pose.from_rpy(0.0, 0.0, 0.0, yaw=-1.4).yaw_rad == pytest.approx(-1.4)


def test_a_box_has_eight_corners_around_its_centre():
    box = BoundingBox(QUARTER_TURN, 0.2, 0.4, 0.6)
    corners = box.corners()
    np.testing.assert_allclose(corners.mean(axis=0), [1.0, 2.0, 3.0], atol=1e-12)
    np.testing.assert_allclose(np.ptp(corners, axis=0), [0.4, 0.2, 0.6], atol=1e-12)
    assert box.volume_m3 == pytest.approx(0.048)


def test_a_box_contains_its_surface_and_nothing_outside():
    box = BoundingBox(Pose(0.0, 0.0, 0.0), 1.0, 1.0, 1.0)
    inside = box.contains(np.array([[0.0, 0.0, 0.0], [0.5, 0.5, 0.5], [0.51, 0.0, 0.0]]))
    assert inside.tolist() == [True, True, False]


@pytest.mark.parametrize("size", [-0.1, math.nan])
def test_a_box_size_is_finite_and_not_negative(size: float):
    with pytest.raises(InvalidGeometry):
        BoundingBox(Pose(0.0, 0.0, 0.0), 1.0, size, 1.0)


def test_distances_from_a_plane_are_positive_on_the_side_of_its_normal():
    table = Plane(np.array([0.0, 0.0, 1.0]), 0.7)
    heights = table.signed_distance(np.array([[5.0, 5.0, 1.0], [0.0, 0.0, 0.0]]))
    np.testing.assert_allclose(heights, [0.3, -0.7])


def test_equal_planes_are_equal_and_hash_alike():
    up = np.array([0.0, 0.0, 1.0])
    assert Plane(up, 0.7) == Plane(up.copy(), 0.7)
    assert hash(Plane(up, 0.7)) == hash(Plane(up.copy(), 0.7))
    assert Plane(up, 0.7) != Plane(up, 0.8)
    assert Plane(up, 0.7) != 0.7


@pytest.mark.parametrize("normal", [[0.0, 0.0, 2.0], [0.0, 1.0], [math.nan, 0.0, 1.0]])
def test_a_plane_has_a_unit_normal(normal: list[float]):
    with pytest.raises(InvalidGeometry, match="unit vector"):
        Plane(np.array(normal), 0.0)
