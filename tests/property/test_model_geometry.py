"""Poses and transforms: ways there and back, and what rigid motions keep."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from fluentboard.model.geometry import BoundingBox, FloatArray, Plane, Pose, Transform

METRES = st.floats(-100.0, 100.0)
ANGLES = st.floats(-math.pi, math.pi) | st.sampled_from(
    [0.0, math.pi / 2, -math.pi / 2, math.pi, -math.pi]
)
SIZES = st.floats(0.0, 5.0)
POSES = st.builds(Pose.from_rpy, METRES, METRES, METRES, ANGLES, ANGLES, ANGLES)
POINTS = st.lists(st.tuples(METRES, METRES, METRES), min_size=1, max_size=5).map(np.array)


def close(first: FloatArray, second: FloatArray, tolerance: float = 1e-9) -> bool:
    return bool(np.allclose(first, second, rtol=0.0, atol=tolerance))


@given(POSES)
def test_a_pose_survives_becoming_a_transform(pose: Pose):
    T_map_cup = pose.to_transform()
    assert close(Pose.from_transform(T_map_cup).to_transform().matrix, T_map_cup.matrix)


@given(POSES)
def test_a_pose_survives_becoming_roll_pitch_and_yaw(pose: Pose):
    roll, pitch, yaw = pose.rpy
    assert abs(pitch) <= math.pi / 2
    again = Pose.from_rpy(pose.x, pose.y, pose.z, roll, pitch, yaw)
    # Near gimbal lock the sine of the pitch leaves only half of the digits.
    assert close(again.to_transform().matrix, pose.to_transform().matrix, 1e-5)


@given(POSES, POINTS)
def test_the_inverse_takes_every_point_back(pose: Pose, points_cup: FloatArray):
    T_map_cup = pose.to_transform()
    assert close(T_map_cup.inverse().apply(T_map_cup.apply(points_cup)), points_cup)


@given(POSES, POSES, POINTS)
def test_a_product_is_one_motion_after_the_other(first: Pose, second: Pose, points: FloatArray):
    T_map_table, T_table_cup = first.to_transform(), second.to_transform()
    assert close(
        (T_map_table @ T_table_cup).apply(points),
        T_map_table.apply(T_table_cup.apply(points)),
    )


@given(POSES, POINTS)
def test_a_rigid_motion_keeps_distances(pose: Pose, points: FloatArray):
    moved = pose.to_transform().apply(points)
    assert close(
        np.linalg.norm(moved - moved[0], axis=1), np.linalg.norm(points - points[0], axis=1)
    )


@given(POSES, SIZES, SIZES, SIZES, POSES, POINTS)
def test_what_is_in_a_box_stays_in_it_when_both_move(
    pose: Pose, x_size: float, y_size: float, z_size: float, motion: Pose, points: FloatArray
):
    T_new_old = motion.to_transform()
    box = BoundingBox(pose, x_size, y_size, z_size)
    # Slightly larger and smaller boxes, so that rounding at the surface does not decide.
    moved_pose = Pose.from_transform(T_new_old @ pose.to_transform())
    larger = BoundingBox(moved_pose, x_size + 1e-6, y_size + 1e-6, z_size + 1e-6)
    near = pose.to_transform().apply(points / 50.0)
    assert not np.any(box.contains(near) & ~larger.contains(T_new_old.apply(near)))
    assert larger.contains(T_new_old.apply(box.corners())).all()


@given(POSES, POINTS)
def test_distances_from_a_plane_move_with_it(pose: Pose, points: FloatArray):
    floor = Plane(np.array([0.0, 0.0, 1.0]), 0.25)
    T_map_room: Transform = pose.to_transform()
    normal = T_map_room.rotate(floor.normal)
    moved = Plane(normal, float(floor.offset_m + normal @ T_map_room.translation))
    assert close(moved.signed_distance(T_map_room.apply(points)), floor.signed_distance(points))
