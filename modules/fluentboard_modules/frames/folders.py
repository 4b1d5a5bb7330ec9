"""Recordings that are folders of image files: the 7-Scenes and the TUM RGB-D layout.

`open_folder` recognises the layout. A layout is a `FolderLayout`: it says whether a folder is one
of its own and lists the frames in it; `FolderRecording` reads them. To add a layout, add it to
`LAYOUTS`.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Protocol

import numpy as np

from fluentboard.errors import FluentboardError, InvalidFrame
from fluentboard.model.geometry import FloatArray, Pose, Transform
from fluentboard_modules.frames.image_files import png_size, read_colour, read_depth_m
from fluentboard_modules.frames.sensor_frame import Camera, SensorFrame

logger = logging.getLogger(__name__)

FIRST_STAMP_S = 1.0
"""Stamp of frame 0 of a recording without stamps; 0.0 is reserved for "unknown" on the board."""

_SEVEN_SCENES_RATE_HZ = 30.0  # the Kinect's frame rate; the layout records no stamps
_ASSOCIATION_TOLERANCE_S = 0.02  # of the TUM RGB-D benchmark's own association tool
_INTRINSICS_FILE = "camera-intrinsics.txt"
_GRAVITY_FILE = "gravity-direction.txt"


@dataclass(frozen=True, slots=True)
class FrameFiles:
    """Where the parts of one frame are.

    Attributes:
        index: number of the frame in its recording.
        stamp_s: when it was taken, in seconds on the board's time axis.
        depth: the depth image.
        colour: the colour image, or None where the recording has none.
        read_pose: gives `T_world_sensor`; raises InvalidFrame when the recorded pose is unusable.
    """

    index: int
    stamp_s: float
    depth: Path
    colour: Path | None
    read_pose: Callable[[], Transform]


@dataclass(frozen=True)
class FolderRecording:
    """A recording on disk (a FrameSource): frames are read when they are asked for.

    Attributes:
        path: the folder.
        layout: name of its layout.
        files: its frames in time order.
        camera: the depth camera.
        depth_units_per_m: depth image values per metre.
        colour_camera: the colour camera, where it differs from the depth camera.
        T_colour_depth: depth camera to colour camera coordinates, where they differ.
        gravity_world: `(3,)` unit vector along which things fall, in the recording's world frame,
            or None if the recording does not say (then its z axis is taken to point up).
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


