"""What the board is told of anchors, and when (Section 4.2.4)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from fluentboard.model.fluent import Fluent
from fluentboard.model.geometry import BoundingBox, Pose
from fluentboard.model.interval import Interval
from fluentboard_modules.anchoring.anchors import Anchor, AnchorState, Functionality
from fluentboard_modules.anchoring.areas import PlacingArea
from fluentboard_modules.anchoring.config import UpdateConfig
from fluentboard_modules.anchoring.estimate import BoxEstimate
from fluentboard_modules.anchoring.removal import Look, Presence
from fluentboard_modules.anchoring.sync import ObjectFluents, Scene
from fluentboard_modules.anchoring.world import Decision
from fluentboard_modules.statements import Ending, Statement

CLASSES = ("Mug", "Plate")
CONFIG = UpdateConfig(evidence_s=0.0)


def mug(
    x: float = 0.0, now_s: float = 10.0, confidence: tuple[float, float] = (0.9, 0.1)
) -> Anchor:
    box = BoundingBox(Pose(x, 0.0, 0.8), 0.1, 0.08, 0.09)
    values = np.array(confidence)
    return Anchor(
        1, AnchorState.TRACKED, BoxEstimate.of_box(box), values, values, 10.0, now_s, 3, track_id=1
    )


def told(
    fluents: ObjectFluents,
    *anchors: Anchor,
    now_s: float = 10.0,
    decisions: Sequence[Decision] = (),
    looks: dict[int, Look] | None = None,
    final: bool = False,
) -> list[Statement]:
    return fluents.update(Scene(anchors, decisions, looks or {}, now_s), final=final)


def new(statements: Sequence[Statement], class_name: str) -> list[Fluent]:
    return [s for s in statements if isinstance(s, Fluent) and s.class_name == class_name]


def ends(statements: Sequence[Statement]) -> dict[str, Interval]:
    return {s.name: s.finish for s in statements if isinstance(s, Ending)}


@pytest.fixture
def fluents() -> ObjectFluents:
    return ObjectFluents(CLASSES, config=CONFIG)


def test_an_anchor_is_written_with_pose_and_box_of_their_own(fluents: ObjectFluents) -> None:
    statements = told(fluents, mug())
    (thing,) = new(statements, "Mug")
    assert (thing.name, thing.start) == ("mug1", Interval(None, 10.0))
    named = {s.name for s in statements if isinstance(s, Fluent)}
    assert {str(v) for key in ("hasPose", "hasBoundingBox") for v in thing.values(key)} <= named


def test_names_on_the_board_are_not_used_again(fluents: ObjectFluents) -> None:
    fluents.take_names(["mug1", "mug2"])
    assert [f.name for f in new(told(fluents, mug()), "Mug")] == ["mug3"]


def test_nothing_is_written_while_nothing_changes(fluents: ObjectFluents) -> None:
    told(fluents, mug())
    assert told(fluents, mug(0.01, 11.0), now_s=11.0) == []


def test_a_moved_object_gets_new_geometry_and_the_old_one_ends(fluents: ObjectFluents) -> None:
    first = told(fluents, mug())
    second = told(fluents, mug(0.2, 12.0), now_s=12.0)
    (thing,) = new(second, "Mug")
    assert thing.name == "mug1"
    ended = ends(second)
    assert set(ended) == {f.name for f in (*new(first, "Pose"), *new(first, "BBox"))}
    assert set(ended.values()) == {Interval(10.0, 12.0)}
    assert all(
        f.start == Interval(10.0, 12.0) for f in (*new(second, "Pose"), *new(second, "BBox"))
    )


def test_small_changes_are_written_after_the_time_out(fluents: ObjectFluents) -> None:
    told(fluents, mug())
    assert told(fluents, mug(0.015, 30.0), now_s=30.0) == []
    assert new(told(fluents, mug(0.015, 45.0), now_s=45.0), "Pose")


def test_the_last_frame_writes_the_best_estimate(fluents: ObjectFluents) -> None:
    told(fluents, mug())
    assert new(told(fluents, mug(0.015, 12.0), now_s=12.0, final=True), "Pose")


def test_a_destroyed_anchor_ends_all_its_fluents(fluents: ObjectFluents) -> None:
    first = told(fluents, mug())
    look = Look(Presence.ABSENT, 100, 0, 95)
    gone = Decision(Functionality.DESTROY, 1, 20.0, look=look)
    ended = ends(told(fluents, now_s=20.0, decisions=[gone]))
    evidence = {f.name for f in new(first, "AssociationEvidence")}
    assert set(ended) == {f.name for f in first if isinstance(f, Fluent)} - evidence
    assert ended["mug1"] == Interval(10.0, 20.0)
    assert fluents.written(1) is None


def test_an_object_on_a_placing_area_is_on_it(fluents: ObjectFluents) -> None:
    area = BoundingBox(Pose(0.0, 0.0, 0.75), 0.6, 0.6, 0.02)
    fluents.areas.put(PlacingArea("area1", "PlacingArea", area))
    (on,) = new(told(fluents, mug()), "On")
    assert on.values("hasPhysicalEntity") == ("mug1",)
    assert on.values("hasArea") == ("area1",)
    moved = told(fluents, mug(1.0, 12.0), now_s=12.0)
    assert on.name in ends(moved)
    assert not new(moved, "On")


def test_what_a_gripper_lifts_is_on_nothing(fluents: ObjectFluents) -> None:
    area = BoundingBox(Pose(0.0, 0.0, 0.75), 0.6, 0.6, 0.02)
    fluents.areas.put(PlacingArea("area1", "PlacingArea", area))
    (on,) = new(told(fluents, mug()), "On")
    assert list(ends(fluents.lifted(1, Interval.at(15.0)))) == [on.name]
    held = replace(mug(0.5, 16.0), is_held=True)
    assert not new(told(fluents, held, now_s=16.0), "Pose")


def test_a_class_that_became_certain_continues_under_a_new_name() -> None:
    fluents = ObjectFluents(CLASSES, config=UpdateConfig(reclassify_frames=3))
    told(fluents, mug())
    statements: list[Statement] = []
    for k in range(6):
        plate = mug(now_s=11.0 + k, confidence=(0.01, 0.99))
        statements += told(fluents, plate, now_s=11.0 + k)
    (thing,) = new(statements, "Plate")
    assert thing.values("continues") == ("mug1",)
    assert "mug1" in ends(statements)


def test_what_looks_at_an_unseen_object_say_is_evidence(fluents: ObjectFluents) -> None:
    told(fluents, mug())
    away = replace(mug(), state=AnchorState.UNTRACKED, track_id=None)
    occluded = {1: Look(Presence.OCCLUDED, 100, 90, 0)}
    statements: list[Statement] = []
    for k in range(3):
        statements += told(fluents, away, now_s=11.0 + k, looks=occluded)
    (evidence,) = new(statements, "PresenceEvidence")
    assert evidence.values("hasPresence") == ("occluded",)


def test_an_unsure_object_has_no_class_of_its_own(fluents: ObjectFluents) -> None:
    unsure = told(fluents, mug(confidence=(0.2, 0.1)))
    assert new(unsure, "PersonalItem")
