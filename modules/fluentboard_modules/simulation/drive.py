"""Simulated drives: a camera's way through a scene as a source of frames."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from fluentboard.errors import InvalidInput
from fluentboard.model.geometry import Transform
from fluentboard_modules.frames.sensor_frame import Camera, SensorFrame
from fluentboard_modules.simulation.navigation import costmap
from fluentboard_modules.simulation.noise import NoiseConfig
from fluentboard_modules.simulation.placement import support_of
from fluentboard_modules.simulation.restaurant import RestaurantConfig, restaurant
from fluentboard_modules.simulation.robots import PR2, RobotModel
from fluentboard_modules.simulation.scene import Scene
from fluentboard_modules.simulation.sensor import RgbdSensor
from fluentboard_modules.simulation.trajectories import around, fewer_stops, stops_in_room, tour
from fluentboard_modules.simulation.viewpoint import kinect_camera

_CLEARANCE_M = 0.035


@dataclass(frozen=True, eq=False)
class SimulatedDrive:
    """A `FrameSource` that looks at a scene from a list of poses.

    Every frame has a random generator of its own, so frame 7 is the same whether or not the frames
    before it were made.

    Attributes:
        name: what to call the drive in messages.
        scene: what there is to see.
        poses: `T_map_sensor` of every frame.
        seed: of the sensor noise.
        camera: of the frames.
        noise: how the camera errs.
        range_m: nearest and farthest depth in metres.
        start_s: stamp of the first frame on the board's time axis.
        rate_hz: frames per second.
    """

    name: str
    scene: Scene
    poses: Sequence[Transform]
    seed: int = 0
    camera: Camera = field(default_factory=kinect_camera)
    noise: NoiseConfig = field(default_factory=NoiseConfig)
    range_m: tuple[float, float] = (0.4, 5.0)
    start_s: float = 1.0
    rate_hz: float = 2.0

    def __post_init__(self) -> None:
        if not (self.start_s > 0.0 and self.rate_hz > 0.0):
            raise InvalidInput(
                f"drive {self.name!r} starts at {self.start_s} s with {self.rate_hz} Hz; both must "
                "be positive, 0.0 s is reserved to mean unknown"
            )

    def __len__(self) -> int:
        return len(self.poses)

    def __iter__(self) -> Iterator[SensorFrame]:
        sensor = self._sensor()
        for position in range(len(self.poses)):
            yield self._look(sensor, position)

    def read(self, position: int) -> SensorFrame:
        """The frame at a position of the drive, 0 for the first."""
        return self._look(self._sensor(), range(len(self.poses))[position])

    def _sensor(self) -> RgbdSensor:
        return RgbdSensor(self.camera, self.noise, self.range_m, self.name)

    def _look(self, sensor: RgbdSensor, position: int) -> SensorFrame:
        return sensor.look(
            self.scene,
            self.poses[position],
            self.start_s + position / self.rate_hz,
            np.random.default_rng([self.seed, position]),
            position,
        )


def room_drive(
    scene: Scene,
    seed: int,
    frames: int = 80,
    height_m: float | None = None,
    robot_radius_m: float = 0.36,
    name: str = "room",
    camera: Camera | None = None,
    noise: NoiseConfig | None = None,
    robot: RobotModel | None = None,
) -> SimulatedDrive:
    """A drive through a room past every table, chair and shelf.

    Args:
        scene: the room.
        seed: of the noise.
        frames: how many. A room has about four stops per table and two per chair and shelf; with
            fewer frames than that, each thing is looked at from fewer sides.
        height_m: of the camera; the robot's if not given.
        robot_radius_m: how far to keep from obstacles; the robot's if one is given.
        name: of the drive.
        camera: a Kinect if not given.
        noise: a Kinect's if not given.
        robot: who drives: the height of its camera and how far it tilts; a PR2 if not given.
    """
    driver = robot if robot is not None else PR2
    if robot is not None:
        robot_radius_m = robot.radius_m + _CLEARANCE_M
    height_m = driver.camera_height_m if height_m is None else height_m
    room = costmap(scene, robot_radius_m, height_m)
    stops = fewer_stops(stops_in_room(scene, room, height_m), frames)
    low, high = driver.tilt_rad
    stops = tuple(replace(s, tilt_rad=min(max(s.tilt_rad, low), high)) for s in stops)
    poses = tour(stops, room, height_m, frames)
    return SimulatedDrive(
        name,
        scene,
        poses,
        seed,
        camera if camera is not None else kinect_camera(),
        noise if noise is not None else NoiseConfig(),
    )


def table_drive(
    scene: Scene,
    table_name: str,
    seed: int,
    frames: int = 40,
    height_m: float = PR2.camera_height_m,
    clearance_m: float = 0.75,
    camera: Camera | None = None,
    noise: NoiseConfig | None = None,
) -> SimulatedDrive:
    """A drive around a table that always looks at its top, as in Section 4.3.1.

    Args:
        scene: has the table.
        table_name: name of the instance.
        seed: of the noise.
        frames: how many looks on the full circle.
        height_m: of the camera.
        clearance_m: distance from the nearest corner of the table.
        camera: a Kinect if not given.
        noise: a Kinect's if not given.
    """
    table = scene[table_name]
    top = support_of(table)
    middle = table.T_map_model.apply(np.array([top.x, top.y, top.z]))
    radius = 0.5 * float(np.hypot(top.x_size, top.y_size)) + clearance_m
    return SimulatedDrive(
        f"around {table_name}",
        scene,
        around(middle, radius, height_m, frames),
        seed,
        camera if camera is not None else kinect_camera(),
        noise if noise is not None else NoiseConfig(),
    )


def restaurant_demo_drive(
    seed: int = 0, frames: int = 80, robot: RobotModel | None = None
) -> SimulatedDrive:
    """The demo: a PR2 with a Kinect drives through the restaurant of the thesis.

    Args:
        seed: of the restaurant and of the noise.
        frames: how many.
        robot: another than the PR2.
    """
    scene = restaurant(np.random.default_rng(seed), RestaurantConfig())
    return room_drive(scene, seed, frames, name="restaurant", robot=robot)
