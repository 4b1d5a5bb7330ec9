"""What the board knows about furniture from earlier runs (pure)."""

from __future__ import annotations

import logging
import re
from collections.abc import Iterable, Mapping
from typing import Any

from fluentboard.errors import FluentboardError
from fluentboard.model.fluent import Fluent
from fluentboard.model.interval import Interval
from fluentboard_modules.geometry_fluents import box_of, pose_of
from fluentboard_modules.mapping.area_fluents import WrittenArea
from fluentboard_modules.mapping.config import ExistenceConfig
from fluentboard_modules.mapping.written_furniture import Estimate, Written

FLOOR_AREAS = ("SittingArea", "ManipulationArea")

logger = logging.getLogger(__name__)


def recollect(
    known: Iterable[Fluent],
    geometry: Mapping[str, Fluent],
    existence: ExistenceConfig | None = None,
) -> list[Written]:
    """What the board has been told about furniture in earlier runs.

    Args:
        known: open furniture fluents.
        geometry: open poses, boxes, placing areas, planes and evidence, by name.
        existence: what is believed of a piece without evidence.
    """
    existence = existence or ExistenceConfig()
    found: list[Written] = []
    areas = {
        str(owner): area
        for area in geometry.values()
        if area.class_name == "PlacingArea"
        for owner in area.values("isAreaOf")
    }
    evidence = {
        str(about): fluent
        for fluent in geometry.values()
        if fluent.class_name == "ExistenceEvidence"
        for about in fluent.values("isEvidenceAbout")
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
                confirmed_s=_latest_s(pose.start, evidence.get(thing.name)),
                generation=_generation(thing.values("hasPose")),
                parts=(pose.name, box.name, *_pose_names(box)),
                planes=tuple(plane.name for plane in planes),
                plane_frames=max((_frames(plane) for plane in planes), default=0),
                plane_number=_generation(thing.values("hasMainPlane")),
                area=area.name if area else "",
                area_parts=tuple(
                    name for part in area_boxes for name in (part.name, *_pose_names(part))
                ),
                areas=_floor_areas(thing.name, geometry),
                model=str(next(iter(thing.values("hasCadModel")[-1:]), "")),
                rules=tuple(str(rule) for rule in thing.values("isExplainedByRule")),
                **_believed(evidence.get(thing.name), existence),
            )
        )
    return found


def _believed(evidence: Fluent | None, existence: ExistenceConfig) -> dict[str, Any]:
    """What the open evidence says, as attributes of `Written`."""
    if evidence is None:
        return {"belief_before": existence.prior}
    belief = max((float(b) for b in evidence.values("hasExistenceBelief")), default=existence.prior)
    belief = min(max(belief, 1.0 - existence.belief_max), existence.belief_max)
    frames_s = [float(stamp_s) for stamp_s in evidence.values("hasSupportingFrame")]
    return {
        "evidence": evidence.name,
        "evidence_number": _generation([evidence.name]),
        "belief": belief,
        "belief_before": belief,
        "frames_until_s": max(frames_s, default=None),
    }


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


def _latest_s(start: Interval, evidence: Fluent | None) -> float | None:
    """The last time the board knows of at which a piece stood there."""
    times = [time_s for time_s in (start.earliest, start.latest) if time_s is not None]
    if evidence is not None:
        times += [float(stamp_s) for stamp_s in evidence.values("hasSupportingFrame")]
    return max(times, default=None)


def _frames(plane: Fluent) -> int:
    return max((int(value) for value in plane.values("hasFrameCount")), default=0)
