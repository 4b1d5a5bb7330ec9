"""Points behind planes counted, compiled: the inner loop of `room_walls`."""

from __future__ import annotations

import numba as nb
import numpy as np
from numpy.typing import NDArray

from fluentboard.model.geometry import FloatArray


@nb.njit(cache=True, nogil=True)
def add_points_behind(
    points: FloatArray,
    limits_m: NDArray[np.float32],
    planes: FloatArray,
    behind: NDArray[np.int64],
    enough: float,
) -> None:
    """Counts the points of a view behind each plane, as long as that is of interest.

    Args:
        points: `(n, 3)`; map frame.
        limits_m: `(n,)`; each is behind if it is by more than this.
        planes: `(m, 4)`; unit normal, and distance from the origin along it.
        behind: `(m,)`; counts so far; added to.
        enough: planes with so many are left out.
    """
    for m in range(planes.shape[0]):
        if behind[m] >= enough:
            continue
        nx, ny, nz, offset = planes[m, 0], planes[m, 1], planes[m, 2], planes[m, 3]
        count = 0
        for k in range(points.shape[0]):
            height = nx * points[k, 0] + ny * points[k, 1] + nz * points[k, 2] - offset
            if height < -limits_m[k]:
                count += 1
        behind[m] += count
