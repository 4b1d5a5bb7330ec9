"""Robots: views they can take, their joint limits, cameras and motion times.

The constants of PR2, Calvin and Turtlebot are those of the original active-perception software and
of the robots' public descriptions; what had to be assumed is marked. A real robot takes part by
implementing `Robot`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

from pydantic import BaseModel, ConfigDict

from fluentboard.errors import UnreachableView
from fluentboard.model.geometry import Transform
from fluentboard_modules.frames.sensor_frame import Camera, SensorFrame
from fluentboard_modules.simulation.viewpoint import optical_pose

DRIVES_FROM_M = 0.05
"""HORIZONTAL_TOLERANCE of the original agents: a goal that near leaves the base where it is."""


@dataclass(frozen=True, slots=True)
class View:
    """A configuration in which a robot looks.

    Attributes:
        x: base position in metres, map frame.
        y: metres.
        yaw_rad: heading of the base.
        torso_m: lift of the torso above its lowest position.
        pan_rad: head, positive to the left.
        tilt_rad: head, positive downwards (a rotation about the y axis that points left).
    """

    x: float
    y: float
    yaw_rad: float
    torso_m: float = 0.0
    pan_rad: float = 0.0
    tilt_rad: float = 0.0


class RobotModel(BaseModel):
    """What a robot can do, in metres, radians and seconds."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    name: str
    radius_m: float
    """Inscribed radius of the base, for the costmap."""

    camera_height_m: float
    """Height of the camera with the torso at its lowest."""

    camera_x_m: float = 0.0
    """Camera ahead of the centre of the base; negative: behind."""

    torso_m: tuple[float, float] = (0.0, 0.0)
    pan_rad: tuple[float, float] = (0.0, 0.0)
    tilt_rad: tuple[float, float]
    horizontal_fov_rad: float
    vertical_fov_rad: float
    range_m: tuple[float, float] = (0.4, 3.0)

    seconds_per_cost: float
    """Slope of the drive time over navfn's path cost."""

    drive_start_s: float
    """Time every drive takes, however short."""

    turn_rad_s: float = math.pi / 2
    """Turning on the spot (TURN_SPEED of the original agents)."""

    lift_m_s: float = 0.01
    head_rad_s: float = 3.14
    acquisition_s: float = 5.0

    def camera(self, width: int = 640) -> Camera:
        """The depth camera with square pixels, cut to the vertical field of view."""
        focal = 0.5 * width / math.tan(0.5 * self.horizontal_fov_rad)
        height = round(2.0 * focal * math.tan(0.5 * self.vertical_fov_rad))
        return Camera(width, height, focal, focal, 0.5 * (width - 1), 0.5 * (height - 1))

    def T_map_sensor(self, view: View) -> Transform:
        """Where the camera is in a view: takes its optical frame to the map frame.

        As in the original, pan and tilt turn the camera about its own centre.
        """
        c, s = math.cos(view.yaw_rad), math.sin(view.yaw_rad)
        return optical_pose(
            view.x + self.camera_x_m * c,
            view.y + self.camera_x_m * s,
            self.camera_height_m + view.torso_m,
            view.yaw_rad + view.pan_rad,
            view.tilt_rad,
        )

    def check(self, view: View) -> None:
        """Raise UnreachableView if a joint would leave its limits."""
        for joint, value, (low, high) in (
            ("torso lift [m]", view.torso_m, self.torso_m),
            ("head pan [rad]", view.pan_rad, self.pan_rad),
            ("head tilt [rad]", view.tilt_rad, self.tilt_rad),
        ):
            if not low - 1e-6 <= value <= high + 1e-6:
                raise UnreachableView(
                    f"{self.name} cannot take a view with {joint} = {value:.3f}; "
                    f"its limits are {low:.3f} to {high:.3f}"
                )

    def motion_time_s(self, start: View, goal: View, path_cost: float) -> float:
        """Time from one view to another, without the look itself.

        Driving (or turning) and lifting add up; the head moves meanwhile, and counts only when
        nothing else moves.

        Args:
            start: where the robot is.
            goal: where it goes.
            path_cost: of the way between the two base positions, in navfn's units.
        """
        seconds = 0.0
        turn = abs(math.remainder(goal.yaw_rad - start.yaw_rad, 2.0 * math.pi))
        if math.hypot(goal.x - start.x, goal.y - start.y) > DRIVES_FROM_M:
            seconds += self.seconds_per_cost * path_cost + self.drive_start_s
        else:
            seconds += turn / self.turn_rad_s
        seconds += abs(goal.torso_m - start.torso_m) / self.lift_m_s
        if seconds == 0.0:
            pan, tilt = goal.pan_rad - start.pan_rad, goal.tilt_rad - start.tilt_rad
            seconds = max(abs(pan), abs(tilt)) / self.head_rad_s
        return seconds

    def transition_time_s(self, start: View, goal: View, path_cost: float) -> float:
        """Time from one view to another and the look there, as a search planner predicts it."""
        return self.motion_time_s(start, goal, path_cost) + self.acquisition_s


