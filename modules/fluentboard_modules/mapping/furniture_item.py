"""Pieces of furniture as the map describes them, and how they change."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from shapely.geometry import Polygon

from fluentboard.model.geometry import BoundingBox, FloatArray, Pose
from fluentboard_modules.mapping.planar_region import PlanarRegion


@dataclass(frozen=True, slots=True)
class FurniturePlane:
    """A plane that explains a piece of furniture.

    Attributes:
        identifier: number of the plane in the map, stable over updates.
        label: what the class's definition asked of it, such as `ChairSeatPlane`.
        region: the plane as accumulated so far.
        n_frames: frames that saw it.
    """

    identifier: int
    label: str
    region: PlanarRegion
    n_frames: int


@dataclass(frozen=True, eq=False, slots=True)
class CadFit:
    """The CAD model that explains a piece of furniture, and how well.

    Attributes:
        model: name of the model.
        is_exact: whether it came from a CAD file; if not, from the planes of the hypothesis.
        pose: of the model's frame (footprint's centre on the floor, x to the front); map frame.
        score: explained share of what was seen of it, in [0, 1].
        initial_pose: where the planes alone had put it.
        initial_score: the score there.
        covariance: `(3, 3)`; of x, y (metres) and yaw (radians) of the pose; map frame.
        n_views: depth images it was compared with.
        explained_m2: area that it explains, across the view, in the mean of the views; a pixel
            counts the less the further off it is.
    """

    model: str
    is_exact: bool
    pose: Pose
    score: float
    initial_pose: Pose
    initial_score: float
    covariance: FloatArray
    n_views: int
    explained_m2: float = 0.0


@dataclass(frozen=True, slots=True)
class FurnitureItem:
    """A piece of furniture.

    Attributes:
        identifier: stable name, the class in lower case and a number: `chair2`.
        class_name: class of the furniture ontology.
        pose: origin at the centroid of the main plane, x to the front, z up; map frame.
        box: upright box from the floor to its highest plane; map frame.
        placing_area: space above its top where things can be put, None for seats.
        score: belief that it is there and what it is said to be, in [0, 1].
        n_frames: frames that support it: that saw the least seen of its planes.
        n_direct: frames that showed the whole definition at once.
        planes: what explains it, the main plane first.
        rules: names of the rules that labelled these planes.
        alternatives: other classes whose definitions its main plane satisfies.
        first_seen_s: stamp of the first frame that supports it, seconds.
        last_seen_s: stamp of the last frame that saw its main plane, seconds.
        cad: the model that explains it; None if nothing was verified.
        frames_s: stamps of the frames that saw one of its planes, in seconds, oldest first.
    """

    identifier: str
    class_name: str
    pose: Pose
    box: BoundingBox
    placing_area: BoundingBox | None
    score: float
    n_frames: int
    n_direct: int
    planes: tuple[FurniturePlane, ...]
    rules: tuple[str, ...]
    alternatives: tuple[str, ...]
    first_seen_s: float
    last_seen_s: float
    cad: CadFit | None = None
    frames_s: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class FurnitureChange:
    """What an update changed.

    Attributes:
        kind: `appeared`, `changed` (pose, size, planes or score) or `disappeared`.
        item: the piece as it is now; as it last was, if it disappeared.
    """

    kind: Literal["appeared", "changed", "disappeared"]
    item: FurnitureItem


def box_overlap(a: BoundingBox, b: BoundingBox) -> float:
    """Common footprint of two upright boxes as a share of the smaller one."""
    first, second = _box_footprint(a), _box_footprint(b)
    smaller = min(first.area, second.area)
    return float(first.intersection(second).area / smaller) if smaller > 1e-6 else 0.0


def _box_footprint(box: BoundingBox) -> Polygon:
    corners = box.corners()[[0, 2, 6, 4], :2]  # the bottom face, in order around it
    return Polygon(corners)
