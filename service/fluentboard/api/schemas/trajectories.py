"""The reply with an object's trajectory."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from fluentboard.api.schemas.fluents import IntervalPair, Schema


class PoseJson(Schema):
    """A pose in the map frame."""

    x: float = Field(description="Metres.")
    y: float = Field(description="Metres.")
    z: float = Field(description="Metres, upwards.")
    roll: float = Field(description="Radians about x, applied first.")
    pitch: float = Field(description="Radians about y.")
    yaw: float = Field(description="Radians about z.")
    quaternion: tuple[float, float, float, float] = Field(description="The same turn: x, y, z, w.")


class StepJson(Schema):
    """A pose that an object had for as long as the pose fluent held."""

    fluent: str = Field(description="Name of the pose fluent.")
    start: IntervalPair
    finish: IntervalPair
    pose: PoseJson


class PositionJson(StepJson):
    """A pose that an object has at a time."""

    certainty: Literal["possible", "certain"]


class PositionsJson(Schema):
    """Where an object is at a time."""

    at: float = Field(description="The time in seconds.")
    poses: list[PositionJson] = Field(
        description="The surest first; more than one if several are possible, none in a gap."
    )


class GapJson(Schema):
    """A time between two poses for which none is known."""

    before: str = Field(description="The pose fluent that ended.")
    after: str = Field(description="The next one.")
    possible: IntervalPair = Field(description="From when to when there may be no pose.")
    certain: IntervalPair | None = Field(
        description="From when to when there surely is none; null if the poses may touch."
    )


class TrajectoryJson(Schema):
    """Where an object was."""

    name: str
    poses: list[StepJson] = Field(description="In the order of their starts.")
    distance_m: float = Field(
        description="The way from pose to pose in straight lines: the least that it travelled."
    )
    gaps: list[GapJson]
    missing: list[str] = Field(
        description="References to poses that are not on the board, or are none."
    )
    positions: list[PositionsJson] | None = Field(
        default=None, description="For each time that was asked for; left out if none was."
    )
    commit: int = Field(description="All of it is as believed after this commit.")
