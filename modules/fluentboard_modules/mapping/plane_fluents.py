"""The planes that explain a piece of furniture, as fluents (pure)."""

from __future__ import annotations

import math

import numpy as np

from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.interval import UNKNOWN, Interval
from fluentboard_modules.mapping.furniture_item import FurnitureItem, FurniturePlane
from fluentboard_modules.mapping.planar_region import PlanarRegion


def plane_fluents(
    stem: str, item: FurnitureItem, start: Interval
) -> tuple[list[Fluent], tuple[Property, ...]]:
    """Plane fluents with what was measured at them, and the properties that refer to them.

    Args:
        stem: name of the first; the others get a number at the end.
        item: the piece of furniture that they explain.
        start: since when.
    """
    fluents: list[Fluent] = []
    links: list[Property] = []
    for index, plane in enumerate(item.planes):
        plane_name = stem if index == 0 else f"{stem}_{index}"
        confidence = Property("hasConfidence", "xsd:double", round(item.score, 4))
        properties = (*plane_properties(plane), confidence)
        fluents.append(Fluent(plane_name, plane.label, start, UNKNOWN, properties))
        relation = "hasMainPlane" if index == 0 else "hasPlane"
        links.append(Property(relation, plane.label, plane_name))
    return fluents, tuple(links)


def plane_properties(plane: FurniturePlane) -> tuple[Property, ...]:
    """What was measured at a plane, its contour, and how many frames saw it."""
    return (
        *(Property(name, "xsd:double", value) for name, value in _measures(plane).items()),
        Property("hasFrameCount", "xsd:integer", plane.n_frames),
        Property("hasContour", "xsd:string", _contour_text(plane.region)),
    )


def _measures(plane: FurniturePlane) -> dict[str, float]:
    """What the furniture ontology measures at a plane."""
    region = plane.region
    length, width = sorted(region.extents_m, reverse=True)
    inclination = min(region.tilt_rad, math.pi - region.tilt_rad)
    values = {
        "hasSize": region.area_m2,
        "hasPosY": region.height_m,
        "hasInclination": inclination,
        "hasLength": length,
        "hasWidth": width,
        "hasRoughness": region.roughness_m,
    }
    return {name: round(value, 4) for name, value in values.items()}


def _contour_text(region: PlanarRegion) -> str:
    """The outline in the map frame as WKT, metres with three digits."""
    polygons: list[str] = []
    for part in region.contour.geoms:
        rings: list[str] = []
        for ring in (part.exterior, *part.interiors):
            corners = np.asarray(ring.coords)
            points = region.T_map_region.apply(np.column_stack([corners, np.zeros(len(corners))]))
            rings.append("(" + ", ".join(f"{x:.3f} {y:.3f} {z:.3f}" for x, y, z in points) + ")")
        polygons.append("(" + ", ".join(rings) + ")")
    return f"MULTIPOLYGON Z ({', '.join(polygons)})"
