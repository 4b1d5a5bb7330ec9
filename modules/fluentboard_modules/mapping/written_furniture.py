"""What the board has been told about furniture, and when it is told more."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from pydantic import Field

from fluentboard.model.geometry import BoundingBox, Pose
from fluentboard.model.interval import Interval
from fluentboard_modules.mapping.area_fluents import WrittenArea
from fluentboard_modules.settings import Settings


class UpdateConfig(Settings):
    """How much has to change before the board is told.

    The thesis asks for a threshold (Section 4.2.4) without naming one.
    """

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
    belief: float = Field(
        0.1,
        gt=0.0,
        lt=1.0,
        description="Change of the existence belief; 0 and 1 are never reached.",
    )
    missing_s: float = Field(
        30.0,
        ge=0.0,
        description="A piece that has gone from its place is looked for so long, then it is ended.",
    )
    same_size_m: float = Field(
        0.12, ge=0.0, description="Edges of a piece that has moved, seen from another side."
    )
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
        plane_number: the last number in a name of its planes.
        evidence: name of the present evidence fluent, or empty.
        evidence_number: the last number in a name of its evidence.
        belief: that it is there, as written last.
        belief_before: the belief that earlier runs ended with; the prior if there were none.
        frames_until_s: stamp of the last supporting frame that was written; None before the first.
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
    plane_number: int = 0
    evidence: str = ""
    evidence_number: int = -1
    belief: float = 0.0
    belief_before: float = 0.5
    frames_until_s: float | None = None


@dataclass(frozen=True, slots=True)
class Departed:
    """A piece that is not where it was: carried off, or moved to where nobody has looked yet.

    Attributes:
        known: what the board has been told about it; what says where it is has been ended.
        since: when it went.
    """

    known: Written
    since: Interval

    def may_be(self, estimate: Estimate, first_seen_s: float, config: UpdateConfig) -> bool:
        """Whether a piece that turned up elsewhere may be this one: nothing is in two places."""
        before = self.known.estimate
        if before.class_name != estimate.class_name:
            return False
        if self.known.confirmed_s is not None and first_seen_s < self.known.confirmed_s:
            return False
        change = np.sort(before.box.sizes[:2]) - np.sort(estimate.box.sizes[:2])
        return bool(np.abs(change).max() <= config.same_size_m)
