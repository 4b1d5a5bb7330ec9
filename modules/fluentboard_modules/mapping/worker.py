"""The mapping worker: frames to furniture, placing areas and the map frame, on the board."""

from __future__ import annotations

import json
import logging
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from fluentboard.errors import FluentboardError, InvalidFrame, InvalidInput
from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.geometry import FloatArray, Pose, Transform
from fluentboard.model.interval import UNKNOWN, Interval
from fluentboard_client import AssertFluent, Client, Command, EndFluent, Event
from fluentboard_modules.frames.folders import FolderRecording
from fluentboard_modules.frames.gravity import align_with_gravity, place_in_map
from fluentboard_modules.frames.sensor_frame import FrameSource, SensorFrame
from fluentboard_modules.geometry_fluents import box_of, pose_fluent, pose_of
from fluentboard_modules.mapping.config import MappingConfig
from fluentboard_modules.mapping.floor import survey_floor
from fluentboard_modules.mapping.furniture_fluents import (
    Ending,
    Estimate,
    FurnitureFluents,
    Statement,
    UpdateConfig,
    Written,
)
from fluentboard_modules.mapping.furniture_map import FurnitureItem, FurnitureMap
from fluentboard_modules.mapping.rules import load_rules
from fluentboard_modules.mapping.surfaces import detect_regions
from fluentboard_ontology import read as read_ontology

logger = logging.getLogger(__name__)

_FLOOR_FRAMES = 20
_SAME_TRANSFORM = 1e-4


class MappingModule:
    """Mapping as the worker loop wants it.

    Args:
        source: name of the recording, for the map frame.
        T_map_world: takes the recording's world frame to the map frame.
        config: of the algorithms.
        update: how much has to change before the board is told.
    """

    name = "mapping"
    subscription = None

    def __init__(
        self,
        source: str,
        T_map_world: Transform,
        config: MappingConfig | None = None,
        update: UpdateConfig | None = None,
    ) -> None:
        self._source = source
        self._T_map_world = T_map_world
        self._config = config or MappingConfig()
        self._rules = load_rules(read_ontology("furniture"))
        self._map = FurnitureMap(self._rules, self._config.furniture, self._config.surfaces.noise)
        self._fluents = FurnitureFluents(
            config=update or UpdateConfig(),
            symmetry_order={
                furniture.name: furniture.symmetry_order
                for furniture in self._rules.furniture_classes
            },
        )
        self._last_s = 0.0

    @property
    def furniture(self) -> list[FurnitureItem]:
        """The furniture believed in at present."""
        return self._map.furniture()

    def begin(self, board: Client) -> Sequence[Command]:
        """Takes over what the board knows about furniture; writes the map frame."""
        known = list(board.fluents("Furniture", is_open=True))
        geometry = {
            fluent.name: fluent
            for class_name in ("Pose", "BBox", "PlacingArea", "Plane")
            for fluent in board.fluents(class_name, is_open=True)
        }
        ended = board.fluents("Furniture", is_open=False)
        self._fluents = replace(
            self._fluents,
            remembered=tuple(recollect(known, geometry)),
            names=frozenset(fluent.name for fluent in (*known, *ended)),
        )
        if self._fluents.remembered:
            logger.info("the board knows %d pieces of furniture", len(self._fluents.remembered))
        before = {f.name: f for f in board.fluents("MapFrame")}
        return commands_for(map_frame(self._source, self._T_map_world, before, geometry))

    def notice(self, event: Event) -> None:
        """Subscribes to nothing."""

    def process(self, frame: SensorFrame) -> Sequence[Command]:
        """What a frame changes about the furniture."""
        regions = detect_regions(frame, self._config.surfaces)
        self._map.update(frame, regions, self._rules.classify(regions))
        self._last_s = frame.stamp_s
        return self._written(final=False)

    def finish(self) -> Sequence[Command]:
        """The last, best estimates."""
        return self._written(final=True) if self._last_s else []

    def status(self) -> str:
        """How many pieces of each class."""
        counts = Counter(item.class_name for item in self._map.furniture())
        return ", ".join(f"{count} {name}" for name, count in sorted(counts.items()))

    def draw(self, directory: Path) -> Sequence[Path]:
        """The planes and furniture from above."""
        from fluentboard_modules.mapping.pictures import save_map

        _, regions, classification = self._map.classified_planes()
        return [save_map(regions, classification, self.furniture, directory / "map.png")]

    def _written(self, *, final: bool) -> list[Command]:
        self._fluents, statements = self._fluents.update(
            self._map.furniture(), self._last_s, final=final
        )
        return commands_for(statements)


