"""Pinhole cameras, units, invalid depth and registration, checked against numbers made by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fluentboard.errors import InvalidFrame
from fluentboard.model.geometry import Pose, Transform
from fluentboard_modules.frames.gravity import align_with_gravity
from fluentboard_modules.frames.image_files import (
    decode_colour,
    decode_depth_m,
    decode_u16,
    encode_colour,
    encode_depth_mm,
)
from fluentboard_modules.frames.registration import registered_colour
from fluentboard_modules.frames.sensor_frame import Camera, SensorFrame

CAMERA = Camera(4, 3, 2.0, 4.0, 1.0, 1.0)


def frame(depth: list[list[float]], T_map_sensor: Transform | None = None) -> SensorFrame:
    return SensorFrame(
        np.array(depth, dtype=np.float32), CAMERA, 1.0, T_map_sensor or Transform.identity()
    )


DEPTH = [[1.0, 2.0, 0.0, 4.0], [1.0, np.nan, 1.0, 1.0], [2.0, 2.0, 2.0, -1.0]]


def test_pixels_become_points_by_fx_and_fy() -> None:
    points = frame(DEPTH).points_sensor()
    assert points.shape == (3, 4, 3)
    # Pixel (u, v) = (3, 0) at 4 m: ((3 - 1) / 2, (0 - 1) / 4, 1) * 4.
    assert points[0, 3].tolist() == [4.0, -1.0, 4.0]
    assert points[2, 0].tolist() == [-1.0, 0.5, 2.0]


def test_zero_negative_and_nan_are_no_measurement() -> None:
    seen = frame(DEPTH)
    assert seen.valid.tolist() == [
        [True, True, False, True],
        [True, False, True, True],
        [True, True, True, False],
    ]
    assert np.isnan(seen.points_sensor()[~seen.valid]).all()


def test_points_of_the_map_are_turned_and_moved() -> None:
    T_map_sensor = Pose.from_rpy(10.0, 20.0, 30.0, yaw=np.pi / 2).to_transform()
    points = frame(DEPTH, T_map_sensor).points_map()
    # (4, -1, 4) turned by 90 degrees about z is (1, 4, 4).
    assert np.allclose(points[0, 3], [11.0, 24.0, 34.0])


def test_projection_undoes_unprojection() -> None:
    seen = frame(DEPTH)
    rows, columns = np.nonzero(seen.valid)
    pixels = CAMERA.project(seen.points_sensor()[seen.valid])
    assert np.allclose(pixels, np.column_stack([columns, rows]))


def test_camera_of_a_matrix() -> None:
    matrix = np.array([[2.0, 0.0, 1.0], [0.0, 4.0, 1.0], [0.0, 0.0, 1.0]])
    assert Camera.from_matrix(4, 3, matrix) == CAMERA


@pytest.mark.parametrize("broken", [{"fx": 0.0}, {"fy": float("nan")}, {"width": 0}])
def test_impossible_camera_is_refused(broken: dict[str, float]) -> None:
    with pytest.raises(InvalidFrame, match="give positive numbers of pixels"):
        replace(CAMERA, **broken)


def test_depth_of_another_size_than_the_camera_is_refused() -> None:
    with pytest.raises(InvalidFrame, match="give the intrinsics of this image size"):
        frame([[1.0]])


def test_cloud_of_a_frame_is_points() -> None:
    with pytest.raises(InvalidFrame, match="cloud has shape"):
        replace(frame(DEPTH), cloud_sensor=np.zeros((5, 2)))


def test_depth_survives_its_encoding_to_the_millimetre() -> None:
    depth = np.array([[0.0, 0.001, 1.2346], [65.534, 70.0, np.nan]], dtype=np.float32)
    back = decode_depth_m(encode_depth_mm(depth), "here", 1000.0)
    assert np.allclose(back, [[0.0, 0.001, 1.235], [65.534, 0.0, 0.0]], atol=1e-5)


def test_units_of_depth_are_the_recordings() -> None:
    content = encode_depth_mm(np.full((2, 2), 5.0, dtype=np.float32))
    assert decode_depth_m(content, "here", 5000.0)[0, 0] == 1.0


def test_damaged_images_are_named_with_what_is_wrong() -> None:
    png = encode_depth_mm(np.ones((9, 9), dtype=np.float32))
    jpeg = encode_colour(np.zeros((9, 9, 3), dtype=np.uint8))
    flipped = bytearray(png)
    flipped[45] ^= 0xFF
    for content, message in (
        (b"", "here: is empty"),
        (b"text", "here: is neither a PNG nor a JPEG image"),
        (png[:-20], "here: the PNG is truncated after"),
        (bytes(flipped), "here: the checksum of PNG chunk IDAT is wrong"),
        (jpeg[:-70], "here: the JPEG is truncated"),
    ):
        with pytest.raises(InvalidFrame, match=message):
            decode_colour(content, "here")


def test_colour_is_no_depth() -> None:
    content = encode_colour(np.zeros((4, 4, 3), dtype=np.uint8), ".png")
    with pytest.raises(InvalidFrame, match=r"has 3 channel\(s\) of 8 bits"):
        decode_u16(content, "here")


def test_colour_of_another_camera_is_registered_by_depth() -> None:
    # The colour camera is 1 m to the right: at depth d a point moves by 2 / d pixels to the left.
    colour = np.zeros((3, 4, 3), dtype=np.uint8)
    colour[:, :, 0] = np.arange(4)
    seen = replace(
        frame([[2.0] * 4, [1.0] * 4, [0.0] * 4]),
        colour=colour,
        colour_camera=CAMERA,
        T_colour_depth=Transform.from_parts(np.eye(3), np.array([-1.0, 0.0, 0.0])),
    )
    registered = registered_colour(seen)
    assert registered is not None
    assert registered[:, :, 0].tolist() == [[0, 0, 1, 2], [0, 0, 0, 1], [0, 0, 0, 0]]


def test_registered_colour_stays_as_it_is() -> None:
    colour = np.full((3, 4, 3), 9, dtype=np.uint8)
    assert registered_colour(replace(frame(DEPTH), colour=colour)) is colour
    assert registered_colour(frame(DEPTH)) is None


@pytest.mark.parametrize(
    "gravity", [(0.0, 0.0, -9.81), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.3, 0.9, -0.2)]
)
def test_gravity_points_down_after_the_smallest_turn(gravity: tuple[float, ...]) -> None:
    falling = np.array(gravity)
    T_upright_world = align_with_gravity(falling)
    assert np.allclose(
        T_upright_world.rotate(falling / np.linalg.norm(falling)), [0.0, 0.0, -1.0], atol=1e-12
    )
    # The smallest turn is about an axis that is level and normal to gravity.
    angle = np.arccos(np.clip((np.trace(T_upright_world.rotation) - 1.0) / 2.0, -1.0, 1.0))
    between = np.arccos(-falling[2] / np.linalg.norm(falling))
    assert angle == pytest.approx(between)
