"""Steps of the ICP of measured points onto a model, compiled: the inner loops of `alignment`."""

from __future__ import annotations

import numba as nb
import numpy as np
from numpy.typing import NDArray

from fluentboard.model.geometry import FloatArray

MISSING, OUTSIDE = -2, -1
"""In a field of nearest points: not looked up yet, and beyond its border."""


@nb.njit(cache=True)
def icp_steps(
    points_map: FloatArray,
    place: FloatArray,
    low: FloatArray,
    voxel_m: float,
    field: NDArray[np.int32],
    samples: FloatArray,
    normals: FloatArray,
    scales_m: FloatArray,
    first: int,
    point_steps: int,
    points_least: int,
    damping: float,
) -> tuple[int, NDArray[np.int64]]:
    """Gauss-Newton steps of a model's place with Tukey weights, as far as the field is known.

    Args:
        points_map: `(n, 3)`; measured points.
        place: `(4,)`; x, y, yaw and z of the model; x, y and yaw are changed.
        low: `(3,)`; lowest corner of the field, model frame.
        voxel_m: edge of its voxels.
        field: `(i, j, k)`; per voxel the sample nearest to its centre, `MISSING` or `OUTSIDE`.
        samples: `(m, 3)`; of the model's surface.
        normals: `(m, 3)`; their unit normals.
        scales_m: `(s,)`; in each step, points that are further off do not vote.
        first: step to begin with.
        point_steps: before this step differences count level in all directions, then along the
            normals.
        points_least: with fewer that vote, the place stays.
        damping: per point that votes.

    Returns:
        The step reached, and the numbers of the voxels that are missing to take it; none are at
        the end.
    """
    n = points_map.shape[0]
    index = np.zeros(n, dtype=np.int32)
    local = np.zeros((n, 3))
    missing = np.zeros(n, dtype=np.int64)
    row, step = np.zeros(3), np.zeros(3)
    for number in range(first, scales_m.size):
        c, s = np.cos(place[2]), np.sin(place[2])
        n_missing = 0
        for k in range(n):
            x, y = points_map[k, 0] - place[0], points_map[k, 1] - place[1]
            local[k, 0], local[k, 1] = c * x + s * y, c * y - s * x
            local[k, 2] = points_map[k, 2] - place[3]
            i = int(np.floor((local[k, 0] - low[0]) / voxel_m))
            j = int(np.floor((local[k, 1] - low[1]) / voxel_m))
            up = int(np.floor((local[k, 2] - low[2]) / voxel_m))
            index[k] = OUTSIDE
            if i < 0 or j < 0 or up < 0:
                continue
            if i >= field.shape[0] or j >= field.shape[1] or up >= field.shape[2]:
                continue
            index[k] = field[i, j, up]
            if index[k] == MISSING:
                missing[n_missing] = (i * field.shape[1] + j) * field.shape[2] + up
                n_missing += 1
        if n_missing > 0:
            return number, missing[:n_missing]
        information, gradient, n_near = _normal_equations(
            local, index, samples, normals, scales_m[number], number >= point_steps, row
        )
        if n_near < points_least:
            break
        for a in range(3):  # what no point binds stays where it is
            information[a, a] += damping * n_near * (0.1 if a == 2 else 1.0)
        step[:] = np.linalg.solve(information, gradient)
        limit = scales_m[number]
        dx, dy = min(max(step[0], -limit), limit), min(max(step[1], -limit), limit)
        place[0] += c * dx - s * dy
        place[1] += s * dx + c * dy
        place[2] += min(max(step[2], -0.3), 0.3)
    return scales_m.size, missing[:0]


@nb.njit(cache=True)
def _normal_equations(
    points_model: FloatArray,
    index: NDArray[np.int32],
    samples: FloatArray,
    normals: FloatArray,
    scale_m: float,
    along_normals: bool,
    row: FloatArray,
) -> tuple[FloatArray, FloatArray, int]:
    """What one step solves: information and gradient of x, y and yaw with Tukey weights.

    Args:
        points_model: `(n, 3)`; measured points in the model's frame.
        index: `(n,)`; the nearest sample of each, negative if there is none.
        samples: `(m, 3)`; of the model's surface.
        normals: `(m, 3)`; their unit normals.
        scale_m: points that are further off do not vote.
        along_normals: whether differences count along the normals only, or level in all
            directions.
        row: `(3,)`; scratch.

    Returns:
        `(3, 3)` information, `(3,)` gradient, and how many points voted.
    """
    information, gradient = np.zeros((3, 3)), np.zeros(3)
    n_near = 0
    for k in range(points_model.shape[0]):
        i = index[k]
        if i < 0:
            continue
        qx, qy = samples[i, 0], samples[i, 1]
        dx, dy = points_model[k, 0] - qx, points_model[k, 1] - qy
        dz = points_model[k, 2] - samples[i, 2]
        share = (dx * dx + dy * dy + dz * dz) / (scale_m * scale_m)
        if share >= 1.0:
            continue
        n_near += 1
        weight = (1.0 - share) ** 2
        for axis in range(1 if along_normals else 2):
            if along_normals:
                nx, ny = normals[i, 0], normals[i, 1]
                row[0], row[1], row[2] = nx, ny, ny * qx - nx * qy
                residual = nx * dx + ny * dy + normals[i, 2] * dz
            elif axis == 0:
                row[0], row[1], row[2] = 1.0, 0.0, -qy
                residual = dx
            else:
                row[0], row[1], row[2] = 0.0, 1.0, qx
                residual = dy
            for a in range(3):
                gradient[a] += weight * row[a] * residual
                for b in range(3):
                    information[a, b] += weight * row[a] * row[b]
    return information, gradient, n_near
