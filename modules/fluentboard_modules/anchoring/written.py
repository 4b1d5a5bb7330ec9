"""What the board has been told about an object."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fluentboard.model.geometry import BoundingBox
from fluentboard_modules.anchoring.config import UpdateConfig
from fluentboard_modules.anchoring.evidence import Rating

_ROUND = 1.15  # less oblong boxes have no direction


@dataclass(frozen=True, slots=True, eq=False)
class Written:
    """The present fluents of an object.

    Attributes:
        name: of the object fluent.
        class_name: of the object fluent.
        box: as written.
        confirmed_s: the last time it was seen as it was written; None if nobody knows.
        written_s: when its place was written last; None if nobody knows.
        generation: number of the present pose and box, 0 for the first.
        parts: names of the present pose, box and box-pose fluents.
        on: name of the present On fluent, or empty.
        area: name of the placing area that it stands on, or empty.
        rating: of its class, as written.
        rated_s: when that was written.
        class_evidence: name of the present fluent that says so.
        presence: what looks at its place say, as written; empty while it is being seen.
        presence_next: what the last look said.
        presence_evidence: name of the present fluent that says so.
        doubts: looks in a row that contradict its class.
    """

    name: str
    class_name: str
    box: BoundingBox
    confirmed_s: float | None
    written_s: float | None = None
    generation: int = 0
    parts: tuple[str, ...] = ()
    on: str = ""
    area: str = ""
    rating: Rating | None = None
    rated_s: float | None = None
    class_evidence: str = ""
    presence: str = ""
    presence_next: str = ""
    presence_evidence: str = ""
    doubts: int = 0


def box_differs(old: BoundingBox, new: BoundingBox, config: UpdateConfig, share: float) -> bool:
    """Whether place, turn or size differ by more than that share of the thresholds."""
    a, b = old.pose, new.pose
    if math.dist((a.x, a.y, a.z), (b.x, b.y, b.z)) > share * config.position_m:
        return True
    if float(np.abs(np.sort(old.sizes) - np.sort(new.sizes)).max()) > share * config.size_m:
        return True
    if min(_oblong(old), _oblong(new)) < _ROUND:
        return False
    turn = math.remainder(b.yaw_rad - a.yaw_rad, math.pi)  # a box has no front
    return abs(turn) > share * math.radians(config.angle_deg)


def _oblong(box: BoundingBox) -> float:
    sides = sorted((max(box.x_size, 1e-3), max(box.y_size, 1e-3)))
    return sides[1] / sides[0]
