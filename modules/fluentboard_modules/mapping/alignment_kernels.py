"""Steps of the ICP of measured points onto a model, compiled: the inner loops of `alignment`."""

from __future__ import annotations

import numba as nb
import numpy as np
from numpy.typing import NDArray

from fluentboard.model.geometry import FloatArray

MISSING, OUTSIDE = -2, -1
"""In a field of nearest points: not looked up yet, and beyond its border."""


@nb.njit(cache=True, nogil=True)
def icp_steps(
    points_map: FloatArray,
    place: FloatArray,
    low: FloatArray,
    voxel_m: float,
    field: NDArray[np.int32],
    members: NDArray[np.int32],
    firsts: NDArray[np.int32],
    cell_m: float,
    reach_m: float,
    samples: FloatArray,
    normals: FloatArray,
    scales_m: FloatArray,
    point_steps: int,
    points_least: int,
    damping: float,
) -> None:
    """Gauss-Newton steps of a model's place with Tukey weights.

    Args:
        points_map: `(n, 3)`; measured points.
        place: `(4,)`; x, y, yaw and z of the model; x, y and yaw are changed.
        low: `(3,)`; lowest corner of the field, model frame.
        voxel_m: edge of its voxels.
        field: `(i, j, k)`; per voxel the sample nearest to its centre, `MISSING` or `OUTSIDE`;
            filled in.
        members: `(m,)`; the samples, sorted by cell.
        firsts: `(a, b, c, 2)`; first and behind the last member of each cell.
        cell_m: edge of the cells, which begin at `low`.
        reach_m: samples further from a voxel are not looked for.
        samples: `(m, 3)`; of the model's surface.
        normals: `(m, 3)`; their unit normals.
        scales_m: `(s,)`; in each step, points that are further off do not vote.
        point_steps: before this step differences count level in all directions, then along the
            normals.
        points_least: with fewer that vote, the place stays.
        damping: per point that votes.
    """
    n = points_map.shape[0]
    index = np.full(n, OUTSIDE, dtype=np.int32)
    local = np.zeros((n, 3))
    row, step = np.zeros(3), np.zeros(3)
    for number in range(scales_m.size):
        c, s = np.cos(place[2]), np.sin(place[2])
        for k in range(n):
            x, y = points_map[k, 0] - place[0], points_map[k, 1] - place[1]
            local[k, 0], local[k, 1] = c * x + s * y, c * y - s * x
            local[k, 2] = points_map[k, 2] - place[3]
            i = int(np.floor((local[k, 0] - low[0]) / voxel_m))
            j = int(np.floor((local[k, 1] - low[1]) / voxel_m))
            up = int(np.floor((local[k, 2] - low[2]) / voxel_m))
            if (
                min(i, j, up) < 0
                or i >= field.shape[0]
                or j >= field.shape[1]
                or up >= field.shape[2]
            ):
                index[k] = OUTSIDE
                continue
            if field[i, j, up] == MISSING:
                field[i, j, up] = nearest_sample(
                    (i + 0.5) * voxel_m, (j + 0.5) * voxel_m, (up + 0.5) * voxel_m, index[k],
                    low, samples, members, firsts, cell_m, reach_m,
                )  # fmt: skip
            index[k] = field[i, j, up]
        information, gradient, n_near = _normal_equations(
            local, index, samples, normals, scales_m[number], number >= point_steps, row
        )
        if n_near < points_least:
            break
        for a in range(3):  # what no point binds stays where it is
            information[a, a] += damping * n_near * (0.1 if a == 2 else 1.0)
        _solve(information, gradient, step)
        limit = scales_m[number]
        dx, dy = min(max(step[0], -limit), limit), min(max(step[1], -limit), limit)
        place[0] += c * dx - s * dy
        place[1] += s * dx + c * dy
        place[2] += min(max(step[2], -0.3), 0.3)


