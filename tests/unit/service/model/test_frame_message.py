"""Frames as bytes: what is packed comes back, and what is wrong is named."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from fluentboard.errors import InvalidFrame
from fluentboard.model.frame_message import (
    FrameMessage,
    PinholeJson,
    pack_frame,
    stamp_of,
    unpack_frame,
)
from fluentboard.model.geometry import Pose, Transform

PNG = b"\x89PNG\r\n\x1a\n depth"
MESSAGE = FrameMessage(
    stamp_s=12.25,
    camera=PinholeJson(640, 480, 525.0, 526.0, 319.5, 239.5),
    T_map_sensor=Pose.from_rpy(1.0, 2.0, 3.0, yaw=0.5).to_transform(),
    depth=PNG,
    colour=b"\xff\xd8\xff colour",
)


def changed(change: Callable[[dict[str, Any]], None]) -> bytes:
    """The message with its header changed."""
    packed = pack_frame(MESSAGE)
    (length,) = struct.unpack_from("<I", packed)
    header = json.loads(packed[4 : 4 + length])
    change(header)
    text = json.dumps(header).encode()
    return struct.pack("<I", len(text)) + text + packed[4 + length :]


def test_what_is_packed_comes_back() -> None:
    assert unpack_frame(pack_frame(MESSAGE)) == MESSAGE


def test_frame_without_colour_comes_back() -> None:
    message = replace(MESSAGE, colour=None)
    assert unpack_frame(pack_frame(message)) == message


def test_colour_camera_of_its_own_comes_back() -> None:
    message = replace(
        MESSAGE,
        colour=PNG,
        colour_encoding="png",
        colour_camera=PinholeJson(1280, 720, 900.0, 900.0, 640.0, 360.0),
        T_colour_depth=Transform.from_parts(np.eye(3), np.array([-0.025, 0.0, 0.0])),
    )
    assert unpack_frame(pack_frame(message)) == message


def test_stamp_is_read_from_the_beginning_alone() -> None:
    packed = pack_frame(MESSAGE)
    assert stamp_of(packed[: len(packed) - len(PNG) - 4]) == 12.25


def test_truncated_frame_says_how_much_is_missing() -> None:
    packed = pack_frame(MESSAGE)
    with pytest.raises(
        InvalidFrame, match=f"has {len(packed) - 5} bytes, its header promises {len(packed)}"
    ):
        unpack_frame(packed[:-5])


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "a frame of 0 bytes"),
        (b"\xff\xff\xff\xff123", "its first four, but only 3 bytes follow"),
        (b"\x03\x00\x00\x00{{{", "header is not JSON"),
        (b"\x02\x00\x00\x00[]", "header is no JSON object"),
    ],
)
def test_bytes_that_are_no_frame_are_refused(content: bytes, message: str) -> None:
    with pytest.raises(InvalidFrame, match=message):
        unpack_frame(content)


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("stamp_s", 0.0, "stamp_s is 0.0, which is reserved"),
        ("stamp_s", None, "has no stamp_s"),
        ("stamp_s", "now", "stamp_s is 'now'"),
        ("camera", {"fx": 1}, "camera is .*; give width, height, fx, fy, cx, cy in pixels"),
        ("camera", None, "camera is None"),
        ("T_map_sensor", [[1, 2], [3, 4]], "T_map_sensor is no 4x4 rigid motion"),
        ("T_map_sensor", [[2, 0, 0, 0]] * 4, "T_map_sensor is no 4x4 rigid motion"),
        ("depth", {"encoding": "raw", "bytes": 5}, "encoding 'raw'; send png16_mm"),
        ("depth", {"encoding": "png16_mm", "bytes": -5}, "depth.bytes is -5"),
        ("depth", None, "depth is None; give an object"),
        ("colour", {"encoding": "bmp", "bytes": 5}, "give encoding .jpeg or png. and bytes"),
        ("sensor", "head", "unknown key 'sensor'; keys are T_map_sensor, camera"),
    ],
)
def test_wrong_header_is_explained(key: str, value: Any, message: str) -> None:
    with pytest.raises(InvalidFrame, match=message):
        unpack_frame(changed(lambda header: header.update({key: value})))


def test_impossible_camera_is_refused() -> None:
    with pytest.raises(InvalidFrame, match="sizes and focal lengths are positive"):
        unpack_frame(changed(lambda header: header["camera"].update(fx=-1)))


def test_image_in_another_encoding_is_refused() -> None:
    with pytest.raises(InvalidFrame, match="depth does not begin like png16_mm; it begins b'GIF8"):
        replace(MESSAGE, depth=b"GIF89a")
