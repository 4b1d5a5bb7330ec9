"""FrameRing: the last frames of every sensor, on disk; what does not fit pushes out the oldest.

Memory holds the number and size of each frame only. A frame is a file that appears whole or not at
all. Nothing is synced: after a power failure the last frames may be missing, which is no loss to a
sensor that sends the next one.
"""

from __future__ import annotations

import contextlib
import logging
import os
import re
import threading
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from fluentboard.board.frame_settings import FrameSettings
from fluentboard.errors import (
    FluentboardError,
    InvalidName,
    StorageFailed,
    TooLarge,
    UnknownResource,
)
from fluentboard.model.frame_message import longest_beginning_bytes, stamp_of, unpack_frame

logger = logging.getLogger(__name__)

_SENSOR = re.compile(r"(?!\.)[A-Za-z0-9_.-]{1,64}")
_FILE = re.compile(r"(\d{12,})\.frame")


@dataclass(frozen=True, slots=True)
class KeptFrame:
    """A frame in the ring.

    Attributes:
        sensor: which sent it.
        index: number among all frames of the sensor, from 0 on, also across restarts.
        stamp_s: when it was taken, in seconds.
        size_bytes: of its message.
    """

    sensor: str
    index: int
    stamp_s: float
    size_bytes: int


@dataclass(frozen=True, slots=True)
class SensorState:
    """What is kept of a sensor.

    Attributes:
        sensor: its name.
        oldest: the first frame kept.
        newest: the last frame it sent.
        frames: how many are kept.
        size_bytes: of all of them.
    """

    sensor: str
    oldest: KeptFrame
    newest: KeptFrame
    frames: int
    size_bytes: int


@dataclass
class _Lane:
    """The frames of one sensor, oldest first, each with the order in which it arrived."""

    kept: deque[tuple[int, KeptFrame]] = field(default_factory=deque[tuple[int, KeptFrame]])
    next_index: int = 0
    size_bytes: int = 0
    writing: threading.Lock = field(default_factory=threading.Lock)


