"""The floor under a few frames: what the map frame's height is taken from."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from fluentboard.model.geometry import FloatArray, Plane
from fluentboard_modules.frames.gravity import (
    FloorCandidates,
    FloorHeight,
    find_floor,
    fit_slope,
)
from fluentboard_modules.frames.sensor_frame import SensorFrame
from fluentboard_modules.mapping.config import SurfacesConfig
from fluentboard_modules.mapping.planar_region import PlanarRegion
from fluentboard_modules.mapping.surfaces import detect_regions

_LEVEL_COSINE = np.cos(
    np.deg2rad(7.0)
)  # gravity, lens and plane fit are each off by about 2 degrees
_LEAST_AREA_M2 = 0.03
_CROSS = np.array(
    [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0]]
)
_FLOOR_SIGMA_M = 0.03  # poses drift by 2-4 cm
_LIKELY_SLOPE = 0.03  # gravity is known to 1-2 degrees


def level_surfaces(regions: Sequence[PlanarRegion]) -> FloorCandidates:
    """The regions of one frame that may be floor: level and facing up."""
    level = [
        region
        for region in regions
        if region.normal[2] > _LEVEL_COSINE and region.area_m2 >= _LEAST_AREA_M2
    ]
    lowest = [r.bounds_map()[0][2] for r in regions if r.area_m2 >= _LEAST_AREA_M2]
    return FloorCandidates(
        centres=np.array([region.centroid for region in level]).reshape(-1, 3),
        areas_m2=np.array([region.area_m2 for region in level]),
        lowest_m=float(min(lowest, default=math.inf)),
    )


def sloping_floor(regions: Sequence[PlanarRegion], reach_m: float) -> Plane | None:
    """The floor of a map with the slope it really has there, or None if it was not seen.

    Gravity a degree off is 5 cm at the other end of a room. The map frame has its floor at z = 0
    below the furniture, which counts as one more place where the floor was seen.

    Args:
        regions: the planes of the map, accumulated over frames.
        reach_m: the floor is within this of z = 0 everywhere.
    """
    level = [r for r in regions if r.normal[2] > _LEVEL_COSINE and r.area_m2 >= _LEAST_AREA_M2]
    low = [region for region in level if abs(region.height_m) <= reach_m]
    if not low:
        return None
    points: list[FloatArray] = []
    weights: list[float] = []
    for region in low:
        # A large plane knows its own slope: its contour says more than its centroid.
        length, width = region.extents_m
        cross = np.array(
            [[0, 0, 0], [1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]], dtype=np.float64
        )
        on_region = region.T_map_region.apply(cross * (0.3 * length, 0.3 * width, 0.0))
        points.append(on_region)
        weights += [min(region.area_m2, 1.0) / len(cross)] * len(cross)
    standing = [region.centroid for region in level if region.height_m > 2.0 * reach_m]
    if standing:
        middle = np.mean(standing, axis=0)
        points.append(np.array([[middle[0], middle[1], 0.0]]))
        weights.append(sum(weights))
    seen, share = np.concatenate(points), np.array(weights)
    centre = np.append(np.average(seen[:, :2], axis=0, weights=share), 0.0)
    height, slope_x, slope_y = fit_slope(seen - centre, share, _FLOOR_SIGMA_M, _LIKELY_SLOPE)
    normal = np.array([-slope_x, -slope_y, 1.0]) / np.sqrt(1.0 + slope_x**2 + slope_y**2)
    return Plane(normal, float(normal @ (centre + np.array([0.0, 0.0, height]))))


def survey_floor(frames: Iterable[SensorFrame], config: SurfacesConfig) -> FloorHeight | None:
    """The floor that some frames show, or None if they show no level surface.

    Args:
        frames: placed in an upright frame (`align_with_gravity`); some twenty, spread over a
            recording, are enough.
        config: how regions are detected.
    """
    return find_floor([level_surfaces(detect_regions(frame, config)) for frame in frames])
