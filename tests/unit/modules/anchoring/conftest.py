"""Tables with boxes and cans on them, rendered exactly."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest
from numpy.typing import NDArray

from fluentboard.model.geometry import FloatArray
from fluentboard_modules.frames.sensor_frame import Camera, SensorFrame
from fluentboard_modules.simulation.viewpoint import look_at

Thing = tuple[float, ...]
"""A box of six numbers (low x y z, high x y z) or an upright can of five (x y radius low high)."""


def box_depth(thing: Thing, eye: FloatArray, rays: FloatArray) -> FloatArray:
    """Depth at which each ray enters a box; infinite where it misses."""
    with np.errstate(divide="ignore", invalid="ignore"):
        a, b = (np.array(thing[:3]) - eye) / rays, (np.array(thing[3:]) - eye) / rays
    enter, leave = np.minimum(a, b).max(axis=-1), np.maximum(a, b).min(axis=-1)
    return np.where((enter < leave) & (enter > 0.0), enter, np.inf)


def can_depth(thing: Thing, eye: FloatArray, rays: FloatArray) -> FloatArray:
    """Depth at which each ray enters a can; infinite where it misses."""
    x, y, radius, low, high = thing
    away = eye[:2] - np.array([x, y])
    a = (rays[..., :2] ** 2).sum(axis=-1)
    b = (rays[..., :2] * away).sum(axis=-1)
    root = b * b - a * (float(away @ away) - radius**2)
    with np.errstate(invalid="ignore", divide="ignore"):
        side = (-b - np.sqrt(root)) / a
        z = eye[2] + side * rays[..., 2]
        side = np.where((root > 0.0) & (z >= low) & (z <= high), side, np.inf)
        lid = (high - eye[2]) / rays[..., 2]
        at = away + lid[..., None] * rays[..., :2]
        on_lid = ((at**2).sum(axis=-1) <= radius**2) & (lid > 0.0)
    return np.minimum(side, np.where(on_lid, lid, np.inf))


@pytest.fixture(scope="session")
def render() -> Callable[..., SensorFrame]:
    """Renders things above a floor as a labelled depth image; labels count the things from 1."""
    camera = Camera(320, 240, 290.0, 290.0, 159.5, 119.5)

    def rendered(
        things: Sequence[Thing],
        *,
        eye: Sequence[float] = (0.0, 0.0, 1.5),
        target: Sequence[float] = (0.0, 1.3, 0.7),
        stamp_s: float = 1.0,
        noise: np.random.Generator | None = None,
    ) -> SensorFrame:
        T_map_sensor = look_at(np.array(eye), np.array(target))
        rays = T_map_sensor.rotate(camera.rays())
        floor = (-4.0, -4.0, -0.1, 4.0, 4.0, 0.0)
        depths = np.stack(
            [
                (box_depth if len(thing) == 6 else can_depth)(thing, np.array(eye), rays)
                for thing in (floor, *things)
            ]
        )
        depth: FloatArray = depths.min(axis=0)
        labels: NDArray[np.int32] = depths.argmin(axis=0).astype(np.int32)
        if noise is not None:
            sigma = 0.0012 + 0.0019 * (np.minimum(depth, 9.0) - 0.4) ** 2
            depth += sigma * noise.standard_normal(depth.shape)
        depth_m = np.where(np.isfinite(depth), depth, 0.0).astype(np.float32)
        return SensorFrame(depth_m, camera, stamp_s, T_map_sensor, labels=labels)

    return rendered
