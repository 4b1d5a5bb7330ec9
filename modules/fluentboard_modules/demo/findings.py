"""What the board says about furniture, and how far that is from the truth (pure)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from fluentboard.model.fluent import Fluent
from fluentboard.model.geometry import BoundingBox, Pose
from fluentboard_modules.geometry_fluents import box_of, pose_of

# A detection counts if it is this near to a true piece of its class (Section 3.3.1), in metres.
TOLERANCE_M: Mapping[str, float] = {"Chair": 0.15, "Shelf": 0.25, "Cabinet": 0.25}
_OTHER_TOLERANCE_M = 0.45


@dataclass(frozen=True, slots=True)
class Finding:
    """A piece of furniture as the board has it at present.

    Attributes:
        name: of its fluent.
        class_name: its class.
        pose: its present pose.
        box: its present bounding box.
        confidence: of its main plane, or None if the board does not say.
        frames: how many frames saw its main plane, 0 if the board does not say.
        rules: that explain it.
    """

    name: str
    class_name: str
    pose: Pose
    box: BoundingBox
    confidence: float | None
    frames: int
    rules: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class TruePiece:
    """A piece of furniture as it really stands: name, class, and box in the map frame."""

    name: str
    class_name: str
    box: BoundingBox


@dataclass(frozen=True, slots=True)
class Match:
    """A finding with the true piece that it is; either is None if it has no partner.

    Attributes:
        found: what the board says.
        true: what is there.
        distance_m: between the centres of the two boxes, seen from above.
    """

    found: Finding | None
    true: TruePiece | None
    distance_m: float = math.nan


def furniture_findings(furniture: Iterable[Fluent], parts: Mapping[str, Fluent]) -> list[Finding]:
    """The furniture on the board that is open and has an open pose and box.

    Args:
        furniture: the fluents of furniture.
        parts: open poses, boxes and planes, by name.
    """
    found: list[Finding] = []
    for thing in furniture:
        poses = _present(thing, "hasPose", parts)
        boxes = _present(thing, "hasBoundingBox", parts)
        if not thing.is_open or not poses or not boxes:
            continue
        planes = _present(thing, "hasMainPlane", parts)
        confidences = [float(c) for plane in planes for c in plane.values("hasConfidence")]
        frames = [int(n) for plane in planes for n in plane.values("hasFrameCount")]
        found.append(
            Finding(
                thing.name,
                thing.class_name,
                pose_of(poses[-1]),
                box_of(boxes[-1], parts),
                max(confidences, default=None),
                max(frames, default=0),
                tuple(str(rule) for rule in thing.values("isExplainedByRule")),
            )
        )
    return found


def compare(found: Sequence[Finding], true: Sequence[TruePiece]) -> list[Match]:
    """Findings and true pieces of the same class, nearest pairs first; each is used once.

    Pieces further apart than the tolerance of their class have no partner.
    """
    pairs = sorted(
        (
            (_distance_m(finding.box, piece.box), i, k)
            for i, finding in enumerate(found)
            for k, piece in enumerate(true)
            if finding.class_name == piece.class_name
        ),
    )
    partner_of: dict[int, tuple[int, float]] = {}
    taken: set[int] = set()
    for distance_m, i, k in pairs:
        tolerance_m = TOLERANCE_M.get(found[i].class_name, _OTHER_TOLERANCE_M)
        if i not in partner_of and k not in taken and distance_m <= tolerance_m:
            partner_of[i] = (k, distance_m)
            taken.add(k)
    matches = [
        Match(finding, true[partner_of[i][0]], partner_of[i][1])
        if i in partner_of
        else Match(finding, None)
        for i, finding in enumerate(found)
    ]
    return matches + [Match(None, piece) for k, piece in enumerate(true) if k not in taken]


def _present(thing: Fluent, relation: str, parts: Mapping[str, Fluent]) -> list[Fluent]:
    return [parts[str(name)] for name in thing.values(relation) if str(name) in parts]


def _distance_m(a: BoundingBox, b: BoundingBox) -> float:
    return math.hypot(a.pose.x - b.pose.x, a.pose.y - b.pose.y)
