"""ROS messages as arrays: images raw and compressed, camera parameters, point clouds, transforms.

Messages are those of ROS 1 and ROS 2 alike; where the two name a field differently, both are taken.
"""

from __future__ import annotations

import struct
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from fluentboard.errors import FluentboardError, InvalidFrame
from fluentboard.model.geometry import FloatArray, Pose, Transform
from fluentboard_modules.frames.image_files import decode_colour, decode_u16, depth_in_m
from fluentboard_modules.frames.point_cloud import PointCloud, unpacked_rgb
from fluentboard_modules.frames.sensor_frame import Camera

IMAGE = "sensor_msgs/msg/Image"
COMPRESSED_IMAGE = "sensor_msgs/msg/CompressedImage"
CAMERA_INFO = "sensor_msgs/msg/CameraInfo"
POINT_CLOUD = "sensor_msgs/msg/PointCloud2"
TRANSFORMS = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")

_MILLIMETRES_PER_M = 1000.0
_MILLIMETRE_ENCODINGS = ("16UC1", "mono16")
_METRE_ENCODING = "32FC1"
_TO_RGB = {
    "bgr8": cv2.COLOR_BGR2RGB,
    "8UC3": cv2.COLOR_BGR2RGB,
    "rgba8": cv2.COLOR_RGBA2RGB,
    "bgra8": cv2.COLOR_BGRA2RGB,
    "mono8": cv2.COLOR_GRAY2RGB,
    "8UC1": cv2.COLOR_GRAY2RGB,
    # OpenCV names the second row's pattern where ROS names the first row's.
    "bayer_rggb8": cv2.COLOR_BayerBG2RGB,
    "bayer_bggr8": cv2.COLOR_BayerRG2RGB,
    "bayer_gbrg8": cv2.COLOR_BayerGR2RGB,
    "bayer_grbg8": cv2.COLOR_BayerGB2RGB,
    "yuv422": cv2.COLOR_YUV2RGB_UYVY,
    "uyvy": cv2.COLOR_YUV2RGB_UYVY,
    "yuv422_yuy2": cv2.COLOR_YUV2RGB_YUY2,
    "yuyv": cv2.COLOR_YUV2RGB_YUY2,
}
_CHANNELS = {"rgb8": 3, "bgr8": 3, "8UC3": 3, "rgba8": 4, "bgra8": 4} | dict.fromkeys(
    ("yuv422", "uyvy", "yuv422_yuy2", "yuyv"), 2
)
_COMPRESSED_DEPTH_HEADER = struct.Struct("<iff")
# sensor_msgs/PointField datatype 1 to 8.
_FIELD_TYPES = ("i1", "u1", "i2", "u2", "i4", "u4", "f4", "f8")


@dataclass(frozen=True, eq=False)
class CameraModel:
    """A camera as ROS describes it: a pinhole, and the lens in front of it.

    Attributes:
        camera: the pinhole of images without distortion.
        matrix: `(3, 3)`; of the raw images.
        distortion: `(n,)`; coefficients of the raw images, empty if they need no correction.
        frame: name of the optical frame.
        is_fisheye: the coefficients are those of the equidistant model.
    """

    camera: Camera
    matrix: FloatArray
    distortion: FloatArray
    frame: str
    is_fisheye: bool = False

    def rectified(self, image: NDArray[Any], *, is_depth: bool) -> NDArray[Any]:
        """The image as the pinhole alone would have taken it.

        Args:
            image: raw.
            is_depth: take the nearest pixel; depths on both sides of an edge do not mix.
        """
        if not self.distortion.size:
            return image
        size = (self.camera.width, self.camera.height)
        maps = (
            cv2.fisheye.initUndistortRectifyMap(
                self.matrix, self.distortion, np.eye(3), self.matrix, size, cv2.CV_32FC1
            )
            if self.is_fisheye
            else cv2.initUndistortRectifyMap(
                self.matrix, self.distortion, np.eye(3), self.matrix, size, cv2.CV_32FC1
            )
        )
        how = cv2.INTER_NEAREST if is_depth else cv2.INTER_LINEAR
        return cv2.remap(image, maps[0], maps[1], how)


def stamp_s(header: Any) -> float:
    """The stamp of a header in seconds; 0.0 if it was never set."""
    return header.stamp.sec + 1e-9 * header.stamp.nanosec


