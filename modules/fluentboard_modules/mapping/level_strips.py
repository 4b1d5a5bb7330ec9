"""Slivers of tops that no plane was found in: level, at the height of a model's top, nothing above.

Seen from five metres, a table top is a few rows of pixels high. That makes no plane, but it is
enough to look there with a CAD model.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.ndimage import binary_dilation, find_objects, label
from shapely.geometry import MultiPolygon, box

from fluentboard.model.geometry import FloatArray, Transform
from fluentboard_modules.mapping.depth_views import DepthView
from fluentboard_modules.mapping.planar_region import PlanarRegion

_CELL_M = 0.05
_NEAR_M = 0.025  # so far above or below the height; more where the depth is worse
_SIGMAS, _NEAR_MAX_M = 1.5, 0.05
_ABOVE_M = (0.12, 0.6)  # what goes on upwards there is a wall, a shelf or somebody's back
_GAP_CELLS = 3
_POINTS_LEAST = 12
_LENGTH_LEAST_M = 0.3
_STRIPS_MAX = 6
_HALF_LEAST_M = 0.03
_RANGE_M = 8.0


def level_strips(
    views: Sequence[DepthView], height_m: float, headings_rad: Sequence[float]
) -> list[PlanarRegion]:
    """Regions at a height of which something was measured, the largest first.

    Args:
        views: depth images without what is explained already.
        height_m: of the top above the floor.
        headings_rad: of what stands in the room; each strip is given a box along each of them.
    """
    points, above = _points_at(views, height_m)
    if len(points) < _POINTS_LEAST:
        return []
    low = points.min(axis=0) - _CELL_M
    shape = tuple(((points.max(axis=0) - low) / _CELL_M).astype(int) + 2)
    is_high = np.zeros(shape, dtype=np.bool_)
    cells = np.floor((above - low) / _CELL_M).astype(int)
    inside = ((cells >= 0) & (cells < shape)).all(axis=1)
    is_high[tuple(cells[inside].T)] = True
    own = np.floor((points - low) / _CELL_M).astype(int)
    points = points[~is_high[tuple(own.T)]]
    if len(points) < _POINTS_LEAST:
        return []
    own = np.floor((points - low) / _CELL_M).astype(int)
    taken = np.zeros(shape, dtype=np.bool_)
    taken[tuple(own.T)] = True
    names, _ = label(binary_dilation(taken, iterations=_GAP_CELLS))
    cluster = names[tuple(own.T)]
    strips: list[tuple[int, list[PlanarRegion]]] = []
    for k in range(1, len(find_objects(names)) + 1):
        member = points[cluster == k]
        if len(member) < _POINTS_LEAST:
            continue
        if float(np.ptp(member, axis=0).max()) < _LENGTH_LEAST_M:
            continue
        strips.append((len(member), [_region(member, height_m, yaw) for yaw in headings_rad]))
    strips.sort(key=lambda strip: -strip[0])
    return [region for _, regions in strips[:_STRIPS_MAX] for region in regions]


def _points_at(views: Sequence[DepthView], height_m: float) -> tuple[FloatArray, FloatArray]:
    """Points `(n, 2)` at a height, and those `(m, 2)` above it, seen from above."""
    at: list[FloatArray] = []
    above: list[FloatArray] = []
    for view in views:
        near = view.depth_m[view.depth_m > 0.0] <= _RANGE_M
        points = view.points_map[near]
        sigma = view.sigma_m[view.depth_m > 0.0][near]
        # Depth errs along the ray, so height errs the less the flatter the ray is.
        ray = points - view.T_map_sensor.translation
        slope = np.abs(ray[:, 2]) / np.maximum(np.linalg.norm(ray, axis=1), 1e-6)
        reach = np.clip(_SIGMAS * sigma * slope, _NEAR_M, _NEAR_MAX_M)
        off = points[:, 2] - height_m
        at.append(points[np.abs(off) <= reach, :2])
        above.append(points[(off > _ABOVE_M[0]) & (off < _ABOVE_M[1]), :2])
    empty = np.zeros((0, 2))
    return np.concatenate([empty, *at]), np.concatenate([empty, *above])


def _region(
    points: FloatArray, height_m: float, yaw_rad: float, outliers: float = 0.02
) -> PlanarRegion:
    c, s = np.cos(yaw_rad), np.sin(yaw_rad)
    turn = np.array([[c, -s], [s, c]])
    along = points @ turn
    low, high = np.quantile(along, (outliers, 1.0 - outliers), axis=0)
    half = np.maximum(0.5 * (high - low), _HALF_LEAST_M)
    rotation = np.eye(3)
    rotation[:2, :2] = turn
    middle = np.append(turn @ (0.5 * (low + high)), height_m)
    contour = MultiPolygon([box(-half[0], -half[1], half[0], half[1])])
    return PlanarRegion(
        index=-1,
        T_map_region=Transform.from_parts(rotation, middle),
        contour=contour,
        n_points=len(points),
        rms_m=_NEAR_M,
    )


def boxed(region: PlanarRegion, yaw_rad: float) -> PlanarRegion:
    """The rectangle of a heading around a level region."""
    return replace(
        _region(region.outline_map()[:, :2], region.height_m, yaw_rad, outliers=0.0),
        sensor_position=region.sensor_position,
    )


def common_headings(regions: Sequence[PlanarRegion], least_m2: float = 0.15) -> list[float]:
    """The direction that the upright planes of a room have in common, up to quarter turns.

    Returns:
        One heading in (-pi/4, pi/4], or none if there is no upright plane.
    """
    total = 0.0 + 0.0j
    for region in regions:
        if abs(float(region.normal[2])) < 0.2 and region.area_m2 >= least_m2:
            angle = float(np.arctan2(region.normal[1], region.normal[0]))
            total += region.area_m2 * np.exp(4.0j * angle)
    return [float(np.angle(total)) / 4.0] if abs(total) > 0.0 else []
