"""A robot in a scene: drives by the costmap, looks by ray casting, and keeps its own time."""

from __future__ import annotations

import numpy as np

from fluentboard_modules.frames.sensor_frame import SensorFrame
from fluentboard_modules.simulation.costmap_robot import CostmapRobot
from fluentboard_modules.simulation.navigation import Costmap, costmap
from fluentboard_modules.simulation.noise import NoiseConfig
from fluentboard_modules.simulation.robots import RobotModel, View
from fluentboard_modules.simulation.scene import Scene
from fluentboard_modules.simulation.sensor import RgbdSensor


class SimulatedRobot(CostmapRobot):
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
        super().__init__(model, _costmap_of(scene, model), start, start_s)
        self._rng = rng
        self._scene = scene
        camera = model.camera(image_width)
        self._sensor = RgbdSensor(camera, noise, model.range_m, name=model.name)

    @property
    def scene(self) -> Scene:
        """Where the robot is; assign a new scene when something has changed."""
        return self._scene

    @scene.setter
    def scene(self, scene: Scene) -> None:
        self._scene = scene
        self._costmap = _costmap_of(scene, self._model)

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


def _costmap_of(scene: Scene, model: RobotModel) -> Costmap:
    return costmap(scene, model.radius_m, model.camera_height_m + model.torso_m[1])
