"""What the demo makes of the board's fluents."""

from __future__ import annotations

from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.geometry import BoundingBox, Pose
from fluentboard.model.interval import UNKNOWN, Interval
from fluentboard_modules.demo.findings import furniture_findings
from fluentboard_modules.geometry_fluents import box_fluents, pose_fluent

SINCE = Interval(None, 4.0)


def a_box(x: float) -> BoundingBox:
    return BoundingBox(Pose(x, 1.0, 0.4), 0.5, 0.5, 0.8)


def test_finding_is_put_together_from_the_open_parts() -> None:
    old = pose_fluent("pose0", Pose(0.0, 1.0, 0.4), SINCE)
    new = pose_fluent("pose1", Pose(2.0, 1.0, 0.4), SINCE)
    box, box_pose = box_fluents("box1", "boxPose1", a_box(2.0), SINCE)
    plane = Fluent(
        "plane1",
        "ChairSeatPlane",
        properties=(
            Property("hasConfidence", "xsd:double", 0.7),
            Property("hasFrameCount", "xsd:integer", 12),
        ),
    )
    chair = Fluent(
        "chair1",
        "Chair",
        SINCE,
        UNKNOWN,
        (
            Property("hasPose", "Pose", old.name),
            Property("hasPose", "Pose", new.name),
            Property("hasBoundingBox", "BBox", box.name),
            Property("hasMainPlane", "ChairSeatPlane", plane.name),
        ),
    )
    present = {fluent.name: fluent for fluent in (new, box, box_pose, plane)}
    (finding,) = furniture_findings([chair, Fluent("chair2", "Chair")], present)
    assert (finding.pose.x, finding.confidence, finding.frames) == (2.0, 0.7, 12)
