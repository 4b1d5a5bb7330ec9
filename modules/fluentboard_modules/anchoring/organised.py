"""Organised points of a depth image in the map frame, and what noise does to their heights."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fluentboard.model.geometry import FloatArray, Transform
from fluentboard_modules.frames.depth_noise import KinectNoiseConfig
from fluentboard_modules.frames.sensor_frame import Camera, SensorFrame

Float32 = NDArray[np.float32]


@dataclass(frozen=True, slots=True, eq=False)
class OrganisedPoints:
    """A frame as points of the map, one per pixel.

    Attributes:
        points_map: `(h, w, 3)` float32; NaN where the depth is unknown.
        depth_m: `(h, w)` float32; 0 where unknown.
        height_sigma_m: `(h, w)` float32; standard deviation of a point's height, from the depth
            noise and the steepness of the line of sight.
        camera: of the frame.
        T_map_sensor: its place.
    """

    points_map: Float32
    depth_m: Float32
    height_sigma_m: Float32
    camera: Camera
    T_map_sensor: Transform

    @property
    def viewpoint_map(self) -> FloatArray:
        """`(3,)`; where the camera was."""
        return self.T_map_sensor.translation

    @property
    def focal_px(self) -> float:
        """Mean focal length in pixels."""
        return 0.5 * (self.camera.fx + self.camera.fy)

    def is_hidden(self, points_map: FloatArray, margin_m: float) -> NDArray[np.bool_]:
        """`(n,)`; which points `(n, 3)` lie behind something that the camera sees."""
        points = self.T_map_sensor.inverse().apply(points_map)
        hidden = np.zeros(len(points), dtype=bool)
        ahead = np.flatnonzero(points[:, 2] > 0.1)
        pixels = np.rint(self.camera.project(points[ahead]))
        inside = np.all((pixels >= 0) & (pixels < self.depth_m.shape[::-1]), axis=1)
        ahead, pixels = ahead[inside], pixels[inside].astype(np.int64)
        depth = self.depth_m[pixels[:, 1], pixels[:, 0]]
        hidden[ahead] = (depth > 0.0) & (depth < points[ahead, 2] - margin_m)
        return hidden


def organise(frame: SensorFrame, noise: KinectNoiseConfig, range_max_m: float) -> OrganisedPoints:
    """The points of a frame.

    Args:
        frame: placed in the map.
        noise: of the depth camera.
        range_max_m: depth beyond which points are left out.
    """
    camera = frame.camera
    transform = np.ascontiguousarray(frame.T_map_sensor.matrix[:3])
    points, depth, sigma = _organise(
        np.ascontiguousarray(frame.depth_m, dtype=np.float32),
        np.array([camera.fx, camera.fy, camera.cx, camera.cy]),
        transform,
        np.array([noise.constant_m, noise.quadratic_per_m, noise.reference_m, range_max_m]),
    )
    return OrganisedPoints(points, depth, sigma, camera, frame.T_map_sensor)


@njit(cache=True)
def _organise(depth, camera, transform, noise):
    height, width = depth.shape
    points = np.full((height, width, 3), np.nan, dtype=np.float32)
    kept = np.zeros((height, width), dtype=np.float32)
    sigma = np.zeros((height, width), dtype=np.float32)
    fx, fy, cx, cy = camera
    for v in range(height):
        y = (v - cy) / fy
        for u in range(width):
            z = depth[v, u]
            if not (z > 0.0 and z < noise[3]):
                continue
            x = (u - cx) / fx
            kept[v, u] = z
            for axis in range(3):
                ray = transform[axis, 0] * x + transform[axis, 1] * y + transform[axis, 2]
                points[v, u, axis] = ray * z + transform[axis, 3]
                if axis == 2:
                    off = z - noise[2]
                    sigma[v, u] = abs(ray) * (noise[0] + noise[1] * off * off)
    return points, kept, sigma


@njit(cache=True)
def patches(points, depth, step):
    """Mean points `(h // step, w // step, 3)` of square patches; NaN across edges of depth.

    Args:
        points: `(h, w, 3)` float32, NaN where unknown.
        depth: `(h, w)` float32, 0 where unknown.
        step: side of a patch in pixels.
    """
    rows, columns = depth.shape[0] // step, depth.shape[1] // step
    means = np.full((rows, columns, 3), np.nan, dtype=np.float32)
    for i in range(rows):
        for j in range(columns):
            count = 0
            near, far = 1e9, 0.0
            x = y = z = 0.0
            for v in range(i * step, (i + 1) * step):
                for u in range(j * step, (j + 1) * step):
                    d = depth[v, u]
                    if d <= 0.0:
                        continue
                    count += 1
                    near, far = min(near, d), max(far, d)
                    x += points[v, u, 0]
                    y += points[v, u, 1]
                    z += points[v, u, 2]
            if 2 * count >= step * step and far - near < 0.02 + 0.03 * near * near:
                means[i, j, 0], means[i, j, 1], means[i, j, 2] = x / count, y / count, z / count
    return means
