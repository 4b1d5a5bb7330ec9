"""Trajectories: where an object was, from the pose fluents it refers to (pure).

An object holds each of its poses for the time that the pose fluent holds. Between poses nothing is
interpolated: what is not known to be somewhere may be anywhere.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from fluentboard.errors import FluentboardError
from fluentboard.model.fluent import Fluent
from fluentboard.model.geometry import Pose
from fluentboard.model.interval import Certainty
from fluentboard.model.relations import (
    Bounds,
    Relation,
    bounds_of,
    holding_certainty,
    relation_certainty,
    window,
)

POSE_PROPERTY = "hasPose"
"""The property by which an object refers to its poses."""

_COORDINATES = ("hasX", "hasY", "hasZ", "hasRoll", "hasPitch", "hasYaw")


@dataclass(frozen=True, slots=True)
class Step:
    """One pose of an object.

    Attributes:
        fluent: the pose fluent; the object has the pose as long as it holds.
        pose: in the map frame.
    """

    fluent: Fluent
    pose: Pose

    @property
    def bounds(self) -> Bounds:
        """What is known of when the object came to have the pose, and when it ceased to."""
        return bounds_of(self.fluent)


@dataclass(frozen=True, slots=True)
class Gap:
    """A time between two poses for which no pose is known.

    Attributes:
        before: name of the pose fluent that ended.
        after: name of the next pose fluent.
        possible_s: from when to when there may be no pose: earliest finish, latest start.
        certain_s: from when to when there surely is none: latest finish, earliest start; None if
            the poses may touch.
    """

    before: str
    after: str
    possible_s: tuple[float, float]
    certain_s: tuple[float, float] | None


@dataclass(frozen=True, slots=True)
class Position:
    """A pose that an object has at a time.

    Attributes:
        step: the pose.
        certainty: POSSIBLE or CERTAIN.
    """

    step: Step
    certainty: Certainty


@dataclass(frozen=True, slots=True)
class Trajectory:
    """The poses of an object in the order of their starts.

    Attributes:
        name: the object.
        steps: its poses.
        missing: references to poses that are not on the board, or that are no poses.
    """

    name: str
    steps: tuple[Step, ...]
    missing: tuple[str, ...] = ()

    @property
    def distance_m(self) -> float:
        """The way from pose to pose in straight lines, in metres: the least that was travelled."""
        places = [(s.pose.x, s.pose.y, s.pose.z) for s in self.steps]
        return math.fsum(math.dist(a, b) for a, b in pairwise(places))

    @property
    def gaps(self) -> tuple[Gap, ...]:
        """The times between consecutive poses for which there may be none."""
        found: list[Gap] = []
        latest: Step | None = None
        for step in self.steps:
            if latest is not None:
                gap = _gap(latest, step)
                if gap is not None:
                    found.append(gap)
            # A pose that ends before an earlier one does opens no gap.
            if latest is None or _finishes(step) >= _finishes(latest):
                latest = step
        return tuple(found)

    def at(self, time_s: float) -> tuple[Position, ...]:
        """The poses that the object possibly or certainly has at a time, the surest first."""
        found = [
            Position(step, certainty)
            for step in self.steps
            if (certainty := holding_certainty(step.bounds, time_s)) > Certainty.IMPOSSIBLE
        ]
        return tuple(sorted(found, key=lambda position: -position.certainty))


def pose_of(fluent: Fluent) -> Pose:
    """The pose that a pose fluent describes; coordinates that are not given are 0.

    Raises:
        InvalidGeometry: a coordinate is not finite.
    """
    first = (next(iter(fluent.values(name)), 0.0) for name in _COORDINATES)
    return Pose.from_rpy(*(float(value) for value in first))


def pose_names(fluent: Fluent) -> tuple[str, ...]:
    """The pose fluents that an object refers to."""
    return tuple(
        str(statement.value)
        for statement in fluent.properties
        if statement.name == POSE_PROPERTY and statement.is_reference
    )


def trajectory_of(
    fluent: Fluent,
    poses: Mapping[str, Fluent],
    from_s: float = -math.inf,
    to_s: float = math.inf,
) -> Trajectory:
    """The trajectory of an object.

    Args:
        fluent: the object.
        poses: the pose fluents it refers to, by name, as far as there are any.
        from_s: only poses that the object may have had at some moment from then on, in seconds,
        to_s: and before then.
    """
    during = window(from_s, to_s)
    steps: list[Step] = []
    missing: list[str] = []
    for name in pose_names(fluent):
        found = poses.get(name)
        pose = None if found is None else _pose_or_none(found)
        if found is None or pose is None:
            missing.append(name)
        elif _may_touch(bounds_of(found), during):
            steps.append(Step(found, pose))
    return Trajectory(fluent.name, tuple(sorted(steps, key=_order)), tuple(missing))


def trajectory_to_json(trajectory: Trajectory, times_s: Iterable[float] = ()) -> dict[str, Any]:
    """The trajectory as a JSON object; unknown and infinite times are null.

    Args:
        trajectory: what to write.
        times_s: times at which the position is wanted as well, in seconds.
    """
    document: dict[str, Any] = {
        "name": trajectory.name,
        "poses": [_step_to_json(step) for step in trajectory.steps],
        "distance_m": trajectory.distance_m,
        "gaps": [
            {
                "before": gap.before,
                "after": gap.after,
                "possible": _times(gap.possible_s),
                "certain": None if gap.certain_s is None else _times(gap.certain_s),
            }
            for gap in trajectory.gaps
        ],
        "missing": list(trajectory.missing),
    }
    positions = [
        {
            "at": time_s,
            "poses": [
                {"certainty": position.certainty.name.lower(), **_step_to_json(position.step)}
                for position in trajectory.at(time_s)
            ],
        }
        for time_s in times_s
    ]
    if positions:
        document["positions"] = positions
    return document


def _pose_or_none(fluent: Fluent) -> Pose | None:
    try:
        return pose_of(fluent)
    except (FluentboardError, ValueError):
        return None


def _may_touch(pose: Bounds, during: Bounds) -> bool:
    if relation_certainty(Relation.INTERSECTS, pose, during):
        return True
    # A pose of one instant never holds, but it is where the object was seen.
    return pose[0] == pose[3] and during[0] <= pose[0] < during[3]


def _finishes(step: Step) -> tuple[float, float]:
    _, _, f1, f2 = step.bounds
    return f2, f1


def _order(step: Step) -> tuple[Bounds, str]:
    return step.bounds, step.fluent.name


def _gap(before: Step, after: Step) -> Gap | None:
    _, _, f1, f2 = before.bounds
    s1, s2, _, _ = after.bounds
    if f1 >= s2:
        return None
    certain_s = (f2, s1) if f2 < s1 else None
    return Gap(before.fluent.name, after.fluent.name, (f1, s2), certain_s)


def _times(times_s: Sequence[float]) -> list[float | None]:
    return [time_s if math.isfinite(time_s) else None for time_s in times_s]


def _step_to_json(step: Step) -> dict[str, Any]:
    fluent, pose = step.fluent, step.pose
    roll, pitch, yaw = pose.rpy
    return {
        "fluent": fluent.name,
        "start": [fluent.start.earliest, fluent.start.latest],
        "finish": [fluent.finish.earliest, fluent.finish.latest],
        "pose": {
            "x": pose.x,
            "y": pose.y,
            "z": pose.z,
            "roll": roll,
            "pitch": pitch,
            "yaw": yaw,
            "quaternion": [pose.qx, pose.qy, pose.qz, pose.qw],
        },
    }
