"""What the board says about furniture at present (pure)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from fluentboard.model.fluent import Fluent
from fluentboard.model.geometry import BoundingBox, Pose
from fluentboard_modules.geometry_fluents import box_of, pose_of


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


def _present(thing: Fluent, relation: str, parts: Mapping[str, Fluent]) -> list[Fluent]:
    return [parts[str(name)] for name in thing.values(relation) if str(name) in parts]
