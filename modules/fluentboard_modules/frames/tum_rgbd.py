"""The layout of the TUM RGB-D benchmark: lists of stamped files and of stamped poses."""

from __future__ import annotations

import logging
from functools import partial
from pathlib import Path

import numpy as np

from fluentboard.errors import FluentboardError, InvalidFrame
from fluentboard.model.geometry import Pose, Transform
from fluentboard_modules.frames.calibration_files import (
    GRAVITY_FILE,
    INTRINSICS_FILE,
    read_camera,
    read_gravity,
)
from fluentboard_modules.frames.folder_recording import (
    FolderRecording,
    FrameFiles,
    board_shift_s,
)
from fluentboard_modules.frames.sensor_frame import Camera
from fluentboard_modules.frames.stamped_lists import (
    ASSOCIATION_TOLERANCE_S,
    StampedList,
    read_stamped_list,
)

logger = logging.getLogger(__name__)

_DEPTH_LIST, _COLOUR_LIST, _POSE_LIST = "depth.txt", "rgb.txt", "groundtruth.txt"
_DEPTH_UNITS_PER_M = 5000.0
# The benchmark's page gives these per Kinect for the colour camera; its depth images are registered
# to colour, so one camera serves both.
_PUBLISHED_CAMERAS = (
    ("freiburg1", Camera(640, 480, 517.3, 516.5, 318.6, 255.3)),
    ("freiburg2", Camera(640, 480, 520.9, 521.0, 325.1, 249.7)),
    ("freiburg3", Camera(640, 480, 535.4, 539.2, 320.1, 247.6)),
)
_DEFAULT_CAMERA = Camera(640, 480, 525.0, 525.0, 319.5, 239.5)


class TumRgbd:
    """Recognises and opens the layout."""

    name = "TUM RGB-D"
    expected = "depth.txt (stamp, file), groundtruth.txt (stamp tx ty tz qx qy qz qw), rgb.txt"

    def recognises(self, path: Path) -> bool:
        """Whether the list of depth images and the list of poses are there."""
        return (path / _DEPTH_LIST).is_file() and (path / _POSE_LIST).is_file()

    def open(self, path: Path, start_s: float | None) -> FolderRecording:
        """The recording; each depth image gets the nearest colour image and pose within 0.02 s."""
        depths = read_stamped_list(path / _DEPTH_LIST)
        if not len(depths):
            raise InvalidFrame(f"{path / _DEPTH_LIST}: lists no depth image; record it again")
        poses = read_stamped_list(path / _POSE_LIST)
        colours = (
            read_stamped_list(path / _COLOUR_LIST)
            if (path / _COLOUR_LIST).is_file()
            else StampedList(np.zeros(0), [])
        )
        shift_s = board_shift_s(float(depths.stamps_s[0]), start_s)
        files: list[FrameFiles] = []
        for index, (stamp, fields) in enumerate(zip(depths.stamps_s, depths.fields, strict=True)):
            stamp_s = float(stamp)
            colour = colours.nearest(stamp_s)
            if len(colours) and colour is None:
                logger.info("%s: no colour image within 0.02 s of %s s", path, stamp_s)
            files.append(
                FrameFiles(
                    index=index,
                    stamp_s=stamp_s + shift_s,
                    depth=path / fields[0],
                    colour=None if colour is None else path / colour[0],
                    read_pose=partial(_pose, path / _POSE_LIST, stamp_s, poses.nearest(stamp_s)),
                )
            )
        camera = read_camera(path / INTRINSICS_FILE, (path / fields[0] for fields in depths.fields))
        return FolderRecording(
            path=path,
            layout=self.name,
            files=files,
            camera=camera or _published_camera(path),
            depth_units_per_m=_DEPTH_UNITS_PER_M,
            gravity_world=read_gravity(path / GRAVITY_FILE),
        )


def _published_camera(path: Path) -> Camera:
    for kinect, camera in _PUBLISHED_CAMERAS:
        if kinect in path.resolve().name:
            return camera
    logger.info("%s has no %s; using 525 px, the Kinect's default", path, INTRINSICS_FILE)
    return _DEFAULT_CAMERA


def _pose(path: Path, stamp_s: float, fields: list[str] | None) -> Transform:
    if fields is None:
        raise InvalidFrame(f"{path}: no pose within {ASSOCIATION_TOLERANCE_S} s of {stamp_s} s")
    try:
        x, y, z, *quaternion = (float(field) for field in fields[:7])
        length = float(np.linalg.norm(quaternion))
        if not (len(quaternion) == 4 and length > 1e-6):
            raise ValueError("a pose is tx ty tz qx qy qz qw, the last four not all 0")
        qx, qy, qz, qw = np.array(quaternion) / length
        return Pose(x, y, z, qx, qy, qz, qw).to_transform()
    except (ValueError, FluentboardError) as error:
        raise InvalidFrame(f"{path}: the pose at {stamp_s} s is unusable ({error})") from error