class FrameRing:
    """Keeps and gives frames; may be used from any number of threads.

    Args:
        folder: where the frames are; made if missing, and read if there are frames from before.
        settings: limits.

    Raises:
        StorageFailed: the folder cannot be read or written.
    """

    def __init__(self, folder: Path, settings: FrameSettings) -> None:
        self._folder = folder
        self._settings = settings
        self._lanes: dict[str, _Lane] = {}
        self._lock = threading.Lock()
        self._arrivals = 0
        self._size_bytes = 0
        self.dropped = 0
        try:
            self._recover()
        except OSError as problem:
            raise StorageFailed(f"{folder}: frames cannot be kept there: {problem}") from problem

    @property
    def size_bytes(self) -> int:
        """Of all frames kept."""
        return self._size_bytes

    def add(self, sensor: str, content: bytes) -> KeptFrame:
        """Keeps a frame, and drops the oldest ones that do not fit beside it.

        Args:
            sensor: name of the sensor.
            content: the frame's message.

        Raises:
            InvalidName: the sensor's name cannot be that of a folder.
            InvalidFrame: the message is not that of a frame.
            TooLarge: it is too long, or there are too many sensors.
            StorageFailed: it cannot be written.
        """
        check_sensor(sensor)
        limit = min(self._settings.frame_max_bytes, self._settings.ring_max_bytes)
        if len(content) > limit:
            raise TooLarge(
                f"the frame has {len(content):,} bytes, more than the {limit:,} it may have; send "
                "a smaller image, or raise frames.frame_max_bytes",
                limit=limit,
            )
        stamp_s = unpack_frame(content).stamp_s
        with self._lock:
            lane = self._lane(sensor)
        with lane.writing:  # one after the other, so that they are kept in order
            with self._lock:
                frame = KeptFrame(sensor, lane.next_index, stamp_s, len(content))
                superseded = self._make_room(frame, lane)
            try:
                # Not under the lock: readers do not wait for the disk.
                self._delete(superseded)
                self._write(frame, content)
            except BaseException:
                with self._lock:
                    self._size_bytes -= frame.size_bytes
                raise
            with self._lock:
                lane.next_index += 1
                self._keep(lane, frame)
        return frame

    def newest(self, sensor: str, after: int | None = None) -> KeptFrame | None:
        """The newest frame of a sensor, None if the caller has it already or there is none.

        Args:
            sensor: name of the sensor.
            after: number of the last frame that the caller has. A number that the sensor has not
                reached is from before the ring was emptied, and counts as none.
        """
        with self._lock:
            lane = self._lanes.get(sensor)
            if lane is None or not lane.kept:
                return None
            frame = lane.kept[-1][1]
            return None if frame.index == after else frame

    def read(self, sensor: str, index: int) -> bytes:
        """The message of a frame.

        Raises:
            UnknownResource: it was dropped, or never was.
        """
        if _SENSOR.fullmatch(sensor):
            try:
                return self._path(sensor, index).read_bytes()
            except FileNotFoundError:
                pass  # the same answer as for a sensor that never was
            except OSError as problem:
                raise StorageFailed(f"frame {index} of {sensor!r}: {problem}") from problem
        raise UnknownResource(
            f"frame {index} of sensor {sensor!r} is not kept; GET /frames tells which are",
            sensor=sensor,
            index=index,
        )

    def sensors(self) -> Sequence[SensorState]:
        """What is kept of every sensor, by name."""
        with self._lock:
            return [
                SensorState(
                    name, lane.kept[0][1], lane.kept[-1][1], len(lane.kept), lane.size_bytes
                )
                for name, lane in sorted(self._lanes.items())
                if lane.kept
            ]

    def _recover(self) -> None:
        self._folder.mkdir(parents=True, exist_ok=True)
        found: list[tuple[float, KeptFrame]] = []
        for folder in sorted(path for path in self._folder.iterdir() if path.is_dir()):
            for path in sorted(folder.iterdir()):
                match = _FILE.fullmatch(path.name)
                if match is None:  # the rest of a write that a crash cut short
                    path.unlink()
                    continue
                try:
                    frame = _kept(path, folder.name, int(match.group(1)))
                except FluentboardError as problem:
                    logger.warning("%s: dropped a damaged frame: %s", path, problem.message)
                    path.unlink()
                    continue
                found.append((path.stat().st_mtime, frame))
        for _, frame in sorted(found, key=lambda entry: (entry[0], entry[1].index)):
            lane = self._lanes.setdefault(frame.sensor, _Lane())
            lane.next_index = max(lane.next_index, frame.index + 1)
            self._size_bytes += frame.size_bytes
            self._keep(lane, frame)
        superseded = self._drop_until(self._settings.ring_max_bytes)
        for lane in self._lanes.values():
            while len(lane.kept) > self._settings.ring_frames:
                superseded.append(self._drop_oldest(lane))
        self._delete(superseded)

    def _lane(self, sensor: str) -> _Lane:
        lane = self._lanes.get(sensor)
        if lane is None:
            if len(self._lanes) >= self._settings.sensors_max:
                raise TooLarge(
                    f"{len(self._lanes)} sensors send frames already, as many as may; raise "
                    "frames.sensors_max, or restart the board without the folders of old ones",
                    limit=self._settings.sensors_max,
                )
            lane = self._lanes[sensor] = _Lane()
        return lane

    def _make_room(self, frame: KeptFrame, lane: _Lane) -> list[KeptFrame]:
        """Sets room aside for a frame; returns those that have to go."""
        superseded: list[KeptFrame] = []
        while len(lane.kept) >= self._settings.ring_frames:
            superseded.append(self._drop_oldest(lane))
        superseded += self._drop_until(self._settings.ring_max_bytes - frame.size_bytes)
        self._size_bytes += frame.size_bytes
        return superseded

    def _drop_until(self, size_bytes: int) -> list[KeptFrame]:
        """Drops the oldest frames of whichever sensor until the rest is not longer than that."""
        superseded: list[KeptFrame] = []
        while self._size_bytes > size_bytes:
            lanes = [lane for lane in self._lanes.values() if lane.kept]
            if not lanes:  # all the rest is being written
                break
            superseded.append(self._drop_oldest(min(lanes, key=lambda lane: lane.kept[0][0])))
        return superseded

    def _drop_oldest(self, lane: _Lane) -> KeptFrame:
        _, frame = lane.kept.popleft()
        lane.size_bytes -= frame.size_bytes
        self._size_bytes -= frame.size_bytes
        self.dropped += 1
        return frame

    def _keep(self, lane: _Lane, frame: KeptFrame) -> None:
        self._arrivals += 1
        lane.kept.append((self._arrivals, frame))
        lane.size_bytes += frame.size_bytes

    def _delete(self, frames: Sequence[KeptFrame]) -> None:
        for frame in frames:
            path = self._path(frame.sensor, frame.index)
            try:
                path.unlink(missing_ok=True)  # someone else may have tidied up the folder
            except OSError as problem:
                logger.warning("%s cannot be deleted: %s", path, problem)

    def _write(self, frame: KeptFrame, content: bytes) -> None:
        path = self._path(frame.sensor, frame.index)
        partial = path.with_suffix(".partial")
        try:
            path.parent.mkdir(exist_ok=True)
            partial.write_bytes(content)
            os.replace(partial, path)
        except OSError as problem:
            with contextlib.suppress(OSError):  # the reason for the failure is the one to tell
                partial.unlink(missing_ok=True)
            raise StorageFailed(
                f"the frame cannot be written to {path.parent} ({problem.strerror}); free some "
                "space there"
            ) from problem

    def _path(self, sensor: str, index: int) -> Path:
        return self._folder / sensor / f"{index:012d}.frame"


def check_sensor(sensor: str) -> None:
    """Refuses a name that cannot be that of a folder.

    Raises:
        InvalidName: it is one.
    """
    if not _SENSOR.fullmatch(sensor):
        raise InvalidName(
            f"sensor name {sensor[:80]!r}: use letters, digits and . _ - only, at most 64 of them, "
            "not beginning with a dot",
            name=sensor[:80],
        )


def _kept(path: Path, sensor: str, index: int) -> KeptFrame:
    with path.open("rb") as file:
        beginning = file.read(longest_beginning_bytes())
    return KeptFrame(sensor, index, stamp_of(beginning), path.stat().st_size)