def transforms(message: Any) -> Iterator[tuple[str, str, float, Transform]]:
    """Parent, child, stamp and `T_parent_child` of a tf message; damaged ones are left out."""
    for stamped in message.transforms:
        moved, turned = stamped.transform.translation, stamped.transform.rotation
        quaternion = np.array([turned.x, turned.y, turned.z, turned.w])
        length = float(np.linalg.norm(quaternion))
        if not (np.isfinite(length) and length > 1e-6):
            continue
        qx, qy, qz, qw = quaternion / length
        try:
            pose = Pose(float(moved.x), float(moved.y), float(moved.z), qx, qy, qz, qw)
        except FluentboardError:
            continue  # NaN, as some trackers publish when they are lost
        parent, child = stamped.header.frame_id, stamped.child_frame_id
        yield parent, child, stamp_s(stamped.header), pose.to_transform()


def camera_model(message: Any, topic: str, *, is_rectified: bool) -> CameraModel:
    """The camera of a CameraInfo message.

    Args:
        message: the message.
        topic: names it in errors.
        is_rectified: of the images: rectified ones have the matrix P and no distortion.

    Raises:
        InvalidFrame: the camera was never calibrated.
    """
    matrix = np.array(getattr(message, "k", getattr(message, "K", None)), dtype=np.float64)
    projection = np.array(getattr(message, "p", getattr(message, "P", None)), dtype=np.float64)
    distortion = np.array(getattr(message, "d", getattr(message, "D", None)), dtype=np.float64)
    matrix, projection = matrix.reshape(3, 3), projection.reshape(3, 4)
    if is_rectified and projection[0, 0] > 0.0:
        matrix, distortion = projection[:, :3], np.zeros(0)
    if not (matrix[0, 0] > 0.0 and matrix[1, 1] > 0.0):
        raise InvalidFrame(
            f"{topic}: the camera is not calibrated (fx = {matrix[0, 0]}); calibrate it, or give "
            "another topic with info="
        )
    return CameraModel(
        Camera.from_matrix(int(message.width), int(message.height), matrix),
        matrix,
        distortion if np.any(distortion) else np.zeros(0),
        message.header.frame_id.removeprefix("/"),
        message.distortion_model in ("equidistant", "fisheye"),
    )


def scaled_camera(camera: Camera, width: int, height: int, where: str) -> Camera:
    """The camera for images of another size: binned or scaled ones of the same view.

    Raises:
        InvalidFrame: the image has other proportions, so it is not the whole view.
    """
    if (camera.width, camera.height) == (width, height):
        return camera
    along, across = width / camera.width, height / camera.height
    if abs(along - across) > 0.01 * along:
        raise InvalidFrame(
            f"{where}: images of {width} x {height} px, but its camera says {camera.width} x "
            f"{camera.height}; give the topic of its own camera parameters with info="
        )
    # Pixel centres are at whole numbers, so the corner of the image is at -0.5.
    return Camera(
        width,
        height,
        camera.fx * along,
        camera.fy * across,
        (camera.cx + 0.5) * along - 0.5,
        (camera.cy + 0.5) * across - 0.5,
    )


def is_depth_message(message: Any, topic: str) -> bool:
    """Whether an Image or CompressedImage holds depth."""
    encoding = getattr(message, "encoding", None)
    if encoding is None:
        return "compressedDepth" in message.format or topic.endswith("compressedDepth")
    return encoding in ("16UC1", _METRE_ENCODING) or (encoding == "mono16" and "depth" in topic)


def depth_m(message: Any, topic: str) -> NDArray[np.float32]:
    """`(h, w)` float32; the depth of an Image or CompressedImage in metres, 0 where unknown.

    Raises:
        InvalidFrame: the message is damaged or its encoding is not one of depth images.
    """
    if not hasattr(message, "encoding"):
        return _compressed_depth_m(message, topic)
    if message.encoding in _MILLIMETRE_ENCODINGS:
        return depth_in_m(_raw(message, topic, np.dtype("u2"), 1)[..., 0], _MILLIMETRES_PER_M)
    if message.encoding == _METRE_ENCODING:
        metres = _raw(message, topic, np.dtype("f4"), 1)[..., 0]
        return np.where(np.isfinite(metres) & (metres > 0.0), metres, np.float32(0.0))
    raise InvalidFrame(
        f"{topic}: encoding {message.encoding!r} is not one of depth images, which are 16UC1 "
        "(millimetres) and 32FC1 (metres)"
    )


