"""Voxels to planar segments: growing from the flattest voxels, then merging what is coplanar."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fluentboard.model.geometry import FloatArray
from fluentboard_modules.mapping.cloud_normals import CloudPlanes, smallest_component
from fluentboard_modules.mapping.config import CloudConfig
from fluentboard_modules.mapping.voxel_cloud import VoxelCloud

NO_SEGMENT = -1


def segment_cloud(cloud: VoxelCloud, planes: CloudPlanes, config: CloudConfig) -> NDArray[np.int32]:
    """`(n,)`; per voxel the number of its segment, largest first, `NO_SEGMENT` where there is none.

    Args:
        cloud: the voxels.
        planes: their local planes.
        config: tolerances.
    """
    if not len(cloud):
        return np.zeros(0, dtype=np.int32)
    seeds = np.flatnonzero(planes.residual_m <= config.planar_residual_m)
    order = seeds[np.argsort(planes.residual_m[seeds], kind="stable")]
    is_planar = np.zeros(len(cloud), dtype=np.bool_)
    is_planar[seeds] = True
    labels, n_segments, equations = _grow(
        cloud.points,
        planes.normals,
        is_planar,
        cloud.neighbours,
        order,
        float(np.cos(np.deg2rad(config.grow_angle_deg))),
        config.grow_distance_m,
        config.seed_voxels,
    )
    sizes = np.bincount(labels[labels >= 0], minlength=n_segments)
    largest_first = np.argsort(-sizes, kind="stable").astype(np.int64)
    _take_borders(
        cloud.points,
        planes.normals,
        is_planar,
        cloud.neighbours,
        labels,
        equations,
        largest_first,
        float(np.cos(np.deg2rad(config.border_angle_deg))),
        config.grow_distance_m,
    )
    return _numbered_by_size(labels)


def _numbered_by_size(labels: NDArray[np.int32]) -> NDArray[np.int32]:
    """The same segments, numbered without gaps, the largest first."""
    counts = np.bincount(labels[labels >= 0])
    order = np.argsort(-counts, kind="stable")[: int(np.count_nonzero(counts))]
    number = np.full(len(counts) + 1, NO_SEGMENT, dtype=np.int32)  # the last stands for none
    number[order] = np.arange(len(order), dtype=np.int32)
    return number[labels]


@njit(cache=True, nogil=True)
def _plane_of(m: FloatArray) -> tuple[float, float, float, float]:
    """Unit normal and offset of the plane through points of these moments."""
    x, y, z = m[1] / m[0], m[2] / m[0], m[3] / m[0]
    _, _, nx, ny, nz = smallest_component(
        m[4] / m[0] - x * x,
        m[5] / m[0] - x * y,
        m[6] / m[0] - x * z,
        m[7] / m[0] - y * y,
        m[8] / m[0] - y * z,
        m[9] / m[0] - z * z,
    )
    return nx, ny, nz, nx * x + ny * y + nz * z


@njit(cache=True, nogil=True)
def _add(m: FloatArray, x: float, y: float, z: float) -> None:
    m[0] += 1.0
    m[1] += x
    m[2] += y
    m[3] += z
    m[4] += x * x
    m[5] += x * y
    m[6] += x * z
    m[7] += y * y
    m[8] += y * z
    m[9] += z * z


@njit(cache=True, nogil=True)
def _grow(
    points: FloatArray,
    normals: FloatArray,
    is_planar: NDArray[np.bool_],
    neighbours: NDArray[np.int32],
    order: NDArray[np.int64],
    least_cosine: float,
    distance_m: float,
    least_voxels: int,
) -> tuple[NDArray[np.int32], int, FloatArray]:
    """Segments grown from seeds over planar voxels; their plane is fitted anew as they double."""
    n = len(points)
    labels = np.full(n, -1, dtype=np.int32)
    tried = np.zeros(n, dtype=np.bool_)
    queue = np.zeros(n, dtype=np.int32)
    equations = np.zeros((1024, 4))
    n_segments = 0
    for start in order:
        if labels[start] != -1 or tried[start]:
            continue
        origin = points[start]
        nx, ny, nz = normals[start, 0], normals[start, 1], normals[start, 2]
        offset = 0.0
        moments = np.zeros(10)
        head, tail = 0, 1
        queue[0] = start
        labels[start] = n_segments
        refit = 16
        while head < tail:
            voxel = queue[head]
            head += 1
            _add(
                moments,
                points[voxel, 0] - origin[0],
                points[voxel, 1] - origin[1],
                points[voxel, 2] - origin[2],
            )
            if head == refit:
                refit *= 2
                mx, my, mz, offset = _plane_of(moments)
                sign = 1.0 if mx * nx + my * ny + mz * nz >= 0.0 else -1.0
                nx, ny, nz, offset = sign * mx, sign * my, sign * mz, sign * offset
            for column in range(26):
                other = neighbours[voxel, column]
                if other < 0 or labels[other] != -1 or not is_planar[other]:
                    continue
                turn = nx * normals[other, 0] + ny * normals[other, 1] + nz * normals[other, 2]
                if turn < least_cosine:
                    continue
                distance = (
                    nx * (points[other, 0] - origin[0])
                    + ny * (points[other, 1] - origin[1])
                    + nz * (points[other, 2] - origin[2])
                    - offset
                )
                if abs(distance) <= distance_m:
                    labels[other] = n_segments
                    queue[tail] = other
                    tail += 1
        if tail < least_voxels:
            for i in range(tail):
                labels[queue[i]] = -1
            tried[start] = True
            continue
        if n_segments == len(equations):
            more = np.zeros((2 * n_segments, 4))
            more[:n_segments] = equations
            equations = more
        mx, my, mz, offset = _plane_of(moments)
        sign = 1.0 if mx * nx + my * ny + mz * nz >= 0.0 else -1.0
        nx, ny, nz, offset = sign * mx, sign * my, sign * mz, sign * offset
        equations[n_segments, 0], equations[n_segments, 1], equations[n_segments, 2] = nx, ny, nz
        equations[n_segments, 3] = offset + nx * origin[0] + ny * origin[1] + nz * origin[2]
        n_segments += 1
    return labels, n_segments, equations[:n_segments]


@njit(cache=True, nogil=True)
def _take_borders(
    points: FloatArray,
    normals: FloatArray,
    is_planar: NDArray[np.bool_],
    neighbours: NDArray[np.int32],
    labels: NDArray[np.int32],
    equations: FloatArray,
    segments: NDArray[np.int64],
    least_cosine: float,
    distance_m: float,
) -> None:
    """Gives voxels beside an edge, whose own normals are bad, to the plane they lie on."""
    n = len(points)
    queue = np.zeros(n, dtype=np.int32)
    member_of = np.zeros(len(segments) + 1, dtype=np.int64)
    for voxel in range(n):
        if labels[voxel] >= 0:
            member_of[labels[voxel] + 1] += 1
    starts = np.cumsum(member_of)
    members = np.zeros(starts[-1], dtype=np.int32)
    filled = starts[:-1].copy()
    for voxel in range(n):
        label = labels[voxel]
        if label >= 0:
            members[filled[label]] = voxel
            filled[label] += 1
    for segment in segments:
        nx, ny, nz, offset = equations[segment]
        head, tail = 0, 0
        for i in range(starts[segment], starts[segment + 1]):
            queue[tail] = members[i]
            tail += 1
        while head < tail:
            voxel = queue[head]
            head += 1
            for column in range(26):
                other = neighbours[voxel, column]
                if other < 0 or labels[other] != -1:
                    continue
                x, y, z = points[other]
                if abs(nx * x + ny * y + nz * z - offset) > distance_m:
                    continue
                turn = nx * normals[other, 0] + ny * normals[other, 1] + nz * normals[other, 2]
                if is_planar[other] and turn < least_cosine:
                    continue
                labels[other] = segment
                queue[tail] = other
                tail += 1
