"""Where a robot's base can stand, and what it costs to drive there: a 2D costmap and its paths.

Costs follow ROS's costmap_2d and navfn, because the published drive-time models are regressions on
their path costs: a cell costs 50 plus 0.8 times its costmap value, and a value falls off
exponentially with the distance from an obstacle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fluentboard.errors import UnreachableView
from fluentboard.model.geometry import FloatArray
from fluentboard_modules.simulation.scene import Scene

LETHAL = 254
INSCRIBED = 253

_NEUTRAL = 50.0  # navfn: COST_NEUTRAL
_FACTOR = 0.8  # navfn: COST_FACTOR
_DECAY_PER_M = 10.0  # costmap_2d: cost_scaling_factor


@dataclass(frozen=True, slots=True)
class Path:
    """A way over the floor.

    Attributes:
        points: `(n, 2)`; positions in the map frame, from start to goal, one per cell.
        cost: in navfn's units, 50 per free cell of the way.
    """

    points: FloatArray
    cost: float

    @property
    def length_m(self) -> float:
        """Length of the way in metres."""
        return float(np.linalg.norm(np.diff(self.points, axis=0), axis=1).sum())


@dataclass(frozen=True, eq=False)
class Costmap:
    """How near to an obstacle the centre of a round robot is, cell by cell.

    Attributes:
        cost: `(rows, columns)` uint8; 254 obstacle, 253 collision, then falling to 0; row = y.
        resolution_m: side of a cell.
        origin: x and y of the corner of cell (0, 0) in metres, map frame.
    """

    cost: NDArray[np.uint8]
    resolution_m: float
    origin: tuple[float, float]

    def cell(self, x: float, y: float) -> tuple[int, int] | None:
        """Row and column of a position, None outside."""
        column = math.floor((x - self.origin[0]) / self.resolution_m)
        row = math.floor((y - self.origin[1]) / self.resolution_m)
        rows, columns = self.cost.shape
        return (row, column) if 0 <= row < rows and 0 <= column < columns else None

    def position(self, row: int, column: int) -> tuple[float, float]:
        """Coordinates x and y of the centre of a cell."""
        return (
            self.origin[0] + (column + 0.5) * self.resolution_m,
            self.origin[1] + (row + 0.5) * self.resolution_m,
        )

    def is_free(self, x: float, y: float) -> bool:
        """Whether the robot can stand there without touching anything."""
        cell = self.cell(x, y)
        return cell is not None and bool(self.cost[cell] < INSCRIBED)

    @cached_property
    def _graph(self) -> Any:
        """Eight-connected cells; an edge costs the mean of its cells times its length in cells."""
        from scipy.sparse import coo_array

        free = self.cost < INSCRIBED
        price = _NEUTRAL + _FACTOR * self.cost.astype(np.float64)  # as in cell_prices
        number = np.arange(self.cost.size).reshape(self.cost.shape)
        heads, tails, weights = [], [], []
        for down, right in ((0, 1), (1, 0), (1, 1), (1, -1)):
            here = (slice(0, -down or None), slice(max(-right, 0), -right if right > 0 else None))
            there = (slice(down, None), slice(max(right, 0), right if right < 0 else None))
            both = free[here] & free[there]
            heads.append(number[here][both])
            tails.append(number[there][both])
            mean = 0.5 * (price[here] + price[there])
            weights.append(math.hypot(down, right) * mean[both])
        edges = (np.concatenate(weights), (np.concatenate(heads), np.concatenate(tails)))
        return coo_array(edges, shape=(self.cost.size,) * 2).tocsr()

    def _free_cell(self, x: float, y: float, what: str) -> int:
        cell = self.cell(x, y)
        if cell is None or self.cost[cell] >= INSCRIBED:
            where = "outside the map" if cell is None else "too close to an obstacle"
            raise UnreachableView(
                f"the {what} ({x:.2f}, {y:.2f}) m is {where}; choose a base position with more room"
            )
        return cell[0] * self.cost.shape[1] + cell[1]

    def path_costs(self, x: float, y: float) -> FloatArray:
        """`(rows, columns)`; cost of the cheapest way from there to every cell, else infinite.

        Raises:
            UnreachableView: the robot cannot stand there.
        """
        from scipy.sparse.csgraph import dijkstra

        start = self._free_cell(x, y, "start")
        costs: FloatArray = dijkstra(self._graph, directed=False, indices=start)
        return costs.reshape(self.cost.shape)

    def path(self, start: tuple[float, float], goal: tuple[float, float]) -> Path:
        """The cheapest way between two positions in metres (Dijkstra).

        Raises:
            UnreachableView: one of them is not free, or no way joins them.
        """
        from scipy.sparse.csgraph import dijkstra

        first = self._free_cell(*start, "start")
        last = self._free_cell(*goal, "goal")
        costs, before = dijkstra(
            self._graph, directed=False, indices=first, return_predecessors=True
        )
        if not np.isfinite(costs[last]):
            raise UnreachableView(
                f"no way leads from ({start[0]:.2f}, {start[1]:.2f}) m to "
                f"({goal[0]:.2f}, {goal[1]:.2f}) m; obstacles part the two"
            )
        cells = [last]
        while cells[-1] != first:
            cells.append(int(before[cells[-1]]))
        rows, columns = np.divmod(np.array(cells[::-1]), self.cost.shape[1])
        points = np.array([self.position(r, c) for r, c in zip(rows, columns, strict=True)])
        return Path(points, float(costs[last]))


def cell_prices(costmap: Costmap) -> FloatArray:
    """`(rows, columns)`; navfn's price of every cell, infinite where the base cannot stand."""
    price = _NEUTRAL + _FACTOR * costmap.cost.astype(np.float64)
    return np.where(costmap.cost < INSCRIBED, price, np.inf)


