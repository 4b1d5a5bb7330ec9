"""Local planes of a voxel cloud: principal components of the voxels around each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fluentboard.model.geometry import FloatArray
from fluentboard_modules.mapping.voxel_cloud import VoxelCloud
from fluentboard_modules.mapping.work_ahead import worked_in_parts


@dataclass(frozen=True, slots=True, eq=False)
class CloudPlanes:
    """Per voxel the plane of its neighbourhood, in the map frame.

    Attributes:
        normals: `(n, 3)`; unit vectors towards the sensor where that is known, else upwards.
        residual_m: `(n,)`; root mean square distance of the neighbourhood from its plane; infinite
            where it does not fix one.
    """

    normals: FloatArray
    residual_m: FloatArray


def fit_cloud_planes(cloud: VoxelCloud) -> CloudPlanes:
    """The local plane of every voxel.

    A neighbourhood is what two passes of a 3x3x3 box filter reach: 5 voxels in every direction,
    the nearer the heavier. Voxels count alike however many points they have, so a surface that the
    sensor stood close to does not pull its surroundings to it.
    """
    if not len(cloud):
        return CloudPlanes(np.zeros((0, 3)), np.zeros(0))
    centre = cloud.points.mean(axis=0)  # moments lose no digits to a far origin
    moments = _moments(cloud.points - centre)
    moments = _box_filtered(_box_filtered(moments, cloud.neighbours), cloud.neighbours)
    normals, residual_m = _smallest_components(moments, (0.5 * cloud.voxel_m) ** 2)
    towards = cloud.towards_sensor
    unknown = ~towards.any(axis=1)
    facing = np.where(unknown, normals[:, 2], np.einsum("ij,ij->i", normals, towards))
    normals[facing < 0.0] *= -1.0
    return CloudPlanes(normals, residual_m)


def _moments(points: FloatArray) -> FloatArray:
    """`(n, 10)`; 1, x, y, z, xx, xy, xz, yy, yz, zz of every point."""
    x, y, z = points.T
    return np.column_stack(
        [np.ones(len(points)), x, y, z, x * x, x * y, x * z, y * y, y * z, z * z]
    )


def _box_filtered(moments: FloatArray, neighbours: NDArray[np.int32]) -> FloatArray:
    """`(n, 10)`; the moments of every voxel and of those around it."""
    total = moments.copy()
    worked_in_parts(
        lambda first, last: _add_neighbours(moments, neighbours, total, first, last), len(moments)
    )
    return total


@njit(cache=True, nogil=True)
def _add_neighbours(
    moments: FloatArray,
    neighbours: NDArray[np.int32],
    total: FloatArray,
    first: int,
    last: int,
) -> None:
    for row in range(first, last):
        for column in range(26):
            other = neighbours[row, column]
            if other >= 0:
                for k in range(10):
                    total[row, k] += moments[other, k]


@njit(cache=True, nogil=True)
def smallest_component(
    xx: float, xy: float, xz: float, yy: float, yz: float, zz: float
) -> tuple[float, float, float, float, float]:
    """Smallest and middle eigenvalue of a symmetric matrix, and the unit vector of the smallest.

    Closed form (the trigonometric solution of the characteristic cubic): some twenty times faster
    than a general solver, and exact enough for covariances of points.
    """
    mean = (xx + yy + zz) / 3.0
    off = xy * xy + xz * xz + yz * yz
    spread = (xx - mean) ** 2 + (yy - mean) ** 2 + (zz - mean) ** 2 + 2.0 * off
    if spread <= 1e-30:
        return mean, mean, 0.0, 0.0, 1.0
    p = np.sqrt(spread / 6.0)
    a, b, c = (xx - mean) / p, (yy - mean) / p, (zz - mean) / p
    d, e, f = xy / p, xz / p, yz / p
    half = 0.5 * (a * (b * c - f * f) - d * (d * c - f * e) + e * (d * f - b * e))
    angle = np.arccos(min(1.0, max(-1.0, half))) / 3.0
    largest = mean + 2.0 * p * np.cos(angle)
    smallest = mean + 2.0 * p * np.cos(angle + 2.0 * np.pi / 3.0)
    middle = 3.0 * mean - largest - smallest
    # Rows of A - smallest are perpendicular to the vector: of their cross products the longest.
    ax, by, cz = xx - smallest, yy - smallest, zz - smallest
    best_x, best_y, best_z, best = 0.0, 0.0, 1.0, 0.0
    for pair in range(3):
        if pair == 0:
            nx, ny, nz = xy * yz - xz * by, xz * xy - ax * yz, ax * by - xy * xy
        elif pair == 1:
            nx, ny, nz = xy * cz - xz * yz, xz * xz - ax * cz, ax * yz - xy * xz
        else:
            nx, ny, nz = by * cz - yz * yz, yz * xz - xy * cz, xy * yz - by * xz
        length = nx * nx + ny * ny + nz * nz
        if length > best:
            best_x, best_y, best_z, best = nx, ny, nz, length
    if best > 0.0:
        norm = np.sqrt(best)
        best_x, best_y, best_z = best_x / norm, best_y / norm, best_z / norm
    return smallest, middle, best_x, best_y, best_z


@njit(cache=True, nogil=True)
def _smallest_components(
    moments: FloatArray, least_spread_m2: float
) -> tuple[FloatArray, FloatArray]:
    """Normals and residuals; neighbourhoods that are a line or a speck have no residual."""
    n = len(moments)
    normals = np.zeros((n, 3))
    residual = np.full(n, np.inf)
    for row in range(n):
        m = moments[row]
        x, y, z = m[1] / m[0], m[2] / m[0], m[3] / m[0]
        smallest, middle, nx, ny, nz = smallest_component(
            m[4] / m[0] - x * x,
            m[5] / m[0] - x * y,
            m[6] / m[0] - x * z,
            m[7] / m[0] - y * y,
            m[8] / m[0] - y * z,
            m[9] / m[0] - z * z,
        )
        normals[row, 0], normals[row, 1], normals[row, 2] = nx, ny, nz
        if middle >= least_spread_m2:
            residual[row] = np.sqrt(max(smallest, 0.0))
    return normals, residual
