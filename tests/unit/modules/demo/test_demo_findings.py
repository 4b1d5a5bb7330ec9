"""What the demo makes of the board's fluents and of the truth."""

from __future__ import annotations

from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.geometry import BoundingBox, Pose
from fluentboard.model.interval import UNKNOWN, Interval
from fluentboard_modules.demo.findings import Finding, TruePiece, compare, furniture_findings
from fluentboard_modules.geometry_fluents import box_fluents, pose_fluent

SINCE = Interval(None, 4.0)


def a_box(x: float) -> BoundingBox:
    return BoundingBox(Pose(x, 1.0, 0.4), 0.5, 0.5, 0.8)


def found(name: str, class_name: str, x: float) -> Finding:
    return Finding(name, class_name, Pose(x, 1.0, 0.4), a_box(x), 0.9, 5, ())


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


def test_each_true_piece_is_found_once_by_the_nearest() -> None:
    findings = [found("chair1", "Chair", 1.10), found("chair2", "Chair", 1.02)]
    matches = compare(findings, [TruePiece("seat", "Chair", a_box(1.0))])
    assert [(m.found and m.found.name, m.true and m.true.name) for m in matches] == [
        ("chair1", None),
        ("chair2", "seat"),
    ]


def test_class_and_distance_must_agree() -> None:
    true = [TruePiece("seat", "Chair", a_box(1.0)), TruePiece("top", "Table", a_box(1.0))]
    matches = compare([found("chair1", "Chair", 1.3), found("table1", "Table", 1.3)], true)
    assert [(m.found is not None, m.true is not None) for m in matches] == [
        (True, False),
        (True, True),
        (False, True),
    ]
