"""The region of interest: oriented boxes with probabilities, and the cells in them (Eq. 5.1)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fluentboard.errors import InvalidInput
from fluentboard.model.geometry import BoundingBox, FloatArray
from fluentboard_modules.search.occupancy import UNKNOWN, CellArray, OccupancyMap


@dataclass(frozen=True, slots=True)
class SearchVolume:
    """A box in which the object may be.

    Attributes:
        name: of the volume.
        box: oriented, map frame.
        probability: P_i, that at least one object of the target is in it.

    Raises:
        InvalidInput: the probability is not in [0, 1].
    """

    name: str
    box: BoundingBox
    probability: float

    def __post_init__(self) -> None:
        if not 0.0 <= self.probability <= 1.0:
            raise InvalidInput(
                f"search volume {self.name!r} has the probability {self.probability}; "
                "give one in [0, 1]"
            )


LOOKS_MAX = 4
"""Looks at one cell that count with an imperfect detector; what they all miss is given up."""

_CERTAIN = 1.0 - 1e-9
"""P_i = 1 would make every further thought worthless: ln 0. This is as good as certain."""


@dataclass(eq=False)
class Region:
    """The cells of all volumes, numbered, with what was believed about them at the beginning.

    Attributes:
        volumes: the boxes.
        cells: `(n, 3)`; their cells, each once.
        prior: `(n,)`; p(c_k) of every cell while it is unknown (Eq. 5.1); where volumes overlap,
            that at least one of them is right.
        members: per volume the numbers of its cells.
        excluded: `(n,)`; cells given up: too small a gap, or never revealed as promised.
        recall: probability that a look recognises an object that it shows.
        looks: `(n,)`; in how many looks each cell has been; counted for an imperfect detector only.
    """

    volumes: tuple[SearchVolume, ...]
    cells: CellArray
    prior: FloatArray
    members: tuple[NDArray[np.int64], ...]
    excluded: NDArray[np.bool_]
    recall: float = 1.0
    looks: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))

    def __post_init__(self) -> None:
        if len(self.looks) != len(self.cells):
            self.looks = np.zeros(len(self.cells), np.int64)

    def unknown(self, occupancy: OccupancyMap) -> NDArray[np.bool_]:
        """`(n,)`; which cells are unknown and not given up."""
        return (occupancy.states(self.cells) == UNKNOWN) & ~self.excluded

    def wanted(self, occupancy: OccupancyMap) -> NDArray[np.bool_]:
        """`(n,)`; which cells are worth a look: unknown, or looked at by a detector that misses."""
        unknown = self.unknown(occupancy)
        if self.recall == 1.0:
            return unknown
        again = (self.looks > 0) & (self.looks < LOOKS_MAX) & ~self.excluded
        return unknown | again

    def probability(self, occupancy: OccupancyMap) -> FloatArray:
        """`(n,)`; p(c_k) now: the prior where a cell is unknown, else 0 (Eq. 5.1).

        With an imperfect detector what has been looked at in vain keeps p q^m / (1 - p + p q^m)
        after m looks, q being the probability to miss.
        """
        belief = self.prior
        if self.recall < 1.0:
            missed = self.prior * (1.0 - self.recall) ** self.looks
            belief = missed / (1.0 - self.prior + missed)
        return np.where(self.wanted(occupancy), belief, 0.0)

    def remaining_probability(self, occupancy: OccupancyMap) -> float:
        """The probability that the object is in what is still worth a look."""
        return 1.0 - float(np.exp(np.log1p(-self.probability(occupancy)).sum()))

    def centre(self, occupancy: OccupancyMap) -> FloatArray:
        """`(3,)`; where the unknown probability is centred, in metres: what to look at on a way."""
        weight = self.probability(occupancy)
        if weight.sum() <= 0.0:
            weight = np.ones(len(self.cells))
        return np.average(occupancy.centres(self.cells), axis=0, weights=weight)

    def worth_watching(
        self, occupancy: OccupancyMap, way: FloatArray, range_max_m: float
    ) -> FloatArray:
        """`(3,)`; what to look at on a way: the volume in reach with most that is still unseen.

        Args:
            occupancy: the map.
            way: `(n, 2)`; points along the way, evenly spaced.
            range_max_m: how far the robot recognises things.
        """
        weight = self.probability(occupancy)
        best, chosen = 0.0, None
        for members in self.members:
            own = weight[members]
            if own.sum() <= 0.0:
                continue
            middle = np.average(occupancy.centres(self.cells[members]), axis=0, weights=own)
            passed = float((np.linalg.norm(way - middle[:2], axis=1) <= range_max_m).mean())
            value = passed * -math.expm1(float(np.log1p(-own).sum()))
            if value > best:
                best, chosen = value, middle
        return self.centre(occupancy) if chosen is None else chosen

    def believe(self, probabilities: Sequence[float], counted: Sequence[int] | None = None) -> None:
        """Takes new P_i for the volumes, as when a source on the board changes its mind."""
        self.volumes = tuple(
            SearchVolume(v.name, v.box, p) for v, p in zip(self.volumes, probabilities, strict=True)
        )
        counts = [len(m) for m in self.members] if counted is None else list(counted)
        self.prior = _prior(self.volumes, self.members, counts, len(self.cells))


def region_of(
    occupancy: OccupancyMap, volumes: Sequence[SearchVolume], count_unknown_only: bool = False
) -> Region:
    """The cells of some volumes.

    Args:
        occupancy: the map; it gets blocks for all cells of the region.
        volumes: where the object may be.
        count_unknown_only: let N_i of Eq. 5.1 count the cells that are unknown now. As printed it
            counts all cells of the volume, so P_i is reached only if all of them are unknown.

    Raises:
        InvalidInput: there is no volume, or one is so thin that no cell lies in it.
    """
    if not volumes:
        raise InvalidInput("nothing to search: give at least one volume")
    each = [occupancy.cells_in(volume.box) for volume in volumes]
    for volume, cells in zip(volumes, each, strict=True):
        if not len(cells):
            raise InvalidInput(
                f"search volume {volume.name!r} of {volume.box.sizes} m holds no cell of "
                f"{occupancy.resolution_m} m; make it thicker or the map finer"
            )
    cells, number = np.unique(np.concatenate(each), axis=0, return_inverse=True)
    ends = np.cumsum([len(c) for c in each])
    members = tuple(np.split(number.reshape(-1), ends[:-1]))
    occupancy.reach(cells)
    counts = [len(m) for m in members]
    if count_unknown_only:
        unknown = occupancy.states(cells) == UNKNOWN
        counts = [max(1, int(unknown[m].sum())) for m in members]
    prior = _prior(tuple(volumes), members, counts, len(cells))
    return Region(tuple(volumes), cells, prior, members, np.zeros(len(cells), np.bool_))


def exclude_small_gaps(region: Region, occupancy: OccupancyMap, object_size_m: float) -> int:
    """Gives up unknown gaps in which a cube of that size does not fit (Section 5.4).

    Wherever the cube is, it fully covers floor(size / resolution) - 1 cells along each axis, and a
    hidden object leaves them all unknown: what such a block of unknown cells never covers can hold
    no object.

    Returns:
        How many cells were given up.
    """
    from scipy.ndimage import binary_opening

    side = math.floor(object_size_m / occupancy.resolution_m + 1e-9) - 1
    if side <= 1:
        return 0
    low = region.cells.min(axis=0) - side
    shape = tuple(int(n) for n in region.cells.max(axis=0) + side + 1 - low)
    unknown = occupancy.dense(low, (shape[0], shape[1], shape[2])) == UNKNOWN
    roomy = binary_opening(unknown, np.ones((side, side, side), np.bool_))
    index = tuple((region.cells - low).T)
    small = unknown[index] & ~roomy[index] & ~region.excluded
    region.excluded |= small
    return int(small.sum())


def _prior(
    volumes: Sequence[SearchVolume],
    members: Sequence[NDArray[np.int64]],
    counts: Sequence[int],
    cell_count: int,
) -> FloatArray:
    # ln(1 - p) = ln(1 - P_i) / N_i, and independent probabilities add up in the logarithm.
    log_absent = np.zeros(cell_count)
    for volume, cells, count in zip(volumes, members, counts, strict=True):
        log_absent[cells] += math.log1p(-min(volume.probability, _CERTAIN)) / count
    return -np.expm1(log_absent)
