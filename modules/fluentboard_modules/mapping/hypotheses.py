"""From the planes of a hypothesis to a first pose and box (section 3.2.2).

The furniture's frame has z up, its origin at the centroid of the main plane, and x to the front:
away from the backrest, or along the longer side of a top.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np
import shapely
from shapely.geometry import MultiPolygon

from fluentboard.model.geometry import BoundingBox, FloatArray, Pose, Transform
from fluentboard_modules.mapping.config import HypothesisConfig
from fluentboard_modules.mapping.planar_region import PlanarRegion, as_multipolygon
from fluentboard_modules.mapping.rule_language import FurnitureClass
from fluentboard_modules.mapping.rules import FurnitureHypothesis

# Edges within this angle have a direction in common, if they make up this share of the outline.
_COMMON_RAD, _COMMON_SHARE = 0.09, 0.5
_SAME_WAY = 0.8  # the least cosine
# Points along an outline; those so near to a side are on it; a side is a line through so many.
_BORDER_STEP_M, _SIDE_M, _FIT_M = 0.02, 0.02, 0.03
_SIDE_POINTS, _SIDE_FITS = 5, 2
_BESIDE_M = 0.1  # so far beside a backrest the middle of the seat may be: of either, half is seen


@dataclass(frozen=True, slots=True)
class FurnitureGeometry:
    """Where a hypothesis puts the piece of furniture.

    Attributes:
        pose: origin at the centroid of the main plane, upright, x to the front; map frame.
        box: upright box from the floor to the highest plane, turned like the pose; map frame.
        back_plane: index of the plane that gave the front direction, None if none did.
        main_side: which side of the piece its main plane is.
        may_be_reversed: whether it may as well face the other way.
    """

    pose: Pose
    box: BoundingBox
    back_plane: int | None
    main_side: Literal["top", "back", "front"] = "top"
    may_be_reversed: bool = False


def place_hypothesis(
    hypothesis: FurnitureHypothesis,
    furniture: FurnitureClass,
    regions: Sequence[PlanarRegion],
    config: HypothesisConfig,
) -> FurnitureGeometry:
    """The first pose and the box of a hypothesis.

    Args:
        hypothesis: what was recognised.
        furniture: what the ontology says about its class.
        regions: the planes the hypothesis speaks of, in the map frame.
        config: how tops are oriented.
    """
    main = regions[hypothesis.main_plane]
    if hypothesis.main_label in furniture.back_planes:
        return _place_backrest(hypothesis, furniture, regions)
    if hypothesis.main_label in furniture.front_planes:
        return _place_front(hypothesis, furniture, regions)
    back = _best_back(hypothesis, furniture, regions)
    if back is None:
        yaw = _top_yaw(main, config)
    else:
        direction = _front_direction(main.centroid, regions[back])
        yaw = float(np.arctan2(direction[1], direction[0]))
    used = [main] if back is None else [main, regions[back]]
    # The other planes of a shelf say how high it is; those of a chair's wrong backrests do not.
    if not furniture.back_planes:
        used = [regions[part.plane] for part in hypothesis.planes]
    if furniture.hanging_height_m > 0.0:
        box = _hanging_box(main, yaw, furniture.hanging_height_m)
    else:
        box = upright_box(used, yaw)
    return FurnitureGeometry(_pose(main.centroid, yaw), box, back)


def upright_box(regions: Sequence[PlanarRegion], yaw_rad: float) -> BoundingBox:
    """The smallest box of a given heading around some planes, standing on the floor."""
    corners = np.concatenate([region.outline_map() for region in regions])
    return _box_around(corners, yaw_rad, float(max(corners[:, 2].max(), 0.0)))


def _hanging_box(main: PlanarRegion, yaw_rad: float, height_m: float) -> BoundingBox:
    """The box of a board that is fixed to a wall."""
    flat = _box_around(main.outline_map(), yaw_rad, 0.0)
    middle = main.height_m - 0.5 * height_m
    pose = Pose.from_rpy(flat.pose.x, flat.pose.y, middle, yaw=yaw_rad)
    return BoundingBox(pose, flat.x_size, flat.y_size, height_m)


def placing_box(main: PlanarRegion, yaw_rad: float, config: HypothesisConfig) -> BoundingBox:
    """The space above a top where things are put: as wide as the top, from the top upwards."""
    corners = main.outline_map()
    flat = _box_around(corners, yaw_rad, 0.0)
    height = config.placing_height_m
    return BoundingBox(
        Pose.from_rpy(flat.pose.x, flat.pose.y, main.height_m + 0.5 * height, yaw=yaw_rad),
        flat.x_size,
        flat.y_size,
        height,
    )


def space_above(box: BoundingBox, config: HypothesisConfig) -> BoundingBox:
    """The same above a piece of whose top nothing was seen."""
    pose, height = box.pose, config.placing_height_m
    middle = pose.z + 0.5 * (box.z_size + height)
    return BoundingBox(
        Pose.from_rpy(pose.x, pose.y, middle, yaw=pose.yaw_rad), box.x_size, box.y_size, height
    )


def principal_yaw(contour: MultiPolygon) -> float:
    """Heading of the longer principal axis of an area, in (-pi/2, pi/2].

    Of the area, not of the points: near points are denser and would pull the axis towards the
    sensor.
    """
    total, moments = 0.0, np.zeros(5)
    for part in contour.geoms:
        for sign, ring in ((1.0, part.exterior), *((-1.0, hole) for hole in part.interiors)):
            area, of_ring = _ring_moments(np.asarray(ring.coords)[:, :2])
            total += sign * abs(area)
            moments += sign * np.sign(area) * of_ring
    if total <= 0.0:
        return 0.0
    x, y, xx, yy, xy = moments / total
    yaw = 0.5 * np.arctan2(2.0 * (xy - x * y), (xx - x * x) - (yy - y * y))
    return float(yaw)


def _ring_moments(corners: FloatArray) -> tuple[float, FloatArray]:
    """Signed area and integrals of x, y, xx, yy, xy over a closed ring (Green's theorem)."""
    x0, y0, x1, y1 = *corners[:-1].T, *corners[1:].T
    cross = x0 * y1 - x1 * y0
    area = 0.5 * cross.sum()
    x = (cross * (x0 + x1)).sum() / 6.0
    y = (cross * (y0 + y1)).sum() / 6.0
    xx = (cross * (x0 * x0 + x0 * x1 + x1 * x1)).sum() / 12.0
    yy = (cross * (y0 * y0 + y0 * y1 + y1 * y1)).sum() / 12.0
    xy = (cross * (x0 * y1 + 2.0 * x0 * y0 + 2.0 * x1 * y1 + x1 * y0)).sum() / 24.0
    return float(area), np.array([x, y, xx, yy, xy])


def _top_yaw(main: PlanarRegion, config: HypothesisConfig) -> float:
    """Heading of the longer side of a top, in (-pi/2, pi/2]."""
    footprint = main.footprint()
    if config.top_orientation == "pca":
        return principal_yaw(footprint)
    # Deviates from Section 3.2.2 (PCA): of a top that is hidden in part, the sides still have the
    # right direction while the principal axes turn with what is missing.
    corners = shapely.get_coordinates(footprint).astype(np.float32)
    if len(corners) < 3:
        return principal_yaw(footprint)
    yaw = float(np.deg2rad(cv2.minAreaRect(corners)[2]))
    along_edges = _edge_yaw(footprint)
    border = _border(footprint)
    if along_edges is not None:
        # The smallest rectangle around an L may stand askew; common edges may be those of gaps.
        yaw = max(yaw, along_edges, key=lambda angle: _on_sides(border, angle))
    for _ in range(_SIDE_FITS):
        yaw += _side_slope(border, yaw)
    width, height = np.ptp(_turned_by(corners, yaw), axis=0)
    yaw += 0.0 if width >= height else 0.5 * np.pi
    return float((yaw + 0.5 * np.pi) % np.pi - 0.5 * np.pi)


def _border(footprint: MultiPolygon) -> FloatArray:
    """`(n, 2)`; points along the outlines of an area, as close as grids are fine."""
    rings = [shapely.segmentize(part.exterior, _BORDER_STEP_M) for part in footprint.geoms]
    return np.concatenate([shapely.get_coordinates(ring)[:-1] for ring in rings])


def _turned_by(points: FloatArray, yaw_rad: float) -> FloatArray:
    """`(n, 2)`; the same points along axes with another heading."""
    c, s = np.cos(yaw_rad), np.sin(yaw_rad)
    return points @ np.array([[c, -s], [s, c]])


def _on_sides(border: FloatArray, yaw_rad: float) -> int:
    """How many points lie on the sides of the box around them that is turned so."""
    turned = _turned_by(border, yaw_rad)
    low, high = turned.min(axis=0), turned.max(axis=0)
    return int(np.count_nonzero(np.minimum(turned - low, high - turned) < _SIDE_M))


def _side_slope(border: FloatArray, yaw_rad: float) -> float:
    """How far the points on the sides of a box are turned against it: least squares, radians."""
    turned = _turned_by(border, yaw_rad)
    low, high = turned.min(axis=0), turned.max(axis=0)
    numerator = denominator = 0.0
    for axis, sign in ((0, -1.0), (1, 1.0)):
        for end in (low[axis], high[axis]):
            side = turned[np.abs(turned[:, axis] - end) < _FIT_M]
            if len(side) < _SIDE_POINTS:
                continue
            along, across = (side - side.mean(axis=0)).T[:: 1 if axis == 1 else -1]
            numerator += sign * float(along @ across)
            denominator += float(along @ along)
    return float(np.arctan2(numerator, denominator)) if denominator > 0.0 else 0.0


def _edge_yaw(footprint: MultiPolygon) -> float | None:
    """The direction that the edges of an outline have in common, up to quarter turns.

    The sides of a top are long and at right angles, also of an L-shaped one; what hides a part of
    it leaves edges in any direction. None if there is no such direction, as for a round table.
    """
    outline = as_multipolygon(footprint.simplify(0.03))
    edges = [np.diff(np.asarray(part.exterior.coords)[:, :2], axis=0) for part in outline.geoms]
    if not edges:
        return None
    sides = np.concatenate(edges)
    length = np.linalg.norm(sides, axis=1)
    angle = np.arctan2(sides[:, 1], sides[:, 0])
    apart = np.abs(np.angle(np.exp(4.0j * (angle[:, None] - angle[None, :])))) / 4.0
    support = (apart <= _COMMON_RAD) @ length
    best = int(np.argmax(support))
    if support[best] < _COMMON_SHARE * length.sum():
        return None
    agree = apart[best] <= _COMMON_RAD
    return float(np.angle((length[agree] ** 2 * np.exp(4.0j * angle[agree])).sum()) / 4.0)


def _best_back(
    hypothesis: FurnitureHypothesis, furniture: FurnitureClass, regions: Sequence[PlanarRegion]
) -> int | None:
    """Of several backrests the one that faces the seat: others belong to chairs next to it."""
    main = regions[hypothesis.main_plane]
    best, best_score = None, 0.0
    for part in hypothesis.planes:
        if part.plane == hypothesis.main_plane or part.label not in furniture.back_planes:
            continue
        back = regions[part.plane]
        offset = main.centroid[:2] - back.centroid[:2]
        distance = max(float(np.linalg.norm(offset)), 1e-6)
        normal = _level(back.normal)
        beside = abs(float(offset @ (-normal[1], normal[0])))
        if beside > 0.5 * back.extents_m[0] + _BESIDE_M:
            continue  # the edge of a backrest faces past the seat
        faces = abs(float(offset @ normal)) / distance
        score = faces * min(back.area_m2, 0.1) / (0.1 + distance)
        if score > best_score:
            best, best_score = part.plane, score
    return best


def _front_direction(main_centre: FloatArray, back: PlanarRegion) -> FloatArray:
    """`(2,)`; unit vector from the back to the front, horizontal (erratum E12)."""
    offset = main_centre[:2] - back.centroid[:2]
    normal = _level(back.normal)
    if normal @ offset < 0.0:
        normal = -normal
    length = float(np.linalg.norm(offset))
    # The thesis takes the direction between the centroids. Half a seat has its centroid to one
    # side; the backrest's own normal has not, as long as the two agree roughly.
    if length > 1e-6 and normal @ offset < length * np.cos(np.deg2rad(50.0)):
        return offset / length
    return normal


def _place_backrest(
    hypothesis: FurnitureHypothesis, furniture: FurnitureClass, regions: Sequence[PlanarRegion]
) -> FurnitureGeometry:
    """A chair of which only the back is seen: it faces what the definition found it at."""
    back = regions[hypothesis.main_plane]
    others = [part.plane for part in hypothesis.planes if part.plane != hypothesis.main_plane]
    normal = _level(back.normal)
    if others:
        corners = np.concatenate([regions[other].outline_map() for other in others])
        nearest = corners[np.argmin(np.linalg.norm(corners[:, :2] - back.centroid[:2], axis=1))]
        middle = regions[others[0]].centroid
        # Towards the middle of the table; beside its corner the nearest edge decides.
        for target in (middle, nearest):
            if abs(normal @ (target[:2] - back.centroid[:2])) > 0.05:
                normal = normal * np.sign(normal @ (target[:2] - back.centroid[:2]))
                break
    yaw = float(np.arctan2(normal[1], normal[0]))
    outline = back.outline_map()
    depth = furniture.typical_depth_m
    forward = np.append(normal, 0.0)
    corners = np.concatenate([outline, outline + depth * forward])
    box = _box_around(corners, yaw, float(outline[:, 2].max()))
    return FurnitureGeometry(
        _pose(back.centroid + 0.5 * depth * forward, yaw),
        box,
        hypothesis.main_plane,
        "back",
        may_be_reversed=not others,
    )


def _place_front(
    hypothesis: FurnitureHypothesis, furniture: FurnitureClass, regions: Sequence[PlanarRegion]
) -> FurnitureGeometry:
    """A piece of which the front is seen, such as the backs of the books in a shelf.

    A wall behind it, if its class asks for one, says how deep it is.
    """
    front = regions[hypothesis.main_plane]
    normal = _level(front.normal)
    yaw = float(np.arctan2(normal[1], normal[0]))
    outline = front.outline_map()
    backward = -np.append(normal, 0.0)
    others = [regions[part.plane] for part in hypothesis.planes[1:]]
    walls = [
        (front.centroid - other.centroid) @ other.normal
        for other in others
        if _faces_like(other, normal)
    ]
    depth = min(walls, default=furniture.typical_depth_m)
    corners = np.concatenate([outline, outline + depth * backward])
    box = _box_around(corners, yaw, float(outline[:, 2].max()))
    return FurnitureGeometry(
        _pose(front.centroid + 0.5 * depth * backward, yaw), box, hypothesis.main_plane, "front"
    )


def _faces_like(wall: PlanarRegion, normal: FloatArray) -> bool:
    """Whether an upright plane faces where a horizontal direction points."""
    return bool(wall.normal[:2] @ normal > _SAME_WAY)


def _level(normal: FloatArray) -> FloatArray:
    """`(2,)`; the horizontal part of a normal as a unit vector."""
    return normal[:2] / max(float(np.linalg.norm(normal[:2])), 1e-9)


def _box_around(corners: FloatArray, yaw_rad: float, top_m: float) -> BoundingBox:
    turn = Transform.from_parts(_about_z(-yaw_rad), np.zeros(3))
    turned = turn.apply(corners)
    low, high = turned.min(axis=0), turned.max(axis=0)
    centre = turn.inverse().apply(np.array([*(0.5 * (low + high))[:2], 0.0]))
    size = high - low
    return BoundingBox(
        Pose.from_rpy(float(centre[0]), float(centre[1]), 0.5 * top_m, yaw=yaw_rad),
        float(size[0]),
        float(size[1]),
        top_m,
    )


def _about_z(angle_rad: float) -> FloatArray:
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _pose(position: FloatArray, yaw_rad: float) -> Pose:
    return Pose.from_rpy(float(position[0]), float(position[1]), float(position[2]), yaw=yaw_rad)
