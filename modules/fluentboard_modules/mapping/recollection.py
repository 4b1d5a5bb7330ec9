"""What the board knows about furniture from earlier runs (pure)."""

from __future__ import annotations

import logging
import re
from collections.abc import Iterable, Mapping

from fluentboard.errors import FluentboardError
from fluentboard.model.fluent import Fluent
from fluentboard.model.interval import Interval
from fluentboard_modules.geometry_fluents import box_of, pose_of
from fluentboard_modules.mapping.area_fluents import WrittenArea
from fluentboard_modules.mapping.furniture_fluents import Estimate, Written

FLOOR_AREAS = ("SittingArea", "ManipulationArea")

logger = logging.getLogger(__name__)


def recollect(known: Iterable[Fluent], geometry: Mapping[str, Fluent]) -> list[Written]:
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
                areas=_floor_areas(thing.name, geometry),
                model=str(next(iter(thing.values("hasCadModel")[-1:]), "")),
                rules=tuple(str(rule) for rule in thing.values("isExplainedByRule")),
            )
        )
    return found


def _floor_areas(owner: str, geometry: Mapping[str, Fluent]) -> tuple[WrittenArea, ...]:
    found: list[WrittenArea] = []
    for name in sorted(geometry):
        area = geometry[name]
        if area.class_name in FLOOR_AREAS and owner in map(str, area.values("isAreaOf")):
            boxes = _open_ones(area, "hasBoundingBox", geometry)
            parts = tuple(part for box in boxes for part in (box.name, *_pose_names(box)))
            found.append(WrittenArea(name, area.class_name, parts))
    return tuple(found)


def _open_ones(thing: Fluent, relation: str, by_name: Mapping[str, Fluent]) -> list[Fluent]:
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