@nb.njit(cache=True, nogil=True)
def nearest_sample(
    x: float,
    y: float,
    z: float,
    near: int,
    low: FloatArray,
    samples: FloatArray,
    members: NDArray[np.int32],
    firsts: NDArray[np.int32],
    cell_m: float,
    reach_m: float,
) -> int:
    """The sample nearest to a point given from the field's lowest corner, or `OUTSIDE`.

    Cells are searched in shells around the point's own, until no further one can hold a nearer
    sample.

    Args:
        x: metres from the lowest corner of the field, as are the next two.
        y: see there.
        z: see there.
        near: a sample that is not far, `OUTSIDE` if none is known.
        low: `(3,)`; that corner.
        samples: `(m, 3)`; of the model's surface.
        members: as for `icp_steps`.
        firsts: see there.
        cell_m: see there.
        reach_m: see there.
    """
    a, b, c = int(x / cell_m), int(y / cell_m), int(z / cell_m)
    # How far the point is inside its cell: shell s begins s cells less this from it.
    inside = min(
        min(x - a * cell_m, (a + 1) * cell_m - x),
        min(y - b * cell_m, (b + 1) * cell_m - y),
        min(z - c * cell_m, (c + 1) * cell_m - z),
    )
    best, least = OUTSIDE, reach_m * reach_m
    if near >= 0:
        dx, dy = samples[near, 0] - low[0] - x, samples[near, 1] - low[1] - y
        dz = samples[near, 2] - low[2] - z
        if dx * dx + dy * dy + dz * dz < least:
            best, least = near, dx * dx + dy * dy + dz * dz
    shell = 0
    while True:
        begins = max((shell - 1) * cell_m + inside, 0.0)
        if begins * begins > least:
            return best
        for i in range(max(a - shell, 0), min(a + shell + 1, firsts.shape[0])):
            off_x = max(i * cell_m - x, x - (i + 1) * cell_m, 0.0)
            for j in range(max(b - shell, 0), min(b + shell + 1, firsts.shape[1])):
                off_y = max(j * cell_m - y, y - (j + 1) * cell_m, 0.0)
                if off_x * off_x + off_y * off_y > least:
                    continue
                is_rim = abs(i - a) == shell or abs(j - b) == shell
                stride = 1 if is_rim or shell == 0 else 2 * shell
                for k in range(c - shell, c + shell + 1, stride):
                    if k < 0 or k >= firsts.shape[2]:
                        continue
                    off_z = max(k * cell_m - z, z - (k + 1) * cell_m, 0.0)
                    if off_x * off_x + off_y * off_y + off_z * off_z > least:
                        continue
                    for at in range(firsts[i, j, k, 0], firsts[i, j, k, 1]):
                        m = members[at]
                        dx = samples[m, 0] - low[0] - x
                        dy = samples[m, 1] - low[1] - y
                        dz = samples[m, 2] - low[2] - z
                        distance = dx * dx + dy * dy + dz * dz
                        if distance < least:
                            best, least = m, distance
        shell += 1


@nb.njit(cache=True, nogil=True)
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


@nb.njit(cache=True, nogil=True)
def _solve(matrix: FloatArray, right_side: FloatArray, solution: FloatArray) -> None:
    """Fills in the solution `(3,)` of a positive definite system, by Cholesky's factors.

    A call of the solver of numpy takes seconds to compile.
    """
    a = np.sqrt(matrix[0, 0])
    b, c = matrix[1, 0] / a, matrix[2, 0] / a
    d = np.sqrt(matrix[1, 1] - b * b)
    e = (matrix[2, 1] - b * c) / d
    f = np.sqrt(matrix[2, 2] - c * c - e * e)
    x = right_side[0] / a
    y = (right_side[1] - b * x) / d
    z = (right_side[2] - c * x - e * y) / f
    z = z / f
    y = (y - e * z) / d
    x = (x - b * y - c * z) / a
    solution[0], solution[1], solution[2] = x, y, z
