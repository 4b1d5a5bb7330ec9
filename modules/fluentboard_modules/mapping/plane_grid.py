"""One plane of the map, accumulated over frames on a grid of cells."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from fluentboard.model.geometry import FloatArray, Transform
from fluentboard_modules.frames.sensor_frame import SensorFrame
from fluentboard_modules.mapping.config import FusionConfig
from fluentboard_modules.mapping.existence import ExistenceBelief
from fluentboard_modules.mapping.grid_outline import (
    covered_cells,
    outline_of_cells,
    placed_outline,
    without_fringe,
)
from fluentboard_modules.mapping.planar_region import PlanarRegion
from fluentboard_modules.mapping.plane_kernels import NOT_JUDGED, SEEN, SEEN_THROUGH
from fluentboard_modules.mapping.plane_look import Visibility, looked_at

_MARGIN_CELLS = 16  # grown on every side when the grid is too small, so that it rarely is


@dataclass(slots=True)
class MapPlane:
    """A planar surface of the room, as far as it has been seen.

    The grid lies in a frame that is fixed when the plane is first seen. Per cell it counts frames
    that saw the surface and frames that saw through it, so that outlines which drift with the poses
    settle on what most frames agree on, and what is taken away disappears. The plane itself is a
    running least-squares fit of all regions.

    Attributes:
        identifier: stable number of the plane in its map.
        T_map_grid: grid frame to map frame; z is the first normal.
        config: cell size and thresholds.
        hits: `(h, w)`; frames that saw the surface in the cell.
        misses: `(h, w)`; frames that saw through it.
        corner: column and row number of the cell at `hits[0, 0]`.
        moments: `(3, 3)`; sum of w (x, y, 1)(x, y, 1)^T over all cells ever hit, grid frame.
        offsets: `(3,)`; sum of w z (x, y, 1).
        square_sum_m2: sum of the regions' mean square residuals.
        n_frames: frames that saw it.
        n_missed: frames that should have seen it and saw through most of it, lately.
        n_confirmed: frames that saw it, lately: both counts are halved together.
        n_unnoticed: frames that had it in view but found no region there.
        n_points: depth pixels over all frames.
        last_seen: number of the update that last saw it.
        belief: that it is there; None before the first look.
        stamps_s: of the frames that saw it, oldest first; the last `stamps_max`.
        sensor_position: `(3,)`; where the sensor last saw it from.
    """

    identifier: int
    T_map_grid: Transform
    config: FusionConfig
    hits: NDArray[np.int32] = field(default_factory=lambda: np.zeros((0, 0), np.int32))
    misses: NDArray[np.int32] = field(default_factory=lambda: np.zeros((0, 0), np.int32))
    corner: tuple[int, int] = (0, 0)
    moments: FloatArray = field(default_factory=lambda: np.zeros((3, 3)))
    offsets: FloatArray = field(default_factory=lambda: np.zeros(3))
    square_sum_m2: float = 0.0
    excess_sum: float = 0.0
    excess_weight: float = 0.0
    n_frames: int = 0
    n_missed: int = 0
    n_confirmed: int = 0
    n_unnoticed: int = 0
    n_points: int = 0
    last_seen: int = 0
    belief: ExistenceBelief | None = None
    stamps_s: list[float] = field(default_factory=list[float])
    sensor_position: FloatArray = field(default_factory=lambda: np.zeros(3))
    _region: PlanarRegion | None = None
    _fit: FloatArray | None = None
    _solid: NDArray[np.bool_] | None = None
    _traced: tuple[int, int, FloatArray] | None = None  # the state the region was made from

    @property
    def solid(self) -> NDArray[np.bool_]:
        """`(h, w)`; the cells that most frames which could see them saw."""
        if self._solid is None:
            share = self.config.solid_share
            self._solid = (self.hits > 0) & (self.hits * (1.0 - share) >= self.misses * share)
        return self._solid

    @property
    def area_m2(self) -> float:
        """Area of the solid cells."""
        return float(np.count_nonzero(self.solid)) * self.config.cell_m**2

    @property
    def fit(self) -> FloatArray:
        """`(3,)`; slopes a, b and height c of the plane z = a x + b y + c in the grid frame."""
        if self._fit is None:
            # The grid frame is the prior, worth one cell: a thin strip fixes no slope across.
            prior = np.diag([1.0, 1.0, 1e-9]) * self.config.slope_prior_weight
            self._fit = np.linalg.solve(self.moments + prior, self.offsets)
        return self._fit

    @property
    def equation(self) -> FloatArray:
        """`(4,)`; unit normal n and offset d of the plane n . p = d in the map frame."""
        a, b, c = self.fit
        normal = self.T_map_grid.rotation @ (-a, -b, 1.0)
        normal /= np.sqrt(a * a + b * b + 1.0)
        point = self.T_map_grid.rotation[:, 2] * c + self.T_map_grid.translation
        return np.append(normal, normal @ point)

    @property
    def normal(self) -> FloatArray:
        """`(3,)`; unit normal in the map frame."""
        return self.equation[:3]

    @property
    def bounds(self) -> FloatArray:
        """`(2, 3)`; lowest and highest corner, in the map frame, of the box around the grid."""
        height, width = self.hits.shape
        x = (np.array([0, width]) + self.corner[0]) * self.config.cell_m
        y = (np.array([0, height]) + self.corner[1]) * self.config.cell_m
        a, b, c = self.fit
        corners = np.array([[u, v, a * u + b * v + c] for u in x for v in y])
        corners_map = corners @ self.T_map_grid.rotation.T + self.T_map_grid.translation
        return np.stack([corners_map.min(axis=0), corners_map.max(axis=0)])

    def cells_of(self, region: PlanarRegion) -> NDArray[np.int32]:
        """Column and row numbers `(n, 2)` of the cells a region covers, seen along the normal."""
        return covered_cells(region, self.T_map_grid, self.config.cell_m)

    def overlap(self, cells: NDArray[np.int32], reach: int) -> int:
        """How many of the given cells lie within so many cells of the plane's solid ones."""
        if self.hits.size == 0:
            return 0
        size = 2 * reach + 1
        near = cv2.dilate(self.solid.astype(np.uint8), np.ones((size, size), np.uint8))
        local = cells - self.corner
        inside = (local >= 0).all(axis=1) & (local < (near.shape[1], near.shape[0])).all(axis=1)
        local = local[inside]
        return int(np.count_nonzero(near[local[:, 1], local[:, 0]]))

    def add(
        self,
        region: PlanarRegion,
        cells: NDArray[np.int32],
        weight: float,
        update: int,
        stamp_s: float,
    ) -> None:
        """Takes in what one frame saw of the plane.

        Args:
            region: what was seen.
            cells: the cells it covers, from `cells_of`.
            weight: inverse variance of the region's position, 1/m^2.
            update: running number of the frame.
            stamp_s: its time, in seconds.
        """
        self._make_room(cells)
        local = cells - self.corner
        self.hits[local[:, 1], local[:, 0]] += 1
        x = (cells[:, 0] + 0.5) * self.config.cell_m
        y = (cells[:, 1] + 0.5) * self.config.cell_m
        rotation = self.T_map_grid.rotation
        n = region.normal @ rotation
        p = (region.centroid - self.T_map_grid.translation) @ rotation
        z = p[2] - (n[0] * (x - p[0]) + n[1] * (y - p[1])) / n[2]
        design = np.column_stack([x, y, np.ones_like(x)])
        self.moments += weight * (design.T @ design)
        self.offsets += weight * (design.T @ z)
        self.square_sum_m2 += region.rms_m**2
        # Noise drowns unevenness far away: near looks count, with the square of their weight.
        self.excess_sum += weight**2 * region.excess_m2
        self.excess_weight += weight**2
        self.n_points += region.n_points
        if self.last_seen != update or self.n_frames == 0:
            self.n_frames += 1
            self.n_confirmed += 1
            self._believe(True, region.sensor_position)
            self.stamps_s = [*self.stamps_s[1 - self.config.stamps_max :], stamp_s]
        self.last_seen = update
        self.sensor_position = region.sensor_position
        self._fit = self._solid = None

    def absorb(self, other: MapPlane) -> None:
        """Takes over everything another map plane knows about the same surface."""
        T_grid_other = self.T_map_grid.inverse() @ other.T_map_grid
        rows, columns = np.nonzero((other.hits > 0) | (other.misses > 0))
        cell = self.config.cell_m
        centres = np.column_stack(
            [(columns + other.corner[0] + 0.5) * cell, (rows + other.corner[1] + 0.5) * cell]
        )
        a, b, c = other.fit
        heights = centres @ (a, b) + c
        points = T_grid_other.apply(np.column_stack([centres, heights]))
        cells = np.floor(points[:, :2] / cell).astype(np.int32)
        self._make_room(cells)
        local = cells - self.corner
        for mine, its in ((self.hits, other.hits), (self.misses, other.misses)):
            total = np.zeros_like(mine)
            # Rotated grids can put two cells into one: a frame still counts once.
            np.maximum.at(total, (local[:, 1], local[:, 0]), its[rows, columns])
            mine += total
        share = float(np.trace(other.moments[2:, 2:])) / max(len(cells), 1)
        design = np.column_stack([points[:, :2], np.ones(len(points))])
        self.moments += share * (design.T @ design)
        self.offsets += share * (design.T @ points[:, 2])
        self.square_sum_m2 += other.square_sum_m2
        self.excess_sum += other.excess_sum
        self.excess_weight += other.excess_weight
        self.n_frames = max(self.n_frames, other.n_frames)
        if other.belief is not None and other.existence > self.existence:
            self.belief = other.belief.copy()
        stamps_s = sorted({*self.stamps_s, *other.stamps_s})
        self.stamps_s = stamps_s[-self.config.stamps_max :]
        self.n_missed = min(self.n_missed, other.n_missed)
        self.n_confirmed = max(self.n_confirmed, other.n_confirmed)
        self.n_unnoticed = min(self.n_unnoticed, other.n_unnoticed)
        self.n_points += other.n_points
        self.last_seen = max(self.last_seen, other.last_seen)
        self._fit = self._solid = self._region = None

    def judge(self, view: Visibility, sensor_position: FloatArray) -> None:
        """Counts a frame against the plane as a whole if it sees through it.

        Args:
            view: how the frame saw its cells.
            sensor_position: `(3,)`; from where, in the map frame.
        """
        solid = int(np.count_nonzero(self.solid))
        if view.seen or view.expected < self.config.judged_share * solid:
            return
        if view.seen_through >= self.config.missed_share * view.expected:
            self.n_missed += 1
            self._believe(False, sensor_position)
        else:
            self.n_unnoticed += 1
        if self.n_confirmed + self.n_missed > self.config.memory_frames:
            self.n_confirmed = (self.n_confirmed + 1) // 2
            self.n_missed //= 2

    @property
    def is_noise(self) -> bool:
        """Whether too few of the views that should have shown it did."""
        doubts = self.n_missed + self.n_unnoticed
        return doubts >= self.config.forget_least_views and (
            doubts > self.config.forget_ratio * self.n_frames
        )

    @property
    def existence(self) -> float:
        """Belief that it is there, by the frames that saw it and those that saw through it."""
        return self.config.existence.prior if self.belief is None else self.belief.probability

    def _believe(self, shows: bool, sensor_position: FloatArray) -> None:
        if self.belief is None:
            self.belief = ExistenceBelief(self.config.existence)
        self.belief.take(shows, (sensor_position - self.T_map_grid.translation).tolist())

    def look(
        self,
        frame: SensorFrame,
        T_sensor_map: Transform,
        tolerance_m: float,
        seen: NDArray[np.int32] | None,
    ) -> Visibility:
        """Compares the plane with a depth image and counts cells that were seen through.

        Args:
            frame: what the sensor measured.
            T_sensor_map: where it was.
            tolerance_m: how far behind the plane a measurement must be to prove it absent.
            seen: cells that this frame's own regions hit; these are not judged again.
        """
        if not self.hits.any():
            return Visibility(0, 0, 0)
        hit = np.zeros(self.hits.shape, dtype=np.bool_)
        if seen is not None and len(seen):
            local = seen - self.corner
            hit[local[:, 1], local[:, 0]] = True
        state = looked_at(
            frame,
            T_sensor_map @ self.T_map_grid,
            self.fit,
            self.corner,
            self.config.cell_m,
            self.hits > 0,
            hit,
            tolerance_m,
        )
        through = state == SEEN_THROUGH
        if through.any():
            self.misses[through] += 1
            self._solid = None
        self._halve_old_counts()
        solid = self.solid
        return Visibility(
            seen=int(np.count_nonzero((state == SEEN) & solid)),
            seen_through=int(np.count_nonzero(through & solid)),
            expected=int(np.count_nonzero((state != NOT_JUDGED) & solid)),
        )

    def _halve_old_counts(self) -> None:
        """Keeps the cells able to change their mind."""
        old = self.hits + self.misses > self.config.memory_frames
        if old.any():
            self.hits[old] = (self.hits[old] + 1) // 2
            self.misses[old] //= 2

    def region(self, index: int) -> PlanarRegion | None:
        """The plane as a region in the map frame, None if no cell of it is left.

        It is made anew when the plane has changed by more than `stale_share` of its area or by
        `stale_m`: tracing the contour of every plane in every frame would be most of the work.
        """
        if self._region is None or self._is_stale():
            self._region = self._make_region()
            self._traced = (int(np.count_nonzero(self.solid)), self.n_frames, self.equation)
        if self._region is None or self._region.index == index:
            return self._region
        self._region = replace(self._region, index=index)
        return self._region

    def _is_stale(self) -> bool:
        if self._traced is None:
            return True
        n_cells, n_frames, equation = self._traced
        if self.n_frames >= 2 * n_frames:
            return True
        grown = abs(int(np.count_nonzero(self.solid)) - n_cells)
        shift = abs(float((self.equation - equation)[3]))
        turn = float(np.abs((self.equation - equation)[:3]).max())
        return (
            grown > self.config.stale_share * n_cells
            or shift > self.config.stale_m
            or turn > self.config.stale_m
        )

    def _make_region(self) -> PlanarRegion | None:
        solid = without_fringe(self.solid, self.hits, self.config)
        contour = outline_of_cells(solid, self.corner, self.config)
        if contour.is_empty:
            return None
        T_map_region, contour = placed_outline(
            contour, solid, self.config.cell_m, self.T_map_grid, self.fit
        )
        return PlanarRegion(
            index=-1,
            T_map_region=T_map_region,
            contour=contour,
            n_points=self.n_points,
            rms_m=float(np.sqrt(self.square_sum_m2 / max(self.n_frames, 1))),
            excess_m2=self.excess_sum / max(self.excess_weight, 1e-12),
            sensor_position=self.sensor_position,
        )

    def _make_room(self, cells: NDArray[np.int32]) -> None:
        """Grows the arrays so that the given cells lie inside."""
        low, high = cells.min(axis=0), cells.max(axis=0) + 1
        old_low = np.array(self.corner)
        old_high = old_low + self.hits.shape[::-1]
        if self.hits.size and (low >= old_low).all() and (high <= old_high).all():
            return
        if self.hits.size:
            low, high = np.minimum(low, old_low), np.maximum(high, old_high)
        low, high = low - _MARGIN_CELLS, high + _MARGIN_CELLS
        shape = (int(high[1] - low[1]), int(high[0] - low[0]))
        for name in ("hits", "misses"):
            old = getattr(self, name)
            new = np.zeros(shape, np.int32)
            if old.size:
                column, row = old_low - low
                new[row : row + old.shape[0], column : column + old.shape[1]] = old
            setattr(self, name, new)
        self.corner = (int(low[0]), int(low[1]))
