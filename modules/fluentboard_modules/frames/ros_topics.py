"""Which topics of a bag to look at: depth, the colour that goes with it, and their cameras."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from fluentboard.errors import InvalidFrame
from fluentboard_modules.frames.ros_messages import (
    CAMERA_INFO,
    COMPRESSED_IMAGE,
    IMAGE,
    POINT_CLOUD,
    is_depth_message,
)

_TRANSPORTS = ("compressedDepth", "compressed")
# Depth that is aligned with colour needs no second camera, so it comes first.
_ALIGNED = ("aligned_depth", "depth_registered", "registered")
_INFRARED = ("infra", "/ir/", "/ir_", "/nir")


@dataclass(frozen=True)
class Topic:
    """A topic of a bag.

    Attributes:
        name: such as `/camera/depth/image_raw`.
        message_type: such as `sensor_msgs/msg/Image`.
        count: of its messages.
        first: its first message, where it had to be looked at.
    """

    name: str
    message_type: str
    count: int
    first: Any = None


@dataclass(frozen=True)
class ChosenTopics:
    """What to read; one of `depth` and `cloud` is None.

    Attributes:
        depth: depth images.
        colour: colour images.
        cloud: point clouds, where there is no depth image.
        depth_info: parameters of the depth camera.
        colour_info: parameters of the colour camera.
    """

    depth: Topic | None
    colour: Topic | None
    cloud: Topic | None
    depth_info: Topic | None
    colour_info: Topic | None


def choose_topics(
    topics: Sequence[Topic],
    options: Mapping[str, str],
    first_message: Callable[[Topic], Any],
    where: str,
) -> ChosenTopics:
    """The topics to read.

    Args:
        topics: of the bag.
        options: topics that the user named, under depth, colour, cloud, info and colour_info.
        first_message: reads a topic's first message.
        where: names the bag in errors.

    Raises:
        InvalidFrame: a named topic is not there, or there is neither depth nor a point cloud.
    """
    by_name = {topic.name: topic for topic in topics if topic.count}

    def named(option: str, *types: str) -> Topic | None:
        name = options.get(option)
        if name is None:
            return None
        topic = by_name.get(name)
        if topic is None or topic.message_type not in types:
            raise InvalidFrame(
                f"{where}: no topic {name!r} for {option}=; topics are {_listed(topics)}"
            )
        return Topic(topic.name, topic.message_type, topic.count, first_message(topic))

    cloud = named("cloud", POINT_CLOUD)
    depth = named("depth", IMAGE, COMPRESSED_IMAGE)
    colour = named("colour", IMAGE, COMPRESSED_IMAGE)
    images = [
        Topic(topic.name, topic.message_type, topic.count, first_message(topic))
        for topic in by_name.values()
        if topic.message_type in (IMAGE, COMPRESSED_IMAGE)
    ]
    if cloud is None and depth is None:
        depths = [topic for topic in images if is_depth_message(topic.first, topic.name)]
        depth = min(depths, key=_depth_rank, default=None)
    if cloud is None and depth is None:
        clouds = [t for t in by_name.values() if t.message_type == POINT_CLOUD]
        best = max(clouds, key=lambda topic: (topic.count, topic.name), default=None)
        if best is None:
            raise InvalidFrame(
                f"{where}: neither depth images nor point clouds in it; topics are "
                f"{_listed(topics)}"
            )
        cloud = Topic(best.name, best.message_type, best.count, first_message(best))
    if depth is None:
        return ChosenTopics(None, None, cloud, None, None)
    if colour is None:
        colours = [topic for topic in images if not is_depth_message(topic.first, topic.name)]
        colour = min(colours, key=lambda topic: _colour_rank(topic, depth), default=None)
    infos = [topic for topic in by_name.values() if topic.message_type == CAMERA_INFO]
    return ChosenTopics(
        depth=depth,
        colour=colour,
        cloud=None,
        depth_info=named("info", CAMERA_INFO) or info_of(depth, infos, first_message),
        colour_info=named("colour_info", CAMERA_INFO)
        or (info_of(colour, infos, first_message) if colour is not None else None),
    )


def info_of(
    image: Topic, infos: Sequence[Topic], first_message: Callable[[Topic], Any]
) -> Topic | None:
    """The camera parameters that belong to an image topic: beside it, or of the same frame."""
    found = [Topic(i.name, i.message_type, i.count, first_message(i)) for i in infos]
    beside = f"{plain_name(image.name).rpartition('/')[0]}/camera_info"
    for info in found:
        if info.name == beside:
            return info
    frame = image.first.header.frame_id
    width, height = getattr(image.first, "width", None), getattr(image.first, "height", None)
    for info in found:
        size_agrees = width is None or (info.first.width, info.first.height) == (width, height)
        if info.first.header.frame_id == frame and size_agrees:
            return info
    return None


def plain_name(name: str) -> str:
    """The name of an image topic without that of its compression."""
    head, _, tail = name.rpartition("/")
    return head if tail in _TRANSPORTS else name


def is_rectified(name: str) -> bool:
    """The images were freed from the lens's distortion, which their names tell by convention."""
    tail = plain_name(name).rpartition("/")[2]
    return "rect" in tail or "registered" in plain_name(name)


def _depth_rank(topic: Topic) -> tuple[bool, bool, int, str]:
    is_aligned = any(word in topic.name for word in _ALIGNED)
    return not is_aligned, topic.message_type == COMPRESSED_IMAGE, -topic.count, topic.name


def _colour_rank(topic: Topic, depth: Topic) -> tuple[bool, bool, int, bool, str]:
    is_infrared = any(word in topic.name for word in _INFRARED)
    shared = sum(
        1 for a, b in zip(topic.name.split("/"), depth.name.split("/"), strict=False) if a == b
    )
    is_grey = getattr(topic.first, "encoding", "") in ("mono8", "8UC1")
    is_compressed = topic.message_type == COMPRESSED_IMAGE
    return is_infrared, is_grey, -shared, is_compressed, topic.name


def _listed(topics: Sequence[Topic]) -> str:
    lines = sorted(f"{t.name} ({t.message_type}, {t.count} messages)" for t in topics)
    return "; ".join(lines) or "none at all"
