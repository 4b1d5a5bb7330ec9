"""Senseless input to mapping: it works or finds nothing, and invents no furniture.

Every input comes as an organised image, as an unorganised cloud, and registered into a scene.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from fluentboard.model.geometry import FloatArray, Transform
from fluentboard_modules.frames.sensor_frame import Camera, SensorFrame
from fluentboard_modules.mapping.cad_library import CadLibrary
from fluentboard_modules.mapping.config import MappingConfig
from fluentboard_modules.mapping.furniture_map import FurnitureMap
from fluentboard_modules.mapping.judge import FurnitureJudge
from fluentboard_modules.mapping.planar_region import PlanarRegion
from fluentboard_modules.mapping.rules import FurnitureRules
from fluentboard_modules.mapping.surfaces import detect_regions

CAMERA = Camera(width=80, height=60, fx=72.0, fy=72.0, cx=39.5, cy=29.5)
# The camera looks along the map's x axis, 1.2 m above its floor.
T_MAP_CAMERA = Transform.from_parts(
    np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]), np.array([0.0, 0.0, 1.2])
)
CONFIG = MappingConfig()
RNG = np.random.default_rng(3)
WALL: FloatArray = np.full((60, 80), 2.0)
DEPTHS: dict[str, Any] = {
    "flat": WALL,
    "single wall": np.repeat(np.linspace(1.5, 3.0, 80)[None], 60, axis=0),
    "no floor": np.where(np.arange(60)[:, None] < 30, WALL, 0.0),
    "all invalid": np.zeros((60, 80)),
    "NaN": np.full((60, 80), np.nan),
    "half NaN": np.where(RNG.random((60, 80)) < 0.5, np.nan, 2.0),
    "infinite": np.full((60, 80), np.inf),
    "one pixel": np.where(np.arange(4800).reshape(60, 80) == 2440, 1.0, 0.0),
}


def organised(depth: FloatArray, number: int) -> SensorFrame:
    image = depth.astype(np.float32)
    return SensorFrame(image, CAMERA, 1.0 + number, T_MAP_CAMERA, index=number)


def unorganised(depth: FloatArray, number: int, copies: int = 1) -> SensorFrame:
    frame = organised(depth, number)
    finite = np.where(np.isfinite(depth), depth, 0.0)[..., None]
    cloud = (CAMERA.rays() * finite)[finite[..., 0] > 0.0].reshape(-1, 3)
    points = np.repeat(cloud, copies, axis=0)
    return SensorFrame(
        np.zeros((60, 80), dtype=np.float32),
        CAMERA,
        frame.stamp_s,
        T_MAP_CAMERA,
        index=number,
        cloud_sensor=points,
    )


def duplicated(depth: FloatArray, number: int) -> SensorFrame:
    return unorganised(depth, number, copies=5)


def one_point_again_and_again(depth: FloatArray, number: int) -> SensorFrame:
    frame = unorganised(depth, number)
    assert frame.cloud_sensor is not None
    points = np.repeat(np.array([[0.1, 0.2, 2.0]]), 500, axis=0)
    return SensorFrame(
        frame.depth_m, CAMERA, frame.stamp_s, T_MAP_CAMERA, index=number, cloud_sensor=points
    )


@pytest.mark.parametrize("name", DEPTHS)
@pytest.mark.parametrize(
    "make",
    [organised, unorganised, duplicated, one_point_again_and_again],
    ids=lambda f: f.__name__,
)
def test_nothing_is_invented(
    name: str, make: Callable[[FloatArray, int], SensorFrame], furniture_rules: FurnitureRules
) -> None:
    noise = CONFIG.surfaces.noise
    judge = FurnitureJudge(CadLibrary(), CONFIG.verification, noise)
    room = FurnitureMap(furniture_rules, CONFIG.furniture, noise, judge)
    regions: list[PlanarRegion] = []
    for number in range(6):
        frame = make(DEPTHS[name], number)
        regions = detect_regions(frame, CONFIG.surfaces)
        room.update(frame, regions, furniture_rules.classify(regions))
    room.settle()
    assert room.furniture() == []
    assert all(miss.shortfall > 0.0 for miss, _ in room.near_misses())
    for region in regions:
        assert np.isfinite(region.centroid).all()
        assert region.area_m2 > 0.0
