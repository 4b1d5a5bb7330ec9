"""Local planes to planar segments of the image: connect, split, merge, grow.

All of it happens on cells, every `step_px`-th pixel. Everything about a set of cells that a plane
fit needs is a 4x4 matrix of moments, which add: merging is adding, and the misfit of any plane to
any set is a quadratic form.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import find_objects
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from fluentboard.model.geometry import FloatArray
from fluentboard_modules.frames.sensor_frame import Camera
from fluentboard_modules.mapping.cell_kernels import (
    best_plane,
    is_on_plane,
    label_moments,
    member_moments,
)
from fluentboard_modules.mapping.config import DepthNoiseConfig, SegmentationConfig
from fluentboard_modules.mapping.normals import LocalPlanes, depth_tolerance_m, lateral_sigma_px
from fluentboard_modules.mapping.plane_merger import PlaneMerger, fit_planes, neighbour_pairs

_NO_SEGMENT = -1
# Each cell and its right neighbour, each cell and the one below it.
_NEIGHBOURS = (
    ((slice(None), slice(None, -1)), (slice(None), slice(1, None))),
    ((slice(None, -1), slice(None)), (slice(1, None), slice(None))),
)


@dataclass(frozen=True, slots=True)
class Cells:
    """The image on a coarser grid, with what every step needs, computed once.

    Attributes:
        inverse_depth: `(h, w)` float32; q in 1/m, 0 where unknown.
        tolerance: `(h, w)` float32; error of q to reckon with, in 1/m; infinite where unknown.
        rays: `(h, w, 3)` float32; directions in the camera frame with z = 1.
        normals: `(h, w, 3)` float32; unit normals in the camera frame, towards the camera.
        coefficients: `(h, w, 3)` float32; local plane m, so that q = m . r.
        is_planar: `(h, w)`; where the local plane is meaningful.
        step_px: pixels per cell.
    """

    inverse_depth: NDArray[np.float32]
    tolerance: NDArray[np.float32]
    rays: NDArray[np.float32]
    normals: NDArray[np.float32]
    coefficients: NDArray[np.float32]
    is_planar: NDArray[np.bool_]
    step_px: int

    @property
    def valid(self) -> NDArray[np.bool_]:
        """`(h, w)`; where the depth is known."""
        return self.inverse_depth > 0.0


@dataclass(frozen=True, slots=True)
class Segments:
    """A partition of some of the cells into planes.

    Attributes:
        labels: `(h, w)` int32; segment of each cell, -1 for none.
        coefficients: `(n, 3)`; plane m = n / d of each segment in the camera frame.
        moments: `(n, 4, 4)`; sums of w (r, q)(r, q)^T over the cells, w = 1 / tolerance^2.
        counts: `(n,)`; cells of each segment.
    """

    labels: NDArray[np.int32]
    coefficients: FloatArray
    moments: FloatArray
    counts: NDArray[np.int64]


def make_cells(
    local: LocalPlanes, camera: Camera, noise: DepthNoiseConfig, range_max_m: float, step_px: int
) -> Cells:
    """The cells of local planes, one every `step_px` pixels, up to the range limit."""
    grid = (slice(None, None, step_px), slice(None, None, step_px))
    q = local.inverse_depth.copy()
    q[q < 1.0 / range_max_m] = 0.0
    smooth = local.smooth_inverse_depth
    is_planar = local.is_planar & (q > 0.0) & (smooth * range_max_m > 0.9)
    coefficients = local.coefficients
    length = np.linalg.norm(coefficients, axis=-1, keepdims=True)
    # m points from the camera to the plane, the visible side looks back.
    normals = -coefficients / np.maximum(length, 1e-9)
    depth = np.divide(1.0, q, out=np.ones_like(q), where=q > 0.0)
    tolerance = depth_tolerance_m(depth, noise) * q * q
    # Of a plane seen at a grazing angle, pixels that wander sideways read another depth.
    slope = coefficients[..., :2] / np.array([camera.fx, camera.fy], dtype=np.float32)
    wander = np.float32(lateral_sigma_px(camera, noise)) * np.linalg.norm(slope, axis=-1)
    tolerance = np.where(is_planar, np.hypot(tolerance, wander), tolerance)
    tolerance[q <= 0.0] = np.inf
    return Cells(
        inverse_depth=q,
        tolerance=tolerance.astype(np.float32, copy=False),
        rays=camera.rays()[grid].astype(np.float32),
        normals=normals,
        coefficients=coefficients,
        is_planar=is_planar,
        step_px=step_px,
    )


def segment_planes(cells: Cells, config: SegmentationConfig) -> Segments:
    """The planar segments of the image, largest first."""
    seeds = _connect(cells, config)
    seeds = _split_bent(cells, seeds, config)
    seeds = _merge_neighbours(cells, seeds, config)
    grown = _grow(cells, seeds, config)
    return summarise(cells, grown, int(grown.max(initial=_NO_SEGMENT)) + 1)


def summarise(cells: Cells, labels: NDArray[np.int32], n_segments: int) -> Segments:
    """Counts, moments and fitted planes of labelled cells."""
    moments, counts = label_moments(
        labels.ravel(),
        cells.rays.reshape(-1, 3),
        cells.inverse_depth.ravel(),
        cells.tolerance.ravel(),
        n_segments,
    )
    return Segments(labels, fit_planes(moments), moments, counts)


def plane_distance_m(
    cells: Cells, plane: FloatArray, window: tuple[slice, slice]
) -> NDArray[np.float32]:
    """`(h, w)`; signed distance in metres of the points in a window from the plane m.

    Positive behind the plane as seen from the camera; -d where the depth is unknown.
    """
    q = cells.inverse_depth[window]
    depth = np.divide(1.0, q, out=np.zeros_like(q), where=q > 0.0)
    # n . p - d = d (z m . r - 1)
    distance = (cells.rays[window] @ plane.astype(np.float32)) * depth - 1.0
    return distance / np.float32(np.linalg.norm(plane))


def local_directions(cells: Cells, segments: Segments) -> FloatArray:
    """`(n, 3)`; sums of the local normals of each segment's planar cells."""
    member = (segments.labels >= 0) & cells.is_planar
    labels = segments.labels[member]
    return np.stack(
        [
            np.bincount(labels, cells.normals[..., axis][member], minlength=segments.counts.size)
            for axis in range(3)
        ],
        axis=-1,
    )


