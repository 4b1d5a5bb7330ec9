"""What the furniture rules measure at planes and between them.

The names are those of the ontology. The ontology's `hasPosY` is the height above the floor, our z:
it is converted here and nowhere else.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from shapely.geometry import MultiPolygon

from fluentboard.model.geometry import FloatArray, Plane
from fluentboard_modules.mapping.planar_region import PlanarRegion

BoolArray = NDArray[np.bool_]
IndexArray = NDArray[np.intp]

FEATURES = ("hasInclination", "hasSize", "hasPosY", "hasLength", "hasWidth", "hasRoughness")
"""The datatype properties that are measured at every plane."""

FEATURE_UNITS: Mapping[str, str] = {
    "hasInclination": "rad",
    "hasSize": "m²",
    "hasPosY": "m",
    "hasLength": "m",
    "hasWidth": "m",
    "hasRoughness": "m",
}

_SAMPLE_SPACING_M = 0.03  # along contours; a quarter-metre gap is then wrong by half a millimetre


@dataclass(frozen=True, slots=True)
class Measurement:
    """One quantity of a relation between two planes, and what the ontology asks of it.

    Attributes:
        quantity: what was measured, in words.
        value: what it is, in `unit`.
        limit: the ontology's tolerance.
        at_least: whether the value must be at least the limit; otherwise at most.
        unit: of value and limit; empty for shares.
    """

    quantity: str
    value: float
    limit: float
    at_least: bool
    unit: str

    @property
    def holds(self) -> bool:
        """Whether the value is on the right side of the limit."""
        return self.value >= self.limit if self.at_least else self.value <= self.limit


def measure_features(
    regions: Sequence[PlanarRegion], floor: Plane | None = None
) -> dict[str, FloatArray]:
    """`(n,)` per feature: inclination in rad, area in m^2; height, sides and roughness in m.

    Args:
        regions: the planes, in the map frame.
        floor: from where heights count, its normal upwards; z = 0 by default.
    """
    centres = np.array([region.centroid for region in regions]).reshape(-1, 3)
    rectangles = np.array([_rectangle_sides(region) for region in regions]).reshape(-1, 2)
    tilt = np.array([region.tilt_rad for region in regions])
    return {
        "hasInclination": np.minimum(tilt, np.pi - tilt),
        "hasSize": np.array([region.area_m2 for region in regions]),
        "hasPosY": centres[:, 2] if floor is None else floor.signed_distance(centres),
        "hasLength": rectangles[:, 0],
        "hasWidth": rectangles[:, 1],
        "hasRoughness": np.array([region.roughness_m for region in regions]),
    }


def _rectangle_sides(region: PlanarRegion) -> tuple[float, float]:
    """Longer and shorter side of the smallest rectangle around the contour, metres."""
    corners = shapely.get_coordinates(region.contour).astype(np.float32)
    if len(corners) < 3:
        return 0.0, 0.0
    _, (a, b), _ = cv2.minAreaRect(corners)
    return max(a, b), min(a, b)


class PlaneRelations:
    """The measured relations between planes, each computed only for the pairs asked for.

    Args:
        regions: the planes, in the map frame.
        tolerances: per relation the ontology's annotations.
    """

    MEASURED = (
        "isLowerThan",
        "isInFrontOf",
        "isBackedBy",
        "isFixedTo",
        "isPerpendicularTo",
        "isParallelTo",
        "isAdjacentTo",
        "isBelow",
    )
    """The relations that are measured, the cheapest first."""

    def __init__(
        self, regions: Sequence[PlanarRegion], tolerances: Mapping[str, Mapping[str, float]]
    ) -> None:
        self._regions = regions
        self._tolerances = tolerances
        n = len(regions)
        self._height = np.array([region.height_m for region in regions])
        self._normal = np.array([region.normal for region in regions]).reshape(n, 3)
        self._centre = np.array([region.centroid for region in regions]).reshape(n, 3)
        bounds = np.array([region.bounds_map() for region in regions]).reshape(n, 2, 3)
        self._low, self._high = bounds[:, 0], bounds[:, 1]
        self._trees: dict[int, cKDTree] = {}
        self._footprints: dict[int, MultiPolygon] = {}
        self._pair_values: dict[tuple[str, int, int], float] = {}
        self._gap_limits: dict[tuple[int, int], float] = {}

    def holds(self, relation: str, candidates: BoolArray) -> BoolArray:
        """`(n, n)`; where the relation holds of (row, column) among the candidate pairs."""
        tolerance = self._tolerances[relation]
        i, j = np.nonzero(candidates)
        if relation in ("isLowerThan", "isBelow"):
            passed = self._height[j] - self._height[i] >= tolerance["minimumRise"]
        elif relation == "isInFrontOf":
            passed = self._depth_behind(i, j) >= tolerance["minimumDepth"]
        elif relation in ("isBackedBy", "isFixedTo"):
            depth = -self._depth_behind(j, i)
            passed = (depth >= tolerance["minimumDepth"]) & (depth <= tolerance["maximumDepth"])
        elif relation == "isPerpendicularTo":
            passed = np.arcsin(self._cosines(i, j)) <= tolerance["angleTolerance"]
        elif relation == "isParallelTo":
            passed = np.arccos(self._cosines(i, j)) <= tolerance["angleTolerance"]
        elif relation == "isAdjacentTo":
            # Boxes first: they are cheap and bound the gap. Nothing is its own neighbour.
            passed = self._boxes_within(i, j, tolerance["maximumGap"]) & (i != j)
        else:
            raise KeyError(relation)
        if relation == "isBelow":
            passed &= self._boxes_within(i, j, 0.0, axes=2)
        i, j = i[passed], j[passed]
        if relation == "isAdjacentTo":
            gap = tolerance["maximumGap"]
            near = [self._gap_m(int(a), int(b), gap) <= gap for a, b in zip(i, j, strict=True)]
            i, j = i[near], j[near]
        elif relation in ("isBackedBy", "isFixedTo"):
            least = tolerance["minimumOverlap"]
            along = [self._goes_along(int(a), int(b)) >= least for a, b in zip(i, j, strict=True)]
            i, j = i[along], j[along]
        elif relation == "isBelow":
            least = tolerance["minimumOverlap"]
            over = [self._overlap(int(a), int(b)) >= least for a, b in zip(i, j, strict=True)]
            i, j = i[over], j[over]
        result = np.zeros_like(candidates)
        result[i, j] = True
        return result

    def measure(self, relation: str, i: int, j: int) -> list[Measurement]:
        """The quantities behind a measured relation of the planes i and j."""
        tolerance = self._tolerances[relation]
        if relation in ("isLowerThan", "isBelow"):
            rise = float(self._height[j] - self._height[i])
            found = [Measurement("rise", rise, tolerance["minimumRise"], True, "m")]
            if relation == "isBelow":
                found.append(
                    Measurement(
                        "overlap", self._overlap(i, j), tolerance["minimumOverlap"], True, ""
                    )
                )
            return found
        if relation == "isInFrontOf":
            depth = float(self._depth_behind(np.array([i]), np.array([j]))[0])
            return [Measurement("depth behind", depth, tolerance["minimumDepth"], True, "m")]
        if relation in ("isBackedBy", "isFixedTo"):
            depth = -float(self._depth_behind(np.array([j]), np.array([i]))[0])
            return [
                Measurement("depth behind", depth, tolerance["minimumDepth"], True, "m"),
                Measurement("depth behind", depth, tolerance["maximumDepth"], False, "m"),
                Measurement(
                    "overlap", self._goes_along(i, j), tolerance["minimumOverlap"], True, ""
                ),
            ]
        if relation == "isAdjacentTo":
            gap = self._gap_m(i, j, np.inf)
            return [Measurement("gap", gap, tolerance["maximumGap"], False, "m")]
        cosine = float(self._cosines(np.array([i]), np.array([j]))[0])
        off = np.arcsin(cosine) if relation == "isPerpendicularTo" else np.arccos(cosine)
        name = "off the right angle" if relation == "isPerpendicularTo" else "off parallel"
        return [Measurement(name, float(off), tolerance["angleTolerance"], False, "rad")]

    def _depth_behind(self, i: IndexArray, j: IndexArray) -> FloatArray:
        """How far the centroid of j lies behind the plane i, seen from where i was seen, metres."""
        return np.einsum("ki,ki->k", self._normal[i], self._centre[i] - self._centre[j])

    def _goes_along(self, i: int, j: int) -> float:
        """Share of the extent of the plane i, level and along the wall j, that the wall reaches."""
        level = self._normal[j][:2]
        length = float(np.linalg.norm(level))
        if length < 1e-6:
            return 0.0
        along = np.array([-level[1], level[0]]) / length
        (low, high), (other_low, other_high) = (
            (float(reach.min()), float(reach.max()))
            for reach in (self._regions[k].outline_map()[:, :2] @ along for k in (i, j))
        )
        return max(min(high, other_high) - max(low, other_low), 0.0) / max(high - low, 1e-6)

    def _cosines(self, i: IndexArray, j: IndexArray) -> FloatArray:
        """Absolute cosine between the normals of each pair."""
        cosine = np.einsum("ki,ki->k", self._normal[i], self._normal[j])
        return np.clip(np.abs(cosine), 0.0, 1.0)

    def _boxes_within(
        self, i: IndexArray, j: IndexArray, distance_m: float, axes: int = 3
    ) -> BoolArray:
        """Whether the axis-aligned boxes of each pair come this close; 2 axes: seen from above."""
        low, high = self._low[:, :axes], self._high[:, :axes] + distance_m
        return (low[i] <= high[j]).all(axis=1) & (low[j] <= high[i]).all(axis=1)

    def _gap_m(self, i: int, j: int, limit_m: float) -> float:
        """Smallest distance of the contours; infinite if it exceeds the limit."""
        i, j = min(i, j), max(i, j)
        key = ("gap", i, j)
        known = self._pair_values.get(key)
        # Infinity was found with some limit; a wider one has to look again.
        if known is None or (np.isinf(known) and limit_m > self._gap_limits.get((i, j), 0.0)):
            self._gap_limits[i, j] = limit_m
            # A little more than the limit: the tree's own bound is exclusive.
            distance, _ = self._tree(i).query(
                self._tree(j).data, distance_upper_bound=limit_m * 1.001 + 1e-6
            )
            self._pair_values[key] = float(distance.min())
        return self._pair_values[key]

    def _tree(self, i: int) -> cKDTree:
        if i not in self._trees:
            dense = shapely.segmentize(self._regions[i].contour, _SAMPLE_SPACING_M)
            corners = shapely.get_coordinates(dense)
            points = np.column_stack([corners, np.zeros(len(corners))])
            self._trees[i] = cKDTree(self._regions[i].T_map_region.apply(points))
        return self._trees[i]

    def _overlap(self, i: int, j: int) -> float:
        """Common area of the footprints as a share of the smaller; 0 for walls, who have none."""
        key = ("overlap", min(i, j), max(i, j))
        if key not in self._pair_values:
            a, b = self._footprint(i), self._footprint(j)
            smaller = min(a.area, b.area)
            self._pair_values[key] = a.intersection(b).area / smaller if smaller > 1e-6 else 0.0
        return self._pair_values[key]

    def _footprint(self, i: int) -> MultiPolygon:
        if i not in self._footprints:
            footprint = self._regions[i].footprint()
            valid = footprint if footprint.is_valid else shapely.make_valid(footprint)
            self._footprints[i] = valid
        return self._footprints[i]
