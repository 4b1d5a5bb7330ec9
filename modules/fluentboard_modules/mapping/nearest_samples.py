"""NearestSamples: which sample of a model's surface is nearest to a point, remembered by voxel."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from fluentboard.model.geometry import FloatArray
from fluentboard_modules.mapping.alignment_kernels import MISSING, OUTSIDE

VOXEL_M = 0.02
"""Edge of a voxel: as far apart as the samples are."""

_MARGIN_M = 0.25  # where ICP begins, points beyond do not vote


class NearestSamples:
    """The samples nearest to the centres of voxels, found once and remembered.

    A look-up costs a hundredth of a search in a tree, and is off by less than the samples are
    apart: enough to come within a centimetre.

    Args:
        tree: over the samples.

    Attributes:
        low: `(3,)`; lowest corner of the field, in the model's frame.
        field: `(i, j, k)` int32; per voxel the index of a sample, `MISSING` where nobody has
            asked yet, `OUTSIDE` where none is near.
    """

    def __init__(self, tree: cKDTree) -> None:
        self._tree = tree
        self.low: FloatArray = np.asarray(tree.mins, dtype=np.float64) - _MARGIN_M
        extent = np.asarray(tree.maxes) + _MARGIN_M - self.low
        shape = np.maximum(np.ceil(extent / VOXEL_M).astype(int), 1)
        self.field: NDArray[np.int32] = np.full(shape, MISSING, dtype=np.int32)

    def find(self, voxels: NDArray[np.int64]) -> None:
        """Fills in voxels, given by their numbers in the field's memory."""
        places = np.unravel_index(np.unique(voxels), self.field.shape)
        centres = self.low + (np.column_stack(places) + 0.5) * VOXEL_M
        distance, nearest = self._tree.query(centres, distance_upper_bound=_MARGIN_M + VOXEL_M)
        self.field[places] = np.where(np.isfinite(distance), nearest, OUTSIDE)