def _connect(cells: Cells, config: SegmentationConfig) -> NDArray[np.int32]:
    """Components of neighbouring local planes that agree in direction and position."""
    cos_limit = np.cos(np.deg2rad(config.join_angle_deg))
    joined: list[NDArray[np.bool_]] = []
    for here, there in _NEIGHBOURS:
        both = cells.is_planar[here] & cells.is_planar[there]
        cosine = np.einsum("hwi,hwi->hw", cells.normals[here], cells.normals[there])
        # The plane of one cell, evaluated at the other's ray, against the other's own plane there.
        rays = cells.rays[there]
        gap = np.einsum("hwi,hwi->hw", cells.coefficients[here] - cells.coefficients[there], rays)
        near = np.abs(gap) < config.join_distance_tolerances * cells.tolerance[there]
        joined.append(both & (cosine > cos_limit) & near)
    return _components(joined, cells.is_planar, config.seed_cells)


def _components(
    joined: list[NDArray[np.bool_]], mask: NDArray[np.bool_], least: int
) -> NDArray[np.int32]:
    """Components of the cells in the mask, given which horizontal and vertical neighbours join."""
    index = np.arange(mask.size).reshape(mask.shape)
    row = np.concatenate([index[here][j] for (here, _), j in zip(_NEIGHBOURS, joined, strict=True)])
    column = np.concatenate(
        [index[there][j] for (_, there), j in zip(_NEIGHBOURS, joined, strict=True)]
    )
    graph = coo_array((np.ones(row.size, np.uint8), (row, column)), shape=(mask.size,) * 2)
    _, component = connected_components(graph, directed=False)
    component = component.reshape(mask.shape)
    counts = np.bincount(component[mask], minlength=component.max(initial=0) + 1)
    return _relabel(component, counts, least, mask)


