"""ROS bags as recordings: ROS 1 .bag, ROS 2 folders, .db3 and .mcap, without an installed ROS.

Depth images (or else point clouds) become frames; each is placed by the recorded transforms at its
stamp and gets the colour image nearest in time.
"""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fluentboard.errors import FluentboardError, InvalidFrame
from fluentboard.model.geometry import FloatArray, Transform
from fluentboard_modules.frames.bag_files import Bag, StampedMessage, opened_bag
from fluentboard_modules.frames.cloud_views import BODY, OPTICAL, frame_of_cloud, view_cloud
from fluentboard_modules.frames.folder_recording import board_shift_s
from fluentboard_modules.frames.ros_messages import (
    CameraModel,
    camera_model,
    colour,
    depth_m,
    point_cloud,
    scaled_camera,
    stamp_s,
)
from fluentboard_modules.frames.ros_topics import ChosenTopics, Topic, choose_topics, is_rectified
from fluentboard_modules.frames.ros_transforms import TransformTree, frame_name
from fluentboard_modules.frames.sensor_frame import Camera, SensorFrame
from fluentboard_modules.frames.stamped_lists import ASSOCIATION_TOLERANCE_S
from fluentboard_modules.frames.upright import guess_gravity, is_z_up

logger = logging.getLogger(__name__)

# How long after a depth image its colour image may be written to the bag.
_COLOUR_WAIT_S = 0.3
_POSES_LOOKED_AT = 20
_FRAMES_LOOKED_AT = 3


