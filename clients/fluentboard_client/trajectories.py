"""Trajectories: where an object was, as the board tells it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import httpx

from fluentboard.model.interval import Certainty, Interval
from fluentboard_client.exchange import Request, Time, segment

if TYPE_CHECKING:
    from fluentboard.model.geometry import Pose


@dataclass(frozen=True, slots=True)
class PoseHeld:
    """A pose that an object had for as long as the pose fluent held.

    Attributes:
        fluent: name of the pose fluent.
        start: when the object came to have it, in seconds.
        finish: when it ceased to.
        pose: in the map frame.
    """

    fluent: str
    start: Interval
    finish: Interval
    pose: Pose


@dataclass(frozen=True, slots=True)
class PoseGap:
    """A time between two poses for which none is known.

    Attributes:
        before: name of the pose fluent that ended.
        after: name of the next.
        possible_s: from when to when there may be no pose; None where it is not known.
        certain_s: from when to when there surely is none; None if the poses may touch.
    """

    before: str
    after: str
    possible_s: tuple[float | None, float | None]
    certain_s: tuple[float | None, float | None] | None


@dataclass(frozen=True, slots=True)
class PoseAt:
    """A pose that an object may have at a time.

    Attributes:
        certainty: POSSIBLE or CERTAIN.
        held: the pose, and for how long the object has it.
    """

    certainty: Certainty
    held: PoseHeld


@dataclass(frozen=True, slots=True)
class Trajectory:
    """Where an object was.

    Attributes:
        name: the object.
        poses: in the order of their starts.
        distance_m: the way from pose to pose in straight lines: the least that it travelled.
        gaps: times for which no pose is known.
        missing: references to poses that are not on the board.
        positions: by time in seconds, the poses it may have then, the surest first.
        commit: all of it is as believed after this commit.
    """

    name: str
    poses: tuple[PoseHeld, ...]
    distance_m: float
    gaps: tuple[PoseGap, ...]
    missing: tuple[str, ...]
    positions: Mapping[float, tuple[PoseAt, ...]]
    commit: int


def trajectory(
    name: str, at: Sequence[Time], during: tuple[float, float] | None, as_of: int | None
) -> Request:
    """Where an object was."""
    params: dict[str, str] = {}
    if at:
        params["at"] = ",".join(map(str, at))
    if during is not None:
        params["during"] = f"{during[0]!r},{during[1]!r}"
    if as_of is not None:
        params["asof"] = str(as_of)
    path = f"/objects/{segment(name)}/trajectory"
    return Request("GET", path, params, headers={"Accept": "application/json"})


def trajectory_of(reply: httpx.Response) -> Trajectory:
    """The trajectory in a reply."""
    document: dict[str, Any] = reply.json()
    return Trajectory(
        str(document["name"]),
        tuple(map(_held, document["poses"])),
        float(document["distance_m"]),
        tuple(
            PoseGap(
                str(gap["before"]),
                str(gap["after"]),
                _pair(gap["possible"]),
                None if gap["certain"] is None else _pair(gap["certain"]),
            )
            for gap in document["gaps"]
        ),
        tuple(map(str, document["missing"])),
        {
            float(position["at"]): tuple(
                PoseAt(Certainty[pose["certainty"].upper()], _held(pose))
                for pose in position["poses"]
            )
            for position in document.get("positions", ())
        },
        int(document["commit"]),
    )


def _held(step: Mapping[str, Any]) -> PoseHeld:
    # It brings numpy with it, which most programs that talk to a board can do without.
    from fluentboard.model.geometry import Pose

    pose = step["pose"]
    return PoseHeld(
        str(step["fluent"]),
        Interval(*step["start"]),
        Interval(*step["finish"]),
        Pose(pose["x"], pose["y"], pose["z"], *pose["quaternion"]),
    )


def _pair(times: Sequence[float | None]) -> tuple[float | None, float | None]:
    first, last = times
    return first, last
