"""Depth images kept for verification: thinned out, and the best few of them for a place."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from fluentboard.model.geometry import FloatArray, Transform
from fluentboard_modules.frames.sensor_frame import Camera, SensorFrame
from fluentboard_modules.mapping.config import DepthNoiseConfig

_NEAREST_M = 0.3
_CUBES = 1 << 20  # to either side of the origin, along each axis
_VIEWS_KEPT = 240  # of 77 kB each
_APART_M, _APART_COSINE = 0.25, 0.97  # views nearer than this to another say the same


@dataclass(frozen=True, eq=False)
class DepthView:
    """A thinned depth image with its place in the map.

    Attributes:
        depth_m: `(h, w)` float32; 0 where unknown.
        camera: of the thinned image.
        T_map_sensor: where it was taken.
        stamp_s: when.
        noise: standard deviation of its depth.
    """

    depth_m: NDArray[np.float32]
    camera: Camera
    T_map_sensor: Transform
    stamp_s: float
    noise: DepthNoiseConfig

    @cached_property
    def T_sensor_map(self) -> Transform:
        """Takes points of the map to the sensor."""
        return self.T_map_sensor.inverse()

    @cached_property
    def intrinsics(self) -> FloatArray:
        """`(4,)`; fx, fy, cx, cy of the thinned image, pixels."""
        camera = self.camera
        return np.array([camera.fx, camera.fy, camera.cx, camera.cy])

    @cached_property
    def rays(self) -> NDArray[np.float32]:
        """`(h, w, 3)`; directions in the sensor's frame with z = 1."""
        return self.camera.rays().astype(np.float32)

    @cached_property
    def sigma_m(self) -> NDArray[np.float32]:
        """`(h, w)`; standard deviation of each depth."""
        noise = self.noise
        excess = np.maximum(self.depth_m - np.float32(noise.reference_m), 0.0)
        return (noise.constant_m + noise.quadratic_per_m * excess**2).astype(np.float32)

    @cached_property
    def points_map(self) -> FloatArray:
        """`(n, 3)`; its measured points in the map."""
        seen = self.depth_m > 0.0
        points = self.rays[seen].astype(np.float64) * self.depth_m[seen][:, None]
        return self.T_map_sensor.apply(points)

    def thinned(self, spacing_m: float) -> tuple[FloatArray, NDArray[np.int64]]:
        """Its measured points in the map, one per cube of a grid, and the numbers of the cubes.

        Returns:
            `(n, 3)` and `(n,)`; the same cube has the same number in every view.
        """
        if spacing_m not in self._thinned:
            points = self.points_map
            x, y, z = (np.floor(points / spacing_m).astype(np.int64) + _CUBES).T
            cubes, first = np.unique((x << 42) | (y << 21) | z, return_index=True)
            self._thinned[spacing_m] = points[first], cubes
        return self._thinned[spacing_m]

    @cached_property
    def _thinned(self) -> dict[float, tuple[FloatArray, NDArray[np.int64]]]:
        return {}


def thin_view(frame: SensorFrame, noise: DepthNoiseConfig, width: int = 160) -> DepthView:
    """A frame thinned to about so many columns, without any mixing of depths."""
    step = max(1, round(frame.camera.width / width))
    first = step // 2
    depth = np.where(frame.valid, frame.depth_m, np.float32(0.0))[first::step, first::step]
    camera = frame.camera
    thinned = Camera(
        depth.shape[1],
        depth.shape[0],
        camera.fx / step,
        camera.fy / step,
        (camera.cx - first) / step,
        (camera.cy - first) / step,
    )
    return DepthView(
        np.ascontiguousarray(depth, dtype=np.float32),
        thinned,
        frame.T_map_sensor,
        frame.stamp_s,
        noise,
    )


class ViewMemory:
    """The views of a run, thinned out evenly when they become too many."""

    def __init__(self, noise: DepthNoiseConfig) -> None:
        self._noise = noise
        self._views: list[DepthView] = []
        self._count = 0
        self._every = 1

    def add(self, frame: SensorFrame) -> DepthView:
        """Takes in one frame; returns its view."""
        view = thin_view(frame, self._noise)
        if self._count % self._every == 0:
            self._views.append(view)
        self._count += 1
        if len(self._views) > _VIEWS_KEPT:
            self._views = self._views[::2]
            self._every *= 2
        return view

    def since(self, stamp_s: float | None = None) -> list[DepthView]:
        """All views kept, or those from a time on."""
        if stamp_s is None:
            return list(self._views)
        return [view for view in self._views if view.stamp_s >= stamp_s]


def best_views(
    views: Sequence[DepthView], centre_map: FloatArray, radius_m: float, count: int
) -> list[DepthView]:
    """The few views that show most of a place, from different sides.

    Args:
        views: to choose from.
        centre_map: `(3,)`; middle of the place.
        radius_m: of the ball around it that should be seen.
        count: how many at most.
    """
    rated = [(_worth(view, centre_map, radius_m), -view.stamp_s, k) for k, view in enumerate(views)]
    chosen: list[DepthView] = []
    spare: list[DepthView] = []
    for worth, _, k in sorted(rated, reverse=True):
        if worth <= 0.0:
            break
        view = views[k]
        if any(_alike(view, other) for other in chosen):
            spare.append(view)
            continue
        chosen.append(view)
        if len(chosen) == count:
            return chosen
    return (chosen + spare)[:count]


def _worth(view: DepthView, centre_map: FloatArray, radius_m: float) -> float:
    """The share of the ball in the image, less for far ones whose depth is bad; 0 behind."""
    x, y, z = view.T_sensor_map.apply(centre_map[None])[0]
    if z < _NEAREST_M:
        return 0.0
    camera = view.camera
    share = 1.0
    for at, focal, middle, size in (
        (x, camera.fx, camera.cx, camera.width),
        (y, camera.fy, camera.cy, camera.height),
    ):
        low, high = focal * (at - radius_m) / z + middle, focal * (at + radius_m) / z + middle
        share *= max(0.0, min(high, size) - max(low, 0.0)) / max(high - low, 1e-6)
    return share / (1.0 + (z / 2.5) ** 2) if share > 0.1 else 0.0


def _alike(a: DepthView, b: DepthView) -> bool:
    moved = float(np.linalg.norm(a.T_map_sensor.translation - b.T_map_sensor.translation))
    looks = float(a.T_map_sensor.rotation[:, 2] @ b.T_map_sensor.rotation[:, 2])
    return moved < _APART_M and looks > _APART_COSINE
