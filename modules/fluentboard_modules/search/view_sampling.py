"""View sampling: poses from which the robot can look at unknown cells, and which it would reveal.

An anytime operation: it draws views until there are enough or the time is up (Section 5.2.1).
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fluentboard.model.geometry import FloatArray, Transform
from fluentboard_modules.search import view_kernels as kernels
from fluentboard_modules.search.config import ViewSamplingConfig
from fluentboard_modules.search.frontiers import Frontiers
from fluentboard_modules.search.occupancy import OccupancyMap
from fluentboard_modules.search.region import Region
from fluentboard_modules.simulation.navigation import Costmap
from fluentboard_modules.simulation.robots import RobotModel, View

_BATCH = 64
_TRANSPARENT = 1 << 30


@dataclass(frozen=True, eq=False)
class SampledViews:
    """Views as the planner wants them.

    Attributes:
        views: configurations of the robot.
        ptr: `(v + 1,)`; the cells of view i are `cells[ptr[i]:ptr[i + 1]]`.
        cells: numbers of the region's cells.
    """

    views: tuple[View, ...]
    ptr: NDArray[np.int64]
    cells: NDArray[np.int64]

    @classmethod
    def joined(cls, views: Sequence[View], cells: Sequence[NDArray[np.int64]]) -> SampledViews:
        """Views with the cells of each."""
        ptr = np.concatenate([[0], np.cumsum([len(c) for c in cells])]).astype(np.int64)
        return cls(tuple(views), ptr, np.concatenate(cells) if cells else np.zeros(0, np.int64))

    def __len__(self) -> int:
        return len(self.views)

    def cells_of(self, view: int) -> NDArray[np.int64]:
        """Numbers of the cells that a view is expected to reveal."""
        return self.cells[self.ptr[view] : self.ptr[view + 1]]


class VisibleCells:
    """What views of a robot would reveal of a region, with the map as it is now.

    Unknown cells are transparent, as in the thesis, unless the configuration gives them a
    probability to be occupied.

    Args:
        region: of interest.
        occupancy: the map.
        model: of the robot, for field of view and range.
        config: how many rays, and the visibility prior.
    """

    def __init__(
        self,
        region: Region,
        occupancy: OccupancyMap,
        model: RobotModel,
        config: ViewSamplingConfig,
    ) -> None:
        self._occupancy = occupancy
        self._model = model
        self._rays = _ray_bundle(model, config.rays)
        prior = config.unknown_occupancy
        # A ray goes on while it is more likely than not that nothing has stopped it.
        self._unknown_max = (
            _TRANSPARENT if prior <= 0.0 else math.floor(math.log(0.5) / math.log1p(-prior))
        )
        wanted = np.flatnonzero(region.wanted(occupancy)).astype(np.int32)
        blocks = len(occupancy.log_odds)
        self._numbers = np.full((blocks, 512), -1, np.int32)
        kernels.number_cells(
            occupancy.directory,
            occupancy.directory_low,
            region.cells[wanted],
            self._numbers,
            wanted,
        )
        self._boxes = _boxes_around(region, wanted, occupancy.resolution_m)
        self._content = np.zeros(blocks, np.uint8)
        kernels.block_content(occupancy.log_odds, self._numbers, self._content)
        self._stamp = np.zeros(len(region.cells), np.int64)
        self._out = np.zeros(len(region.cells), np.int64)
        self._mark = 0

    def of(self, view: View) -> NDArray[np.int64]:
        """Numbers of the cells worth a look that a view would show, in rising order."""
        return self.of_pose(self._model.T_map_sensor(view))

    def of_pose(self, T_map_sensor: Transform) -> NDArray[np.int64]:
        """The same for a pose of the sensor, such as that of another robot's claim."""
        self._mark += 1
        near, far = self._model.range_m
        count = kernels.reveal(
            np.ascontiguousarray(T_map_sensor.translation),
            np.ascontiguousarray(T_map_sensor.rotation),
            self._rays,
            near,
            far,
            self._boxes,
            self._unknown_max,
            self._occupancy.resolution_m,
            self._occupancy.directory,
            self._occupancy.directory_low,
            self._occupancy.log_odds,
            self._numbers,
            self._content,
            self._stamp,
            self._mark,
            self._out,
        )
        return np.sort(self._out[:count])


