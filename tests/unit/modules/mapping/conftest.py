"""Rooms made of boxes, rendered exactly, and planes made by hand."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
import pytest
from numpy.typing import NDArray
from shapely.geometry import MultiPolygon, box

from fluentboard.model.geometry import FloatArray, Transform
from fluentboard_modules.frames.sensor_frame import Camera, SensorFrame
from fluentboard_modules.mapping.planar_region import PlanarRegion, upright_axes
from fluentboard_modules.mapping.rules import FurnitureRules, load_rules
from fluentboard_ontology import read

Box = tuple[Sequence[float], Sequence[float]]
"""Lower and upper corner of an axis-aligned box in the map, metres."""

TABLE: list[Box] = [
    ((-0.7, 1.2, 0.68), (0.7, 2.0, 0.72)),
    ((-0.68, 1.22, 0.0), (-0.62, 1.28, 0.68)),
    ((0.62, 1.22, 0.0), (0.68, 1.28, 0.68)),
]
CHAIR: list[Box] = [
    ((-0.22, 1.7, 0.41), (0.22, 2.15, 0.45)),
    ((-0.22, 2.15, 0.45), (0.22, 2.19, 0.9)),
    ((-0.22, 2.15, 0.0), (-0.19, 2.19, 0.45)),
    ((0.19, 2.15, 0.0), (0.22, 2.19, 0.45)),
]


class Render(Protocol):
    """Renders boxes on a floor as a depth image."""

    def __call__(
        self,
        boxes: Sequence[Box],
        *,
        eye: Sequence[float] = (0.0, -0.5, 1.4),
        target: Sequence[float] = (0.0, 1.6, 0.6),
        noise: np.random.Generator | None = None,
        width: int = 160,
        stamp_s: float = 1.0,
        floor: bool = True,
    ) -> SensorFrame: ...


class MakePlane(Protocol):
    """Makes a rectangular plane from its centre, normal and sides."""

    def __call__(
        self,
        centre: Sequence[float],
        normal: Sequence[float] = (0.0, 0.0, 1.0),
        size: tuple[float, float] = (1.0, 1.0),
        index: int = 0,
    ) -> PlanarRegion: ...


def _look_at(eye: Sequence[float], target: Sequence[float]) -> Transform:
    forward = np.asarray(target, dtype=np.float64) - np.asarray(eye, dtype=np.float64)
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    return Transform.from_parts(
        np.column_stack([right, np.cross(forward, right), forward]),
        np.asarray(eye, dtype=np.float64),
    )


def _hit(origin: FloatArray, rays: FloatArray, corners: Box) -> NDArray[np.float64]:
    """Distance along each ray to a box, infinite where it misses (slab test)."""
    with np.errstate(divide="ignore", invalid="ignore"):
        a = (np.asarray(corners[0]) - origin) / rays
        b = (np.asarray(corners[1]) - origin) / rays
    near = np.nanmax(np.minimum(a, b), axis=-1)
    far = np.nanmin(np.maximum(a, b), axis=-1)
    return np.where((near <= far) & (near > 0.0), near, np.inf)


@pytest.fixture(scope="session")
def render() -> Render:
    def render_boxes(
        boxes: Sequence[Box],
        *,
        eye: Sequence[float] = (0.0, -0.5, 1.4),
        target: Sequence[float] = (0.0, 1.6, 0.6),
        noise: np.random.Generator | None = None,
        width: int = 160,
        stamp_s: float = 1.0,
        floor: bool = True,
    ) -> SensorFrame:
        height = width * 3 // 4
        focal = 0.9 * width
        camera = Camera(width, height, focal, focal, 0.5 * width, 0.5 * height)
        T_map_sensor = _look_at(eye, target)
        rays = T_map_sensor.rotate(camera.rays())
        origin = T_map_sensor.translation
        ground: list[Box] = [((-20.0, -20.0, -0.5), (20.0, 20.0, 0.0))] if floor else []
        depth = np.full((height, width), np.inf)
        for corners in [*ground, *boxes]:
            depth = np.minimum(depth, _hit(origin, rays, corners))
        depth = np.where(np.isfinite(depth) & (depth < 5.0), depth, 0.0)
        if noise is not None:
            sigma = 0.0012 + 0.0019 * (depth - 0.4) ** 2
            depth = np.where(depth > 0.0, depth + sigma * noise.standard_normal(depth.shape), 0.0)
        return SensorFrame(depth.astype(np.float32), camera, stamp_s, T_map_sensor)

    return render_boxes


@pytest.fixture(scope="session")
def make_plane() -> MakePlane:
    def rectangle(
        centre: Sequence[float],
        normal: Sequence[float] = (0.0, 0.0, 1.0),
        size: tuple[float, float] = (1.0, 1.0),
        index: int = 0,
    ) -> PlanarRegion:
        unit = np.asarray(normal, dtype=np.float64)
        unit = unit / np.linalg.norm(unit)
        axes = upright_axes(unit)
        half = 0.5 * np.asarray(size)
        return PlanarRegion(
            index=index,
            T_map_region=Transform.from_parts(axes, np.asarray(centre, dtype=np.float64)),
            contour=MultiPolygon([box(-half[0], -half[1], half[0], half[1])]),
            n_points=1000,
            rms_m=0.002,
            sensor_position=np.asarray(centre, dtype=np.float64) + 2.0 * unit,
        )

    return rectangle


@pytest.fixture(scope="session")
def furniture_rules() -> FurnitureRules:
    return load_rules(read("furniture"))


@pytest.fixture(scope="session")
def table_boxes() -> list[Box]:
    """A table with its top at 0.72 m, 1.4 x 0.8 m."""
    return TABLE


@pytest.fixture(scope="session")
def chair_boxes() -> list[Box]:
    """A chair that faces the sensor: seat at 0.45 m, backrest behind it."""
    return CHAIR