@dataclass(frozen=True, eq=False)
class BagRecording:
    """A `Recording` in a ROS bag, read from its beginning each time it is iterated.

    Attributes:
        path: file or folder.
        topics: what is read.
        tree: the recorded transforms.
        world_frame: the frame whose coordinates are the recording's world frame.
        sensor_frame: the frame of the depth camera or scanner.
        depth_model: the depth camera; None for point clouds.
        colour_model: the colour camera, where there is one.
        shift_s: added to recorded stamps.
        step: only every step-th frame is given.
        gravity_world: `(3,)` unit vector along which things fall, or None for a world with z up.
        T_map_world: takes the recording's world frame to the map frame.
    """

    path: Path
    topics: ChosenTopics
    tree: TransformTree
    world_frame: str
    sensor_frame: str
    depth_model: CameraModel | None
    colour_model: CameraModel | None
    shift_s: float
    step: int = 1
    gravity_world: FloatArray | None = None
    T_map_world: Transform = Transform.identity()  # noqa: RUF009 - immutable

    @property
    def name(self) -> str:
        """What to call the recording in messages."""
        return str(self.path)

    def __len__(self) -> int:
        return -(-self._main.count // self.step)

    def __iter__(self) -> Iterator[SensorFrame]:
        with opened_bag(self.path) as bag:
            index = -1
            messages = self._associated(bag)
            while True:
                try:
                    index, message, picture = next(messages)
                except StopIteration:
                    return
                except InvalidFrame as error:
                    if index < 0:
                        raise
                    logger.error("%s: ends after frame %d: %s", self.name, index, error.message)
                    return
                try:
                    frame = self._frame(index, message, picture)
                except FluentboardError as error:
                    logger.warning("%s: frame %d skipped: %s", self.name, index, error.message)
                    continue
                yield frame

    def in_map(self, T_map_world: Transform) -> BagRecording:
        """The same recording with its frames placed in another map frame."""
        return replace(self, T_map_world=T_map_world)

    def every(self, step: int) -> BagRecording:
        """The same recording with only every step-th frame."""
        return replace(self, step=self.step * step)

    @property
    def _main(self) -> Topic:
        main = self.topics.depth or self.topics.cloud
        assert main is not None
        return main

    def _associated(self, bag: Bag) -> Iterator[tuple[int, StampedMessage, StampedMessage | None]]:
        """Depth messages in order, each with the colour message nearest in time."""
        wanted = [self._main.name]
        if self.topics.colour is not None:
            wanted.append(self.topics.colour.name)
        waiting: deque[tuple[int, StampedMessage]] = deque()
        pictures: deque[StampedMessage] = deque()
        index = -1
        for found in bag.messages(wanted):
            if found.topic != self._main.name:
                pictures.append(found)
            else:
                index += 1
                if index % self.step == 0:
                    waiting.append((index, found))
            while waiting and (
                self.topics.colour is None
                or (pictures and pictures[-1].stamp_s >= waiting[0][1].stamp_s)
                or found.written_s > waiting[0][1].written_s + _COLOUR_WAIT_S
            ):
                number, message = waiting.popleft()
                yield number, message, _nearest(pictures, message.stamp_s)
            oldest_s = (waiting[0][1] if waiting else found).stamp_s
            while pictures and pictures[0].stamp_s < oldest_s - _COLOUR_WAIT_S:
                pictures.popleft()
        for number, message in waiting:
            yield number, message, _nearest(pictures, message.stamp_s)

    def _frame(
        self, index: int, message: StampedMessage, picture: StampedMessage | None
    ) -> SensorFrame:
        T_world_sensor = Transform.identity()
        if self.world_frame != self.sensor_frame:
            T_world_sensor = self.tree.lookup(self.world_frame, self.sensor_frame, message.stamp_s)
        T_map_sensor = self.T_map_world @ T_world_sensor
        if self.depth_model is None:
            return self._cloud_frame(index, message, T_map_sensor)
        depth = depth_m(message.content, message.topic)
        height, width = depth.shape
        camera = scaled_camera(self.depth_model.camera, width, height, message.topic)
        if camera == self.depth_model.camera:
            depth = self.depth_model.rectified(depth, is_depth=True)
        pixels, colour_camera, T_colour_depth = None, None, None
        if picture is not None:
            pixels, colour_camera, T_colour_depth = self._picture(picture, camera)
        return SensorFrame(
            depth_m=depth,
            camera=camera,
            stamp_s=message.stamp_s + self.shift_s,
            T_map_sensor=T_map_sensor,
            colour=pixels,
            colour_camera=colour_camera,
            T_colour_depth=T_colour_depth,
            sensor=self.sensor_frame or self._main.name,
            index=index,
        )

    def _picture(
        self, picture: StampedMessage, depth_camera: Camera
    ) -> tuple[NDArray[np.uint8], Camera | None, Transform | None]:
        pixels = colour(picture.content, picture.topic)
        model = self.colour_model
        height, width = pixels.shape[:2]
        if model is None:  # registered, or nobody knows better
            if (width, height) == (depth_camera.width, depth_camera.height):
                return pixels, None, None
            return pixels, scaled_camera(depth_camera, width, height, picture.topic), None
        camera = scaled_camera(model.camera, width, height, picture.topic)
        if camera == model.camera:
            pixels = model.rectified(pixels, is_depth=False)
        if model.frame == self.sensor_frame:
            return pixels, None if camera == depth_camera else camera, None
        try:
            return pixels, camera, self.tree.lookup(model.frame, self.sensor_frame, picture.stamp_s)
        except InvalidFrame:
            return pixels, camera, None  # said once, when the bag was opened

    def _cloud_frame(
        self, index: int, message: StampedMessage, T_map_sensor: Transform
    ) -> SensorFrame:
        cloud = point_cloud(message.content, message.topic)
        view = view_cloud(
            cloud,
            f"{self.name}, {message.topic}",
            fallback=OPTICAL if "optical" in self.sensor_frame else BODY,
            level=logging.DEBUG if index else logging.WARNING,
        )
        stamp = message.stamp_s + self.shift_s
        return frame_of_cloud(cloud, view, T_map_sensor, stamp, self.sensor_frame, index)


def open_bag(
    path: str | Path,
    *,
    start_s: float | None = None,
    options: Mapping[str, str] | None = None,
) -> BagRecording:
    """The recording in a bag.

    Args:
        path: a `.bag`, `.db3` or `.mcap` file, or the folder of a ROS 2 bag.
        start_s: stamp of the first frame on the board's time axis; by default the recorded one.
        options: topics by `depth`, `colour`, `cloud`, `info` and `colour_info`, and the fixed frame
            by `map`; what is missing is chosen by looking at the bag.

    Raises:
        InvalidFrame: the bag is damaged, or has no depth, no camera, or no such topic.
        MissingExtra: the library that reads bags is not installed.
    """
    path = Path(path)
    options = options or {}
    with opened_bag(path) as bag:
        topics = choose_topics(bag.topics, options, bag.first, str(path))
        tree = bag.transforms()
        main = topics.depth or topics.cloud
        assert main is not None
        first_s = stamp_s(main.first.header) or bag.start_s
        last_s = bag.end_s
    sensor_frame = frame_name(main.first.header.frame_id)
    depth_model, colour_model = _models(path, topics)
    world_frame = _world_frame(path, tree, sensor_frame, options.get("map"))
    logger.info(
        "%s: depth from %s, colour from %s, poses of %r in %r",
        path,
        main.name,
        topics.colour.name if topics.colour is not None else "nowhere",
        sensor_frame,
        world_frame,
    )
    recording = BagRecording(
        path=path,
        topics=topics,
        tree=tree,
        world_frame=world_frame,
        sensor_frame=sensor_frame,
        depth_model=depth_model,
        colour_model=colour_model,
        shift_s=board_shift_s(first_s, start_s),
    )
    _check_colour(recording, first_s)
    return _with_gravity(recording, first_s, last_s)


def _nearest(pictures: deque[StampedMessage], stamp: float) -> StampedMessage | None:
    best = min(pictures, key=lambda picture: abs(picture.stamp_s - stamp), default=None)
    if best is None or abs(best.stamp_s - stamp) > ASSOCIATION_TOLERANCE_S:
        return None
    return best


def _models(path: Path, topics: ChosenTopics) -> tuple[CameraModel | None, CameraModel | None]:
    depth, pictures = topics.depth, topics.colour
    if depth is None:
        return None, None
    info = topics.depth_info
    if info is None:
        raise InvalidFrame(
            f"{path}: no camera parameters for {depth.name}: no CameraInfo beside it or of its "
            "frame; name their topic with info="
        )
    depth_model = camera_model(info.first, info.name, is_rectified=is_rectified(depth.name))
    if pictures is None or topics.colour_info is None:
        return depth_model, None
    info = topics.colour_info
    return depth_model, camera_model(
        info.first, info.name, is_rectified=is_rectified(pictures.name)
    )


def _world_frame(path: Path, tree: TransformTree, sensor_frame: str, wanted: str | None) -> str:
    if wanted is not None:
        if frame_name(wanted) not in tree.frames:
            raise InvalidFrame(
                f"{path}: no frame {wanted!r} for map=; frames are "
                f"{', '.join(tree.frames) or 'none'}"
            )
        return frame_name(wanted)
    if sensor_frame not in tree.frames:
        logger.warning(
            "%s: no transform places %r (frames are %s); all frames get the same pose",
            path,
            sensor_frame,
            ", ".join(tree.frames) or "none",
        )
        return sensor_frame
    if not tree.moves(sensor_frame):
        logger.warning("%s: nothing moves %r; all frames get the same pose", path, sensor_frame)
    return tree.fixed_frame(sensor_frame)


def _check_colour(recording: BagRecording, first_s: float) -> None:
    model = recording.colour_model
    if model is None or model.frame == recording.sensor_frame:
        return
    try:
        recording.tree.lookup(model.frame, recording.sensor_frame, first_s)
    except InvalidFrame as error:
        logger.warning(
            "%s: how the colour camera lies to the depth camera is not recorded (%s); colour is "
            "off by the distance between them",
            recording.path,
            error.message,
        )


def _with_gravity(recording: BagRecording, first_s: float, last_s: float) -> BagRecording:
    """The recording with a guessed gravity, if its world frame cannot have z up."""
    turn = Transform.identity()
    if recording.depth_model is None and "optical" not in recording.sensor_frame:
        turn = BODY
    poses: list[Transform] = []
    for stamp in np.linspace(first_s, max(first_s, last_s), _POSES_LOOKED_AT):
        try:
            poses.append(
                recording.tree.lookup(recording.world_frame, recording.sensor_frame, float(stamp))
                @ turn
            )
        except InvalidFrame:
            continue  # the frame itself will say so when it is read
    if recording.world_frame == recording.sensor_frame:
        poses = [turn]
    if not poses or is_z_up(poses):
        return recording
    frames: list[SensorFrame] = []
    for frame in recording:
        frames.append(frame)
        if len(frames) == _FRAMES_LOOKED_AT:
            break
    if not frames:
        return recording
    gravity = guess_gravity(frames, np.random.default_rng(0))
    logger.warning(
        "%s: z is not up in %r; gravity guessed from the planes in view: %s. Give the measured "
        "vector with --gravity, or the name of an upright frame with map=",
        recording.path,
        recording.world_frame,
        np.array2string(gravity, precision=3),
    )
    return replace(recording, gravity_world=gravity)
