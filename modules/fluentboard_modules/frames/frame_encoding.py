"""Sensor frames to the messages in which they travel, and back."""

from __future__ import annotations

from fluentboard.model.frame_message import ColourEncoding, FrameMessage, PinholeJson
from fluentboard_modules.frames.image_files import (
    decode_colour,
    decode_depth_m,
    encode_colour,
    encode_depth_mm,
)
from fluentboard_modules.frames.sensor_frame import Camera, SensorFrame

_MILLIMETRES_PER_M = 1000.0
_ENDINGS: dict[ColourEncoding, str] = {"jpeg": ".jpg", "png": ".png"}


def message_of(frame: SensorFrame, colour_encoding: ColourEncoding = "jpeg") -> FrameMessage:
    """The frame with its images encoded; depth to the millimetre, labels left out.

    Args:
        frame: any frame.
        colour_encoding: `jpeg` is small, `png` exact.
    """
    return FrameMessage(
        stamp_s=frame.stamp_s,
        camera=_pinhole(frame.camera),
        T_map_sensor=frame.T_map_sensor,
        depth=encode_depth_mm(frame.depth_m),
        colour=None
        if frame.colour is None
        else encode_colour(frame.colour, _ENDINGS[colour_encoding]),
        colour_encoding=colour_encoding,
        colour_camera=None if frame.colour_camera is None else _pinhole(frame.colour_camera),
        T_colour_depth=frame.T_colour_depth,
    )


def frame_of(message: FrameMessage, sensor: str, index: int) -> SensorFrame:
    """The frame in a message.

    Args:
        message: as it came from the board.
        sensor: which sent it.
        index: its number.

    Raises:
        InvalidFrame: an image is damaged, or not of the camera's size.
    """
    where = f"frame {index} of {sensor}"
    return SensorFrame(
        depth_m=decode_depth_m(message.depth, f"{where}, depth", _MILLIMETRES_PER_M),
        camera=_camera(message.camera),
        stamp_s=message.stamp_s,
        T_map_sensor=message.T_map_sensor,
        colour=None
        if message.colour is None
        else decode_colour(message.colour, f"{where}, colour"),
        colour_camera=None if message.colour_camera is None else _camera(message.colour_camera),
        T_colour_depth=message.T_colour_depth,
        sensor=sensor,
        index=index,
    )


def _pinhole(camera: Camera) -> PinholeJson:
    return PinholeJson(camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy)


def _camera(pinhole: PinholeJson) -> Camera:
    return Camera(pinhole.width, pinhole.height, pinhole.fx, pinhole.fy, pinhole.cx, pinhole.cy)
