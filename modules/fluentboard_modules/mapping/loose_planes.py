"""Planes that nearly are furniture and belong to none of the pieces that were found (pure)."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

from fluentboard_modules.mapping.furniture_item import FurniturePlane
from fluentboard_modules.mapping.near_misses import NearMiss
from fluentboard_modules.mapping.planar_region import PlanarRegion
from fluentboard_modules.mapping.rules import Classification

_ROOM = frozenset({"FloorPlane", "CeilingPlane", "WallPlane"})
_DIRECTIONS = ("HorizontalPlane", "VerticalPlane")


def unexplained(
    verdict: Classification,
    identifiers: Sequence[int],
    regions: Sequence[PlanarRegion],
    frames_of: Mapping[int, int],
    taken: Collection[int],
) -> list[tuple[NearMiss, FurniturePlane]]:
    """The near misses that no piece explains, with their planes, the nearest first.

    Args:
        verdict: what the ontology says about the planes.
        identifiers: of the planes in the map.
        regions: the planes.
        frames_of: per identifier the frames that saw it.
        taken: identifiers of the planes of furniture that was found.
    """
    found: list[tuple[NearMiss, FurniturePlane]] = []
    for miss in verdict.near_misses:
        identifier, labels = identifiers[miss.plane], verdict.labels[miss.plane]
        if identifier in taken or labels & _ROOM:
            continue
        label = next((name for name in _DIRECTIONS if name in labels), "Plane")
        region = regions[miss.plane]
        found.append((miss, FurniturePlane(identifier, label, region, frames_of[identifier])))
    return found
