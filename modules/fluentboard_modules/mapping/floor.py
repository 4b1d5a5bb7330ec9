"""The floor under a few frames: what the map frame's height is taken from."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from fluentboard_modules.frames.gravity import FloorCandidates, FloorHeight, find_floor
from fluentboard_modules.frames.sensor_frame import SensorFrame
from fluentboard_modules.mapping.config import SurfacesConfig
from fluentboard_modules.mapping.planar_region import PlanarRegion
from fluentboard_modules.mapping.surfaces import detect_regions

_LEVEL_COSINE = np.cos(
    np.deg2rad(7.0)
)  # gravity, lens and plane fit are each off by about 2 degrees
_LEAST_AREA_M2 = 0.03


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


def survey_floor(frames: Iterable[SensorFrame], config: SurfacesConfig) -> FloorHeight | None:
    """The floor that some frames show, or None if they show no level surface.

    Args:
        frames: placed in an upright frame (`align_with_gravity`); some twenty, spread over a
            recording, are enough.
        config: how regions are detected.
    """
    return find_floor([level_surfaces(detect_regions(frame, config)) for frame in frames])