def sample_views(
    frontiers: Frontiers,
    visible: VisibleCells,
    model: RobotModel,
    costmap: Costmap,
    path_costs: FloatArray,
    config: ViewSamplingConfig,
    rng: np.random.Generator,
    count: int | None = None,
) -> SampledViews:
    """Views that reveal something, within the robot's limits and from where it can stand.

    Args:
        frontiers: what to look at.
        visible: what views would reveal.
        model: of the robot.
        costmap: where its base can stand.
        path_costs: costs to get everywhere from where the robot is, infinite where no way leads.
        config: limits.
        rng: decides everything.
        count: how many; `config.views` if not given.
    """
    wanted = config.views if count is None else count
    begun = time.perf_counter()
    chosen: list[View] = []
    each: list[NDArray[np.int64]] = []
    seed = np.array([int(rng.integers(1, 1 << 62))], np.uint64)
    low, high = config.tilt_rad or model.tilt_rad
    # A camera that hardly tilts may see the cell off its axis.
    slack = max(0.0, 0.4 * model.vertical_fov_rad - 0.5 * (high - low))
    torso = config.camera_height_m or tuple(model.camera_height_m + t for t in model.torso_m)
    poses = np.zeros((_BATCH, kernels.CANDIDATE_COLUMNS))
    targets = np.zeros(_BATCH, np.int64)
    drawn = 0
    while len(frontiers) and len(chosen) < wanted and drawn < config.tries_per_view * wanted:
        found, tried = kernels.sample_poses(
            frontiers.centres,
            frontiers.normals,
            np.array(torso),
            np.array([low - slack, high + slack]),
            np.array(model.range_m),
            model.camera_x_m,
            path_costs,
            costmap.resolution_m,
            np.array(costmap.origin),
            config.tries_per_view * wanted - drawn,
            seed,
            poses,
            targets,
        )
        drawn += tried
        for x, y, z, azimuth, tilt, _ in poses[:found].tolist():
            view = View(
                x,
                y,
                azimuth,
                min(max(z - model.camera_height_m, model.torso_m[0]), model.torso_m[1]),
                0.0,
                min(max(tilt, low), high),
            )
            cells = visible.of(view)
            if len(cells):  # otherwise something stands in the line of sight
                chosen.append(view)
                each.append(cells)
                if len(chosen) == wanted:
                    break
        if time.perf_counter() - begun > config.time_limit_s:
            break
    return SampledViews.joined(chosen, each)


def _boxes_around(region: Region, wanted: NDArray[np.int32], resolution_m: float) -> FloatArray:
    """`(m, 6)`; low and high corners of boxes, one for each volume, that hold its wanted cells."""
    is_wanted = np.zeros(len(region.cells), np.bool_)
    is_wanted[wanted] = True
    corners: list[FloatArray] = []
    for members in region.members:
        cells = region.cells[members[is_wanted[members]]]
        if len(cells):
            # Half a cell wider, so that rounding plays no part.
            low, high = cells.min(axis=0) - 0.5, cells.max(axis=0) + 1.5
            corners.append(np.concatenate([low, high]) * resolution_m)
    return np.array(corners).reshape(-1, 6)


def _ray_bundle(model: RobotModel, rays: tuple[int, int]) -> FloatArray:
    """`(n, 3)`; unit directions through the centres of a grid on the image plane."""
    columns, rows = rays
    across = math.tan(0.5 * model.horizontal_fov_rad) * ((2 * np.arange(columns) + 1) / columns - 1)
    down = math.tan(0.5 * model.vertical_fov_rad) * ((2 * np.arange(rows) + 1) / rows - 1)
    x, y = np.meshgrid(across, down)
    directions = np.stack([x, y, np.ones_like(x)], axis=-1).reshape(-1, 3)
    return directions / np.linalg.norm(directions, axis=1, keepdims=True)