def costmap(
    scene: Scene,
    robot_radius_m: float,
    robot_height_m: float = 1.6,
    resolution_m: float = 0.05,
    inflation_m: float = 0.55,
) -> Costmap:
    """The costmap of a scene for a round robot.

    Args:
        scene: everything between 5 cm above the floor and the robot's height is an obstacle.
        robot_radius_m: inscribed radius of the base.
        robot_height_m: what is higher than this does not matter.
        resolution_m: side of a cell.
        inflation_m: distance from an obstacle at which it no longer costs anything.
    """
    low, high = scene.bounds
    columns, rows = (int(n) + 1 for n in np.ceil((high - low)[:2] / resolution_m))
    origin = (float(low[0]), float(low[1]))
    occupied = np.zeros((rows, columns), dtype=np.bool_)
    # Beyond the border of the map nothing is known.
    occupied[[0, -1], :] = True
    occupied[:, [0, -1]] = True
    for instance in scene.instances:
        corners = instance.vertices_map[instance.model.mesh.triangles]
        points = _surface_points(corners, 0.05, robot_height_m, 0.5 * resolution_m)
        index = np.floor((points - low[:2]) / resolution_m).astype(np.int64)
        occupied[index[:, 1].clip(0, rows - 1), index[:, 0].clip(0, columns - 1)] = True
    return inflated(occupied, resolution_m, origin, robot_radius_m, inflation_m)


def inflated(
    occupied: NDArray[np.bool_],
    resolution_m: float,
    origin: tuple[float, float],
    robot_radius_m: float,
    inflation_m: float = 0.55,
) -> Costmap:
    """The costmap of a floor plan for a round robot.

    Args:
        occupied: `(rows, columns)`; where obstacles are; row = y.
        resolution_m: side of a cell.
        origin: x and y of the corner of cell (0, 0) in metres, map frame.
        robot_radius_m: inscribed radius of the base.
        inflation_m: distance from an obstacle at which it no longer costs anything.
    """
    from scipy.ndimage import distance_transform_edt

    distance = resolution_m * distance_transform_edt(~occupied)
    decayed = (INSCRIBED - 1) * np.exp(-_DECAY_PER_M * (distance - robot_radius_m))
    cost = np.where(distance <= inflation_m, decayed, 0.0)
    cost = np.where(distance <= robot_radius_m, INSCRIBED, cost)
    return Costmap(np.where(occupied, LETHAL, cost).astype(np.uint8), resolution_m, origin)


def _surface_points(
    corners: FloatArray, z_low: float, z_high: float, spacing_m: float
) -> FloatArray:
    """`(n, 2)`; points on triangles `(m, 3, 3)`, at most `spacing_m` apart, between two heights."""
    heights = corners[:, :, 2]
    corners = corners[(heights.max(axis=1) > z_low) & (heights.min(axis=1) < z_high)]
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    steps = np.maximum(np.ceil(edges / spacing_m).astype(int), 1)
    found: list[FloatArray] = [np.zeros((0, 2))]
    for count in np.unique(steps):
        i, j = np.meshgrid(np.arange(count + 1), np.arange(count + 1))
        inside = i + j <= count
        u, v = i[inside] / count, j[inside] / count
        weights = np.stack([1.0 - u - v, u, v], axis=1)
        points = np.einsum("pk,mkc->mpc", weights, corners[steps == count]).reshape(-1, 3)
        found.append(points[(points[:, 2] > z_low) & (points[:, 2] < z_high), :2])
    return np.concatenate(found)
