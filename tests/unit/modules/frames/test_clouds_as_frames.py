"""Point clouds as sensor frames: the camera is recovered, or a virtual one looks at them."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np
import pytest

from fluentboard.errors import InvalidFrame
from fluentboard.model.geometry import FloatArray, Pose, Transform
from fluentboard_modules.frames.cloud_views import (
    BODY,
    GRAPHICS,
    fit_pinhole,
    frame_of_cloud,
    view_cloud,
)
from fluentboard_modules.frames.clouds import open_cloud
from fluentboard_modules.frames.point_cloud import PointCloud
from fluentboard_modules.frames.sensor_frame import Camera, SensorFrame
from fluentboard_modules.frames.upright import (
    CAMERA_UP,
    dominant_level_plane,
    guess_gravity,
    is_z_up,
)

CAMERA = Camera(20, 15, 30.0, 31.0, 9.0, 7.5)


def image_points(rng: np.random.Generator) -> FloatArray:
    """The pixels of a camera at random depths, one of them unknown."""
    points = (CAMERA.rays() * rng.uniform(0.5, 4.0, (15, 20, 1))).reshape(-1, 3)
    points[17] = np.nan
    return points


def as_frame(cloud: PointCloud) -> SensorFrame:
    view = view_cloud(cloud, "cloud")
    return frame_of_cloud(cloud, view, Transform.identity(), 1.0, "test")


def test_camera_of_an_organised_cloud_is_recovered(rng: np.random.Generator) -> None:
    points = image_points(rng)
    frame = as_frame(PointCloud(points, 20, 15))
    assert frame.camera == CAMERA
    assert frame.cloud_sensor is None
    assert not frame.valid[0, 17]
    assert np.allclose(frame.points_sensor().reshape(-1, 3), points, equal_nan=True, atol=1e-6)


def test_cloud_with_y_up_is_turned(rng: np.random.Generator) -> None:
    points = image_points(rng)
    frame = as_frame(PointCloud(GRAPHICS.apply(points), 20, 15))
    assert frame.camera == CAMERA
    assert np.allclose(frame.depth_m.ravel()[18:], points[18:, 2])
    assert np.allclose(frame.points_map().reshape(-1, 3)[18:], GRAPHICS.apply(points)[18:])


def test_recorded_viewpoint_is_believed_if_the_points_lie_in_front(
    rng: np.random.Generator,
) -> None:
    points = image_points(rng)
    T_cloud_sensor = Pose.from_rpy(3.0, 2.0, 1.0, 0.3, 0.2, 0.1).to_transform()
    cloud = PointCloud(T_cloud_sensor.apply(points), 20, 15, T_cloud_sensor=T_cloud_sensor)
    frame = as_frame(cloud)
    assert frame.T_map_sensor == T_cloud_sensor
    assert frame.camera == CAMERA


def test_wrong_viewpoint_is_not_believed(rng: np.random.Generator) -> None:
    # Some files of the Point Cloud Library say "looks along -z" of points at z > 0.
    cloud = PointCloud(image_points(rng), 20, 15, T_cloud_sensor=GRAPHICS)
    assert as_frame(cloud).T_map_sensor == Transform.identity()


def test_points_that_are_no_image_have_no_camera(rng: np.random.Generator) -> None:
    cloud = PointCloud(rng.uniform(1.0, 2.0, (300, 3)), 20, 15)
    assert fit_pinhole(cloud, Transform.identity()) is None


def test_unorganised_cloud_is_seen_from_its_sensor(rng: np.random.Generator) -> None:
    wall = np.column_stack([rng.uniform(-0.5, 0.5, (5000, 2)), np.full(5000, 2.0)])
    box = np.column_stack([rng.uniform(-0.1, 0.1, (1000, 2)), np.full(1000, 1.0)])
    labels = np.repeat([1, 2], [5000, 1000]).astype(np.int32)
    frame = as_frame(PointCloud(np.concatenate([wall, box]), 6000, 1, labels=labels))
    assert frame.cloud_sensor is not None
    assert frame.cloud_sensor.shape == (6000, 3)
    assert frame.valid.mean() > 0.85
    rows, columns = frame.depth_m.shape
    assert frame.depth_m[rows // 2, columns // 2] == 1.0  # the box hides the wall
    assert frame.depth_m[2, 2] == 2.0
    assert np.asarray(frame.labels)[rows // 2, columns // 2] == 2
    # Every pixel's point is within a pixel of a point of the cloud.
    seen = frame.points_map()[frame.valid]
    assert np.abs(seen[:, :2]).max() < 0.5 + 2.0 / frame.camera.fx


def test_scene_all_around_is_seen_from_above_with_a_warning(
    rng: np.random.Generator, caplog: pytest.LogCaptureFixture
) -> None:
    floor = np.column_stack([rng.uniform(-3, 3, (20000, 2)), np.zeros(20000)])
    with caplog.at_level(logging.WARNING):
        frame = as_frame(PointCloud(floor, 20000, 1))
    assert "seen from above" in caplog.text
    assert frame.T_map_sensor.translation[2] > 2.0
    assert is_z_up([frame.T_map_sensor])
    assert frame.valid.sum() > 3000
    assert np.abs(frame.points_map()[frame.valid][:, 2]).max() < 0.1


def test_scan_of_a_robot_is_seen_forward(rng: np.random.Generator) -> None:
    points = rng.uniform([1.0, -0.5, -0.5], [3.0, 0.5, 0.5], (2000, 3))
    assert as_frame(PointCloud(points, 2000, 1)).T_map_sensor == BODY


def test_cloud_without_a_point_is_an_error() -> None:
    with pytest.raises(InvalidFrame, match="not one valid point in a cloud of 4"):
        view_cloud(PointCloud(np.full((4, 3), np.nan), 2, 2), "empty")


def test_colours_must_be_as_many_as_points() -> None:
    with pytest.raises(InvalidFrame, match="a cloud of 2 x 1 points has arrays of"):
        PointCloud(np.zeros((2, 3)), 2, 1, colours=np.zeros((3, 3), dtype=np.uint8))


def test_largest_level_plane_gives_up(rng: np.random.Generator) -> None:
    # A camera pitched down by 35 degrees sees a table top, and a wall with more points behind it.
    tilt = Pose.from_rpy(0.0, 0.0, 0.0, roll=np.deg2rad(35.0)).to_transform()
    level = Pose.from_rpy(0.0, 0.0, 0.0, roll=np.deg2rad(-90.0)).to_transform()
    T_sensor_world = (level @ tilt.inverse()).inverse()
    table = rng.uniform([-0.6, 0.8, -0.701], [0.6, 1.6, -0.699], (3000, 3))
    wall = rng.uniform([-1.0, 2.499, -0.7], [1.0, 2.501, 1.0], (4000, 3))
    points = T_sensor_world.apply(np.concatenate([table, wall]))
    assert (points[:, 2] > 0.0).all()
    found = dominant_level_plane(points, rng)
    assert found is not None
    expected = T_sensor_world.rotate(np.array([0.0, 0.0, 1.0]))
    assert found[0] @ expected > np.cos(np.deg2rad(1.0))
    assert expected @ CAMERA_UP == pytest.approx(np.cos(np.deg2rad(35.0)))


def test_gravity_without_any_plane_is_that_of_a_level_camera() -> None:
    depth = np.zeros((15, 20), dtype=np.float32)
    frame = SensorFrame(depth, CAMERA, 1.0, BODY)
    gravity = guess_gravity([frame], np.random.default_rng(0))
    assert np.allclose(gravity, [0.0, 0.0, -1.0])


def test_file_of_something_else_is_no_cloud(tmp_path: Path) -> None:
    with pytest.raises(InvalidFrame, match=r"no point cloud; expected a file in \.pcd or \.ply"):
        open_cloud(tmp_path / "cloud.xyz")
