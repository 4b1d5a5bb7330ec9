"""FrameMessage: a sensor frame as bytes, as robots send it to a board and workers get it.

Four bytes with the length of the header (little-endian), the header as JSON, then the parts that it
names one after the other: the depth image, and the colour image if there is one.

    {"stamp_s": 1690000000.25,
     "camera": {"width": 640, "height": 480, "fx": 525, "fy": 525, "cx": 319.5, "cy": 239.5},
     "T_map_sensor": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]],
     "depth": {"encoding": "png16_mm", "bytes": 91234},
     "colour": {"encoding": "jpeg", "bytes": 45678}}

Where the colour camera differs from the depth camera, `colour` also has its `camera` and
`T_colour_depth`.
"""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, cast

import numpy as np

from fluentboard.errors import FluentboardError, InvalidFrame
from fluentboard.model.geometry import Transform
from fluentboard.model.interval import checked_time

MEDIA_TYPE = "application/vnd.fluentboard.frame"

ColourEncoding = Literal["jpeg", "png"]

_LENGTH = struct.Struct("<I")
_LONGEST_HEADER_BYTES = 64 * 1024
_SIGNATURES = {
    "png16_mm": b"\x89PNG\r\n\x1a\n",
    "png": b"\x89PNG\r\n\x1a\n",
    "jpeg": b"\xff\xd8\xff",
}
_HEADER_KEYS = frozenset({"stamp_s", "camera", "T_map_sensor", "depth", "colour"})
_COLOUR_KEYS = frozenset({"encoding", "bytes", "camera", "T_colour_depth"})
_CAMERA_KEYS = ("width", "height", "fx", "fy", "cx", "cy")


