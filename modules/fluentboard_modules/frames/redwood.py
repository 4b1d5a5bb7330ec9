"""The layout of Open3D's RGB-D tools and the Redwood data sets: color/, depth/, a camera, a log.

`trajectory.log` holds five lines per pose: a line of numbers of which the first is that of the
frame, then the 4x4 matrix from camera to world. The camera is Open3D's JSON; it may be named
camera.json, intrinsic.json or camera_primesense.json and may give `depth_scale` and `fps`.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from fluentboard.errors import InvalidFrame
from fluentboard.model.geometry import FloatArray, Transform
from fluentboard_modules.frames.calibration_files import (
    GRAVITY_FILE,
    INTRINSICS_FILE,
    camera_from_json,
    pose_from_matrix,
    read_camera,
    read_gravity,
    read_json,
    read_text,
)
from fluentboard_modules.frames.folder_recording import (
    FRAME_RATE_HZ,
    FolderRecording,
    FrameFiles,
    board_shift_s,
)
from fluentboard_modules.frames.sensor_frame import Camera
from fluentboard_modules.frames.stamped_lists import nearest

logger = logging.getLogger(__name__)

_COLOUR_FOLDERS = ("color", "image", "rgb")
_CAMERA_FILES = ("camera.json", "intrinsic.json", "camera_intrinsic.json", "camera_primesense.json")
_TRAJECTORY_FILE = "trajectory.log"
_DEPTH_UNITS_PER_M = 1000.0
# Of the PrimeSense cameras that the data sets were recorded with; Open3D's default too.
_PRIMESENSE = Camera(640, 480, 525.0, 525.0, 319.5, 239.5)
# 0000012-000000400033.png: frame 12, taken 0.400033 s after the first.
_STAMPED = re.compile(r"(\d+)-(\d{6,})$")
_MICROSECONDS = 1e-6
# Half the time between two frames: beyond that, the colour image belongs to another depth image.
_COLOUR_TOLERANCE_S = 0.5 / FRAME_RATE_HZ


class Redwood:
    """Recognises and opens the layout."""

    name = "Open3D/Redwood"
    expected = "depth/ and color/ (images of the same order), trajectory.log, camera.json"

    def recognises(self, path: Path) -> bool:
        """Whether there is a folder of depth images."""
        return (path / "depth").is_dir() and not (path / "depth.txt").is_file()

    def open(self, path: Path, start_s: float | None) -> FolderRecording:
        """The recording; frames without a stamp in their name are 1/30 s apart."""
        depths = _images(path / "depth")
        if not depths:
            raise InvalidFrame(f"{path / 'depth'}: holds no PNG; put the depth images there")
        about = _camera_document(path)
        camera = (
            camera_from_json(about[1], str(about[0]))
            if about is not None
            else read_camera(path / INTRINSICS_FILE, depths)
        )
        if camera is None:
            logger.info("%s has no %s; using 525 px, the PrimeSense's", path, _CAMERA_FILES[0])
            camera = _PRIMESENSE
        document = about[1] if about is not None else {}
        stamps_s = _stamps_s(depths, _positive(document.get("fps"), FRAME_RATE_HZ))
        colours = _associated(path, depths, stamps_s)
        poses = _read_trajectory(path / _TRAJECTORY_FILE)
        shift_s = board_shift_s(stamps_s[0], start_s)
        files = [
            FrameFiles(
                index=index,
                stamp_s=stamps_s[index] + shift_s,
                depth=depth,
                colour=colours[index],
                read_pose=partial(_pose, path / _TRAJECTORY_FILE, poses, index),
            )
            for index, depth in enumerate(depths)
        ]
        return FolderRecording(
            path=path,
            layout=self.name,
            files=files,
            camera=camera,
            depth_units_per_m=_positive(document.get("depth_scale"), _DEPTH_UNITS_PER_M),
            gravity_world=read_gravity(path / GRAVITY_FILE),
        )


def _images(folder: Path) -> list[Path]:
    """Sorted by the numbers in their names: 2.png comes before 10.png."""
    if not folder.is_dir():
        return []
    found = (p for p in folder.iterdir() if p.suffix.lower() in (".png", ".jpg", ".jpeg"))
    return sorted(found, key=lambda p: ([int(n) for n in re.findall(r"\d+", p.stem)], p.name))


def _camera_document(path: Path) -> tuple[Path, Mapping[str, Any]] | None:
    for name in _CAMERA_FILES:
        for folder in (path, path.parent):  # Open3D's own sample has it beside the folder
            if (folder / name).is_file():
                return folder / name, read_json(folder / name)
    return None


def _positive(value: Any, default: float) -> float:
    return float(value) if isinstance(value, int | float) and value > 0 else default


def _stamps_s(images: Sequence[Path], rate_hz: float) -> list[float]:
    """Stamps in the file names, or else the position over the frame rate, from 0 on."""
    matches = [_STAMPED.search(image.stem) for image in images]
    if all(matches):
        return [int(match.group(2)) * _MICROSECONDS for match in matches if match]
    return [position / rate_hz for position in range(len(images))]


def _associated(
    path: Path, depths: Sequence[Path], stamps_s: Sequence[float]
) -> Sequence[Path | None]:
    """The colour image of each depth image: of the same name, the nearest stamp or the same place.

    Raises:
        InvalidFrame: names and numbers of the images do not tell which belong together.
    """
    colours = next((found for name in _COLOUR_FOLDERS if (found := _images(path / name))), [])
    if not colours:
        return [None] * len(depths)
    by_name = {colour.stem: colour for colour in colours}
    if any(depth.stem in by_name for depth in depths):
        return [by_name.get(depth.stem) for depth in depths]
    if all(_STAMPED.search(image.stem) for image in (*colours, *depths)):
        colour_stamps_s = np.array(_stamps_s(colours, FRAME_RATE_HZ))
        positions = [nearest(colour_stamps_s, stamp, _COLOUR_TOLERANCE_S) for stamp in stamps_s]
        return [None if place is None else colours[place] for place in positions]
    if len(colours) == len(depths):
        return colours
    raise InvalidFrame(
        f"{path}: {len(depths)} depth and {len(colours)} colour images with different names; give "
        "images that belong together the same name"
    )


def _read_trajectory(path: Path) -> dict[int, FloatArray]:
    """The recorded matrices by number of the frame."""
    if not path.is_file():
        raise InvalidFrame(
            f"{path}: no such file; a recording needs the pose of its frames. Estimate one with an "
            "RGB-D reconstruction and save it there"
        )
    lines = [line.split() for line in read_text(path).splitlines() if line.strip()]
    poses: dict[int, FloatArray] = {}
    for first in range(0, len(lines), 5):
        block = lines[first : first + 5]
        try:
            number = int(block[0][0])
            matrix = np.array([[float(word) for word in line] for line in block[1:]])
        except ValueError as error:
            raise InvalidFrame(
                f"{path}: the pose in line {first + 1} is damaged ({error})"
            ) from error
        if matrix.shape != (4, 4):
            raise InvalidFrame(
                f"{path}: the pose in line {first + 1} has no 4x4 matrix; the file is truncated"
            )
        poses[number] = matrix
    if not poses:
        raise InvalidFrame(f"{path}: holds no pose; record or estimate them again")
    # Some tools count from 1; no frame has the number of frames itself.
    return poses if 0 in poses or 1 not in poses else {n - 1: m for n, m in poses.items()}


def _pose(path: Path, poses: Mapping[int, FloatArray], index: int) -> Transform:
    if index not in poses:
        raise InvalidFrame(f"{path}: no pose of frame {index}")
    return pose_from_matrix(poses[index], f"{path}, frame {index}")
