"""Which planes are one: least squares on 4x4 moments of cells, merged pair by pair (pure)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fluentboard.model.geometry import FloatArray
from fluentboard_modules.mapping.config import SegmentationConfig


def fit_planes(moments: FloatArray) -> FloatArray:
    """`(n, 3)`; the least-squares planes m of n moment matrices `(n, 4, 4)`."""
    normal_matrix = moments[:, :3, :3].copy()
    # Cells in one line leave the plane undetermined; a trace of regularisation keeps it finite.
    trace = np.trace(normal_matrix, axis1=1, axis2=2)
    normal_matrix += (1e-12 * trace + 1e-30)[:, None, None] * np.eye(3)
    return np.linalg.solve(normal_matrix, moments[:, :3, 3:])[..., 0]


def misfit(moments: FloatArray, count: int, plane: FloatArray) -> float:
    """Root mean square distance of a set of cells from the plane m, in depth tolerances."""
    residual = np.append(plane, -1.0)
    return float(np.sqrt(max(residual @ moments @ residual, 0.0) / max(count, 1)))


def neighbour_pairs(labels: NDArray[np.int32], reach: int) -> list[tuple[int, int]]:
    """Pairs of segments that come within so many cells of each other, each pair once."""
    n_segments = int(labels.max(initial=-1)) + 1
    codes: list[NDArray[np.int64]] = []
    for shift in range(1, reach + 1):
        for here, there in (
            (labels[:, :-shift], labels[:, shift:]),
            (labels[:-shift], labels[shift:]),
        ):
            differ = (here != there) & (here >= 0) & (there >= 0)
            low = np.minimum(here[differ], there[differ]).astype(np.int64)
            codes.append(low * n_segments + np.maximum(here[differ], there[differ]))
    unique = np.unique(np.concatenate(codes))
    return [(int(code // n_segments), int(code % n_segments)) for code in unique]


class PlaneMerger:
    """Merges planes pair by pair while one plane explains both parts up to noise.

    Args:
        moments: `(n, 4, 4)`; of the parts; a merged part's are the sum.
        counts: `(n,)`; cells of the parts.
        directions: `(n, 3)`; sums of the cells' local normals, which tell the rim of a table top
            from the top even where the noise is as large as the rim.
        config: the limits.
    """

    def __init__(
        self,
        moments: FloatArray,
        counts: NDArray[np.int64],
        directions: FloatArray,
        config: SegmentationConfig,
    ) -> None:
        self._moments = moments.copy()
        self._counts = counts.copy()
        self._directions = directions.copy()
        self._parent = list(range(counts.size))
        self._config = config

    def merge(self, pairs: list[tuple[int, int]]) -> None:
        """Merges the given pairs where possible, the best fitting first."""
        rated = sorted(
            (cost, a, b) for a, b in pairs if (cost := self._cost(a, b)) < self._config.merge_misfit
        )
        for _, a, b in rated:
            a, b = self._root(a), self._root(b)
            # Parts change as they merge, so the verdict on the original pair is checked again.
            if a != b and self._cost(a, b) < self._config.merge_misfit:
                keep, drop = (a, b) if self._counts[a] >= self._counts[b] else (b, a)
                self._parent[drop] = keep
                self._moments[keep] += self._moments[drop]
                self._counts[keep] += self._counts[drop]
                self._directions[keep] += self._directions[drop]

    def new_labels(self) -> NDArray[np.int64]:
        """`(n,)`; the part that each part now belongs to."""
        return np.array([self._root(part) for part in range(len(self._parent))])

    def _root(self, part: int) -> int:
        while self._parent[part] != part:
            part = self._parent[part]
        return part

    def _cost(self, a: int, b: int) -> float:
        """The worse misfit of the two under their common plane; infinite if they are turned."""
        direction_a, direction_b = self._directions[a], self._directions[b]
        lengths = np.linalg.norm(direction_a) * np.linalg.norm(direction_b)
        if direction_a @ direction_b < lengths * np.cos(np.deg2rad(self._config.merge_angle_deg)):
            return float("inf")
        plane = fit_planes((self._moments[a] + self._moments[b])[None])[0]
        return max(
            misfit(self._moments[a], int(self._counts[a]), plane),
            misfit(self._moments[b], int(self._counts[b]), plane),
        )
