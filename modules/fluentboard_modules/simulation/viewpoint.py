"""Where a camera stands and looks: poses of its optical frame (x right, y down, z forward)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from fluentboard.errors import InvalidGeometry
from fluentboard.model.geometry import Transform
from fluentboard_modules.frames.sensor_frame import Camera


def optical_pose(x: float, y: float, z: float, yaw_rad: float, tilt_rad: float) -> Transform:
    """`T_map_sensor` of a level camera at (x, y, z).

    Args:
        x: metres, map frame.
        y: metres, map frame.
        z: metres, map frame.
        yaw_rad: heading of the line of sight; 0 looks along +x, positive turns to the left.
        tilt_rad: how far the line of sight points below the horizon.
    """
    cy, sy = math.cos(yaw_rad), math.sin(yaw_rad)
    ct, st = math.cos(tilt_rad), math.sin(tilt_rad)
    right = (sy, -cy, 0.0)
    down = (-st * cy, -st * sy, -ct)
    forward = (ct * cy, ct * sy, -st)
    return Transform.from_parts(np.array([right, down, forward]).T, np.array([x, y, z]))


def look_at(eye: ArrayLike, target: ArrayLike) -> Transform:
    """`T_map_sensor` of a level camera at `eye` whose optical axis passes through `target`.

    Raises:
        InvalidGeometry: the two points coincide.
    """
    start = np.asarray(eye, dtype=np.float64)
    ray = np.asarray(target, dtype=np.float64) - start
    if float(np.linalg.norm(ray)) < 1e-9:
        raise InvalidGeometry(f"a camera at {start} cannot look at its own position")
    tilt = math.atan2(-float(ray[2]), math.hypot(float(ray[0]), float(ray[1])))
    yaw = math.atan2(float(ray[1]), float(ray[0]))
    x, y, z = (float(v) for v in start)
    return optical_pose(x, y, z, yaw, tilt)


def heading(T_map_sensor: Transform) -> tuple[float, float]:
    """Yaw and tilt in radians of a level camera, the inverse of `optical_pose`."""
    forward = T_map_sensor.rotation[:, 2]
    yaw = math.atan2(float(forward[1]), float(forward[0]))
    return yaw, math.asin(max(-1.0, min(1.0, -float(forward[2]))))


def pinhole(width: int, height: int, horizontal_fov_rad: float) -> Camera:
    """A camera with square pixels and its principal point in the middle of the image."""
    focal = 0.5 * width / math.tan(0.5 * horizontal_fov_rad)
    return Camera(width, height, focal, focal, 0.5 * (width - 1), 0.5 * (height - 1))


def kinect_camera(width: int = 640) -> Camera:
    """The depth camera of a Kinect (525 px at 640 px width), or a smaller image of it."""
    height = round(0.75 * width)
    focal = 525.0 * width / 640.0
    return Camera(width, height, focal, focal, 0.5 * (width - 1), 0.5 * (height - 1))
