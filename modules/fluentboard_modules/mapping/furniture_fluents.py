"""Furniture to fluents: the statements that bring the board up to what was seen (pure).

Every piece of furniture is a fluent of its class with poses and bounding boxes as fluents of their
own (Listing 4.1). When a piece has moved, or more of it has been seen, the old pose and box are
ended and new ones begin (Listing 4.2). Tops on which things can be put are placing areas.

What the intervals say. A piece that is first seen at time t stands there at t and may have stood
there before, for all anybody knows: its start is [unknown, t], so it certainly holds from t on and
possibly at any time before. A wholly unknown start would say that it certainly stood there before
the record began, which nobody has seen. A change between two looks at s and t happened at some time
in [s, t]: the old pose ends within that interval, and the new one starts within it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.geometry import BoundingBox, Pose
from fluentboard.model.interval import UNKNOWN, Interval
from fluentboard_modules.geometry_fluents import box_fluents, pose_fluent
from fluentboard_modules.mapping.area_fluents import WrittenArea, area_fluents, floor_areas
from fluentboard_modules.mapping.furniture_item import FurnitureItem, box_overlap
from fluentboard_modules.mapping.plane_fluents import plane_fluents
from fluentboard_modules.statements import Ending, Statement

_LEAST_AREA_M = 0.05  # nothing can be put on less


class UpdateConfig(BaseModel):
    """How much has to change before the board is told.

    The thesis asks for a threshold (Section 4.2.4) without naming one.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    position_m: float = Field(
        0.05, gt=0.0, description="Poses of a hand-held Kinect agree to 2-4 cm (7-Scenes)."
    )
    angle_deg: float = Field(5.0, gt=0.0, description="Turn about the vertical.")
    size_m: float = Field(0.08, gt=0.0, description="An edge that grew as more of it was seen.")
    final_share: float = Field(
        0.2,
        gt=0.0,
        le=1.0,
        description="Share of these thresholds that counts at the end of a run: the last estimate "
        "is the best.",
    )
    rest_s: float = Field(
        2.0,
        ge=0.0,
        description="A piece that grows with every frame is not written more often than this, "
        "unless it has changed by `urgent` thresholds.",
    )
    urgent: float = Field(4.0, ge=1.0, description="In thresholds: 20 cm, 20 degrees.")
    same_place_overlap: float = Field(
        0.4,
        gt=0.0,
        le=1.0,
        description="Share of the smaller footprint by which a piece seen now is one that the "
        "board knows from before.",
    )


@dataclass(frozen=True, slots=True)
class Estimate:
    """Where a piece of furniture stands and how large it is, as far as the board is concerned."""

    class_name: str
    pose: Pose
    box: BoundingBox
    symmetry_order: int = 1

    def differs(self, other: Estimate, config: UpdateConfig, share: float) -> bool:
        """Whether pose or box differ by more than that share of the thresholds."""
        for a, b in ((self.pose, other.pose), (self.box.pose, other.box.pose)):
            if math.dist((a.x, a.y, a.z), (b.x, b.y, b.z)) > share * config.position_m:
                return True
        if np.abs(self.box.sizes - other.box.sizes).max() > share * config.size_m:
            return True
        turn = 2.0 * math.pi / other.symmetry_order  # a table turned by half a turn is the same
        angle = math.remainder(other.pose.yaw_rad - self.pose.yaw_rad, turn)
        return abs(angle) > share * math.radians(config.angle_deg)


@dataclass(frozen=True, slots=True)
class Written:
    """What the board has been told about a piece of furniture.

    Attributes:
        name: of its fluent.
        estimate: its pose and box as written.
        confirmed_s: the last time it was seen as it was written, in seconds; None if nobody knows.
        written_s: time of the look that was written last; None if nobody knows.
        generation: number of the present pose and box, 0 for the first.
        parts: names of the present pose, box and box-pose fluents.
        planes: names of the present plane fluents.
        plane_frames: how many frames had seen these when they were written.
        area: name of the placing area, or empty.
        area_parts: names of its present box and box-pose fluents.
        rules: written as its explanation.
        areas: on the floor at it.
        model: the CAD model that was written.
    """

    name: str
    estimate: Estimate
    confirmed_s: float | None
    generation: int
    parts: tuple[str, ...]
    planes: tuple[str, ...] = ()
    plane_frames: int = 0
    area: str = ""
    area_parts: tuple[str, ...] = ()
    rules: tuple[str, ...] = ()
    areas: tuple[WrittenArea, ...] = ()
    model: str = ""
    written_s: float | None = None


