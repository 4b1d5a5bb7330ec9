"""Recordings that are folders of image files: `open_folder` recognises the layout.

A layout is a `FolderLayout`: it says whether a folder is one of its own and lists the frames in it;
`FolderRecording` reads them. To add a layout, add it to `LAYOUTS`.
"""

from __future__ import annotations

import logging
from dataclasses import replace
from pathlib import Path

import numpy as np

from fluentboard.errors import FluentboardError, InvalidFrame
from fluentboard.model.geometry import Transform
from fluentboard_modules.frames.folder_recording import (
    FIRST_STAMP_S,
    FolderLayout,
    FolderRecording,
    FrameFiles,
)
from fluentboard_modules.frames.redwood import Redwood
from fluentboard_modules.frames.sensor_frame import SensorFrame
from fluentboard_modules.frames.seven_scenes import SevenScenes
from fluentboard_modules.frames.tum_rgbd import TumRgbd
from fluentboard_modules.frames.upright import guess_gravity, is_z_up

__all__ = ["FIRST_STAMP_S", "LAYOUTS", "FolderRecording", "FrameFiles", "open_folder"]

logger = logging.getLogger(__name__)

LAYOUTS: tuple[FolderLayout, ...] = (SevenScenes(), TumRgbd(), Redwood())
"""The layouts `open_folder` knows, in the order they are tried."""

_POSES_LOOKED_AT = 40
_FRAMES_LOOKED_AT = 5


def open_folder(
    path: str | Path, *, start_s: float | None = None, T_map_world: Transform | None = None
) -> FolderRecording:
    """The recording in a folder, whatever its layout.

    A recording without a gravity vector whose camera would look at a wall if z were up gets a
    gravity guessed from the planes it shows, with a warning.

    Args:
        path: the folder.
        start_s: stamp of the first frame on the board's time axis, greater than 0. By default the
            recording's own stamps, or `FIRST_STAMP_S` where it has none.
        T_map_world: takes the recording's world frame to the map frame (see `frames.gravity`);
            the identity by default.

    Raises:
        InvalidFrame: there is no such folder, or no recording in it that can be read.
    """
    folder = Path(path)
    check_start(str(folder), start_s)
    if not folder.is_dir():
        raise InvalidFrame(f"{folder}: no such folder; give the folder that holds the recording")
    for layout in LAYOUTS:
        if layout.recognises(folder):
            recording = _with_gravity(layout.open(folder, start_s))
            return recording if T_map_world is None else recording.in_map(T_map_world)
    raise InvalidFrame(f"{folder}: not a recording; expected {expected_layouts()}")


def expected_layouts() -> str:
    """What the folders that can be opened contain, for error messages."""
    return "; or ".join(f"{layout.name}: {layout.expected}" for layout in LAYOUTS)


def check_start(name: str, start_s: float | None) -> None:
    """Refuses a first stamp that the board's time axis does not have.

    Raises:
        InvalidFrame: it is not greater than 0.
    """
    if start_s is not None and not start_s > 0.0:
        raise InvalidFrame(
            f"{name}: first stamp {start_s} s; give one greater than 0, which means unknown"
        )


def _with_gravity(recording: FolderRecording) -> FolderRecording:
    if recording.gravity_world is not None:
        return recording
    poses: list[Transform] = []
    for files in recording.files[:: max(1, len(recording) // _POSES_LOOKED_AT)]:
        try:
            poses.append(files.read_pose())
        except FluentboardError:
            continue  # reading the frame itself will say what is wrong with its pose
    if not poses or is_z_up(poses):
        return recording
    frames: list[SensorFrame] = []
    for position in range(0, len(recording), max(1, len(recording) // _FRAMES_LOOKED_AT)):
        try:
            frames.append(recording.read(position))
        except FluentboardError:
            continue  # likewise
    if not frames:
        return recording
    gravity = guess_gravity(frames, np.random.default_rng(0))
    logger.warning(
        "%s: gravity is not recorded, and z up would mean a camera held sideways; guessed from the "
        "planes in view: %s. Give the measured vector with --gravity",
        recording.name,
        np.array2string(gravity, precision=3),
    )
    return replace(recording, gravity_world=gravity)
