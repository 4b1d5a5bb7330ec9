"""Placing areas of the board: which one does an object stand on?"""

from __future__ import annotations

import math
from dataclasses import dataclass

from fluentboard.model.geometry import BoundingBox

_ABOVE_M = 0.10  # poses of the map and of the camera are both some centimetres off
_BESIDE_M = 0.03


@dataclass(frozen=True, slots=True)
class PlacingArea:
    """A part of a top.

    Attributes:
        name: of its fluent.
        class_name: of its fluent: PlacingArea or a subclass.
        box: its extent in the map; its bottom is the top.
    """

    name: str
    class_name: str
    box: BoundingBox


class PlacingAreas:
    """The placing areas that hold at present."""

    def __init__(self) -> None:
        self._areas: dict[str, PlacingArea] = {}

    def put(self, area: PlacingArea) -> None:
        """Takes over an area, or its new extent."""
        self._areas[area.name] = area

    def drop(self, name: str) -> None:
        """Forgets an area that has ended."""
        self._areas.pop(name, None)

    @property
    def names(self) -> frozenset[str]:
        """Names of all areas."""
        return frozenset(self._areas)

    def under(self, box: BoundingBox) -> PlacingArea | None:
        """The smallest area that carries the middle of a box; None if none does."""
        carriers = [area for area in self._areas.values() if _carries(area.box, box)]
        return min(carriers, key=lambda a: (a.box.x_size * a.box.y_size, a.name), default=None)


def _carries(area: BoundingBox, box: BoundingBox) -> bool:
    bottom = box.pose.z - 0.5 * box.z_size
    if abs(bottom - (area.pose.z - 0.5 * area.z_size)) > _ABOVE_M:
        return False
    x, y = box.pose.x - area.pose.x, box.pose.y - area.pose.y
    cos, sin = math.cos(area.pose.yaw_rad), math.sin(area.pose.yaw_rad)
    return (
        abs(cos * x + sin * y) <= 0.5 * area.x_size + _BESIDE_M
        and abs(cos * y - sin * x) <= 0.5 * area.y_size + _BESIDE_M
    )