@dataclass(frozen=True, slots=True)
class PinholeJson:
    """A pinhole camera as the header gives it; all in pixels."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float

    def to_json(self) -> dict[str, float]:
        """The members of the JSON object."""
        return {name: getattr(self, name) for name in _CAMERA_KEYS}


@dataclass(frozen=True, slots=True)
class FrameMessage:
    """What the bytes say; the images stay encoded.

    Attributes:
        stamp_s: when the frame was taken, in seconds on the board's time axis.
        camera: the depth camera.
        T_map_sensor: takes points of the depth camera's optical frame to the map frame.
        depth: a 16-bit PNG of millimetres.
        colour: a JPEG or PNG, or None.
        colour_encoding: `jpeg` or `png`.
        colour_camera: where it differs from the depth camera.
        T_colour_depth: depth camera to colour camera coordinates, where they differ.

    Raises:
        InvalidFrame: an image is not in the encoding it is said to be in.
    """

    stamp_s: float
    camera: PinholeJson
    T_map_sensor: Transform
    depth: bytes
    colour: bytes | None = None
    colour_encoding: ColourEncoding = "jpeg"
    colour_camera: PinholeJson | None = None
    T_colour_depth: Transform | None = None

    def __post_init__(self) -> None:
        _check_image(self.depth, "png16_mm", "depth")
        if self.colour is not None:
            _check_image(self.colour, self.colour_encoding, "colour")


def pack_frame(message: FrameMessage) -> bytes:
    """The bytes of a frame."""
    header: dict[str, Any] = {
        "stamp_s": message.stamp_s,
        "camera": message.camera.to_json(),
        "T_map_sensor": message.T_map_sensor.matrix.tolist(),
        "depth": {"encoding": "png16_mm", "bytes": len(message.depth)},
    }
    if message.colour is not None:
        colour: dict[str, Any] = {
            "encoding": message.colour_encoding,
            "bytes": len(message.colour),
        }
        if message.colour_camera is not None:
            colour["camera"] = message.colour_camera.to_json()
        if message.T_colour_depth is not None:
            colour["T_colour_depth"] = message.T_colour_depth.matrix.tolist()
        header["colour"] = colour
    text = json.dumps(header, allow_nan=False).encode()
    return b"".join((_LENGTH.pack(len(text)), text, message.depth, message.colour or b""))


def unpack_frame(content: bytes) -> FrameMessage:
    """The frame that bytes stand for.

    Raises:
        InvalidFrame: they are truncated, or the header is not what it should be.
    """
    header, begins = _header(content)
    unknown = header.keys() - _HEADER_KEYS
    if unknown:
        raise InvalidFrame(
            f"the frame's header has the unknown key {min(unknown)!r}; keys are "
            f"{', '.join(sorted(_HEADER_KEYS))}"
        )
    depth = _object(header.get("depth"), "depth")
    if depth.get("encoding") != "png16_mm":
        raise InvalidFrame(
            f"the frame's depth has the encoding {depth.get('encoding')!r}; send png16_mm, a "
            "16-bit PNG of millimetres"
        )
    depth_end = begins + _size(depth, "depth")
    colour = header.get("colour")
    members: Mapping[str, Any] = {} if colour is None else _object(colour, "colour")
    if members.keys() - _COLOUR_KEYS or members.get("encoding", "png") not in ("jpeg", "png"):
        raise InvalidFrame(
            f"the frame's colour is {dict(members)!r}; give encoding (jpeg or png) and bytes, and "
            "where the camera differs camera and T_colour_depth"
        )
    end = depth_end + (0 if colour is None else _size(members, "colour"))
    if len(content) != end:
        raise InvalidFrame(
            f"the frame has {len(content)} bytes, its header promises {end}; it is truncated or "
            "the sizes in the header are wrong"
        )
    camera, T_colour_depth = members.get("camera"), members.get("T_colour_depth")
    try:
        stamp_s = checked_time(header.get("stamp_s"), "the frame's stamp_s")
    except FluentboardError as problem:
        raise InvalidFrame(problem.message) from problem
    if stamp_s is None:
        raise InvalidFrame("the frame's header has no stamp_s; give the seconds it was taken at")
    return FrameMessage(
        stamp_s=stamp_s,
        camera=_camera(header.get("camera"), "camera"),
        T_map_sensor=_transform(header.get("T_map_sensor"), "T_map_sensor"),
        depth=content[begins:depth_end],
        colour=None if colour is None else content[depth_end:end],
        colour_encoding="png" if members.get("encoding") == "png" else "jpeg",
        colour_camera=None if camera is None else _camera(camera, "colour.camera"),
        T_colour_depth=None
        if T_colour_depth is None
        else _transform(T_colour_depth, "colour.T_colour_depth"),
    )


def stamp_of(beginning: bytes) -> float:
    """The stamp of a frame of which only the beginning is at hand.

    Raises:
        InvalidFrame: the beginning does not hold the whole header.
    """
    header, _ = _header(beginning)
    stamp_s = header.get("stamp_s")
    if isinstance(stamp_s, bool) or not isinstance(stamp_s, int | float):
        raise InvalidFrame(f"the frame's stamp_s is {stamp_s!r}; give seconds")
    return float(stamp_s)


def longest_beginning_bytes() -> int:
    """As many bytes of a frame as hold any header."""
    return _LENGTH.size + _LONGEST_HEADER_BYTES


def _header(content: bytes) -> tuple[dict[str, Any], int]:
    if len(content) < _LENGTH.size:
        raise InvalidFrame(
            f"a frame of {len(content)} bytes; it begins with four bytes, the length of its header"
        )
    (length,) = _LENGTH.unpack_from(content)
    end = _LENGTH.size + length
    if length > _LONGEST_HEADER_BYTES or len(content) < end:
        raise InvalidFrame(
            f"the frame's header has {length} bytes by its first four, but only "
            f"{len(content) - _LENGTH.size} bytes follow (it may have {_LONGEST_HEADER_BYTES}); "
            "the frame is truncated, or does not begin with the length of its header"
        )
    try:
        header: Any = json.loads(content[_LENGTH.size : end])
    except (json.JSONDecodeError, UnicodeDecodeError) as problem:
        raise InvalidFrame(f"the frame's header is not JSON: {problem}") from problem
    if not isinstance(header, dict):
        raise InvalidFrame("the frame's header is no JSON object")
    return cast("dict[str, Any]", header), end


def _object(value: Any, name: str) -> Mapping[str, Any]:
    if not isinstance(value, dict):
        raise InvalidFrame(
            f"the frame's {name} is {value!r}; give an object with encoding and bytes"
        )
    return cast("dict[str, Any]", value)


def _size(members: Mapping[str, Any], name: str) -> int:
    size = members.get("bytes")
    if isinstance(size, bool) or not isinstance(size, int) or size < 0:
        raise InvalidFrame(f"the frame's {name}.bytes is {size!r}; give the length of the image")
    return size


def _camera(value: Any, name: str) -> PinholeJson:
    members = cast("dict[str, Any]", value) if isinstance(value, dict) else {}
    numbers = [members.get(key) for key in _CAMERA_KEYS]
    finite = [
        float(n)
        for n in numbers
        if isinstance(n, int | float) and not isinstance(n, bool) and math.isfinite(n)
    ]
    if members.keys() != set(_CAMERA_KEYS) or len(finite) != len(_CAMERA_KEYS):
        raise InvalidFrame(
            f"the frame's {name} is {value!r}; give {', '.join(_CAMERA_KEYS)} in pixels"
        )
    width, height, fx, fy, cx, cy = finite
    if min(width, height) < 1 or min(fx, fy) <= 0 or width % 1 or height % 1:
        raise InvalidFrame(f"the frame's {name} is {value!r}; sizes and focal lengths are positive")
    return PinholeJson(int(width), int(height), fx, fy, cx, cy)


def _transform(value: Any, name: str) -> Transform:
    try:
        return Transform(np.array(value, dtype=np.float64))
    except (FluentboardError, ValueError, TypeError) as problem:
        reason = problem.message if isinstance(problem, FluentboardError) else str(problem)
        raise InvalidFrame(f"the frame's {name} is no 4x4 rigid motion: {reason}") from problem


def _check_image(content: bytes, encoding: str, name: str) -> None:
    if not content.startswith(_SIGNATURES[encoding]):
        raise InvalidFrame(
            f"the frame's {name} does not begin like {encoding}; it begins {content[:8]!r}"
        )