@dataclass(frozen=True, slots=True)
class FurnitureFluents:
    """What the board has been told so far; `update` gives the next state and what to write.

    Attributes:
        written: by the identifier that the furniture map gave the piece.
        remembered: what the board knew before, and nobody has seen again yet.
        names: names of furniture that are taken.
        config: thresholds.
        symmetry_order: per class, how many turns within a full circle look alike.
    """

    written: Mapping[str, Written] = field(default_factory=dict[str, Written])
    remembered: tuple[Written, ...] = ()
    names: frozenset[str] = frozenset()
    config: UpdateConfig = field(default_factory=UpdateConfig)
    symmetry_order: Mapping[str, int] = field(default_factory=dict[str, int])

    def update(
        self, items: Sequence[FurnitureItem], now_s: float, *, final: bool = False
    ) -> tuple[FurnitureFluents, list[Statement]]:
        """The statements that a look leads to, and what the board has been told after them.

        Args:
            items: all furniture that is believed in at present.
            now_s: time of the look.
            final: whether it is the last one; then small improvements are written too.
        """
        written = dict(self.written)
        remembered = list(self.remembered)
        names = set(self.names)
        statements: list[Statement] = []
        believed = {item.identifier for item in items}
        for identifier in [known for known in written if known not in believed]:
            statements += _retraction(written.pop(identifier), now_s)
        for item in items:
            known = written.get(item.identifier)
            if known is None:
                known = self._recalled(item, remembered)
            if known is None:
                name = _free_name(item.class_name, names)
                names.add(name)
                known, new = self._introduction(name, item)
            else:
                known, new = self._revision(known, item, final)
            statements += new
            if final:
                known, new = _last_planes(known, item)
                statements += new
            written[item.identifier] = known
        state = replace(self, written=written, remembered=tuple(remembered), names=frozenset(names))
        return state, statements

    def _estimate(self, item: FurnitureItem) -> Estimate:
        order = self.symmetry_order.get(item.class_name, 1)
        return Estimate(item.class_name, item.pose, item.box, order)

    def _recalled(self, item: FurnitureItem, remembered: list[Written]) -> Written | None:
        """The piece that the board knows from before, taken off the list, or None."""
        rated = [
            (box_overlap(known.estimate.box, item.box), known)
            for known in remembered
            if known.estimate.class_name == item.class_name
        ]
        best = max(rated, key=lambda pair: pair[0], default=None)
        if best is None or best[0] < self.config.same_place_overlap:
            return None
        remembered.remove(best[1])
        return best[1]

    def _introduction(self, name: str, item: FurnitureItem) -> tuple[Written, list[Statement]]:
        start = Interval(None, item.first_seen_s)
        parts, links = _geometry(name, item, 0, start)
        planes, plane_links = plane_fluents(_plane_name(name, 0), item, start)
        properties = (*links, *plane_links, *_rules(item.rules), *_fit(item, ""))
        known = Written(
            name,
            self._estimate(item),
            item.last_seen_s,
            generation=0,
            parts=_names(parts),
            planes=_names(planes),
            plane_frames=item.n_frames,
            rules=item.rules,
            written_s=item.last_seen_s,
            model=item.cad.model if item.cad is not None else "",
        )
        thing = Fluent(name, item.class_name, start, UNKNOWN, properties)
        known, area = _placed(known, item, start)
        known, on_floor = self._on_the_floor(known, item, start)
        return known, [thing, *parts, *planes, *area, *on_floor]

    def _revision(
        self, known: Written, item: FurnitureItem, final: bool
    ) -> tuple[Written, list[Statement]]:
        estimate = self._estimate(item)
        new_rules = tuple(rule for rule in item.rules if rule not in known.rules)
        share = self.config.final_share if final else 1.0
        # A recording may be played again: what the board knows from later times stays.
        is_past = known.confirmed_s is not None and item.last_seen_s < known.confirmed_s
        if is_past or not known.estimate.differs(estimate, self.config, share):
            known = replace(
                known,
                confirmed_s=_later(known.confirmed_s, item.last_seen_s),
                rules=(*known.rules, *new_rules),
            )
            if not new_rules:
                return known, []
            return known, [Fluent(known.name, item.class_name, properties=_rules(new_rules))]
        if not final and self._is_resting(known, estimate, item.last_seen_s):
            return known, []
        change = Interval(known.confirmed_s, item.last_seen_s)
        generation = known.generation + 1
        fit = _fit(item, known.model)
        parts, links = _geometry(known.name, item, generation, change)
        statements: list[Statement] = [
            *parts,
            Fluent(known.name, item.class_name, properties=(*links, *_rules(new_rules), *fit)),
            *(Ending(part, change) for part in known.parts),
        ]
        known = replace(
            known,
            estimate=estimate,
            confirmed_s=_later(known.confirmed_s, item.last_seen_s),
            generation=generation,
            parts=_names(parts),
            rules=(*known.rules, *new_rules),
            model=item.cad.model if item.cad is not None else known.model,
            written_s=item.last_seen_s,
        )
        known, area = _placed(known, item, change)
        known, on_floor = self._on_the_floor(known, item, change)
        return known, [*statements, *area, *on_floor]

    def _on_the_floor(
        self, known: Written, item: FurnitureItem, since: Interval
    ) -> tuple[Written, list[Statement]]:
        """The areas on the floor at a piece, new or with new boxes."""
        areas = floor_areas(item, self.symmetry_order.get(item.class_name, 1))
        written, fluents, ended = area_fluents(
            known.name, item, areas, known.areas, known.generation, since
        )
        endings = [Ending(name, since) for name in ended]
        return replace(known, areas=written), [*fluents, *endings]

    def _is_resting(self, known: Written, estimate: Estimate, now_s: float) -> bool:
        """Whether it was written a moment ago and has not changed much since."""
        if known.written_s is None or now_s - known.written_s >= self.config.rest_s:
            return False
        return not known.estimate.differs(estimate, self.config, self.config.urgent)


