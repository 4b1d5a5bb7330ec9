"""FolderRecording: image files and poses in a folder, each frame read when it is asked for."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol

from fluentboard.errors import FluentboardError, InvalidFrame
from fluentboard.model.geometry import FloatArray, Transform
from fluentboard_modules.frames.image_files import read_colour, read_depth_m, read_labels
from fluentboard_modules.frames.sensor_frame import Camera, SensorFrame

logger = logging.getLogger(__name__)

FIRST_STAMP_S = 1.0
"""Stamp of frame 0 of a recording without stamps; 0.0 is reserved for "unknown" on the board."""

FRAME_RATE_HZ = 30.0
"""Of a recording without stamps: the Kinect's."""


@dataclass(frozen=True, slots=True)
class FrameFiles:
    """Where the parts of one frame are.

    Attributes:
        index: number of the frame in its recording.
        stamp_s: when it was taken, in seconds on the board's time axis.
        depth: the depth image.
        colour: the colour image, or None where the recording has none.
        read_pose: gives `T_world_sensor`; raises InvalidFrame when the recorded pose is unusable.
        labels: the image of instance labels, or None where the recording has none.
    """

    index: int
    stamp_s: float
    depth: Path
    colour: Path | None
    read_pose: Callable[[], Transform]
    labels: Path | None = None


@dataclass(frozen=True)
class FolderRecording:
    """A `Recording` on disk.

    Attributes:
        path: the folder.
        layout: name of its layout.
        files: its frames in time order.
        camera: the depth camera.
        depth_units_per_m: depth image values per metre.
        colour_camera: the colour camera, where it differs from the depth camera.
        T_colour_depth: depth camera to colour camera coordinates, where they differ.
        gravity_world: `(3,)` unit vector along which things fall, in the recording's world frame,
            or None for a world with z up.
        T_map_world: takes the recording's world frame to the map frame.
    """

    path: Path
    layout: str
    files: Sequence[FrameFiles]
    camera: Camera
    depth_units_per_m: float
    colour_camera: Camera | None = None
    T_colour_depth: Transform | None = None
    gravity_world: FloatArray | None = None
    T_map_world: Transform = Transform.identity()  # noqa: RUF009 - immutable

    @property
    def name(self) -> str:
        """What to call the recording in messages."""
        return str(self.path)

    def __len__(self) -> int:
        return len(self.files)

    def __iter__(self) -> Iterator[SensorFrame]:
        for position in range(len(self.files)):
            try:
                yield self.read(position)
            except FluentboardError as error:
                logger.warning(
                    "%s: frame %d skipped: %s",
                    self.name,
                    self.files[position].index,
                    error.message,
                )

    def read(self, position: int) -> SensorFrame:
        """The frame at a position of the recording, 0 for the first.

        Raises:
            InvalidFrame: a part of the frame is missing or damaged; the message names the file.
        """
        files = self.files[position]
        try:
            T_world_sensor = files.read_pose()
        except FluentboardError as error:
            raise InvalidFrame(error.message) from error
        return SensorFrame(
            depth_m=read_depth_m(files.depth, self.depth_units_per_m),
            camera=self.camera,
            stamp_s=files.stamp_s,
            T_map_sensor=self.T_map_world @ T_world_sensor,
            colour=None if files.colour is None else read_colour(files.colour),
            colour_camera=self.colour_camera,
            T_colour_depth=self.T_colour_depth,
            labels=None if files.labels is None else read_labels(files.labels),
            sensor=self.path.name,
            index=files.index,
        )

    def in_map(self, T_map_world: Transform) -> FolderRecording:
        """The same recording with its frames placed in another map frame."""
        return replace(self, T_map_world=T_map_world)

    def every(self, step: int) -> FolderRecording:
        """The same recording with only every step-th frame."""
        return replace(self, files=self.files[::step])


class FolderLayout(Protocol):
    """One way of laying out a recording in a folder."""

    name: str
    expected: str
    """What a folder of this layout contains, for the error message."""

    def recognises(self, path: Path) -> bool:
        """Whether the folder is laid out this way."""
        ...

    def open(self, path: Path, start_s: float | None) -> FolderRecording:
        """The recording in the folder, its frames listed but not read."""
        ...


def board_shift_s(first_s: float, start_s: float | None) -> float:
    """What to add to the stamps of a recording, so that they suit the board's time axis.

    Args:
        first_s: the recording's first stamp.
        start_s: what the first stamp is to become; None leaves stamps that are greater than 0.
    """
    if start_s is not None:
        return start_s - first_s
    return 0.0 if first_s > 0.0 else FIRST_STAMP_S - first_s  # one that counts from zero
