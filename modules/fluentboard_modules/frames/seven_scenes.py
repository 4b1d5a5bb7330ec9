"""The layout of Microsoft 7-Scenes: three files per frame, poses camera-to-world.

`fluentboard frames record` writes it too, and adds stamps.txt, instance labels and recording.json.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from fluentboard.errors import InvalidFrame
from fluentboard.model.geometry import Transform
from fluentboard_modules.frames.calibration_files import (
    GRAVITY_FILE,
    INTRINSICS_FILE,
    read_camera,
    read_gravity,
    read_json,
    read_numbers,
    read_pose,
)
from fluentboard_modules.frames.folder_recording import (
    FIRST_STAMP_S,
    FRAME_RATE_HZ,
    FolderRecording,
    FrameFiles,
    board_shift_s,
)
from fluentboard_modules.frames.sensor_frame import Camera

logger = logging.getLogger(__name__)

_STAMPS_FILE = "stamps.txt"
_ABOUT_FILE = "recording.json"
_DEPTH = re.compile(r"frame-(\d+)\.depth\.png$")

# The data set's own page gives these for its depth camera.
_PUBLISHED_CAMERA = Camera(640, 480, 585.0, 585.0, 320.0, 240.0)
# Its colour images are not registered to depth; these were estimated on the data itself.
_COLOUR_CAMERA = Camera(640, 480, 525.0, 525.0, 326.0, 242.0)
_T_COLOUR_DEPTH = np.array(
    [
        [0.99997, 0.00268, -0.00790, -0.0256],
        [-0.00274, 0.99996, -0.00815, 0.0001],
        [0.00788, 0.00817, 0.99994, 0.0020],
        [0.0, 0.0, 0.0, 1.0],
    ]
)


class SevenScenes:
    """Recognises and opens the layout."""

    name = "7-Scenes"
    expected = "frame-NNNNNN.depth.png (16 bit, mm), frame-NNNNNN.pose.txt (4x4, camera to world)"

    def recognises(self, path: Path) -> bool:
        """Whether any file is named like a depth image of this layout."""
        return any(_DEPTH.search(file.name) for file in path.iterdir())

    def open(self, path: Path, start_s: float | None) -> FolderRecording:
        """The recording; without stamps.txt, frame numbers count thirtieths of a second."""
        numbered = sorted(
            (int(match.group(1)), file)
            for file in path.iterdir()
            if (match := _DEPTH.search(file.name))
        )
        if not any(_sibling(depth, ".pose.txt").exists() for _, depth in numbered):
            raise InvalidFrame(
                f"{path}: depth images without poses ({_sibling(numbered[0][1], '.pose.txt').name} "
                "and the others are missing); frames can only be put together if it is known where "
                "the camera was"
            )
        about = read_json(path / _ABOUT_FILE) if (path / _ABOUT_FILE).is_file() else {}
        stamps_s = _stamps_s(path / _STAMPS_FILE, [number for number, _ in numbered], start_s)
        has_colour = any(_colour_file(depth).exists() for _, depth in numbered)
        has_labels = any(_sibling(depth, ".labels.png").exists() for _, depth in numbered)
        files = [
            FrameFiles(
                index=number,
                stamp_s=stamp_s,
                depth=depth,
                colour=_colour_file(depth) if has_colour else None,
                read_pose=partial(read_pose, _sibling(depth, ".pose.txt")),
                labels=_sibling(depth, ".labels.png") if has_labels else None,
            )
            for (number, depth), stamp_s in zip(numbered, stamps_s, strict=True)
        ]
        camera = read_camera(path / INTRINSICS_FILE, (depth for _, depth in numbered))
        if camera is None:
            camera = _PUBLISHED_CAMERA
            logger.info("%s has no %s; using the published one", path, INTRINSICS_FILE)
        recording = FolderRecording(
            path=path,
            layout=self.name,
            files=files,
            camera=camera,
            depth_units_per_m=1000.0,
            gravity_world=read_gravity(path / GRAVITY_FILE),
        )
        return recording if _is_registered(about) else _with_kinect_colour(recording)


def _is_registered(about: Mapping[str, Any]) -> bool:
    return about.get("colour") == "registered"


def _with_kinect_colour(recording: FolderRecording) -> FolderRecording:
    return replace(
        recording, colour_camera=_COLOUR_CAMERA, T_colour_depth=Transform(_T_COLOUR_DEPTH)
    )


def _stamps_s(path: Path, numbers: list[int], start_s: float | None) -> list[float]:
    if not path.is_file():
        first_s = FIRST_STAMP_S if start_s is None else start_s
        return [first_s + (number - numbers[0]) / FRAME_RATE_HZ for number in numbers]
    stamps_s = read_numbers(path)
    if stamps_s.size != len(numbers) or not (np.diff(stamps_s) >= 0.0).all():
        raise InvalidFrame(
            f"{path}: {stamps_s.size} stamps, perhaps unordered, for {len(numbers)} depth images; "
            "give one per image in ascending order, or remove the file"
        )
    return [float(stamp) for stamp in stamps_s + board_shift_s(stamps_s[0], start_s)]


def _sibling(depth: Path, ending: str) -> Path:
    return depth.with_name(depth.name.removesuffix(".depth.png") + ending)


def _colour_file(depth: Path) -> Path:
    png = _sibling(depth, ".color.png")
    return png if png.exists() else _sibling(depth, ".color.jpg")
