"""Point cloud files as recordings of one frame: PCD and PLY, organised or not."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from fluentboard.errors import InvalidFrame
from fluentboard.model.geometry import FloatArray, Transform
from fluentboard_modules.frames.cloud_views import frame_of_cloud, view_cloud
from fluentboard_modules.frames.folder_recording import FIRST_STAMP_S
from fluentboard_modules.frames.pcd_files import read_pcd
from fluentboard_modules.frames.ply_files import read_ply
from fluentboard_modules.frames.sensor_frame import SensorFrame
from fluentboard_modules.frames.upright import guess_gravity, is_z_up

logger = logging.getLogger(__name__)

READERS = {".pcd": read_pcd, ".ply": read_ply}
"""What reads a cloud, by the ending of its file."""


@dataclass(frozen=True, eq=False)
class CloudRecording:
    """A `Recording` of one frame. Its world frame is the frame of the points in the file.

    Attributes:
        path: the file.
        frame: the cloud, placed in the world frame.
        gravity_world: `(3,)` unit vector along which things fall, guessed from the planes seen;
            None for a cloud with z up.
        T_map_world: takes the world frame to the map frame.
    """

    path: Path
    frame: SensorFrame
    gravity_world: FloatArray | None = None
    T_map_world: Transform = Transform.identity()  # noqa: RUF009 - immutable

    @property
    def name(self) -> str:
        """What to call the recording in messages."""
        return str(self.path)

    def __len__(self) -> int:
        return 1

    def __iter__(self) -> Iterator[SensorFrame]:
        yield replace(self.frame, T_map_sensor=self.T_map_world @ self.frame.T_map_sensor)

    def in_map(self, T_map_world: Transform) -> CloudRecording:
        """The same recording with its frame placed in another map frame."""
        return replace(self, T_map_world=T_map_world)

    def every(self, step: int) -> CloudRecording:
        """The same recording: its first frame is its only one."""
        return self


def open_cloud(path: str | Path, *, start_s: float | None = None) -> CloudRecording:
    """The cloud in a file, as a recording of one frame.

    Args:
        path: a `.pcd` or `.ply` file.
        start_s: stamp of the frame; by default `FIRST_STAMP_S`.

    Raises:
        InvalidFrame: the file is missing, truncated, damaged, or empty.
    """
    path = Path(path)
    read = READERS.get(path.suffix.lower())
    if read is None:
        raise InvalidFrame(f"{path}: no point cloud; expected a file in {' or '.join(READERS)}")
    cloud = read(path)
    frame = frame_of_cloud(
        cloud,
        view_cloud(cloud, str(path)),
        Transform.identity(),
        FIRST_STAMP_S if start_s is None else start_s,
        path.stem,
    )
    gravity = None
    if not is_z_up([frame.T_map_sensor]):
        gravity = guess_gravity([frame], np.random.default_rng(0))
        logger.info(
            "%s: no gravity in a cloud file; guessed from the planes in view: %s",
            path,
            np.array2string(gravity, precision=3),
        )
    return CloudRecording(path, frame, gravity)
