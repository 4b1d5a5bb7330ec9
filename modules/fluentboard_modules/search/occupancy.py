"""The occupancy map: which cells of space are free, occupied or unknown (Section 5.2.1).

The sensor model is OctoMap's (Hornung et al. 2013): log-odds that hits and misses add to, clamped.
Cells live in blocks of 8 x 8 x 8, so memory follows the walls and the ways, not the building.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fluentboard.errors import InvalidGeometry, InvalidInput
from fluentboard.model.geometry import BoundingBox, FloatArray
from fluentboard_modules.frames.sensor_frame import SensorFrame
from fluentboard_modules.search import cast_kernels, look_kernels
from fluentboard_modules.search import occupancy_kernels as kernels
from fluentboard_modules.search.config import SensorModelConfig
from fluentboard_modules.search.looks import LookMarks

CellArray = NDArray[np.int64]
"""`(n, 3)`; integer cell coordinates: cell i spans i to i + 1 resolutions along its axis."""

UNKNOWN, FREE, OCCUPIED = -1, 0, 1

_BLOCK = 512
_FIRST_BLOCKS = 2048  # four megabytes, of which only those used are touched
_DIRECTORY_MAX = 1 << 27  # half a gigabyte; at 5 cm that is 2.9 km x 2.9 km x 1 m


@dataclass(frozen=True, slots=True)
class RayHits:
    """Where rays ended.

    Attributes:
        is_hit: `(n,)`; whether the ray met an occupied cell within its range.
        is_unknown: `(n,)`; whether it stopped at an unknown cell.
        cells: `(n, 3)`; the last cell.
        length_m: `(n,)`; way to the border of that cell in metres.
    """

    is_hit: NDArray[np.bool_]
    is_unknown: NDArray[np.bool_]
    cells: CellArray
    length_m: FloatArray


@dataclass(frozen=True, slots=True)
class RayStops:
    """What rays stop at, in a form that is quick to ask.

    Attributes:
        cells: `(blocks, 8)`; a bit for each cell; see `cast_kernels.find_stops`.
        meetings: `(nx, ny, nz)`; which blocks have a bit that is set; see `find_meetings` there.
        outside: what a ray meets beyond them.
    """

    cells: NDArray[np.uint64]
    meetings: NDArray[np.int32]
    outside: int


@dataclass(eq=False)
class OccupancyMap:
    """A map of free, occupied and unknown cells in the map frame.

    Attributes:
        resolution_m: side of a cell in metres.
        model: what a reading does to the cells along its ray.

    Raises:
        InvalidInput: the resolution is not positive.
    """

    resolution_m: float = 0.05
    model: SensorModelConfig = field(default_factory=SensorModelConfig)

    def __post_init__(self) -> None:
        if not (self.resolution_m > 0.0 and math.isfinite(self.resolution_m)):
            raise InvalidInput(
                f"a map with cells of {self.resolution_m} m; give a positive side in metres"
            )
        self._low = np.zeros(3, np.int64)
        self._directory = np.full((1, 1, 1), -1, np.int32)
        self._count = 0
        self._blocks = np.zeros((_FIRST_BLOCKS, 3), np.int64)
        self._log_odds = np.zeros((_FIRST_BLOCKS, _BLOCK), np.float32)
        self._look = LookMarks(self.resolution_m)
        self._stops: dict[bool, RayStops] = {}

    # -- arrays for the compiled loops of this package ------------------------------------------

    @property
    def directory(self) -> NDArray[np.int32]:
        """`(nx, ny, nz)`; number of the block at each place, -1 for none."""
        return self._directory

    @property
    def directory_low(self) -> NDArray[np.int64]:
        """`(3,)`; block coordinates of the directory's first entry."""
        return self._low

    @property
    def log_odds(self) -> NDArray[np.float32]:
        """`(blocks, 512)`; log-odds of every cell, NaN where unknown."""
        return self._log_odds[: self._count]

    @property
    def block_coordinates(self) -> NDArray[np.int64]:
        """`(blocks, 3)`; cell coordinates of each block's first cell, divided by 8."""
        return self._blocks[: self._count]

    def ray_stops(self, ignore_unknown: bool = True) -> RayStops:
        """Where rays stop; found anew after a change."""
        if ignore_unknown not in self._stops:
            stops = np.zeros((self._count, 8), np.uint64)
            cast_kernels.find_stops(self.log_odds, not ignore_unknown, stops)
            outside = cast_kernels.NOTHING if ignore_unknown else cast_kernels.ANYTHING
            meetings = np.zeros_like(self._directory)
            cast_kernels.find_meetings(self._directory, stops, outside, meetings)
            self._stops[ignore_unknown] = RayStops(stops, meetings, outside)
        return self._stops[ignore_unknown]

    # -- what is where --------------------------------------------------------------------------

    def cells_of(self, points_map: ArrayLike) -> CellArray:
        """The cells `(n, 3)` that points `(n, 3)` lie in."""
        points = np.asarray(points_map, dtype=np.float64).reshape(-1, 3)
        return np.floor(points / self.resolution_m).astype(np.int64)

    def centres(self, cells: CellArray) -> FloatArray:
        """`(n, 3)`; centres of cells in metres, map frame."""
        return (np.asarray(cells, dtype=np.float64) + 0.5) * self.resolution_m

    def log_odds_at(self, cells: CellArray) -> NDArray[np.float32]:
        """`(n,)`; log-odds of cells, NaN where unknown."""
        wanted = np.ascontiguousarray(cells, dtype=np.int64)
        found = np.zeros(len(wanted), np.float32)
        kernels.read_cells(self._directory, self._low, self._log_odds, wanted, found)
        return found

    def states(self, cells: CellArray) -> NDArray[np.int8]:
        """`(n,)`; UNKNOWN (-1), FREE (0) or OCCUPIED (1)."""
        return _states(self.log_odds_at(cells))

    def dense(self, first: ArrayLike, shape: tuple[int, int, int]) -> NDArray[np.int8]:
        """States of a box of cells that begins at cell `first`, as an array of that shape."""
        out = np.zeros(shape, np.float32)
        start = np.asarray(first, dtype=np.int64)
        kernels.copy_dense(self._directory, self._low, self._log_odds, start, out)
        return _states(out)

    def known_cells(self) -> tuple[CellArray, NDArray[np.float32]]:
        """All known cells `(n, 3)` and their log-odds `(n,)`."""
        block, cell = np.nonzero(~np.isnan(self.log_odds))
        offset = np.stack([cell >> 6, (cell >> 3) & 7, cell & 7], axis=1)
        return 8 * self._blocks[block] + offset, self._log_odds[block, cell]

    def occupied_cells(self) -> CellArray:
        """`(n, 3)`; all occupied cells."""
        cells, values = self.known_cells()
        return cells[values >= 0.0]

    @property
    def known_count(self) -> int:
        """How many cells are free or occupied."""
        return int(np.count_nonzero(~np.isnan(self.log_odds)))

    def copy(self) -> OccupancyMap:
        """A map of its own with the same content."""
        other = OccupancyMap(self.resolution_m, self.model)
        other._low, other._directory = self._low.copy(), self._directory.copy()
        other._make_room(self._count)
        other._count = self._count
        other._blocks[: self._count] = self.block_coordinates
        other._log_odds[: self._count] = self.log_odds
        return other

    # -- changes --------------------------------------------------------------------------------

    def integrate(
        self, points_map: ArrayLike, origin_map: ArrayLike, range_max_m: float = 0.0
    ) -> int:
        """Takes in one look: end points are hit, what lies before them is free.

        Every cell changes at most once per look, and hits win over misses.

        Args:
            points_map: `(..., 3)`; what the sensor measured; rows with NaN or infinity are skipped.
            origin_map: `(3,)`; where the sensor was.
            range_max_m: farther points only free the way to this distance; 0 for no limit.

        Returns:
            How many cells were updated.

        Raises:
            InvalidGeometry: a coordinate lies absurdly far away, or the origin is not finite.
        """
        points = np.ascontiguousarray(points_map, dtype=np.float64).reshape(-1, 3)
        origin = np.array(origin_map, dtype=np.float64)
        if not np.isfinite(origin).all():
            raise InvalidGeometry(f"a sensor at {origin} m; its position must be finite")
        low, shape = self._look.mark(points, origin, float(range_max_m))
        counts = np.array([self._count, 0], np.int64)
        done, blocks = 0, int(np.prod(shape >> 3))
        try:
            self._reach(np.array([low, low + shape - 1]))
            while True:
                done = look_kernels.apply_marks(
                    self._look.marks, low, shape, done, self._directory, self._low, self._blocks,
                    self._log_odds, counts, *np.array(self.model.log_odds_updates, np.float32),
                )  # fmt: skip
                self._count = int(counts[0])
                if done == blocks:
                    break
                self._make_room(2 * len(self._blocks))
        except InvalidGeometry:
            self._look = LookMarks(self.resolution_m)  # its marks were not cleared
            raise
        self._stops.clear()
        return int(counts[1])

    def integrate_frame(self, frame: SensorFrame, range_max_m: float = 0.0) -> int:
        """Takes in a sensor frame; see `integrate`."""
        points = (
            frame.points_map()
            if frame.cloud_sensor is None
            else frame.T_map_sensor.apply(frame.cloud_sensor)
        )
        return self.integrate(points, frame.T_map_sensor.translation, range_max_m)

    def set_cells(self, cells: CellArray, log_odds: float | NDArray[np.float32]) -> None:
        """Sets cells `(n, 3)` to log-odds (NaN: unknown), whatever they were."""
        wanted = np.ascontiguousarray(cells, dtype=np.int64).reshape(-1, 3)
        if not len(wanted):
            return
        self._reach(np.array([wanted.min(axis=0), wanted.max(axis=0)]))
        self._stops.clear()
        new = len(np.unique(_packed(wanted >> 3)))
        self._make_room(self._count + new)
        values = np.broadcast_to(np.asarray(log_odds, np.float32), (len(wanted),)).copy()
        self._count = int(
            kernels.write_cells(
                self._directory,
                self._low,
                self._blocks,
                self._log_odds,
                self._count,
                wanted,
                values,
            )
        )

    def cells_in(self, box: BoundingBox) -> CellArray:
        """`(n, 3)`; the cells whose centres lie in an oriented box, in the order x, y, z."""
        corners = box.corners()
        low = np.floor(corners.min(axis=0) / self.resolution_m).astype(np.int64)
        high = np.floor(corners.max(axis=0) / self.resolution_m).astype(np.int64)
        if float(np.prod((high - low + 1).astype(np.float64))) > 1e8:
            raise InvalidGeometry(
                f"a box of {box.sizes} m has too many cells of {self.resolution_m} m; give a "
                "smaller box or a coarser map"
            )
        axes = [np.arange(first, last + 1) for first, last in zip(low, high, strict=True)]
        cells = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        # Half a micrometre: whether a cell on the border belongs must not depend on rounding.
        inside = BoundingBox(box.pose, *(box.sizes + 1e-6)).contains(self.centres(cells))
        return cells[inside]

    def reset(self, box: BoundingBox, keep_occupied: bool = False) -> int:
        """Makes the cells in a box unknown, because what is there may have changed.

        Args:
            box: oriented, map frame.
            keep_occupied: leave what stands there, forget only that the rest is free.

        Returns:
            How many cells became unknown.
        """
        cells = self.cells_in(box)
        states = self.states(cells)
        forgotten = cells[(states == FREE) | ((states == OCCUPIED) & (not keep_occupied))]
        self.set_cells(forgotten, math.nan)
        return len(forgotten)

    def fade(self, elapsed_s: float, half_life_s: float) -> int:
        """Lets confidence in all cells fade (Section 5.2.1, future work there).

        Log-odds halve every `half_life_s`; a cell whose probability comes within
        `model.fade_margin` of one half becomes unknown again.

        Returns:
            How many cells became unknown.
        """
        if elapsed_s <= 0.0:
            return 0
        self._stops.clear()
        values = self.log_odds
        values *= np.float32(0.5 ** (elapsed_s / half_life_s))
        faded = np.abs(values) < math.log(
            (0.5 + self.model.fade_margin) / (0.5 - self.model.fade_margin)
        )
        values[faded] = np.nan
        return int(np.count_nonzero(faded))

    # -- rays -----------------------------------------------------------------------------------

    def cast_rays(
        self,
        origins_map: ArrayLike,
        directions_map: ArrayLike,
        range_max_m: float,
        ignore_unknown: bool = True,
    ) -> RayHits:
        """The first occupied cell along each ray.

        Args:
            origins_map: `(n, 3)` or `(3,)`; metres.
            directions_map: `(n, 3)`; of any length but zero.
            range_max_m: how far a ray goes.
            ignore_unknown: whether unknown cells are transparent; otherwise a ray stops there.

        Raises:
            InvalidGeometry: an origin or the range is not finite, or a direction is zero.
        """
        directions = np.ascontiguousarray(directions_map, dtype=np.float64).reshape(-1, 3)
        origins = np.ascontiguousarray(origins_map, dtype=np.float64).reshape(-1, 3)
        if len(origins) != 1:
            origins = np.broadcast_to(origins, directions.shape).copy()
        cells = np.zeros((len(directions), 3), np.int64)
        lengths = np.zeros(len(directions))
        outcome = np.zeros(len(directions), np.int8)
        wrong = 0
        if np.isfinite(origins).all() and math.isfinite(range_max_m):
            stops = self.ray_stops(ignore_unknown)
            wrong = cast_kernels.cast(
                origins, directions, float(range_max_m), self.resolution_m, stops.meetings,
                self._low, stops.outside, stops.cells, self._log_odds, cells, lengths, outcome,
            )  # fmt: skip
        if wrong >= 0:
            raise InvalidGeometry(
                "a ray needs a finite origin and range, and a direction that is not zero"
            )
        return RayHits(
            outcome == cast_kernels.HIT, outcome == cast_kernels.UNKNOWN_MET, cells, lengths
        )

    # -- room -----------------------------------------------------------------------------------

    def reach(self, cells: CellArray) -> None:
        """Makes blocks for cells `(n, 3)` that have none, so that compiled loops find them."""
        self.set_cells(cells, self.log_odds_at(cells))

    def _reach(self, box: CellArray) -> None:
        """Lets the directory reach the blocks of two corner cells `(2, 3)`."""
        low, high = box[0] >> 3, (box[1] >> 3) + 1
        if self._count:
            before = self._low + np.array(self._directory.shape)
            if (low >= self._low).all() and (high <= before).all():
                return
            # Some more than needed: a robot that drives along does not copy at every step.
            low = np.where(low < self._low, low - 4, self._low)
            high = np.where(high > before, high + 4, before)
        shape = high - low
        if float(np.prod(shape.astype(np.float64))) > _DIRECTORY_MAX:
            raise InvalidGeometry(
                f"the map would span {shape * 8 * self.resolution_m} m; limit the sensor's range "
                "(range_max_m) or remove the points that lie that far away"
            )
        directory = np.full(shape, -1, np.int32)
        if self._count:
            x, y, z = self._low - low
            nx, ny, nz = self._directory.shape
            directory[x : x + nx, y : y + ny, z : z + nz] = self._directory
        self._directory, self._low = directory, low

    def _make_room(self, blocks: int) -> None:
        before = len(self._blocks)
        if blocks <= before:
            return
        blocks = max(blocks, before + before // 2)
        numbers, log_odds = np.zeros((blocks, 3), np.int64), np.zeros((blocks, _BLOCK), np.float32)
        numbers[: self._count] = self._blocks[: self._count]
        log_odds[: self._count] = self._log_odds[: self._count]
        self._blocks, self._log_odds = numbers, log_odds


def _states(log_odds: NDArray[np.float32]) -> NDArray[np.int8]:
    return np.where(np.isnan(log_odds), UNKNOWN, log_odds >= 0.0).astype(np.int8)


def _packed(blocks: CellArray) -> NDArray[np.int64]:
    x, y, z = ((blocks[:, axis] + (1 << 20)) for axis in range(3))
    return (x << 42) | (y << 21) | z
