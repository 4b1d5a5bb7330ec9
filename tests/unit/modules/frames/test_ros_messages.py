"""ROS messages as arrays: encodings, units, byte order, padding and damage, worked out by hand."""

from __future__ import annotations

import struct
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from fluentboard.errors import InvalidFrame
from fluentboard_modules.frames.image_files import encode_colour, encode_u16
from fluentboard_modules.frames.ros_messages import (
    camera_model,
    colour,
    depth_m,
    is_depth_message,
    point_cloud,
    scaled_camera,
    transforms,
)
from fluentboard_modules.frames.sensor_frame import Camera

HEADER = SimpleNamespace(stamp=SimpleNamespace(sec=5, nanosec=500_000_000), frame_id="optical")


def image(content: bytes, encoding: str, *, step: int, big: int = 0, height: int = 2) -> Any:
    return SimpleNamespace(
        header=HEADER,
        height=height,
        width=2,
        encoding=encoding,
        is_bigendian=big,
        step=step,
        data=np.frombuffer(content, dtype=np.uint8),
    )


def compressed(content: bytes, kind: str) -> Any:
    return SimpleNamespace(header=HEADER, format=kind, data=np.frombuffer(content, np.uint8))


def test_millimetres_become_metres_and_rows_lose_their_padding() -> None:
    content = struct.pack("<HHHHHH", 1500, 0, 9, 65535, 250, 9)
    depth = depth_m(image(content, "16UC1", step=6), "/depth")
    assert depth.tolist() == [[1.5, 0.0], [0.0, 0.25]]


def test_byte_order_is_the_messages() -> None:
    content = struct.pack(">HHHH", 1500, 0, 1, 2000)
    assert depth_m(image(content, "16UC1", step=4, big=1), "/depth").tolist() == [
        [1.5, 0.0],
        [np.float32(0.001), 2.0],
    ]


def test_metres_stay_and_what_is_no_distance_becomes_zero() -> None:
    content = struct.pack("<ffff", 1.25, float("nan"), float("inf"), -1.0)
    depth = depth_m(image(content, "32FC1", step=8), "/depth")
    assert depth.tolist() == [[1.25, 0.0], [0.0, 0.0]]


def test_last_row_may_lack_its_padding() -> None:
    content = struct.pack("<HHHHH", 1, 2, 9, 3, 4)
    assert depth_m(image(content, "16UC1", step=6), "/depth")[1, 1] == np.float32(0.004)


def test_truncated_image_says_so() -> None:
    with pytest.raises(InvalidFrame, match="/depth: 6 bytes for 2 rows of 4"):
        depth_m(image(b"123456", "16UC1", step=4), "/depth")


def test_unknown_depth_encoding_is_named() -> None:
    with pytest.raises(InvalidFrame, match="encoding 'rgb8' is not one of depth images"):
        depth_m(image(bytes(12), "rgb8", step=6), "/depth")


def test_compressed_depth_in_millimetres() -> None:
    raw = np.array([[1500, 0], [65535, 250]], dtype=np.uint16)
    content = struct.pack("<iff", 0, 0.0, 0.0) + encode_u16(raw)
    depth = depth_m(compressed(content, "16UC1; compressedDepth png"), "/depth")
    assert depth.tolist() == [[1.5, 0.0], [0.0, 0.25]]