def commands_for(statements: Iterable[Statement]) -> list[Command]:
    """The commands that make the board say this."""
    return [
        EndFluent(statement.name, statement.finish)
        if isinstance(statement, Ending)
        else AssertFluent(statement, merge=True)
        for statement in statements
    ]


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
    if not isinstance(source, FolderRecording):
        if gravity_world is not None:
            raise InvalidInput(
                f"{source.name} has z up already; --gravity is for recordings on disk"
            )
        return source, Transform.identity()
    gravity = source.gravity_world if gravity_world is None else gravity_world
    upright = source.in_map(align_with_gravity(gravity))
    floor = survey_floor(upright.every(max(1, len(source) // _FLOOR_FRAMES)), config.surfaces)
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


def map_frame(
    source: str,
    T_map_world: Transform,
    known: dict[str, Fluent],
    poses: dict[str, Fluent],
) -> list[Statement]:
    """The map frame of a recording as fluents, if the board does not say so already.

    It holds since ever and until further notice: it is a choice of coordinates, not an event.

    Args:
        source: name of the recording.
        T_map_world: takes its world frame to the map frame.
        known: the MapFrame fluents on the board, by name.
        poses: the open Pose fluents on the board, by name.
    """
    stem = re.sub(r"\W+", "_", Path(source).name) or "recording"
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


def recollect(known: Iterable[Fluent], geometry: dict[str, Fluent]) -> list[Written]:
    """What the board has been told about furniture in earlier runs.

    Args:
        known: open furniture fluents.
        geometry: open poses, boxes, placing areas and planes, by name.
    """
    found: list[Written] = []
    areas = {
        str(owner): area
        for area in geometry.values()
        if area.class_name == "PlacingArea"
        for owner in area.values("isAreaOf")
    }
    for thing in known:
        poses = _open_ones(thing, "hasPose", geometry)
        boxes = _open_ones(thing, "hasBoundingBox", geometry)
        if not poses or not boxes:
            continue  # written by somebody who gives no place
        pose, box = poses[-1], boxes[-1]
        try:
            estimate = Estimate(thing.class_name, pose_of(pose), box_of(box, geometry))
        except FluentboardError as problem:
            logger.warning("%s on the board is left alone: %s", thing.name, problem)
            continue
        planes = [
            *_open_ones(thing, "hasMainPlane", geometry),
            *_open_ones(thing, "hasPlane", geometry),
        ]
        area = areas.get(thing.name)
        area_boxes = _open_ones(area, "hasBoundingBox", geometry) if area else []
        found.append(
            Written(
                name=thing.name,
                estimate=estimate,
                confirmed_s=_latest_s(pose.start),
                generation=_generation(thing.values("hasPose")),
                parts=(pose.name, box.name, *_pose_names(box)),
                planes=tuple(plane.name for plane in planes),
                plane_frames=max((_frames(plane) for plane in planes), default=0),
                area=area.name if area else "",
                area_parts=tuple(
                    name for part in area_boxes for name in (part.name, *_pose_names(part))
                ),
                rules=tuple(str(rule) for rule in thing.values("isExplainedByRule")),
            )
        )
    return found


def _open_ones(thing: Fluent, relation: str, by_name: dict[str, Fluent]) -> list[Fluent]:
    names = (str(value) for value in thing.values(relation))
    return [by_name[name] for name in names if name in by_name]


def _pose_names(box: Fluent) -> list[str]:
    return [str(name) for name in box.values("hasPose")]


def _generation(pose_names: Iterable[object]) -> int:
    """The highest number at the end of the names, so that the next one is free."""
    numbers = [re.search(r"_(\d+)$", str(name)) for name in pose_names]
    return max((int(found.group(1)) for found in numbers if found), default=0)


def _latest_s(start: Interval) -> float | None:
    times = [time_s for time_s in (start.earliest, start.latest) if time_s is not None]
    return max(times, default=None)


def _frames(plane: Fluent) -> int:
    return max((int(value) for value in plane.values("hasFrameCount")), default=0)


def _is_same(a: Pose, b: Pose) -> bool:
    difference = a.to_transform().matrix - b.to_transform().matrix
    return bool(np.abs(difference).max() < _SAME_TRANSFORM)
