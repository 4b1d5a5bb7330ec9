"""How much upright boxes overlap."""

from __future__ import annotations

import cv2
import numpy as np

from fluentboard.model.geometry import BoundingBox

_THIN_M = 1e-3  # narrower boxes count as that wide


def shared_footprint(a: BoundingBox, b: BoundingBox, *, of_first: bool = False) -> float:
    """Share of the smaller footprint that both boxes cover, 0 to 1; 0 if one is above the other.

    Args:
        a: a box.
        b: another one.
        of_first: of the footprint of `a` instead.
    """
    if _shared_height_m(a, b) < 0.0:
        return 0.0
    areas = [max(box.x_size, _THIN_M) * max(box.y_size, _THIN_M) for box in (a, b)]
    return float(min(1.0, _common_area_m2(a, b) / (areas[0] if of_first else min(areas))))


def shared_volume(a: BoundingBox, b: BoundingBox) -> float:
    """Volume that both boxes fill over the volume that either fills, 0 to 1 (IoU)."""
    tall = _shared_height_m(a, b)
    both = a.volume_m3 + b.volume_m3
    if tall <= 0.0 or both <= 0.0:
        return 0.0
    common = min(tall * _common_area_m2(a, b), a.volume_m3, b.volume_m3)
    return float(common / (both - common))


def _shared_height_m(a: BoundingBox, b: BoundingBox) -> float:
    """Height of the layer in which both are; negative if one is above the other."""
    return min(box.pose.z + 0.5 * box.z_size for box in (a, b)) - max(
        box.pose.z - 0.5 * box.z_size for box in (a, b)
    )


def _common_area_m2(a: BoundingBox, b: BoundingBox) -> float:
    """Area of the floor that both stand over."""
    reach = 0.5 * (np.hypot(a.x_size, a.y_size) + np.hypot(b.x_size, b.y_size))
    if np.hypot(a.pose.x - b.pose.x, a.pose.y - b.pose.y) > reach:
        return 0.0
    rectangles = [
        (
            (box.pose.x, box.pose.y),
            (max(box.x_size, _THIN_M), max(box.y_size, _THIN_M)),
            float(np.degrees(box.pose.yaw_rad)),
        )
        for box in (a, b)
    ]
    _, corners = cv2.rotatedRectangleIntersection(*rectangles)
    if corners is None or len(corners) < 3:
        return 0.0
    return float(cv2.contourArea(cv2.convexHull(corners)))
