"""The fluents that a piece of furniture is made of: pose, boxes, planes, top, evidence (pure)."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.geometry import BoundingBox, FloatArray
from fluentboard.model.interval import UNKNOWN, Interval
from fluentboard_modules.geometry_fluents import box_fluents, pose_fluent
from fluentboard_modules.mapping.furniture_item import FurnitureItem
from fluentboard_modules.mapping.plane_fluents import plane_fluents
from fluentboard_modules.mapping.written_furniture import Written
from fluentboard_modules.statements import Ending, Statement

_LEAST_AREA_M = 0.05  # nothing can be put on less


def last_planes(known: Written, item: FurnitureItem) -> tuple[Written, list[Statement]]:
    """The planes as all frames together show them, if more frames have seen them since."""
    if item.n_frames <= known.plane_frames:
        return known, []
    # By frames, so that a later run goes on with numbers of its own.
    change = Interval.at(later(known.confirmed_s, item.last_seen_s))
    number = max(item.n_frames, known.plane_number + 1)
    planes, links = plane_fluents(plane_name(known.name, number), item, change)
    statements: list[Statement] = [
        *planes,
        Fluent(known.name, item.class_name, properties=links),
        *(Ending(name, change) for name in known.planes if name not in names_of(planes)),
    ]
    known = replace(known, planes=names_of(planes), plane_frames=item.n_frames, plane_number=number)
    return known, statements


def evidence_of(
    known: Written, seen_s: Sequence[float], belief: float, now_s: float, *, is_due: bool
) -> tuple[Written, list[Statement]]:
    """How far the piece is believed in, and the frames since the last evidence that support it.

    Args:
        known: what the board has been told.
        seen_s: stamps of the frames that show it.
        belief: that it is there.
        now_s: time of the look.
        is_due: whether it is time to tell more; the first time it always is.
    """
    until_s = -math.inf if known.frames_until_s is None else known.frames_until_s
    frames_s = [stamp_s for stamp_s in seen_s if stamp_s > until_s]
    belief = round(belief, 4)
    is_due |= not known.evidence
    is_past = now_s < until_s or (known.confirmed_s is not None and now_s < known.confirmed_s)
    if is_past or not is_due or not (frames_s or belief != known.belief):
        return known, []
    number = known.evidence_number + 1
    name = f"evidence{_capitalised(known.name)}_{number}"
    now = Interval.at(now_s)
    fluent = Fluent(
        name,
        "ExistenceEvidence",
        now,
        UNKNOWN,
        (
            Property("isEvidenceAbout", known.estimate.class_name, known.name),
            Property("hasExistenceBelief", "xsd:double", belief),
            *(Property("hasSupportingFrame", "xsd:double", stamp_s) for stamp_s in frames_s),
        ),
    )
    ended = [Ending(known.evidence, now)] if known.evidence else []
    known = replace(
        known,
        evidence=name,
        evidence_number=number,
        belief=belief,
        frames_until_s=max([until_s, *frames_s]) if frames_s else known.frames_until_s,
    )
    return known, [fluent, *ended]


def place_endings(known: Written, finish: Interval) -> tuple[Written, list[Statement]]:
    """Everything that says where a piece is ends; the piece itself does not."""
    names = [*known.parts, *known.planes, *known.area_parts]
    names += [name for area in known.areas for name in (*area.parts, area.name)]
    names += [name for name in (known.area, known.evidence) if name]
    known = replace(
        known, parts=(), planes=(), plane_frames=0, area="", area_parts=(), areas=(), evidence=""
    )
    return known, [Ending(name, finish) for name in names]


def placed(known: Written, item: FurnitureItem, since: Interval) -> tuple[Written, list[Statement]]:
    """The placing area on top of a piece, new or with a new box."""
    if item.placing_area is None or min(item.placing_area.sizes[:2]) < _LEAST_AREA_M:
        return known, []
    # A name is used once: a piece that was away has a new area.
    number = f"_{known.generation}" if known.generation else ""
    name = known.area or f"placingArea{_capitalised(known.name)}{number}"
    stem = f"{_capitalised(name)}_{known.generation}"
    parts = box_fluents(f"bBox{stem}", f"poseBB{stem}", _surface(item.placing_area), since)
    properties = [Property("hasBoundingBox", "BBox", parts[0].name)]
    if not known.area:
        properties.append(Property("isAreaOf", item.class_name, known.name))
    start = UNKNOWN if known.area else since
    area = Fluent(name, "PlacingArea", start, UNKNOWN, tuple(properties))
    old = [Ending(part, since) for part in known.area_parts]
    return replace(known, area=name, area_parts=names_of(parts)), [*parts, area, *old]


def _surface(space: BoundingBox) -> BoundingBox:
    """The bottom of the space above a top: an area is a part of a surface and has no height."""
    low = replace(space.pose, z=space.pose.z - 0.5 * space.z_size)
    return BoundingBox(low, space.x_size, space.y_size, 0.0)


def geometry(
    name: str, item: FurnitureItem, generation: int, start: Interval
) -> tuple[list[Fluent], tuple[Property, ...]]:
    """Pose, box and box-pose fluents of Listing 4.1, and the properties that refer to them."""
    stem = f"{_capitalised(name)}_{generation}"
    pose = pose_fluent(f"pose{stem}", item.pose, start)
    fluents = [
        replace(pose, properties=(*pose.properties, *_deviations(item))),
        *box_fluents(f"bBox{stem}", f"poseBB{stem}", item.box, start),
    ]
    links = (
        Property("hasPose", "Pose", f"pose{stem}"),
        Property("hasBoundingBox", "BBox", f"bBox{stem}"),
    )
    return fluents, links


def plane_name(name: str, number: int) -> str:
    """Name of the main plane of a piece."""
    return f"plane{_capitalised(name)}_{number}"


def rule_properties(rules: Iterable[str]) -> tuple[Property, ...]:
    """The rules that explain a piece."""
    return tuple(Property("isExplainedByRule", "xsd:string", rule) for rule in rules)


def fit_properties(item: FurnitureItem, known_model: str) -> tuple[Property, ...]:
    """The CAD model and how well it fits, when it is a new one."""
    if item.cad is None or item.cad.model == known_model:
        return ()
    return (
        Property("hasCadModel", "xsd:string", item.cad.model),
        Property("hasFitScore", "xsd:double", round(item.cad.score, 4)),
    )


def _deviations(item: FurnitureItem) -> tuple[Property, ...]:
    """How uncertain a verified pose is, as standard deviations."""
    if item.cad is None:
        return ()
    xx, yy, yaw = np.diag(item.cad.covariance).tolist()
    return (
        Property("hasPositionDeviation", "xsd:double", round(math.sqrt(0.5 * (xx + yy)), 4)),
        Property("hasYawDeviation", "xsd:double", round(math.sqrt(yaw), 4)),
        Property("hasPoseCovariance", "xsd:string", _covariance_text(item.cad.covariance)),
    )


def _covariance_text(covariance: FloatArray) -> str:
    """`(3, 3)`; of x, y and yaw, as JSON with three digits that count."""
    return json.dumps([[float(f"{value:.3g}") for value in row] for row in covariance.tolist()])


def names_of(fluents: Iterable[Fluent]) -> tuple[str, ...]:
    """Names, in order."""
    return tuple(fluent.name for fluent in fluents)


def _capitalised(name: str) -> str:
    return name[0].upper() + name[1:]


def later(before_s: float | None, now_s: float) -> float:
    """The later of two times, the first of which may be unknown."""
    return now_s if before_s is None else max(before_s, now_s)
