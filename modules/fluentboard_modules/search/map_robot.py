"""A robot in a saved occupancy map: searches in real rooms of which only an OctoMap is known."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fluentboard.errors import InvalidInput
from fluentboard_modules.frames.sensor_frame import SensorFrame
from fluentboard_modules.search.occupancy import OCCUPIED, UNKNOWN, OccupancyMap
from fluentboard_modules.simulation.costmap_robot import CostmapRobot
from fluentboard_modules.simulation.navigation import Costmap, inflated
from fluentboard_modules.simulation.robots import RobotModel, View

_IMAGE_WIDTH = 160
_STEP_M = 0.15  # lower than this is floor, to wheels
_DEPTH_MAX_M = 9.0


def costmap_of(occupancy: OccupancyMap, model: RobotModel, floor_z_m: float = 0.0) -> Costmap:
    """Where a robot can drive by an occupancy map.

    A cell of the floor plan is an obstacle if something occupied stands between the floor and the
    robot's top, or if nothing is known of that column.

    Args:
        occupancy: the map.
        model: of the robot, for radius and height.
        floor_z_m: height of the floor in the map.

    Raises:
        InvalidInput: the map knows nothing at that height.
    """
    resolution = occupancy.resolution_m
    top = floor_z_m + model.camera_height_m + model.torso_m[1]
    low_z = math.floor((floor_z_m + _STEP_M) / resolution)
    high_z = math.ceil(top / resolution)
    bounds = _known_floor(occupancy, low_z, high_z)
    if bounds is None:
        raise InvalidInput(f"the map knows nothing between {floor_z_m} m and {top:.2f} m")
    low, high = bounds
    first = np.array([*low, low_z])
    shape = (int(high[0] - low[0] + 1), int(high[1] - low[1] + 1), high_z - low_z)
    states = occupancy.dense(first, shape)
    blocked = (states == OCCUPIED).any(axis=2) | (states == UNKNOWN).all(axis=2)
    origin = (float(first[0]) * resolution, float(first[1]) * resolution)
    return inflated(np.ascontiguousarray(blocked.T), resolution, origin, model.radius_m)


def _known_floor(
    occupancy: OccupancyMap, low_z: int, high_z: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]] | None:
    """Least and greatest x and y of the known cells from `low_z` to below `high_z`; None: none."""
    known = ~np.isnan(occupancy.log_odds).reshape(-1, 8, 8, 8)
    corners = 8 * occupancy.block_coordinates
    height = corners[:, 2:] + np.arange(8)
    known &= ((height >= low_z) & (height < high_z))[:, None, None, :]
    along_x, along_y = known.any(axis=(2, 3)), known.any(axis=(1, 3))
    if not along_x.any():
        return None
    x = (corners[:, 0:1] + np.arange(8))[along_x]
    y = (corners[:, 1:2] + np.arange(8))[along_y]
    return np.array([x.min(), y.min()]), np.array([x.max(), y.max()])


class MapRobot(CostmapRobot):
    """A `Robot` whose world is an occupancy map: it looks by casting rays into it.

    Args:
        model: which robot.
        world: what is where.
        start: its first view.
        floor_z_m: height of the floor in the map.
        start_s: its clock at the beginning.

    Raises:
        UnreachableView: it cannot stand at its first view.
    """

    def __init__(
        self,
        model: RobotModel,
        world: OccupancyMap,
        start: View,
        floor_z_m: float = 0.0,
        start_s: float = 1.0,
    ) -> None:
        raised = model.model_copy(update={"camera_height_m": model.camera_height_m + floor_z_m})
        super().__init__(raised, costmap_of(world, model, floor_z_m), start, start_s)
        self._world = world
        self._camera = model.camera(_IMAGE_WIDTH)

    def sense(self) -> SensorFrame:
        """A depth image of the map; what the map does not know is not measured."""
        self._time_s += self._model.acquisition_s
        T_map_sensor = self._model.T_map_sensor(self._view)
        directions = self._camera.rays()
        rays = T_map_sensor.rotate(directions.reshape(-1, 3))
        hits = self._world.cast_rays(T_map_sensor.translation, rays, _DEPTH_MAX_M)
        # To the middle of the cell, which a point on its border might miss.
        along = hits.length_m + 0.5 * self._world.resolution_m
        depth = np.where(hits.is_hit, along / np.linalg.norm(rays, axis=1), 0.0)
        self._index += 1
        return SensorFrame(
            depth_m=depth.reshape(directions.shape[:2]).astype(np.float32),
            camera=self._camera,
            stamp_s=self._time_s,
            T_map_sensor=T_map_sensor,
            sensor=self._model.name,
            index=self._index - 1,
        )