def _compressed_depth_m(message: Any, topic: str) -> NDArray[np.float32]:
    content = np.asarray(message.data, dtype=np.uint8).tobytes()
    if "rvl" in message.format.lower():
        raise InvalidFrame(f"{topic}: RVL compression is not supported; record with format png")
    if len(content) <= _COMPRESSED_DEPTH_HEADER.size:
        raise InvalidFrame(f"{topic}: a compressed depth image of {len(content)} bytes is cut off")
    # Plain PNG, if the publisher was not compressed_depth_image_transport.
    if content.startswith(b"\x89PNG"):
        return depth_in_m(decode_u16(content, topic), _MILLIMETRES_PER_M)
    _, a, b = _COMPRESSED_DEPTH_HEADER.unpack_from(content)
    raw = decode_u16(content[_COMPRESSED_DEPTH_HEADER.size :], topic)
    if not message.format.startswith(_METRE_ENCODING):
        return depth_in_m(raw, _MILLIMETRES_PER_M)
    # Metres are stored as quantised inverse depth: depth = a / (value - b).
    metres = np.zeros(raw.shape, dtype=np.float32)
    known = raw > 0
    metres[known] = a / (raw[known].astype(np.float32) - np.float32(b))
    return np.where(np.isfinite(metres) & (metres > 0.0), metres, np.float32(0.0))


def colour(message: Any, topic: str) -> NDArray[np.uint8]:
    """`(h, w, 3)` uint8 RGB; the picture of an Image or CompressedImage.

    Raises:
        InvalidFrame: the message is damaged or its encoding is unknown.
    """
    encoding = getattr(message, "encoding", None)
    if encoding is None:
        return decode_colour(np.asarray(message.data, dtype=np.uint8).tobytes(), topic)
    if encoding != "rgb8" and encoding not in _TO_RGB:
        known = ", ".join(["rgb8", *_TO_RGB])
        raise InvalidFrame(f"{topic}: colour encoding {encoding!r} is unknown; known are {known}")
    pixels = _raw(message, topic, np.dtype("u1"), _CHANNELS.get(encoding, 1))
    if encoding == "rgb8":
        return np.ascontiguousarray(pixels)
    return cv2.cvtColor(np.ascontiguousarray(pixels), _TO_RGB[encoding])


def _raw(message: Any, topic: str, kind: np.dtype[Any], channels: int) -> NDArray[Any]:
    """`(h, w, channels)`; the pixels of an Image, without the padding of its rows."""
    content = np.asarray(message.data, dtype=np.uint8)
    row = int(message.width) * channels * kind.itemsize
    if message.step < row or content.size < message.step * (message.height - 1) + row:
        raise InvalidFrame(
            f"{topic}: {content.size} bytes for {message.height} rows of {message.step}, each with "
            f"{message.width} pixels of {channels * kind.itemsize} bytes; the message is truncated"
        )
    padded = np.zeros(message.step * message.height, dtype=np.uint8)
    size = min(content.size, padded.size)
    padded[:size] = content[:size]
    rows = np.ascontiguousarray(padded.reshape(message.height, message.step)[:, :row])
    pixels = rows.view(kind.newbyteorder(">" if message.is_bigendian else "<"))
    if sys.byteorder != ("big" if message.is_bigendian else "little"):
        pixels = pixels.astype(kind)
    return pixels.reshape(message.height, message.width, channels)


def point_cloud(message: Any, topic: str) -> PointCloud:
    """The points of a PointCloud2.

    Raises:
        InvalidFrame: the message is truncated or has no x, y and z.
    """
    width, height, step = int(message.width), int(message.height), int(message.point_step)
    content = np.asarray(message.data, dtype=np.uint8)
    if message.row_step < width * step or content.size < message.row_step * height:
        raise InvalidFrame(
            f"{topic}: {content.size} bytes for {height} rows of {width} points of {step} bytes; "
            "the message is truncated"
        )
    order = ">" if message.is_bigendian else "<"
    offsets = {
        f.name: (int(f.offset), order + _FIELD_TYPES[f.datatype - 1]) for f in message.fields
    }
    if not {"x", "y", "z"} <= offsets.keys():
        raise InvalidFrame(f"{topic}: a cloud without x, y and z; its fields are {list(offsets)}")
    rows = content[: message.row_step * height].reshape(height, message.row_step)
    points = np.ascontiguousarray(rows[:, : width * step]).reshape(width * height, step)

    def column(name: str) -> NDArray[Any]:
        offset, kind = offsets[name]
        size = np.dtype(kind).itemsize
        return np.ascontiguousarray(points[:, offset : offset + size]).view(kind)[:, 0]

    xyz = np.stack([column(axis).astype(np.float64) for axis in "xyz"], axis=-1)
    xyz[~np.isfinite(xyz).all(axis=1)] = np.nan
    packed = next((name for name in ("rgb", "rgba") if name in offsets), None)
    colours = None
    if packed is not None and np.dtype(offsets[packed][1]).itemsize == 4:
        colours = unpacked_rgb(column(packed).view(order + "u4").astype(np.uint32))
    return PointCloud(xyz, width, height, colours=colours)
