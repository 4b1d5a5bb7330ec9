"""Sums and tests over the cells of segments, compiled: the inner loops of `segments`."""

from __future__ import annotations

import numba as nb
import numpy as np
from numpy.typing import NDArray

from fluentboard.model.geometry import FloatArray

Floats = NDArray[np.float32]


@nb.njit(cache=True)
def label_moments(
    labels: NDArray[np.int32], rays: Floats, q: Floats, tolerance: Floats, n_segments: int
) -> tuple[FloatArray, NDArray[np.int64]]:
    """Sums of w (r, q)(r, q)^T per label, w = 1 / tolerance^2, and the number of cells.

    Args:
        labels: `(n,)`; segment of each cell, negative for none.
        rays: `(n, 3)`; directions with z = 1.
        q: `(n,)`; inverse depths, 1/m.
        tolerance: `(n,)`; of q.
        n_segments: how many labels there are.

    Returns:
        `(n_segments, 4, 4)` and `(n_segments,)`.
    """
    moments = np.zeros((n_segments, 4, 4))
    counts = np.zeros(n_segments, dtype=np.int64)
    column = np.zeros(4)
    for k in range(labels.size):
        label = labels[k]
        if label < 0:
            continue
        counts[label] += 1
        weight = 1.0 / np.float64(tolerance[k]) ** 2
        column[0], column[1], column[2] = rays[k, 0], rays[k, 1], rays[k, 2]
        column[3] = q[k]
        for i in range(4):
            for j in range(i, 4):
                moments[label, i, j] += weight * column[i] * column[j]
    for label in range(n_segments):
        for i in range(4):
            for j in range(i):
                moments[label, i, j] = moments[label, j, i]
    return moments, counts


@nb.njit(cache=True)
def member_moments(
    member: NDArray[np.int64], rays: Floats, q: Floats, tolerance: Floats
) -> FloatArray:
    """`(4, 4)`; sum of w (r, q)(r, q)^T over some cells, w = 1 / tolerance^2."""
    moments = np.zeros((4, 4))
    column = np.zeros(4)
    for k in member:
        weight = 1.0 / np.float64(tolerance[k]) ** 2
        column[0], column[1], column[2] = rays[k, 0], rays[k, 1], rays[k, 2]
        column[3] = q[k]
        for i in range(4):
            for j in range(i, 4):
                moments[i, j] += weight * column[i] * column[j]
    for i in range(4):
        for j in range(i):
            moments[i, j] = moments[j, i]
    return moments


@nb.njit(cache=True)
def is_on_plane(
    member: NDArray[np.int64],
    plane: Floats,
    normal: Floats,
    rays: Floats,
    q: Floats,
    limit: Floats,
    normals: Floats,
    cos_limit: float,
) -> NDArray[np.bool_]:
    """`(n,)`; which of some cells lie on a plane and face its way.

    Args:
        member: `(n,)`; the cells.
        plane: `(3,)`; m = n / d.
        normal: `(3,)`; unit, towards the camera.
        rays: of all cells.
        q: inverse depths of all cells.
        limit: how far q may be off, per cell.
        normals: `(m, 3)`; local normals of all cells.
        cos_limit: least cosine between the normals.
    """
    inside = np.zeros(member.size, dtype=np.bool_)
    for i in range(member.size):
        k = member[i]
        at = rays[k, 0] * plane[0] + rays[k, 1] * plane[1] + rays[k, 2] * plane[2]
        if abs(at - q[k]) < limit[k]:
            cosine = (
                normals[k, 0] * normal[0] + normals[k, 1] * normal[1] + normals[k, 2] * normal[2]
            )
            inside[i] = cosine > cos_limit
    return inside


@nb.njit(cache=True)
def best_plane(
    member: NDArray[np.int64],
    planes: Floats,
    unit: Floats,
    rays: Floats,
    q: Floats,
    limit: Floats,
    normals: Floats,
    cos_limit: float,
) -> int:
    """Which of several planes most of the cells lie on; the first of equals."""
    best, most = 0, -1
    for candidate in range(len(planes)):
        plane, normal = planes[candidate], unit[candidate]
        count = 0
        for i in range(member.size):
            if count + member.size - i <= most:
                break  # it cannot win any more
            k = member[i]
            at = rays[k, 0] * plane[0] + rays[k, 1] * plane[1] + rays[k, 2] * plane[2]
            if abs(at - q[k]) < limit[k]:
                cosine = (
                    normals[k, 0] * normal[0]
                    + normals[k, 1] * normal[1]
                    + normals[k, 2] * normal[2]
                )
                count += cosine > cos_limit
        if count > most:
            best, most = candidate, count
    return best
