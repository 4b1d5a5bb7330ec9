"""NearestSamples: which sample of a model's surface is nearest to a point, remembered by voxel."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fluentboard.model.geometry import FloatArray
from fluentboard_modules.mapping.alignment_kernels import MISSING

VOXEL_M = 0.02
"""Edge of a voxel: as far apart as the samples are."""

REACH_M = 0.25 + VOXEL_M
"""Where ICP begins, points beyond do not vote."""

CELL_M = 0.12
"""Edge of the cells that samples are sorted into."""


class NearestSamples:
    """The samples nearest to the centres of voxels, found once and remembered.

    A look-up costs a hundredth of a search, and is off by less than the samples are apart: enough
    to come within a centimetre. Several threads may fill it in at once: all find the same.

    Args:
        samples: `(n, 3)`; points of a surface, metres.

    Attributes:
        low: `(3,)`; lowest corner of the field, in the model's frame.
        field: `(i, j, k)` int32; per voxel the index of a sample, `MISSING` where nobody has
            asked yet, `OUTSIDE` where none is near.
        members: `(n,)` int32; the samples, sorted by cell.
        firsts: `(a, b, c, 2)` int32; first and behind the last member of each cell.
    """

    def __init__(self, samples: FloatArray) -> None:
        low, high = samples.min(axis=0), samples.max(axis=0)
        self.low: FloatArray = low - (REACH_M - VOXEL_M)
        shape = np.ceil((high + REACH_M - VOXEL_M - self.low) / VOXEL_M).astype(int)
        self.field: NDArray[np.int32] = np.full(np.maximum(shape, 1), MISSING, dtype=np.int32)
        places = np.floor((samples - self.low) / CELL_M).astype(np.int64)
        cells = places.max(axis=0) + 1
        number = np.ravel_multi_index(tuple(places.T), tuple(cells))
        self.members: NDArray[np.int32] = np.argsort(number, kind="stable").astype(np.int32)
        edges = np.searchsorted(number[self.members], np.arange(int(cells.prod()) + 1))
        firsts = np.column_stack([edges[:-1], edges[1:]]).astype(np.int32)
        self.firsts: NDArray[np.int32] = firsts.reshape(*cells, 2)
