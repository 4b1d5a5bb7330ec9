"""Write frames in the folder layouts of TUM RGB-D and Open3D, for other people's tools.

The layout of 7-Scenes, which also keeps labels and gravity, is written by `simulation.recording`.
Both layouts here want colour registered to depth; it is registered where it is not.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

import numpy as np

from fluentboard.errors import InvalidInput
from fluentboard.model.geometry import Pose
from fluentboard_modules.frames.image_files import encode_colour, encode_depth_mm, encode_u16
from fluentboard_modules.frames.registration import registered_colour
from fluentboard_modules.frames.sensor_frame import Camera, FrameSource, SensorFrame

Progress = Callable[[int, int], None]
"""Called with the number of frames written and the number of all frames."""

TUM_UNITS_PER_M = 5000.0


def write_tum(source: FrameSource, folder: Path, progress: Progress | None = None) -> int:
    """Writes the TUM RGB-D layout; returns the number of frames.

    Args:
        source: frames of one camera.
        folder: created if missing; must be empty.
        progress: called after every frame.

    Raises:
        InvalidInput: the folder is not empty, or the camera changes.
    """
    _prepared(folder, "depth", "rgb")
    with (
        _listing(folder / "depth.txt", "timestamp filename") as depths,
        _listing(folder / "rgb.txt", "timestamp filename") as colours,
        _listing(folder / "groundtruth.txt", "timestamp tx ty tz qx qy qz qw") as poses,
    ):
        number = 0
        for number, frame in enumerate(_of_one_camera(source), start=1):
            if number == 1:
                _write_matrix(folder / "camera-intrinsics.txt", frame.camera)
            stamp = f"{frame.stamp_s:.6f}"
            units = np.rint(np.nan_to_num(frame.depth_m) * np.float32(TUM_UNITS_PER_M))
            units[(units < 0) | (units >= np.iinfo(np.uint16).max)] = 0  # beyond 13 m
            _write(folder / "depth" / f"{stamp}.png", encode_u16(units.astype(np.uint16)))
            depths.write(f"{stamp} depth/{stamp}.png\n")
            colour = registered_colour(frame)
            if colour is not None:
                _write(folder / "rgb" / f"{stamp}.png", encode_colour(colour, ".png"))
                colours.write(f"{stamp} rgb/{stamp}.png\n")
            pose = Pose.from_transform(frame.T_map_sensor)
            numbers = (pose.x, pose.y, pose.z, pose.qx, pose.qy, pose.qz, pose.qw)
            poses.write(stamp + "".join(f" {value:.9f}" for value in numbers) + "\n")
            if progress is not None:
                progress(number, len(source))
    return number


def write_redwood(source: FrameSource, folder: Path, progress: Progress | None = None) -> int:
    """Writes the layout of Open3D and the Redwood data sets; returns the number of frames.

    Args:
        source: frames of one camera.
        folder: created if missing; must be empty.
        progress: called after every frame.

    Raises:
        InvalidInput: the folder is not empty, or the camera changes.
    """
    _prepared(folder, "depth", "color")
    first_s = 0.0
    number = 0
    with (folder / "trajectory.log").open("w", encoding="utf-8") as log:
        for number, frame in enumerate(_of_one_camera(source), start=1):
            position = number - 1
            if position == 0:
                first_s = frame.stamp_s
                _write_camera_json(folder / "camera.json", frame.camera)
            # Open3D's own recorder names files like this: number, then microseconds.
            name = f"{position:07d}-{round((frame.stamp_s - first_s) * 1e6):012d}"
            _write(folder / "depth" / f"{name}.png", encode_depth_mm(frame.depth_m))
            colour = registered_colour(frame)
            if colour is not None:
                _write(folder / "color" / f"{name}.png", encode_colour(colour, ".png"))
            log.write(f"{position} {position} {number}\n")
            for row in frame.T_map_sensor.matrix:
                log.write(" ".join(f"{value:.9f}" for value in row) + "\n")
            if progress is not None:
                progress(number, len(source))
    return number


def _prepared(folder: Path, *names: str) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    if next(folder.iterdir(), None) is not None:
        raise InvalidInput(f"{folder} is not empty; choose an empty folder")
    for name in names:
        (folder / name).mkdir()


def _of_one_camera(source: FrameSource) -> Iterator[SensorFrame]:
    camera: Camera | None = None
    for frame in source:
        if camera is not None and frame.camera != camera:
            raise InvalidInput(
                f"frame {frame.index} of {source.name} has another camera than the first; the "
                "layout has one camera per recording"
            )
        camera = frame.camera
        yield frame


@contextmanager
def _listing(path: Path, columns: str) -> Iterator[IO[str]]:
    with path.open("w", encoding="utf-8") as file:
        file.write(f"# {columns}\n")
        yield file


def _write(path: Path, content: bytes) -> None:
    try:
        path.write_bytes(content)
    except OSError as problem:
        raise InvalidInput(f"{path}: cannot be written ({problem.strerror})") from problem


def _write_matrix(path: Path, camera: Camera) -> None:
    matrix = np.array([[camera.fx, 0.0, camera.cx], [0.0, camera.fy, camera.cy], [0.0, 0.0, 1.0]])
    np.savetxt(path, matrix, fmt="%.8f")


def _write_camera_json(path: Path, camera: Camera) -> None:
    document = {
        "width": camera.width,
        "height": camera.height,
        "intrinsic_matrix": [camera.fx, 0, 0, 0, camera.fy, 0, camera.cx, camera.cy, 1],
        "depth_scale": 1000.0,
    }
    path.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
