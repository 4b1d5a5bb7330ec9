"""How a depth image sees the cells of a map plane, compiled: the inner loop of `plane_grid`."""

from __future__ import annotations

import numba as nb
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]

NOT_JUDGED, OPEN_TO_VIEW, SEEN, SEEN_THROUGH = 0, 1, 2, 3


@nb.njit(cache=True)
def look_at_cells(
    known: NDArray[np.bool_],
    hit: NDArray[np.bool_],
    first: Floats,
    along: Floats,
    normal: Floats,
    depth_m: Floats,
    intrinsics: Floats,
    tolerance_m: float,
    nearest_m: float,
) -> NDArray[np.uint8]:
    """What a depth image says of each cell.

    Args:
        known: `(h, w)`; cells that were ever seen; the others are not judged.
        hit: `(h, w)`; cells that this image's own regions cover.
        first: `(3,)`; centre of the first cell in the camera frame, metres.
        along: `(2, 3)`; from a cell to the next column and to the next row, metres.
        normal: `(3,)`; unit normal of the plane in the camera frame.
        depth_m: `(height, width)`; 0 where unknown.
        intrinsics: `(4,)`; fx, fy, cx, cy in pixels.
        tolerance_m: measured so far behind the plane, it is not there.
        nearest_m: nearer cells are not judged.

    Returns:
        `(h, w)`; NOT_JUDGED where out of sight, unknown or hidden, SEEN where hit, SEEN_THROUGH
        where the surface cannot be, OPEN_TO_VIEW where it can.
    """
    height, width = depth_m.shape
    fx, fy, cx, cy = intrinsics
    state = np.zeros(known.shape, dtype=np.uint8)
    for row in range(known.shape[0]):
        for column in range(known.shape[1]):
            if not known[row, column]:
                continue
            x = first[0] + column * along[0, 0] + row * along[1, 0]
            y = first[1] + column * along[0, 1] + row * along[1, 1]
            z = first[2] + column * along[0, 2] + row * along[1, 2]
            if z <= nearest_m:
                continue
            u, v = np.rint(x / z * fx + cx), np.rint(y / z * fy + cy)
            if u < 0 or u >= width or v < 0 or v >= height:
                continue
            if hit[row, column]:
                state[row, column] = SEEN
                continue
            measured = depth_m[int(v), int(u)]
            if measured <= 0.0:
                continue
            # Along the ray it is measured - z, and the ray meets the plane at an angle.
            slant = abs(x * normal[0] + y * normal[1] + z * normal[2]) / z
            behind = (measured - z) * slant
            if behind > tolerance_m:
                state[row, column] = SEEN_THROUGH
            elif behind >= -tolerance_m:
                state[row, column] = OPEN_TO_VIEW
    return state