def test_compressed_depth_in_metres_is_quantised_inverse_depth() -> None:
    # compressed_depth_image_transport: value = a / depth + b, so depth = a / (value - b).
    a, b = 1000.0, -9.0
    raw = np.array([[1000 // 2 - 9, 0], [991, 91]], dtype=np.uint16)
    content = struct.pack("<iff", 0, a, b) + encode_u16(raw)
    depth = depth_m(compressed(content, "32FC1; compressedDepth png"), "/depth")
    assert np.allclose(depth, [[2.0, 0.0], [1.0, 10.0]])


def test_run_length_compression_says_what_to_do() -> None:
    with pytest.raises(InvalidFrame, match="RVL compression is not supported; record with"):
        depth_m(compressed(bytes(40), "16UC1; compressedDepth rvl"), "/depth")


@pytest.mark.parametrize(
    ("encoding", "pixel"),
    [
        ("rgb8", [10, 20, 30]),
        ("bgr8", [30, 20, 10]),
        ("rgba8", [10, 20, 30, 255]),
        ("bgra8", [30, 20, 10, 255]),
    ],
)
def test_colour_encodings_become_rgb(encoding: str, pixel: list[int]) -> None:
    content = bytes(pixel * 4)
    found = colour(image(content, encoding, step=2 * len(pixel)), "/rgb")
    assert found.shape == (2, 2, 3)
    assert found[1, 1].tolist() == [10, 20, 30]


def test_grey_becomes_rgb() -> None:
    assert colour(image(bytes([1, 2, 3, 4]), "mono8", step=2), "/rgb")[1, 0].tolist() == [3, 3, 3]


@pytest.mark.parametrize(
    ("encoding", "first"),
    [("bayer_rggb8", (0, 0)), ("bayer_grbg8", (0, 1)), ("bayer_bggr8", (1, 1))],
)
def test_bayer_pattern_is_that_of_the_first_row(encoding: str, first: tuple[int, int]) -> None:
    mosaic = np.zeros((8, 8), dtype=np.uint8)
    mosaic[first[0] :: 2, first[1] :: 2] = 200  # red alone is bright
    message = image(mosaic.tobytes(), encoding, step=8)
    message.height = message.width = 8
    middle = colour(message, "/rgb")[4, 4].astype(int)
    assert middle[0] > 150
    assert middle[1] < 20
    assert middle[2] < 20


def test_compressed_colour_is_rgb() -> None:
    picture = np.full((4, 4, 3), (200, 40, 10), dtype=np.uint8)
    png = colour(compressed(encode_colour(picture, ".png"), "rgb8; png compressed bgr8"), "/rgb")
    assert np.array_equal(png, picture)
    jpeg = colour(compressed(encode_colour(picture, ".jpg"), "jpeg"), "/rgb")
    assert np.abs(jpeg.astype(int) - picture).max() < 8


def test_truncated_jpeg_says_so() -> None:
    content = encode_colour(np.zeros((4, 4, 3), dtype=np.uint8), ".jpg")[:-100]
    with pytest.raises(InvalidFrame, match="/rgb: the JPEG is truncated"):
        colour(compressed(content, "jpeg"), "/rgb")


def test_unknown_colour_encoding_lists_the_known() -> None:
    with pytest.raises(InvalidFrame, match="'plasma' is unknown; known are rgb8, bgr8"):
        colour(image(bytes(4), "plasma", step=2), "/rgb")


@pytest.mark.parametrize(
    ("message", "topic", "expected"),
    [
        (image(b"", "16UC1", step=4), "/a", True),
        (image(b"", "32FC1", step=4), "/a", True),
        (image(b"", "mono16", step=4), "/camera/depth/image", True),
        (image(b"", "mono16", step=4), "/camera/ir/image", False),
        (image(b"", "rgb8", step=4), "/camera/depth/image", False),
        (compressed(b"", "16UC1; compressedDepth png"), "/a", True),
        (compressed(b"", "jpeg"), "/a/compressed", False),
    ],
)
def test_depth_is_told_by_its_encoding(message: Any, topic: str, expected: bool) -> None:
    assert is_depth_message(message, topic) is expected


def info(*, d: list[float], old: bool = False, fx: float = 500.0) -> Any:
    values = {
        "k": [fx, 0, 320, 0, 501, 240, 0, 0, 1],
        "p": [480, 0, 321, 0, 0, 481, 241, 0, 0, 0, 1, 0],
        "d": d,
    }
    return SimpleNamespace(
        header=HEADER,
        width=640,
        height=480,
        distortion_model="plumb_bob",
        **{(name.upper() if old else name): np.array(v, float) for name, v in values.items()},
    )


@pytest.mark.parametrize("old", [False, True])
def test_raw_images_have_the_matrix_k_and_rectified_ones_p(old: bool) -> None:
    raw = camera_model(info(d=[0.1, 0, 0, 0, 0], old=old), "/info", is_rectified=False)
    assert raw.camera == Camera(640, 480, 500.0, 501.0, 320.0, 240.0)
    assert raw.distortion.size == 5
    rectified = camera_model(info(d=[0.1, 0, 0, 0, 0], old=old), "/info", is_rectified=True)
    assert rectified.camera == Camera(640, 480, 480.0, 481.0, 321.0, 241.0)
    assert rectified.distortion.size == 0


def test_uncalibrated_camera_is_an_error() -> None:
    with pytest.raises(InvalidFrame, match="/info: the camera is not calibrated"):
        camera_model(info(d=[], fx=0.0), "/info", is_rectified=False)


def test_lens_distortion_is_removed() -> None:
    model = camera_model(info(d=[-0.2, 0.0, 0.0, 0.0, 0.0]), "/info", is_rectified=False)
    raw = np.zeros((480, 640), dtype=np.float32)
    # A barrel lens (k1 = -0.2) draws x/z = 0.5 at 0.5 (1 - 0.2 * 0.25) = 0.475.
    column = round(320 + 500 * 0.475)
    raw[:, column - 1 : column + 2] = 2.0
    rectified = model.rectified(raw, is_depth=True)
    assert rectified[240, 320 + 250] == 2.0
    assert set(np.unique(rectified)) == {0.0, 2.0}


def test_scaled_images_have_a_scaled_camera() -> None:
    camera = scaled_camera(Camera(640, 480, 500.0, 502.0, 319.5, 239.5), 320, 240, "/depth")
    assert camera == Camera(320, 240, 250.0, 251.0, 159.5, 119.5)
    with pytest.raises(InvalidFrame, match="images of 320 x 200 px, but its camera says 640 x 480"):
        scaled_camera(Camera(640, 480, 500.0, 502.0, 319.5, 239.5), 320, 200, "/depth")


def cloud_message(content: NDArray[Any], height: int = 1, row_step: int | None = None) -> Any:
    fields = [("x", 0, 7), ("y", 4, 7), ("z", 8, 7), ("rgb", 16, 7)]
    width = len(content) // height
    return SimpleNamespace(
        header=HEADER,
        width=width,
        height=height,
        point_step=20,
        row_step=row_step or width * 20,
        is_bigendian=False,
        is_dense=False,
        fields=[SimpleNamespace(name=n, offset=o, datatype=t, count=1) for n, o, t in fields],
        data=np.frombuffer(content.tobytes(), np.uint8),
    )


POINT = np.dtype(
    {
        "names": ["x", "y", "z", "rgb"],
        "formats": ["<f4", "<f4", "<f4", "<u4"],
        "offsets": [0, 4, 8, 16],
        "itemsize": 20,
    }
)


def test_points_and_packed_colours_of_a_cloud() -> None:
    points = np.array([(1.0, 2.0, 3.0, 0x112233), (np.nan, 0.0, 0.0, 0)] * 2, POINT)
    cloud = point_cloud(cloud_message(points, height=2), "/points")
    assert (cloud.width, cloud.height) == (2, 2)
    assert cloud.points[0].tolist() == [1.0, 2.0, 3.0]
    assert cloud.valid.tolist() == [True, False, True, False]
    assert np.asarray(cloud.colours)[2].tolist() == [0x11, 0x22, 0x33]


def test_truncated_cloud_says_so() -> None:
    points = np.zeros(4, POINT)
    with pytest.raises(InvalidFrame, match="/points: 80 bytes for 2 rows of 2 points of 20 bytes"):
        point_cloud(cloud_message(points, height=2, row_step=60), "/points")


def test_transforms_without_a_rotation_are_left_out() -> None:
    def stamped(w: float) -> Any:
        return SimpleNamespace(
            header=HEADER,
            child_frame_id="base",
            transform=SimpleNamespace(
                translation=SimpleNamespace(x=1.0, y=2.0, z=3.0),
                rotation=SimpleNamespace(x=0.0, y=0.0, z=0.0, w=w),
            ),
        )

    found = list(transforms(SimpleNamespace(transforms=[stamped(0.0), stamped(2.0)])))
    assert len(found) == 1
    parent, child, stamp_s, T_parent_child = found[0]
    assert (parent, child, stamp_s) == ("optical", "base", 5.5)
    assert T_parent_child.translation.tolist() == [1.0, 2.0, 3.0]
