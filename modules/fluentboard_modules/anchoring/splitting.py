"""Objects that touch, told apart by the waist of their common silhouette or footprint."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from fluentboard.model.geometry import FloatArray
from fluentboard_modules.anchoring.config import SegmentationConfig
from fluentboard_modules.anchoring.extents import largest_of
from fluentboard_modules.anchoring.organised import OrganisedPoints
from fluentboard_modules.anchoring.pixel_parts import windows
from fluentboard_modules.anchoring.supports import Top

_STANDS_M = 0.03  # a part whose lowest points are higher stands on the other part
_CORE_SHARE = 0.75
_CELL_M = 0.004
_SEAM_PX, _NEARER_M, _NEARER_SHARE = 4, 0.02, 0.25


def split_touching(
    parts: NDArray[np.int32],
    count: int,
    points: OrganisedPoints,
    top: Top,
    config: SegmentationConfig,
) -> tuple[NDArray[np.int32], int]:
    """The labels with touching objects told apart, and the highest label.

    A part is cut when its silhouette, or its footprint seen from above, consists of two bodies
    joined by a waist narrower than `neck_ratio` of the lesser body, and both stand on the top. A
    handle is too thin for a body, and the neck of a bottle carries nothing that stands on the top.

    Args:
        parts: `(h, w)` int32; numbers from 1, 0 for nothing.
        count: the highest number.
        points: of the frame.
        top: what the parts stand on.
        config: how narrow a waist is.
    """
    result = parts.copy()
    for number, found in enumerate(windows(parts, count).tolist()):
        size, first, last, left, right = found
        if size < 4 * config.points_min:
            continue
        window = (slice(first, last + 1), slice(left, right + 1))
        inside = parts[window] == number
        distance_m = float(np.median(points.depth_m[window][inside]))
        cloud = points.points_map[window][inside].astype(np.float64)
        bodies = _bodies(inside, config, distance_m / points.focal_px, 5)
        if bodies is None:
            bodies = _bodies_from_above(inside, cloud, config)
        if bodies is None or _is_cut_by_occluder(bodies, inside, points.depth_m[window]):
            continue
        lowest: list[float] = []
        for body in range(1, int(bodies.max()) + 1):
            part = cloud[bodies[inside] == body]
            lowest.append(float(np.percentile(part[:, 2] - top.height_at(part), 3)))
        if max(lowest) > _STANDS_M:
            continue
        for body in range(2, int(bodies.max()) + 1):
            count += 1
            result[window][bodies == body] = count
    return result, count


def _is_cut_by_occluder(
    bodies: NDArray[np.int32], inside: NDArray[np.bool_], depth_m: NDArray[np.float32]
) -> bool:
    """Whether something nearer to the camera borders on the seam: then it makes the waist."""
    seam = np.zeros(inside.shape, dtype=bool)
    for body in range(1, int(bodies.max()) + 1):
        grown = cv2.dilate((bodies == body).astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
        seam |= grown & (bodies > 0) & (bodies != body)
    size = 2 * _SEAM_PX + 1
    around = cv2.dilate(seam.astype(np.uint8), np.ones((size, size), np.uint8)) > 0
    around &= ~inside & (depth_m > 0.0)
    if not seam.any() or not around.any():
        return False
    nearer = depth_m[around] < float(np.median(depth_m[seam])) - _NEARER_M
    return bool(nearer.mean() > _NEARER_SHARE)


def _bodies_from_above(
    inside: NDArray[np.bool_], cloud_map: FloatArray, config: SegmentationConfig
) -> NDArray[np.int32] | None:
    """The bodies of a footprint, as labels of the silhouette from 1; None if there is only one."""
    cells = np.floor(cloud_map[:, :2] / _CELL_M).astype(np.int64)
    cells -= cells.min(axis=0) - 2
    footprint = np.zeros(tuple((cells.max(axis=0) + 3).tolist()), dtype=np.uint8)
    footprint[tuple(cells.T)] = 1
    # Pixels are further apart than cells, and vessels are hollow.
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (3, 3))
    footprint = np.asarray(cv2.morphologyEx(footprint, cv2.MORPH_CLOSE, kernel))
    contours, _ = cv2.findContours(footprint, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    filled = cv2.drawContours(np.zeros_like(footprint), contours, -1, 1, cv2.FILLED)
    found = _bodies(filled.astype(bool), config, _CELL_M, 1)
    if found is None:
        return None
    labels = np.zeros(inside.shape, dtype=np.int32)
    labels[inside] = found[tuple(cells.T)]
    return labels if np.all(labels[inside] > 0) else None


def _bodies(
    inside: NDArray[np.bool_], config: SegmentationConfig, per_px: float, closed_px: int
) -> NDArray[np.int32] | None:
    """The bodies of a silhouette as labels from 1; None if there is only one."""
    padded = np.pad(inside.astype(np.uint8), 1)
    if closed_px > 1:  # holes without depth are no waist
        padded = cv2.morphologyEx(padded, cv2.MORPH_CLOSE, np.ones((closed_px,) * 2, np.uint8))
    width_px = np.asarray(cv2.distanceTransform(padded, cv2.DIST_L2, 5))
    least_px = 0.5 * config.part_min_m / per_px
    deepest = float(width_px.max())
    if deepest < least_px:
        return None
    for share in (0.3, 0.45, 0.6, _CORE_SHARE):
        level = max(least_px * share, share * deepest)
        count, cores = cv2.connectedComponents((width_px > level).astype(np.uint8))
        if count < 3:
            continue
        widest = largest_of(cores, width_px, count)
        bodies = [
            core
            for core in range(1, count)
            if widest[core] >= least_px and level <= config.neck_ratio * widest[core]
        ]
        if len(bodies) >= 2:
            return _grown(inside, cores[1:-1, 1:-1], bodies)
    return None


def _grown(
    inside: NDArray[np.bool_], cores: NDArray[np.int32], bodies: list[int]
) -> NDArray[np.int32]:
    """Every pixel with its nearest core."""
    seeds = np.isin(cores, bodies)
    _, nearest = cv2.distanceTransformWithLabels(
        (~seeds).astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    lookup = np.zeros(int(nearest.max()) + 1, dtype=np.int32)
    order = {core: position + 1 for position, core in enumerate(bodies)}
    renumbered = np.zeros(int(cores.max()) + 1, dtype=np.int32)
    for core, position in order.items():
        renumbered[core] = position
    lookup[nearest[seeds]] = renumbered[cores[seeds]]
    return np.where(inside, lookup[nearest], 0).astype(np.int32)
