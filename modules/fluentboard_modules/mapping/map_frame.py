"""The map frame of a recording: found by gravity and floor, and written down."""

from __future__ import annotations

import json
import logging
import re
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from fluentboard.errors import InvalidFrame, InvalidInput
from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.geometry import FloatArray, Pose, Transform
from fluentboard.model.interval import UNKNOWN
from fluentboard_modules.frames.gravity import align_with_gravity, place_in_map
from fluentboard_modules.frames.recordings import Recording
from fluentboard_modules.frames.sensor_frame import FrameSource, SensorFrame
from fluentboard_modules.geometry_fluents import pose_fluent, pose_of
from fluentboard_modules.mapping.config import MappingConfig
from fluentboard_modules.mapping.floor import survey_floor

logger = logging.getLogger(__name__)

_FLOOR_FRAMES = 20
_LOW_CAMERA_M = 0.9  # people and robots that see the tops of tables hold cameras higher
_SAME_TRANSFORM = 1e-4


def place(
    source: FrameSource, config: MappingConfig, gravity_world: FloatArray | None = None
) -> tuple[FrameSource, Transform]:
    """The source with its frames in the map frame, and `T_map_world`.

    A recording on disk is turned upright by gravity and lowered to its floor. Other sources know
    the map frame themselves.

    Args:
        source: any source.
        config: how surfaces are found.
        gravity_world: `(3,)`; the direction things fall; None takes what the recording says.

    Raises:
        InvalidFrame: no frame of the recording shows anything level.
    """
    if not isinstance(source, Recording):
        if gravity_world is not None:
            raise InvalidInput(
                f"{source.name} has z up already; --gravity is for recordings on disk"
            )
        return source, Transform.identity()
    gravity = source.gravity_world if gravity_world is None else gravity_world
    upright = source.in_map(align_with_gravity(gravity))
    heights: list[float] = []

    def surveyed() -> Iterator[SensorFrame]:
        for frame in upright.every(max(1, len(source) // _FLOOR_FRAMES)):
            heights.append(float(frame.T_map_sensor.translation[2]))
            yield frame

    floor = survey_floor(surveyed(), config.surfaces)
    if floor is None:
        raise InvalidFrame(
            f"{source.name}: no frame shows a level surface, so nobody knows where the floor is; "
            "check --gravity"
        )
    logger.info(
        "floor at %.3f m in %d of the surveyed frames, residual %.3f m",
        floor.height_m,
        floor.n_frames,
        floor.residual_m,
    )
    above_m = float(np.median(heights)) - floor.height_m
    if above_m < _LOW_CAMERA_M:
        logger.warning(
            "%s: the lowest level surface in sight is %.2f m below the camera and taken for the "
            "floor; if it is the top of a table, heights count from there and no furniture is "
            "recognised: record more of the room",
            source.name,
            above_m,
        )
    T_map_world = place_in_map(gravity, floor.height_m)
    return source.in_map(T_map_world), T_map_world


def read_gravity(path: Path) -> FloatArray:
    """`(3,)`; the vector in a file of three numbers.

    Raises:
        InvalidInput: the file cannot be read or holds something else.
    """
    try:
        numbers = np.array([float(word) for word in path.read_text(encoding="utf-8").split()])
    except (OSError, ValueError) as problem:
        raise InvalidInput(f"{path}: {problem}; give a file of three numbers") from problem
    if numbers.shape != (3,):
        raise InvalidInput(f"{path}: holds {numbers.size} numbers; give the three of a vector")
    return numbers


def write_transform(path: Path, T_map_world: Transform) -> None:
    """Writes `{"T_map_world": 4x4}` as JSON.

    Raises:
        InvalidInput: the file cannot be written.
    """
    document = {"T_map_world": T_map_world.matrix.tolist()}
    try:
        path.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    except OSError as problem:
        raise InvalidInput(f"{path}: cannot be written ({problem.strerror})") from problem


def map_frame_fluents(
    source: str,
    T_map_world: Transform,
    known: Mapping[str, Fluent],
    poses: Mapping[str, Fluent],
) -> list[Fluent]:
    """The map frame of a recording as fluents, if the board does not say so already.

    It holds since ever and until further notice: it is a choice of coordinates, not an event.

    Args:
        source: name of the recording.
        T_map_world: takes its world frame to the map frame.
        known: the MapFrame fluents on the board, by name.
        poses: the open Pose fluents on the board, by name.
    """
    stem = _stem(source)
    name = f"mapFrame_{stem}"
    pose = Pose.from_transform(T_map_world)
    frame = known.get(name)
    named = [str(value) for value in frame.values("hasPose")] if frame else []
    for pose_name in named:
        written = poses.get(pose_name)
        if written and _is_same(pose_of(written), pose):
            return []
    pose_name = f"poseMapFrame_{stem}_{len(named)}"
    properties = (
        Property("hasPose", "Pose", pose_name),
        Property("hasRecording", "xsd:string", source),
    )
    return [
        pose_fluent(pose_name, pose, UNKNOWN),
        Fluent(name, "MapFrame", UNKNOWN, UNKNOWN, properties),
    ]


def written_map_frame(
    source: str, known: Mapping[str, Fluent], poses: Mapping[str, Fluent]
) -> Transform | None:
    """`T_map_world` of a recording as the board has it; None if the board has none.

    Args:
        source: name of the recording.
        known: the MapFrame fluents on the board, by name.
        poses: the open Pose fluents on the board, by name.
    """
    frame = known.get(f"mapFrame_{_stem(source)}")
    names = [str(value) for value in frame.values("hasPose")] if frame else []
    written = [poses[name] for name in names if name in poses]
    return pose_of(written[-1]).to_transform() if written else None


def _stem(source: str) -> str:
    return re.sub(r"\W+", "_", Path(source).name) or "recording"


def _is_same(a: Pose, b: Pose) -> bool:
    difference = a.to_transform().matrix - b.to_transform().matrix
    return bool(np.abs(difference).max() < _SAME_TRANSFORM)
