"""Bag: an open ROS bag and its messages; every kind of damage becomes InvalidFrame."""

from __future__ import annotations

import logging
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fluentboard.errors import FluentboardError, InvalidFrame, MissingExtra
from fluentboard_modules.frames.ros_messages import TRANSFORMS, stamp_s, transforms
from fluentboard_modules.frames.ros_topics import Topic
from fluentboard_modules.frames.ros_transforms import TransformTree

if TYPE_CHECKING:
    from rosbags.highlevel import AnyReader


logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class StampedMessage:
    """A message: what it says, of which time it speaks, and when it was written down."""

    topic: str
    content: Any
    stamp_s: float
    written_s: float


class Bag:
    """An open bag."""

    def __init__(self, path: Path, reader: AnyReader) -> None:
        self._path = path
        self._reader = reader
        self.topics = [
            Topic(name, info.msgtype or "several types", info.msgcount)
            for name, info in reader.topics.items()
        ]
        self.start_s = 1e-9 * reader.start_time
        self.end_s = 1e-9 * reader.end_time

    def messages(self, names: list[str]) -> Iterator[StampedMessage]:
        """The messages of some topics, in the order in which they were written."""
        connections = [c for c in self._reader.connections if c.topic in names]
        if not connections:
            return
        found = self._reader.messages(connections=connections)
        while True:
            with _named(self._path):
                entry = next(found, None)
                if entry is None:
                    return
            connection, written_ns, content = entry
            written_s = 1e-9 * written_ns
            try:
                with _named(self._path):
                    message: Any = self._reader.deserialize(content, connection.msgtype)
            except InvalidFrame as error:
                logger.warning(
                    "%s: a message of %s at %.3f s is skipped: %s",
                    self._path,
                    connection.topic,
                    written_s,
                    error.message,
                )
                continue
            header = getattr(message, "header", None)
            stamp = stamp_s(header) if header is not None else 0.0
            yield StampedMessage(connection.topic, message, stamp or written_s, written_s)

    def first(self, topic: Topic) -> Any:
        """The first message of a topic."""
        for found in self.messages([topic.name]):
            return found.content
        raise InvalidFrame(f"{self._path}: topic {topic.name} has no message")

    def transforms(self) -> TransformTree:
        """All recorded transforms."""
        tree = TransformTree()
        names = [topic.name for topic in self.topics if topic.message_type in TRANSFORMS]
        for found in self.messages(names):
            for parent, child, stamp, T_parent_child in transforms(found.content):
                is_static = found.topic.endswith("static")
                tree.add(
                    parent, child, stamp or found.written_s, T_parent_child, is_static=is_static
                )
        return tree


@contextmanager
def opened_bag(path: Path) -> Generator[Bag]:
    """The bag at a path while the block runs.

    Raises:
        InvalidFrame: it cannot be read.
        MissingExtra: the library that reads bags is not installed.
    """
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ModuleNotFoundError as problem:
        raise MissingExtra(
            "reading ROS bags needs the extra 'mapping' (rosbags is missing); install it with: "
            "pip install 'fluentboard[mapping]'"
        ) from problem
    # Bags before ROS 2 Iron do not say what their messages look like; these have not changed since.
    with _named(path):
        reader = AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE))
        reader.open()
    try:
        with _named(path):
            bag = Bag(path, reader)
        yield bag
    finally:
        reader.close()


@contextmanager
def _named(path: Path) -> Generator[None]:
    """Names the bag in whatever the library raises about it."""
    try:
        yield
    except FluentboardError:
        raise
    except Exception as problem:
        # Damage shows as anything from a SerdeError to a struct.error or an error of SQLite.
        hint = "; try `rosbag reindex`" if path.suffix == ".bag" else ""
        raise InvalidFrame(
            f"{path}: the bag cannot be read ({type(problem).__name__}: {problem}){hint}"
        ) from problem
