"""A robot in a scene: drives by the costmap, looks by ray casting, and keeps its own time."""

from __future__ import annotations

import math

import numpy as np

from fluentboard.errors import UnreachableView
from fluentboard_modules.frames.sensor_frame import SensorFrame
from fluentboard_modules.simulation.navigation import Costmap, costmap
from fluentboard_modules.simulation.noise import NoiseConfig
from fluentboard_modules.simulation.robots import RobotModel, View
from fluentboard_modules.simulation.scene import Scene
from fluentboard_modules.simulation.sensor import RgbdSensor


class SimulatedRobot:
    """A `Robot` whose motions take the time that its model predicts, and no time to compute.

    Args:
        model: which robot.
        scene: where it is.
        start: its first view.
        rng: source of the sensor noise.
        noise: of the camera; exact if not given.
        image_width: pixels.
        start_s: time at the beginning, on the board's time axis.

    Raises:
        UnreachableView: it cannot stand at its first view.
    """

    def __init__(
        self,
        model: RobotModel,
        scene: Scene,
        start: View,
        rng: np.random.Generator,
        noise: NoiseConfig | None = None,
        image_width: int = 640,
        start_s: float = 1.0,
    ) -> None:
        self._model = model
        self._rng = rng
        self._time_s = start_s
        self._view = start
        self._index = 0
        camera = model.camera(image_width)
        self._sensor = RgbdSensor(camera, noise, model.range_m, name=model.name)
        self._scene = scene
        self._map = self._costmap()
        model.check(start)
        self._map.path_costs(start.x, start.y)

    @property
    def model(self) -> RobotModel:
        """Limits, camera and motion times."""
        return self._model

    @property
    def view(self) -> View:
        """The present configuration."""
        return self._view

    @property
    def time_s(self) -> float:
        """The robot's own clock: it advances with motions and looks only."""
        return self._time_s

    @property
    def scene(self) -> Scene:
        """Where the robot is; assign a new scene when something has changed."""
        return self._scene

    @scene.setter
    def scene(self, scene: Scene) -> None:
        self._scene = scene
        self._map = self._costmap()

    @property
    def costmap(self) -> Costmap:
        """The map that it drives by, the true one."""
        return self._map

    def _costmap(self) -> Costmap:
        height = self._model.camera_height_m + self._model.torso_m[1]
        return costmap(self._scene, self._model.radius_m, height)

    def predicted_time_s(self, start: View, goal: View) -> float:
        """Time to go and look; infinite where no way leads or a joint cannot go."""
        try:
            self._model.check(goal)
            cost = self._map.path((start.x, start.y), (goal.x, goal.y)).cost
        except UnreachableView:
            return math.inf
        return self._model.transition_time_s(start, goal, cost)

    def move_to(self, view: View) -> float:
        """Take a view; the clock advances by the seconds returned.

        Raises:
            UnreachableView: a joint limit, an obstacle or a missing way forbids it; the robot has
                not moved.
        """
        self._model.check(view)
        cost = self._map.path((self._view.x, self._view.y), (view.x, view.y)).cost
        seconds = self._model.motion_time_s(self._view, view, cost)
        self._view = view
        self._time_s += seconds
        return seconds

    def sense(self) -> SensorFrame:
        """Look; the clock advances by the acquisition time first, as the camera must be still."""
        self._time_s += self._model.acquisition_s
        frame = self._sensor.look(
            self._scene,
            self._model.T_map_sensor(self._view),
            self._time_s,
            self._rng,
            self._index,
        )
        self._index += 1
        return frame
