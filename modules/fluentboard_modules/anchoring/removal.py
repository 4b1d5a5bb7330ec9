"""Has the object gone? Its box is looked at in the depth image (Section 4.2.2.3, Algorithm 4.2).

With the corrections: an object has gone when there are *fewer* points than the threshold (E1) *and*
most of the box has been seen through, for pixels without depth prove nothing (E2); the box is
shrunk first, so that the table under it is no evidence for the object (E3); and each line of sight
is cut with the box by slabs in the box's own frame, which needs no hull (E4).
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numba import njit

from fluentboard.model.geometry import BoundingBox, FloatArray, Transform
from fluentboard_modules.anchoring.config import RemovalConfig
from fluentboard_modules.anchoring.organised import Float32
from fluentboard_modules.frames.sensor_frame import Camera

_SHRUNK_MAX = 0.3  # share of a side: what is flat keeps some of its height


class Presence(Enum):
    """What a look at the place of an object says."""

    PRESENT = "present"
    ABSENT = "absent"
    OCCLUDED = "occluded"
    OUT_OF_VIEW = "out of view"


@dataclass(frozen=True, slots=True)
class Look:
    """A look at the place of an object.

    Attributes:
        presence: what it says.
        before: pixels of the box with something nearer than the box.
        inside: pixels with something in the box.
        behind: pixels that see through the box.
        unknown: pixels without depth.
    """

    presence: Presence
    before: int = 0
    inside: int = 0
    behind: int = 0
    unknown: int = 0

    @property
    def pixels(self) -> int:
        """How many pixels look through the box."""
        return self.before + self.inside + self.behind + self.unknown


def look_at(
    box_map: BoundingBox,
    depth_m: Float32,
    camera: Camera,
    T_map_sensor: Transform,
    config: RemovalConfig,
) -> Look:
    """What a depth image says about an object in a box.

    Args:
        box_map: where it was seen last; upright, bottom on a top.
        depth_m: `(h, w)` float32; 0 where unknown.
        camera: the depth camera.
        T_map_sensor: its place.
        config: thresholds.
    """
    bounds = _bounds(box_map, config)
    T_sensor_box = T_map_sensor.inverse() @ box_map.pose.to_transform()
    corners = T_sensor_box.apply(
        np.array([[x, y, z] for x in bounds[:2, 0] for y in bounds[:2, 1] for z in bounds[:2, 2]])
    )
    depths = corners[:, 2]
    if depths.min() < config.range_min_m or depths.max() > config.range_max_m:
        return Look(Presence.OUT_OF_VIEW)
    low, high = (f(camera.project(corners)) for f in (_lowest, _highest))
    if low.min() < 0.0 or high[0] > camera.width - 1 or high[1] > camera.height - 1:
        return Look(Presence.OUT_OF_VIEW)
    T_box_sensor = np.ascontiguousarray(T_sensor_box.inverse().matrix[:3])
    counts = _count(
        np.ascontiguousarray(depth_m, dtype=np.float32),
        np.array([camera.fx, camera.fy, camera.cx, camera.cy]),
        T_box_sensor,
        bounds,
        np.array([*np.floor(low), *np.ceil(high)]).astype(np.int64),
        config.behind_m,
    )
    before, inside, behind, unknown = (int(count) for count in counts)
    look = Look(Presence.OCCLUDED, before, inside, behind, unknown)
    if not look.pixels:
        return Look(Presence.OUT_OF_VIEW)
    # The threshold n, or its share of a large box, where stray points are more than n.
    is_empty = before + inside < max(config.points_max, config.points_max_share * look.pixels)
    if is_empty and behind >= config.behind_min_share * look.pixels:
        presence = Presence.ABSENT
    elif inside >= config.points_max_share * look.pixels:
        presence = Presence.PRESENT
    else:
        presence = Presence.OCCLUDED
    return Look(presence, before, inside, behind, unknown)


def _bounds(box: BoundingBox, config: RemovalConfig) -> FloatArray:
    """`(4, 3)`; low and high corner of the shrunk box and of the whole one, in the box's axes."""
    sizes = np.maximum(box.sizes, 1e-3)
    side = np.minimum(config.shrink_m, 0.5 * _SHRUNK_MAX * sizes)
    bottom = np.array([side[0], side[1], min(2.0 * config.shrink_m, _SHRUNK_MAX * sizes[2])])
    return np.stack([bottom - 0.5 * sizes, 0.5 * sizes - side, -0.5 * sizes, 0.5 * sizes])


def _lowest(pixels: np.ndarray) -> np.ndarray:
    return pixels.min(axis=0)


def _highest(pixels: np.ndarray) -> np.ndarray:
    return pixels.max(axis=0)


@njit(cache=True)
def _count(depth, camera, T_box_sensor, bounds, window, behind_m):
    counts = np.zeros(4, dtype=np.int64)
    fx, fy, cx, cy = camera
    for v in range(window[1], window[3] + 1):
        for u in range(window[0], window[2] + 1):
            x, y = (u - cx) / fx, (v - cy) / fy
            # In units of depth, since the ray has z = 1. A line of sight counts if it crosses the
            # shrunk box; the surface of the object is where it enters the whole one.
            enter, leave, surface = 0.0, 1e9, 0.0
            for axis in range(3):
                origin = T_box_sensor[axis, 3]
                ray = T_box_sensor[axis, 0] * x + T_box_sensor[axis, 1] * y + T_box_sensor[axis, 2]
                if abs(ray) < 1e-12:
                    if origin < bounds[0, axis] or origin > bounds[1, axis]:
                        leave = -1.0
                    continue
                a, b = (bounds[0, axis] - origin) / ray, (bounds[1, axis] - origin) / ray
                enter, leave = max(enter, min(a, b)), min(leave, max(a, b))
                a, b = (bounds[2, axis] - origin) / ray, (bounds[3, axis] - origin) / ray
                surface = max(surface, min(a, b))
            if leave <= enter:
                continue
            d = depth[v, u]
            if d <= 0.0 or np.isnan(d):
                counts[3] += 1
            elif d < surface:
                counts[0] += 1
            elif d <= leave + behind_m:
                counts[1] += 1
            else:
                counts[2] += 1
    return counts