def _retraction(known: Written, now_s: float) -> list[Statement]:
    """Everything about a piece that is not believed in any more ends."""
    if (
        known.confirmed_s is not None and now_s < known.confirmed_s
    ):  # a recording is played again, and this is before its time
        return []
    finish = Interval(known.confirmed_s, now_s)
    names = [known.name, *known.parts, *known.planes, *known.area_parts]
    names += [name for area in known.areas for name in (*area.parts, area.name)]
    return [Ending(name, finish) for name in (*names, *filter(None, [known.area]))]


def _last_planes(known: Written, item: FurnitureItem) -> tuple[Written, list[Statement]]:
    """The planes as all frames together show them, if more frames have seen them since."""
    if item.n_frames <= known.plane_frames:
        return known, []
    # By frames, so that a later run goes on with numbers of its own.
    change = Interval.at(_later(known.confirmed_s, item.last_seen_s))
    planes, links = plane_fluents(_plane_name(known.name, item.n_frames), item, change)
    statements: list[Statement] = [
        *planes,
        Fluent(known.name, item.class_name, properties=links),
        *(Ending(name, change) for name in known.planes if name not in _names(planes)),
    ]
    known = replace(known, planes=_names(planes), plane_frames=item.n_frames)
    return known, statements


def _placed(
    known: Written, item: FurnitureItem, since: Interval
) -> tuple[Written, list[Statement]]:
    """The placing area on top of a piece, new or with a new box."""
    if item.placing_area is None or min(item.placing_area.sizes[:2]) < _LEAST_AREA_M:
        return known, []
    name = known.area or f"placingArea{_capitalised(known.name)}"
    stem = f"{_capitalised(name)}_{known.generation}"
    parts = box_fluents(f"bBox{stem}", f"poseBB{stem}", _surface(item.placing_area), since)
    properties = [Property("hasBoundingBox", "BBox", parts[0].name)]
    if not known.area:
        properties.append(Property("isAreaOf", item.class_name, known.name))
    start = UNKNOWN if known.area else since
    area = Fluent(name, "PlacingArea", start, UNKNOWN, tuple(properties))
    old = [Ending(part, since) for part in known.area_parts]
    return replace(known, area=name, area_parts=_names(parts)), [*parts, area, *old]


def _surface(space: BoundingBox) -> BoundingBox:
    """The bottom of the space above a top: an area is a part of a surface and has no height."""
    low = replace(space.pose, z=space.pose.z - 0.5 * space.z_size)
    return BoundingBox(low, space.x_size, space.y_size, 0.0)


def _geometry(
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


def _plane_name(name: str, number: int) -> str:
    return f"plane{_capitalised(name)}_{number}"


def _rules(rules: Iterable[str]) -> tuple[Property, ...]:
    return tuple(Property("isExplainedByRule", "xsd:string", rule) for rule in rules)


def _fit(item: FurnitureItem, known_model: str) -> tuple[Property, ...]:
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
    )


def _names(fluents: Iterable[Fluent]) -> tuple[str, ...]:
    return tuple(fluent.name for fluent in fluents)


def _free_name(class_name: str, taken: set[str]) -> str:
    stem = class_name[0].lower() + class_name[1:]
    number = 1
    while f"{stem}{number}" in taken:
        number += 1
    return f"{stem}{number}"


def _capitalised(name: str) -> str:
    return name[0].upper() + name[1:]


def _later(before_s: float | None, now_s: float) -> float:
    return now_s if before_s is None else max(before_s, now_s)
