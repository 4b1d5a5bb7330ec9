"""Trajectories: poses over time, positions, the way travelled, gaps."""

from __future__ import annotations

import math
from collections.abc import Iterable

import orjson
import pytest

from fluentboard.board.blackboard import Blackboard
from fluentboard.board.commands import AssertFluent, EndFluent, RefineFluent
from fluentboard.board.trajectory import Trajectory, pose_of, trajectory_of, trajectory_to_json
from fluentboard.errors import IntervalReversed, UnknownFluent
from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.interval import UNKNOWN, Certainty, Interval


def pose(name: str, start: Interval, finish: Interval, x: float, y: float = 0.0) -> Fluent:
    values = (Property("hasX", "xsd:float", x), Property("hasY", "xsd:float", y))
    return Fluent(name, "Pose", start, finish, values)


FIRST = pose("p0", UNKNOWN, Interval(10.0, 12.0), 1.0)
SECOND = pose("p1", Interval(10.0, 12.0), Interval.at(20.0), 4.0, 4.0)
THIRD = pose("p2", Interval.at(25.0), UNKNOWN, 4.0, 5.0)
POSES = (FIRST, SECOND, THIRD)


def trajectory(poses: Iterable[Fluent], *window_s: float) -> Trajectory:
    found = {one.name: one for one in poses}
    references = tuple(Property("hasPose", "Pose", name) for name in (*found, "lost"))
    mug = Fluent("mug1", "Mug", properties=references)
    return trajectory_of(mug, found, *window_s)


def test_poses_come_in_the_order_of_their_starts():
    found = trajectory(reversed(POSES))
    assert [step.fluent.name for step in found.steps] == ["p0", "p1", "p2"]


def test_a_reference_to_no_pose_is_reported_as_missing():
    assert trajectory(POSES).missing == ("lost",)


def test_a_pose_that_is_no_pose_is_reported_as_missing():
    broken = Fluent("p9", "Pose", properties=(Property("hasX", "xsd:string", "left"),))
    assert trajectory([broken]).missing == ("p9", "lost")


def test_the_distance_is_the_way_from_pose_to_pose():
    assert trajectory(POSES).distance_m == pytest.approx(5.0 + 1.0)


def test_between_uncertain_ends_both_positions_are_possible():
    found = trajectory(POSES).at(11.0)
    assert [(p.step.fluent.name, p.certainty) for p in found] == [
        ("p0", Certainty.POSSIBLE),
        ("p1", Certainty.POSSIBLE),
    ]


def test_a_certain_position_is_certain():
    found = trajectory(POSES).at(15.0)
    assert [(p.step.fluent.name, p.certainty) for p in found] == [("p1", Certainty.CERTAIN)]


def test_no_position_is_known_in_a_gap():
    assert trajectory(POSES).at(22.0) == ()


def test_gaps_are_possible_or_certain():
    first, second = trajectory(POSES).gaps
    assert (first.possible_s, first.certain_s) == ((10.0, 12.0), None)
    assert (second.before, second.after) == ("p1", "p2")
    assert (second.possible_s, second.certain_s) == ((20.0, 25.0), (20.0, 25.0))


def test_a_pose_inside_a_longer_one_opens_no_gap():
    inner = pose("p1", Interval.at(3.0), Interval.at(4.0), 2.0)
    outer = pose("p0", Interval.at(1.0), Interval.at(9.0), 1.0)
    assert trajectory([outer, inner, pose("p2", Interval.at(9.0), UNKNOWN, 3.0)]).gaps == ()


def test_a_window_keeps_the_poses_that_it_may_touch():
    found = trajectory(POSES, 11.0, 25.0)
    assert [step.fluent.name for step in found.steps] == ["p0", "p1"]


def test_a_pose_of_one_instant_is_kept():
    seen = pose("p0", Interval.at(5.0), Interval.at(5.0), 1.0)
    assert len(trajectory([seen]).steps) == 1
    assert trajectory([seen], 6.0, 7.0).steps == ()


def test_a_pose_has_its_angles():
    turned = Fluent("p0", "Pose", properties=(Property("hasYaw", "xsd:float", math.pi / 2),))
    assert pose_of(turned).yaw_rad == pytest.approx(math.pi / 2)


def test_the_json_form_has_no_infinite_numbers():
    found = orjson.loads(orjson.dumps(trajectory_to_json(trajectory(POSES), [11.0])))
    assert found["poses"][0]["start"] == [None, None]
    assert found["distance_m"] == pytest.approx(6.0)
    assert found["gaps"][1] == {
        "before": "p1",
        "after": "p2",
        "possible": [20.0, 25.0],
        "certain": [20.0, 25.0],
    }
    assert [p["certainty"] for p in found["positions"][0]["poses"]] == ["possible", "possible"]


def test_the_board_tells_the_trajectory_as_believed_at_a_commit():
    with Blackboard.open(None) as board:
        mug = Fluent("mug1", "Mug", properties=(Property("hasPose", "Pose", "p0"),))
        old = Fluent("p0", "Pose", UNKNOWN, UNKNOWN, FIRST.properties)
        commit = board.execute([AssertFluent(mug), AssertFluent(old)], "test").number
        moved = RefineFluent("mug1", properties=(Property("hasPose", "Pose", "p1"),))
        board.execute([EndFluent("p0", FIRST.finish), AssertFluent(SECOND), moved], "test")
        assert board.trajectory("mug1").distance_m == pytest.approx(5.0)
        assert board.trajectory("mug1", as_of=commit).distance_m == 0.0
        assert len(board.trajectory("mug1", 13.0, 14.0).steps) == 1
        with pytest.raises(UnknownFluent):
            board.trajectory("nobody")
        with pytest.raises(IntervalReversed):
            board.trajectory("mug1", 5.0, 4.0)
