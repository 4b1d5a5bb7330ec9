"""A simulated robot whose camera also looks while it moves."""

from __future__ import annotations

import math

import numpy as np

from fluentboard.model.geometry import FloatArray
from fluentboard_modules.frames.sensor_frame import SensorFrame
from fluentboard_modules.simulation.noise import NoiseConfig
from fluentboard_modules.simulation.robots import RobotModel, View
from fluentboard_modules.simulation.scene import Scene
from fluentboard_modules.simulation.sensor import RgbdSensor
from fluentboard_modules.simulation.simulated_robot import SimulatedRobot

_BETWEEN_FRAMES_M = 0.5
_DEPTH_MAX_M = 9.0


class WatchfulSimulatedRobot(SimulatedRobot):
    """Keeps its camera turned to a point while it drives, as the original search does.

    The frames cost no time: the robot is under way anyhow. Its camera measures up to 9 m, farther
    than the range within which its model recognises things, so that the air before a distant wall
    is seen to be free.

    Args: as for `SimulatedRobot`.
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
        super().__init__(model, scene, start, rng, noise, image_width, start_s)
        near, far = model.range_m
        self._sensor = RgbdSensor(
            model.camera(image_width), noise, (near, max(far, _DEPTH_MAX_M)), name=model.name
        )

    between_frames_m: float = _BETWEEN_FRAMES_M
    """How far it drives from one look to the next; infinite for no looks on the way."""

    _attention: FloatArray | None = None
    _seen: tuple[tuple[float, SensorFrame], ...] = ()

    def attend(self, point_map: FloatArray) -> None:
        """Turns the camera to that point, as far as it can, on the way to the next view."""
        self._attention = np.asarray(point_map, dtype=np.float64)

    def frames_on_the_way(self) -> tuple[tuple[float, SensorFrame], ...]:
        """What it saw on its last way: the share of the way's time by then, and the frame."""
        return self._seen

    def move_to(self, view: View) -> float:
        """Takes a view; see `SimulatedRobot.move_to`."""
        self._seen = ()
        start, began = self._view, self._time_s
        seconds = super().move_to(view)
        stays = math.hypot(view.x - start.x, view.y - start.y) < 0.05
        if self._attention is None or stays or math.isinf(self.between_frames_m):
            return seconds
        points = self._costmap.path((start.x, start.y), (view.x, view.y)).points
        along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
        stops = np.arange(self.between_frames_m, along[-1] - 0.1, self.between_frames_m)
        self._seen = tuple(
            (share, self._look(points[int(np.searchsorted(along, s))], view, began, seconds, share))
            for s, share in ((s, float(s / along[-1])) for s in stops)
        )
        return seconds

    def _look(
        self, place: FloatArray, goal: View, began: float, seconds: float, share: float
    ) -> SensorFrame:
        assert self._attention is not None
        model = self._model
        dx, dy = self._attention[:2] - place
        height = model.camera_height_m + goal.torso_m
        yaw = math.atan2(dy, dx)
        if model.pan_rad == (0.0, 0.0):
            yaw = goal.yaw_rad  # a fixed camera looks where the base goes
        tilt = math.atan2(height - float(self._attention[2]), math.hypot(dx, dy))
        low, high = model.tilt_rad
        pose = View(
            float(place[0]), float(place[1]), yaw, goal.torso_m, 0.0, min(max(tilt, low), high)
        )
        self._index += 1
        return self._sensor.look(
            self._scene,
            model.T_map_sensor(pose),
            began + share * seconds,
            self._rng,
            self._index - 1,
        )
