"""What the board says about objects, whoever wrote it (pure)."""

from __future__ import annotations

import logging
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from fluentboard.errors import FluentboardError
from fluentboard.model.fluent import Fluent
from fluentboard.model.geometry import BoundingBox, FloatArray
from fluentboard.model.interval import Interval
from fluentboard_modules.anchoring.areas import PlacingArea
from fluentboard_modules.anchoring.evidence import read_ratings
from fluentboard_modules.anchoring.written import Written
from fluentboard_modules.geometry_fluents import box_of

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class BoardView:
    """Open fluents of the board, by class.

    Attributes:
        objects: tableware and personal items.
        geometry: poses and boxes, by name.
        areas: placing areas.
        holdings: what grippers hold.
        relations: `On` fluents.
        evidence: of this module.
    """

    objects: Sequence[Fluent] = ()
    geometry: Mapping[str, Fluent] = field(default_factory=dict[str, Fluent])
    areas: Sequence[Fluent] = ()
    holdings: Sequence[Fluent] = ()
    relations: Sequence[Fluent] = ()
    evidence: Sequence[Fluent] = ()

    @property
    def open_names(self) -> frozenset[str]:
        """Names of all of them."""
        groups = (self.objects, self.relations, self.evidence)
        return frozenset(self.geometry) | {fluent.name for group in groups for fluent in group}

    def held(self) -> dict[str, Interval]:
        """What is held, by name, and since when."""
        return {
            str(thing): holding.start
            for holding in self.holdings
            for thing in holding.values("hasPassiveObject")
        }

    def placing_areas(self) -> list[PlacingArea]:
        """The areas whose extent is known."""
        found: list[PlacingArea] = []
        for area in self.areas:
            box = _latest_box(area, self.geometry)
            if box is not None:
                found.append(PlacingArea(area.name, area.class_name, box[1]))
        return found


@dataclass(frozen=True, slots=True, eq=False)
class Recollection:
    """An object that the board knows.

    Attributes:
        written: its present fluents.
        author: of the object fluent.
        confidence: `(k,)`; of local recognition, as the last class evidence has it; None if there
            is none for these classes.
    """

    written: Written
    author: str
    confidence: FloatArray | None = None


def recollect(view: BoardView, classes: Sequence[str]) -> list[Recollection]:
    """The objects on the board that have a box.

    Args:
        view: what is open.
        classes: of the recogniser.
    """
    relations = {
        str(thing): relation
        for relation in view.relations
        for thing in relation.values("hasPhysicalEntity")
    }
    evidence = _by_subject(view.evidence)
    found: list[Recollection] = []
    for thing in view.objects:
        box = _latest_box(thing, view.geometry)
        if box is None:
            continue  # written by somebody who gives no place
        box_fluent, extent = box
        poses = [str(n) for n in thing.values("hasPose") if str(n) in view.geometry]
        on = relations.get(thing.name)
        told = evidence.get((thing.name, "ClassEvidence"))
        seen = evidence.get((thing.name, "PresenceEvidence"))
        confidence = None
        if told is not None and told.values("hasLocalConfidences"):
            confidence = read_ratings(str(told.values("hasLocalConfidences")[-1]), classes)
        written = Written(
            name=thing.name,
            class_name=thing.class_name,
            box=extent,
            confirmed_s=_latest_s(box_fluent.start),
            generation=_generation(thing.values("hasBoundingBox")),
            parts=(
                *poses[-1:],
                box_fluent.name,
                *(str(n) for n in box_fluent.values("hasPose") if str(n) in view.geometry),
            ),
            on=on.name if on else "",
            area=str(next(iter(on.values("hasArea")), "")) if on else "",
            class_evidence=told.name if told else "",
            presence=str(seen.values("hasPresence")[-1]) if seen else "",
            presence_evidence=seen.name if seen else "",
        )
        found.append(Recollection(written, thing.author, confidence))
    return found


def _by_subject(evidence: Iterable[Fluent]) -> dict[tuple[str, str], Fluent]:
    return {
        (str(subject), fluent.class_name): fluent
        for fluent in evidence
        for subject in fluent.values("isEvidenceFor")
    }


def _latest_box(thing: Fluent, geometry: Mapping[str, Fluent]) -> tuple[Fluent, BoundingBox] | None:
    names = [str(name) for name in thing.values("hasBoundingBox")]
    boxes = [geometry[name] for name in names if name in geometry]
    if not boxes:
        return None
    try:
        return boxes[-1], box_of(boxes[-1], geometry)
    except FluentboardError as problem:
        logger.warning("%s on the board is left alone: %s", thing.name, problem)
        return None


def _generation(names: Iterable[object]) -> int:
    """The highest number at the end of the names, so that the next one is free."""
    numbers = [re.search(r"_(\d+)$", str(name)) for name in names]
    return max((int(found.group(1)) for found in numbers if found), default=0)


def _latest_s(start: Interval) -> float | None:
    times = [time_s for time_s in (start.earliest, start.latest) if time_s is not None]
    return max(times, default=None)