def open_folder(
    path: str | Path, *, start_s: float | None = None, T_map_world: Transform | None = None
) -> FolderRecording:
    """The recording in a folder, whatever its layout.

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
    if start_s is not None and not start_s > 0.0:
        raise InvalidFrame(
            f"{folder}: first stamp {start_s} s; give one greater than 0, which means unknown"
        )
    if not folder.is_dir():
        raise InvalidFrame(f"{folder}: no such folder; give the folder that holds the recording")
    for layout in LAYOUTS:
        if layout.recognises(folder):
            recording = layout.open(folder, start_s)
            return recording if T_map_world is None else recording.in_map(T_map_world)
    expected = "; or ".join(f"{layout.name}: {layout.expected}" for layout in LAYOUTS)
    raise InvalidFrame(f"{folder}: not a recording; expected {expected}")


class SevenScenes:
    """The layout of Microsoft 7-Scenes: three files per frame, poses camera-to-world."""

    name = "7-Scenes"
    expected = "frame-NNNNNN.depth.png (16 bit, mm), frame-NNNNNN.pose.txt (4x4, camera to world)"

    _DEPTH = re.compile(r"frame-(\d+)\.depth\.png$")
    # The data set's own page gives these for its depth camera.
    _PUBLISHED_CAMERA = Camera(640, 480, 585.0, 585.0, 320.0, 240.0)
    # The colour images are not registered to depth; these were estimated on the data itself.
    _COLOUR_CAMERA = Camera(640, 480, 525.0, 525.0, 326.0, 242.0)
    _T_COLOUR_DEPTH = np.array(
        [
            [0.99997, 0.00268, -0.00790, -0.0256],
            [-0.00274, 0.99996, -0.00815, 0.0001],
            [0.00788, 0.00817, 0.99994, 0.0020],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )

    def recognises(self, path: Path) -> bool:
        """Whether any file is named like a depth image of this layout."""
        return any(self._DEPTH.search(file.name) for file in path.iterdir())

    def open(self, path: Path, start_s: float | None) -> FolderRecording:
        """The recording; stamps are frame number / 30 s after the start."""
        numbered = sorted(
            (int(match.group(1)), file)
            for file in path.iterdir()
            if (match := self._DEPTH.search(file.name))
        )
        start_s = FIRST_STAMP_S if start_s is None else start_s
        has_colour = any(self._colour_file(depth).exists() for _, depth in numbered)
        files = [
            FrameFiles(
                index=number,
                stamp_s=start_s + (number - numbered[0][0]) / _SEVEN_SCENES_RATE_HZ,
                depth=depth,
                colour=self._colour_file(depth) if has_colour else None,
                read_pose=partial(_read_pose_matrix, self._sibling(depth, ".pose.txt")),
            )
            for number, depth in numbered
        ]
        camera = _read_camera(path / _INTRINSICS_FILE, (depth for _, depth in numbered))
        if camera is None:
            camera = self._PUBLISHED_CAMERA
            logger.info("%s has no %s; using the published one", path, _INTRINSICS_FILE)
        return FolderRecording(
            path=path,
            layout=self.name,
            files=files,
            camera=camera,
            depth_units_per_m=1000.0,
            colour_camera=self._COLOUR_CAMERA,
            T_colour_depth=Transform(self._T_COLOUR_DEPTH),
            gravity_world=_read_gravity(path / _GRAVITY_FILE),
        )

    @staticmethod
    def _sibling(depth: Path, ending: str) -> Path:
        return depth.with_name(depth.name.removesuffix(".depth.png") + ending)

    def _colour_file(self, depth: Path) -> Path:
        png = self._sibling(depth, ".color.png")
        return png if png.exists() else self._sibling(depth, ".color.jpg")


class TumRgbd:
    """The layout of the TUM RGB-D benchmark: lists of stamped files and of stamped poses."""

    name = "TUM RGB-D"
    expected = "depth.txt (stamp, file), groundtruth.txt (stamp tx ty tz qx qy qz qw), rgb.txt"

    _DEPTH_UNITS_PER_M = 5000.0
    # The data set's calibration page: colour cameras of the three Kinects. Depth is registered to
    # colour, so one camera serves both.
    _PUBLISHED_CAMERAS = (
        ("freiburg1", Camera(640, 480, 517.3, 516.5, 318.6, 255.3)),
        ("freiburg2", Camera(640, 480, 520.9, 521.0, 325.1, 249.7)),
        ("freiburg3", Camera(640, 480, 535.4, 539.2, 320.1, 247.6)),
    )
    _DEFAULT_CAMERA = Camera(640, 480, 525.0, 525.0, 319.5, 239.5)

    def recognises(self, path: Path) -> bool:
        """Whether the list of depth images and the list of poses are there."""
        return (path / "depth.txt").is_file() and (path / "groundtruth.txt").is_file()

    def open(self, path: Path, start_s: float | None) -> FolderRecording:
        """The recording; each depth image gets the nearest colour image and pose within 0.02 s."""
        depths = _read_stamped_lines(path / "depth.txt")
        if not depths:
            raise InvalidFrame(f"{path / 'depth.txt'}: lists no depth image; record it again")
        poses = _read_stamped_lines(path / "groundtruth.txt")
        colours = _read_stamped_lines(path / "rgb.txt") if (path / "rgb.txt").is_file() else []
        pose_stamps_s = np.array([stamp for stamp, _ in poses])
        colour_stamps_s = np.array([stamp for stamp, _ in colours])
        shift_s = 0.0 if start_s is None else start_s - depths[0][0]
        if depths[0][0] + shift_s <= 0.0:  # a recording that counts from zero
            shift_s = FIRST_STAMP_S - depths[0][0]

        files: list[FrameFiles] = []
        for index, (stamp_s, fields) in enumerate(depths):
            colour = _nearest(colour_stamps_s, stamp_s)
            pose = _nearest(pose_stamps_s, stamp_s)
            if colours and colour is None:
                logger.info("%s: no colour image within 0.02 s of %s s", path, stamp_s)
            files.append(
                FrameFiles(
                    index=index,
                    stamp_s=stamp_s + shift_s,
                    depth=path / fields[0],
                    colour=None if colour is None else path / colours[colour][1][0],
                    read_pose=partial(
                        _read_tum_pose,
                        path / "groundtruth.txt",
                        stamp_s,
                        None if pose is None else poses[pose][1],
                    ),
                )
            )
        return FolderRecording(
            path=path,
            layout=self.name,
            files=files,
            camera=_read_camera(path / _INTRINSICS_FILE, (path / fields[0] for _, fields in depths))
            or self._published_camera(path),
            depth_units_per_m=self._DEPTH_UNITS_PER_M,
            gravity_world=_read_gravity(path / _GRAVITY_FILE),
        )

    def _published_camera(self, path: Path) -> Camera:
        for kinect, camera in self._PUBLISHED_CAMERAS:
            if kinect in path.resolve().name:
                return camera
        logger.info("%s has no %s; using 525 px, the Kinect's default", path, _INTRINSICS_FILE)
        return self._DEFAULT_CAMERA


LAYOUTS: tuple[FolderLayout, ...] = (SevenScenes(), TumRgbd())
"""The layouts `open_folder` knows, in the order they are tried."""


def _read_numbers(path: Path, shape: tuple[int, ...]) -> FloatArray:
    """The numbers of a text file; InvalidFrame unless there are as many as the shape has."""
    try:
        words = path.read_text(encoding="utf-8").split()
    except (OSError, UnicodeDecodeError) as error:
        raise InvalidFrame(f"{path}: cannot be read ({error}); restore the file") from error
    try:
        numbers = np.array([float(word) for word in words])
    except ValueError as error:  # 7-Scenes itself holds "-1.#IND" where tracking was lost
        raise InvalidFrame(f"{path}: holds something that is not a number ({error})") from error
    if numbers.size != np.prod(shape):
        expected = "x".join(str(side) for side in shape)
        raise InvalidFrame(f"{path}: holds {numbers.size} numbers, expected {expected}")
    return numbers.reshape(shape)


def _read_pose_matrix(path: Path) -> Transform:
    matrix = _read_numbers(path, (4, 4))
    if not np.isfinite(matrix).all():
        raise InvalidFrame(f"{path}: the pose holds NaN or infinity (tracking was lost)")
    # Poses of 7-Scenes are off a rotation by up to 2e-4 (filtered by their tracker, then printed);
    # left alone, the errors add up in products. The nearest rotation is that of the SVD.
    left, stretch, right = np.linalg.svd(matrix[:3, :3])
    if np.abs(stretch - 1.0).max() < 0.01:
        matrix[:3, :3] = left @ right
    try:
        return Transform(matrix)
    except FluentboardError as error:
        raise InvalidFrame(f"{path}: {error.message}") from error


def _read_tum_pose(path: Path, stamp_s: float, fields: list[str] | None) -> Transform:
    if fields is None:
        raise InvalidFrame(f"{path}: no pose within {_ASSOCIATION_TOLERANCE_S} s of {stamp_s} s")
    try:
        x, y, z, *quaternion = (float(field) for field in fields[:7])
        qx, qy, qz, qw = np.array(quaternion) / np.linalg.norm(quaternion)
        return Pose(x, y, z, qx, qy, qz, qw).to_transform()
    except (ValueError, FluentboardError) as error:
        raise InvalidFrame(f"{path}: the pose at {stamp_s} s is unusable ({error})") from error


def _read_camera(path: Path, depths: Iterable[Path]) -> Camera | None:
    """The camera of a 3x3 intrinsics file, None if there is no such file.

    The file holds no image size, so the size is that of the first depth image that has one.
    """
    if not path.is_file():
        return None
    matrix = _read_numbers(path, (3, 3))
    size = next((size for depth in depths if (size := png_size(depth)) is not None), None)
    if size is None:
        raise InvalidFrame(f"{path.parent}: not one depth image of the recording can be read")
    return Camera(*size, fx=matrix[0, 0], fy=matrix[1, 1], cx=matrix[0, 2], cy=matrix[1, 2])


def _read_gravity(path: Path) -> FloatArray | None:
    """The unit vector of a gravity file, None if there is no such file."""
    if not path.is_file():
        return None
    gravity = _read_numbers(path, (3,))
    length = float(np.linalg.norm(gravity))
    if not (np.isfinite(length) and length > 1e-6):
        raise InvalidFrame(f"{path}: {gravity} is no direction; give the gravity vector")
    return gravity / length


def _read_stamped_lines(path: Path) -> list[tuple[float, list[str]]]:
    """Sorted (stamp in seconds, other fields) of a TUM list; lines with # are comments."""
    lines: list[tuple[float, list[str]]] = []
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1):
        fields = line.replace(",", " ").split()
        if not fields or fields[0].startswith("#"):
            continue
        try:
            stamp_s = float(fields[0])
        except ValueError as error:
            raise InvalidFrame(f"{path}, line {number}: starts with no stamp ({error})") from error
        if len(fields) < 2:
            raise InvalidFrame(f"{path}, line {number}: nothing follows the stamp {stamp_s}")
        lines.append((stamp_s, fields[1:]))
    return sorted(lines)


def _nearest(stamps_s: FloatArray, stamp_s: float) -> int | None:
    """Index of the nearest stamp, None if it is further off than the tolerance."""
    if stamps_s.size == 0:
        return None
    after = int(np.searchsorted(stamps_s, stamp_s))
    candidates = [i for i in (after - 1, after) if 0 <= i < stamps_s.size]
    best = min(candidates, key=lambda i: abs(stamps_s[i] - stamp_s))
    return best if abs(stamps_s[best] - stamp_s) <= _ASSOCIATION_TOLERANCE_S else None
