"""PlanarRegion: one planar piece of a surface, in the map frame."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.affinity import affine_transform
from shapely.geometry import MultiPolygon, Polygon

from fluentboard.model.geometry import FloatArray, Plane, Pose, Transform

# Half as wide as the necks that are cut; wide ones, as the noise of registered frames leaves
# between chairs, only if that makes more of a region.
_NECKS_M, _NARROW_SHARE = (0.05, 0.1), 0.9
_TWO_SEATS_M2, _LEVEL = 0.25, 0.9
_LEVEL_RAD = np.deg2rad(20.0)  # flatter than this, a region's x follows its longer side


@dataclass(frozen=True, slots=True, eq=False)
class PlanarRegion:
    """A planar region: where it is, how large, how well it fits, how much of it was seen.

    Attributes:
        index: number of the region in its frame.
        T_map_region: region frame to map frame. Origin at the centroid of the contour, z along the
            normal towards the sensor, x along the longer side (horizontal regions) or horizontal
            (all others; y then points up the surface).
        contour: outline with holes in the region's x and y, metres.
        n_points: depth pixels on the region.
        rms_m: root mean square distance of the points from the plane.
        touches_edge: whether the region runs into the border of the image, so may be larger.
        sensor_position: `(3,)`; where the sensor was, map frame.
        excess_m2: mean square distance of the points from the plane beyond what the sensor's noise
            explains; negative where the noise was less than expected.
        pixel_box: rows and columns of the image that hold it, (top, left, bottom, right).
        pixel_mask: `(bottom - top, right - left)`; which pixels of that box are on the region.
    """

    index: int
    T_map_region: Transform
    contour: MultiPolygon
    n_points: int
    rms_m: float
    touches_edge: bool = False
    sensor_position: FloatArray = field(default_factory=lambda: np.zeros(3))
    excess_m2: float = 0.0
    pixel_box: tuple[int, int, int, int] = (0, 0, 0, 0)
    pixel_mask: NDArray[np.bool_] = field(default_factory=lambda: np.zeros((0, 0), dtype=np.bool_))

    @property
    def normal(self) -> FloatArray:
        """`(3,)`; unit vector towards the sensor, map frame."""
        return self.T_map_region.rotation[:, 2]

    @property
    def centroid(self) -> FloatArray:
        """`(3,)`; centre of area in the map frame, metres."""
        return self.T_map_region.translation

    @property
    def pose(self) -> Pose:
        """The region's own axes in the map frame."""
        return Pose.from_transform(self.T_map_region)

    @property
    def plane(self) -> Plane:
        """The infinite plane in the map frame."""
        return Plane(self.normal, float(self.normal @ self.centroid))

    @property
    def area_m2(self) -> float:
        """Area without the holes, square metres (the ontology's hasSize)."""
        return float(self.contour.area)

    @property
    def height_m(self) -> float:
        """Height of the centroid above the floor, metres (the ontology's hasPosY)."""
        return float(self.centroid[2])

    @property
    def extents_m(self) -> tuple[float, float]:
        """Length and width of the contour's bounds along the region's x and y, metres."""
        x_min, y_min, x_max, y_max = self.contour.bounds
        return x_max - x_min, y_max - y_min

    @property
    def roughness_m(self) -> float:
        """Root mean square unevenness of the surface itself, metres (hasRoughness)."""
        return float(np.sqrt(max(self.excess_m2, 0.0)))

    @property
    def tilt_rad(self) -> float:
        """Angle between the normal and straight up: 0 faces up, pi/2 is a wall, pi faces down."""
        return float(np.arccos(np.clip(self.normal[2], -1.0, 1.0)))

    def outline_map(self) -> FloatArray:
        """`(n, 3)`; vertices of all outer rings in the map frame."""
        corners = np.concatenate([np.asarray(part.exterior.coords) for part in self.contour.geoms])
        return self.T_map_region.apply(np.column_stack([corners, np.zeros(len(corners))]))

    def rings_map(self) -> list[FloatArray]:
        """Closed rings `(n, 3)` in the map frame: outlines and holes."""
        rings: list[FloatArray] = []
        for part in self.contour.geoms:
            for ring in (part.exterior, *part.interiors):
                corners = np.asarray(ring.coords)
                rings.append(
                    self.T_map_region.apply(np.column_stack([corners, np.zeros(len(corners))]))
                )
        return rings

    def bounds_map(self) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest corner `(3,)` of the axis-aligned box in the map frame, metres."""
        outline = self.outline_map()
        return outline.min(axis=0), outline.max(axis=0)

    def footprint(self) -> MultiPolygon:
        """The contour seen from above, in the map's x and y; a wall's has no area."""
        r, t = self.T_map_region.rotation, self.T_map_region.translation
        seen = affine_transform(
            self.contour, [r[0, 0], r[0, 1], r[1, 0], r[1, 1], float(t[0]), float(t[1])]
        )
        return as_multipolygon(seen)

    def numbered(self, index: int) -> PlanarRegion:
        """The same region under another number."""
        return replace(self, index=index)

    def moved(self, T_new_map: Transform) -> PlanarRegion:
        """The same region in another map frame."""
        return replace(
            self,
            T_map_region=T_new_map @ self.T_map_region,
            sensor_position=T_new_map.apply(self.sensor_position),
        )


def as_multipolygon(shape: object) -> MultiPolygon:
    """The polygons of any shapely geometry; lines and points have no area and are dropped."""
    if isinstance(shape, MultiPolygon):
        return shape
    if isinstance(shape, Polygon):
        return MultiPolygon([] if shape.is_empty else [shape])
    parts = getattr(shape, "geoms", ())
    polygons = [polygon for part in parts for polygon in as_multipolygon(part).geoms]
    return MultiPolygon(polygons)


def parts_of(region: PlanarRegion, least_m2: float = 0.01) -> list[PlanarRegion]:
    """The islands of a region that narrow necks or nothing joins: two seats are two chairs.

    Args:
        region: in the map frame.
        least_m2: smaller islands are left out.

    Returns:
        Empty if the region is in one piece and has no narrow parts worth mentioning.
    """
    whole = region.contour if region.contour.is_valid else shapely.make_valid(region.contour)
    islands: list[Polygon] = []
    # What is smaller than two seats has no wide necks.
    may_be_seats = whole.area > _TWO_SEATS_M2 and abs(float(region.normal[2])) > _LEVEL
    for neck_m in _NECKS_M if may_be_seats else _NECKS_M[:1]:
        opened = as_multipolygon(whole.buffer(-neck_m).buffer(neck_m))
        cut = [part for part in opened.geoms if part.area >= least_m2]
        if len(cut) > max(len(islands), 1) or not islands:
            islands = cut
    kept_m2 = sum(part.area for part in islands)
    if len(islands) < 2 and kept_m2 > _NARROW_SHARE * region.area_m2:
        return []
    found: list[PlanarRegion] = []
    for island in islands:
        x, y = island.centroid.x, island.centroid.y
        shift = Transform.from_parts(np.eye(3), np.array([x, y, 0.0]))
        moved = affine_transform(island, [1, 0, 0, 1, -x, -y])
        share = island.area / max(region.area_m2, 1e-9)
        found.append(
            replace(
                region,
                T_map_region=region.T_map_region @ shift,
                contour=as_multipolygon(moved),
                n_points=round(share * region.n_points),
            )
        )
    return found


def contour_gap_m(a: PlanarRegion, b: PlanarRegion) -> float:
    """Distance between two contours, both seen along the normal of the first, metres."""
    T_a_b = a.T_map_region.inverse() @ b.T_map_region
    r, t = T_a_b.rotation, T_a_b.translation
    b_on_a = affine_transform(
        b.contour, [r[0, 0], r[0, 1], r[1, 0], r[1, 1], float(t[0]), float(t[1])]
    )
    return float(a.contour.distance(b_on_a))


def region_axes(
    normal: FloatArray, spread: FloatArray, weight: FloatArray | None = None
) -> FloatArray:
    """`(3, 3)`; columns x, y, z of a region's axes in the map frame.

    Args:
        normal: `(3,)`; becomes z.
        spread: `(n, 3)`; its points relative to their centre. If the region is level, x follows
            its longer side.
        weight: `(n,)`; how much surface each point stands for; None for all the same.
    """
    if abs(normal[2]) <= np.cos(_LEVEL_RAD):
        return upright_axes(normal)
    level = spread[:, :2]
    covariance = (level if weight is None else level * weight[:, None]).T @ level
    longest = np.linalg.eigh(covariance)[1][:, 1]
    longest = longest * (1.0 if longest[np.argmax(np.abs(longest))] > 0.0 else -1.0)
    return upright_axes(normal, np.array([longest[0], longest[1], 0.0]))


def upright_axes(normal: FloatArray, direction: FloatArray | None = None) -> FloatArray:
    """`(3, 3)`; columns x, y, z of a region's axes in the map frame.

    Args:
        normal: `(3,)`; becomes z.
        direction: `(3,)`; x points along it as far as the plane allows. By default x is horizontal
            and y points up the surface; for a level plane x is the map's x.
    """
    if direction is None:
        direction = np.array([-normal[1], normal[0], 0.0])
        if np.linalg.norm(direction) < 0.05:  # within 3 degrees of level: any x will do
            direction = np.array([1.0, 0.0, 0.0])
    x = direction - normal * float(direction @ normal)
    x = x / np.linalg.norm(x)
    (a, b, c), (d, e, f) = normal.tolist(), x.tolist()  # np.cross takes longer to begin
    return np.column_stack([x, (b * f - c * e, c * d - a * f, a * e - b * d), normal])