def _relabel(
    component: NDArray[np.int32], counts: NDArray[np.int64], least: int, mask: NDArray[np.bool_]
) -> NDArray[np.int32]:
    """Labels 0, 1, ... for the components of at least so many cells, largest first."""
    order = np.argsort(-counts, kind="stable")
    order = order[counts[order] >= least]
    new = np.full(max(counts.size, 1), _NO_SEGMENT, dtype=np.int32)
    new[order] = np.arange(order.size)
    return np.where(mask, new[component], _NO_SEGMENT).astype(np.int32)


def _split_bent(
    cells: Cells, labels: NDArray[np.int32], config: SegmentationConfig
) -> NDArray[np.int32]:
    """Parts of components that chained several planes through a soft edge.

    Deterministic: the candidate planes are those of evenly spaced cells, and each cell knows its
    plane, so a handful of candidates suffices where points would need triples.
    """
    n_components = int(labels.max(initial=_NO_SEGMENT)) + 1
    segments = summarise(cells, labels, n_components)
    cos_limit = float(np.cos(np.deg2rad(config.grow_angle_deg)))
    flat_labels = labels.ravel()
    order = np.argsort(flat_labels, kind="stable")
    starts = np.searchsorted(flat_labels[order], np.arange(n_components + 1))
    rays = cells.rays.reshape(-1, 3)
    q = cells.inverse_depth.ravel()
    limit = config.grow_distance_tolerances * cells.tolerance.ravel()
    normals = cells.normals.reshape(-1, 3)
    local = cells.coefficients.reshape(-1, 3)
    result = np.full(flat_labels.size, _NO_SEGMENT, dtype=np.int32)
    n_found = 0

    def is_inlier(member: NDArray[np.int64], plane: FloatArray) -> NDArray[np.bool_]:
        planes, unit = _with_normals(plane[None])
        return is_on_plane(member, planes[0], unit[0], rays, q, limit, normals, cos_limit)

    for component in range(n_components):
        rest = order[starts[component] : starts[component + 1]]
        plane = segments.coefficients[component]
        while rest.size >= config.seed_cells:
            inlier = is_inlier(rest, plane)
            if inlier.mean() < config.planar_share:
                planes, unit = _with_normals(local[rest[:: max(1, rest.size // 16)]])
                best = best_plane(rest, planes, unit, rays, q, limit, normals, cos_limit)
                inlier = is_on_plane(
                    rest, planes[best], unit[best], rays, q, limit, normals, cos_limit
                )
                for _ in range(2):  # refit on the inliers; twice is enough to settle
                    inlier = is_inlier(rest, _fit_cells(cells, rest[inlier]))
            if np.count_nonzero(inlier) < config.seed_cells:
                break
            result[rest[inlier]] = n_found
            n_found += 1
            rest = rest[~inlier]
            if rest.size >= config.seed_cells:
                plane = _fit_cells(cells, rest)
    result = result.reshape(labels.shape)
    # Outliers of a noisy plane agree with some plane too, but they do not hang together.
    joined = [(result[here] == result[there]) & (result[here] >= 0) for here, there in _NEIGHBOURS]
    return _components(joined, result >= 0, config.seed_cells)


def _fit_cells(cells: Cells, member: NDArray[np.int64]) -> FloatArray:
    if member.size == 0:
        return np.array([0.0, 0.0, 1.0])
    moments = member_moments(
        member, cells.rays.reshape(-1, 3), cells.inverse_depth.ravel(), cells.tolerance.ravel()
    )
    return fit_planes(moments[None])[0]


def _with_normals(planes: NDArray[np.floating]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Planes m `(n, 3)` and their unit normals towards the camera, as the kernels want them."""
    unit = -planes / np.linalg.norm(planes, axis=1, keepdims=True)
    return planes.astype(np.float32), unit.astype(np.float32)


def _merge_neighbours(
    cells: Cells, labels: NDArray[np.int32], config: SegmentationConfig
) -> NDArray[np.int32]:
    """Neighbouring segments that one plane explains become one: no plane competes with itself."""
    n_segments = int(labels.max(initial=_NO_SEGMENT)) + 1
    if n_segments < 2:
        return labels
    segments = summarise(cells, labels, n_segments)
    member = labels >= 0
    merger = PlaneMerger(
        segments.moments, segments.counts, local_directions(cells, segments), config
    )
    merger.merge(neighbour_pairs(labels, reach=3))
    new = merger.new_labels()
    merged = np.where(member, new[labels], _NO_SEGMENT).astype(np.int32)
    counts = np.bincount(merged[member], minlength=n_segments)
    return _relabel(np.maximum(merged, 0), counts, config.seed_cells, member)


def _grow(cells: Cells, labels: NDArray[np.int32], config: SegmentationConfig) -> NDArray[np.int32]:
    """Every cell goes to the plane that explains it best among those it is connected to."""
    n_segments = min(int(labels.max(initial=_NO_SEGMENT)) + 1, config.segments_max)
    labels = np.where(labels < n_segments, labels, _NO_SEGMENT).astype(np.int32)
    seeds = summarise(cells, labels, n_segments)
    distance_max, angle_max = config.grow_distance_tolerances, np.deg2rad(config.grow_angle_deg)
    best = np.full(labels.shape, np.inf, dtype=np.float32)
    grown = np.full(labels.shape, _NO_SEGMENT, dtype=np.int32)
    for segment, window in enumerate(_growth_windows(labels, n_segments, config)):
        plane = seeds.coefficients[segment].astype(np.float32)
        normal = -plane / np.linalg.norm(plane)
        q = cells.inverse_depth[window]
        distance = (cells.rays[window] @ plane - q) / (distance_max * cells.tolerance[window])
        cost = distance * distance
        # 1 - cos is half the squared angle, without the arc cosine. Cells without a local plane
        # lie beside an edge: they may join, at the price of a middling angle.
        turn = (1.0 - cells.normals[window] @ normal) / (1.0 - np.cos(angle_max))
        cost += np.where(cells.is_planar[window], turn, 0.25)
        is_candidate = (cost < 1.0) & (q > 0.0)
        _, component = cv2.connectedComponents(
            is_candidate.astype(np.uint8), connectivity=4, ltype=cv2.CV_32S
        )
        seeded = np.zeros(component.max() + 1, dtype=np.bool_)
        seeded[component[labels[window] == segment]] = True
        seeded[0] = False
        # Larger planes come first and keep what a smaller one explains hardly better.
        wins = seeded[component] & (cost < best[window] - config.grow_margin)
        best[window][wins] = cost[wins]
        grown[window][wins] = segment
    counts = np.bincount(grown[grown >= 0], minlength=n_segments)
    return _relabel(np.maximum(grown, 0), counts, config.seed_cells, grown >= 0)


def _growth_windows(
    labels: NDArray[np.int32], n_segments: int, config: SegmentationConfig
) -> list[tuple[slice, slice]]:
    """Per segment its bounding rectangle with a margin: a plane is no reason to cross the room."""
    height, width = labels.shape
    windows: list[tuple[slice, slice]] = []
    for rows, columns in find_objects(labels + 1, max_label=n_segments):
        sides: list[slice] = []
        for side, limit in ((rows, height), (columns, width)):
            margin = max(
                config.grow_margin_cells, int(config.grow_margin_share * (side.stop - side.start))
            )
            sides.append(slice(max(0, side.start - margin), min(limit, side.stop + margin)))
        windows.append((sides[0], sides[1]))
    return windows