PR2 = RobotModel(
    name="PR2",
    radius_m=0.325,  # the base is a square of 0.65 m
    camera_height_m=1.484,
    camera_x_m=-0.07,
    torso_m=(0.0, 0.33),
    pan_rad=(-3.007, 3.007),
    tilt_rad=(-0.471, 1.396),
    horizontal_fov_rad=0.9934,
    vertical_fov_rad=0.6855,
    range_m=(0.4, 3.0),
    seconds_per_cost=0.00154359,
    drive_start_s=5.940,
)

PR2_SEARCH_HEIGHT_M = (1.484, 1.784)
"""Camera heights that the original object search used, narrower than the torso's limits."""

PR2_SEARCH_TILT_RAD = (-math.radians(20.0), math.radians(50.0))
"""Tilts that the original object search used: 20 deg up to 50 deg down."""

CALVIN = RobotModel(
    name="Calvin",
    radius_m=0.35,  # assumed
    camera_height_m=1.5875,
    tilt_rad=(math.radians(53.62), math.radians(53.62)),
    horizontal_fov_rad=1.0123,
    vertical_fov_rad=0.7854,
    # No drive-time model of Calvin was published; it is taken to drive like the PR2.
    seconds_per_cost=0.00154359,
    drive_start_s=5.940,
)

TURTLEBOT = RobotModel(
    name="Turtlebot",
    radius_m=0.177,  # Kobuki base
    camera_height_m=0.30,  # turtlebot_description: 0.287 m above a base at 0.010 m
    camera_x_m=-0.087,
    tilt_rad=(0.0, 0.0),
    horizontal_fov_rad=0.9948,  # Kinect: 57 x 43 deg
    vertical_fov_rad=0.7505,
    # Over 5 cm cells this slope means 3 m/s, more than a Turtlebot's 0.65 m/s; it was probably
    # fitted on a finer map. Kept as published.
    seconds_per_cost=0.00030533,
    drive_start_s=2.724,
)

KURTANA = RobotModel(
    name="Kurtana",
    radius_m=0.25,  # assumed, as all of its measures: only a picture is published (Fig. 2.7)
    camera_height_m=1.3,
    tilt_rad=(math.radians(15.0), math.radians(30.0)),
    horizontal_fov_rad=0.9948,
    vertical_fov_rad=0.7505,
    range_m=(0.4, 5.0),
    seconds_per_cost=0.00154359,
    drive_start_s=5.940,
)
"""The robot of Chapter 3: a Kinect on a pole."""

ROBOTS = {model.name: model for model in (PR2, CALVIN, TURTLEBOT, KURTANA)}


class Robot(Protocol):
    """What active search needs of a robot, simulated or real.

    On a real robot, `move_to` calls navigation, torso and head controllers one after the other and
    blocks until they have arrived; `sense` waits until the camera is still and returns the newest
    registered depth image with the pose that localisation gives the camera. Both raise
    UnreachableView when the robot cannot get there; it then stays where it stopped, and `view`
    says where that is.
    """

    @property
    def model(self) -> RobotModel:
        """Limits, camera and motion times."""
        ...

    @property
    def view(self) -> View:
        """The present configuration."""
        ...

    @property
    def time_s(self) -> float:
        """The present time on the board's time axis."""
        ...

    def predicted_time_s(self, start: View, goal: View) -> float:
        """Seconds that going from one view to another and looking there would take.

        Infinite if no way leads there.
        """
        ...

    def move_to(self, view: View) -> float:
        """Take a view; returns the seconds it took, without looking.

        Raises:
            UnreachableView: a joint limit, an obstacle or a missing way forbids it.
        """
        ...

    def sense(self) -> SensorFrame:
        """Look from where the robot is."""
        ...
