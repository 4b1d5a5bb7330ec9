"""Write frames as a ROS bag: ROS 1 .bag, or ROS 2 with SQLite or MCAP storage.

Topics as drivers name them: /camera/depth/image_rect_raw (16UC1), /camera/color/image_raw (rgb8),
camera_info beside both, /tf from `map` to the camera and /tf_static between the cameras.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from fluentboard.errors import InvalidInput, MissingExtra
from fluentboard.model.geometry import Pose, Transform
from fluentboard_modules.frames.sensor_frame import Camera, FrameSource, SensorFrame

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

Progress = Callable[[int, int], None]
"""Called with the number of frames written and the number of all frames."""

Kind = Literal["bag", "mcap", "sqlite3"]

DEPTH_TOPIC = "/camera/depth/image_rect_raw"
COLOUR_TOPIC = "/camera/color/image_raw"
_MAP, _DEPTH_FRAME, _COLOUR_FRAME = (
    "map",
    "camera_depth_optical_frame",
    "camera_color_optical_frame",
)
_TRANSFORM_TYPE = "tf2_msgs/msg/TFMessage"


def write_bag(source: FrameSource, path: Path, kind: Kind, progress: Progress | None = None) -> int:
    """Writes the frames of a source to a bag; returns how many.

    Args:
        source: frames placed in a map frame.
        path: a file for ROS 1, a folder for ROS 2; must not exist.
        kind: `bag` is ROS 1; `mcap` and `sqlite3` are ROS 2.
        progress: called after every frame.

    Raises:
        InvalidInput: there is something at the path already.
        MissingExtra: the library that writes bags is not installed.
    """
    if path.exists():
        raise InvalidInput(f"{path} exists already; choose another name")
    number = 0
    with _recorder(path, kind) as bag:
        for number, frame in enumerate(source, start=1):
            if number == 1:
                bag.write_static(frame)
            bag.write(frame)
            if progress is not None:
                progress(number, len(source))
    return number


@contextmanager
def _recorder(path: Path, kind: Kind) -> Generator[_Recorder]:
    try:
        from rosbags.rosbag1 import Writer as Writer1
        from rosbags.rosbag2 import StoragePlugin
        from rosbags.rosbag2 import Writer as Writer2
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore
    except ModuleNotFoundError as problem:
        raise MissingExtra(
            "writing ROS bags needs the extra 'mapping' (rosbags is missing); install it with: "
            "pip install 'fluentboard[mapping]'"
        ) from problem
    path.parent.mkdir(parents=True, exist_ok=True)
    with ExitStack() as stack:
        if kind == "bag":
            store = get_typestore(Stores.ROS1_NOETIC)
            transforms = "geometry_msgs/TransformStamped[] transforms"
            store.register(get_types_from_msg(transforms, _TRANSFORM_TYPE))
            writer: Any = stack.enter_context(Writer1(path))
        else:
            store = get_typestore(Stores.ROS2_HUMBLE)
            plugin = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
            writer = stack.enter_context(Writer2(path, version=9, storage_plugin=plugin))
        yield _Recorder(writer, store, is_ros1=kind == "bag")


class _Recorder:
    """An open bag that takes frames."""

    def __init__(self, writer: Any, store: Typestore, *, is_ros1: bool) -> None:
        self._writer = writer
        self._store = store
        self._is_ros1 = is_ros1
        self._connections: dict[str, Any] = {}

    def write_static(self, frame: SensorFrame) -> None:
        """Where the cameras are on the robot."""
        if frame.T_colour_depth is not None:
            transform = self._transform(
                _DEPTH_FRAME, _COLOUR_FRAME, frame.stamp_s, frame.T_colour_depth.inverse()
            )
            self._put("/tf_static", _TRANSFORM_TYPE, frame.stamp_s, transforms=[transform])

    def write(self, frame: SensorFrame) -> None:
        """Pose, cameras and images of a frame."""
        stamp = frame.stamp_s
        transform = self._transform(_MAP, _DEPTH_FRAME, stamp, frame.T_map_sensor)
        self._put("/tf", _TRANSFORM_TYPE, stamp, transforms=[transform])
        self._put_camera(DEPTH_TOPIC, frame.camera, stamp, _DEPTH_FRAME)
        millimetres = np.rint(np.nan_to_num(frame.depth_m) * np.float32(1000.0))
        millimetres[(millimetres < 0) | (millimetres >= np.iinfo(np.uint16).max)] = 0
        self._put_image(DEPTH_TOPIC, millimetres.astype("<u2"), "16UC1", stamp, _DEPTH_FRAME)
        if frame.colour is not None:
            frame_id = _DEPTH_FRAME if frame.T_colour_depth is None else _COLOUR_FRAME
            self._put_camera(COLOUR_TOPIC, frame.colour_camera or frame.camera, stamp, frame_id)
            self._put_image(COLOUR_TOPIC, frame.colour, "rgb8", stamp, frame_id)

    def _put_image(
        self, topic: str, image: NDArray[Any], encoding: str, stamp_s: float, frame_id: str
    ) -> None:
        self._put(
            topic,
            "sensor_msgs/msg/Image",
            stamp_s,
            header=self._header(stamp_s, frame_id),
            height=image.shape[0],
            width=image.shape[1],
            encoding=encoding,
            is_bigendian=0,
            step=image[0].nbytes,
            data=np.ascontiguousarray(image).view(np.uint8).reshape(-1),
        )

    def _put_camera(self, topic: str, camera: Camera, stamp_s: float, frame_id: str) -> None:
        matrix = np.array([camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1.0])
        projection = np.array(
            [camera.fx, 0, camera.cx, 0, 0, camera.fy, camera.cy, 0, 0, 0, 1.0, 0]
        )
        values = {"d": np.zeros(5), "k": matrix, "r": np.eye(3).reshape(-1), "p": projection}
        region = self._store.types["sensor_msgs/msg/RegionOfInterest"]
        self._put(
            topic.rpartition("/")[0] + "/camera_info",
            "sensor_msgs/msg/CameraInfo",
            stamp_s,
            header=self._header(stamp_s, frame_id),
            height=camera.height,
            width=camera.width,
            distortion_model="plumb_bob",
            **({name.upper(): v for name, v in values.items()} if self._is_ros1 else values),
            binning_x=0,
            binning_y=0,
            roi=region(x_offset=0, y_offset=0, height=0, width=0, do_rectify=False),
        )

    def _transform(self, parent: str, child: str, stamp_s: float, pose: Transform) -> Any:
        types, at = self._store.types, Pose.from_transform(pose)
        return types["geometry_msgs/msg/TransformStamped"](
            header=self._header(stamp_s, parent),
            child_frame_id=child,
            transform=types["geometry_msgs/msg/Transform"](
                translation=types["geometry_msgs/msg/Vector3"](x=at.x, y=at.y, z=at.z),
                rotation=types["geometry_msgs/msg/Quaternion"](x=at.qx, y=at.qy, z=at.qz, w=at.qw),
            ),
        )

    def _header(self, stamp_s: float, frame_id: str) -> Any:
        nanoseconds = round(stamp_s * 1e9)
        time = self._store.types["builtin_interfaces/msg/Time"](
            sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9
        )
        more = {"seq": 0} if self._is_ros1 else {}
        return self._store.types["std_msgs/msg/Header"](stamp=time, frame_id=frame_id, **more)

    def _put(self, topic: str, message_type: str, stamp_s: float, **fields: Any) -> None:
        if topic not in self._connections:
            self._connections[topic] = self._writer.add_connection(
                topic, message_type, typestore=self._store
            )
        message = self._store.types[message_type](**fields)
        content = (
            self._store.serialize_ros1(message, message_type)
            if self._is_ros1
            else self._store.serialize_cdr(message, message_type)
        )
        self._writer.write(self._connections[topic], round(stamp_s * 1e9), content)
