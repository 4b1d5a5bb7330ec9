"""Areas on the floor at furniture, as in Section 2.4: where chairs stand, where a robot can reach.

A SittingArea is the floor that a chair occupies. A ManipulationArea is the floor from which a robot
reaches what stands on a top: before a piece with a front, and along both longer sides of the rest.
Whether a robot fits there is for its navigation to say.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.geometry import BoundingBox, Pose, Transform
from fluentboard.model.interval import UNKNOWN, Interval
from fluentboard_modules.geometry_fluents import box_fluents
from fluentboard_modules.mapping.furniture_item import FurnitureItem

_DEPTH_M = 0.7  # of a manipulation area: a PR2 with its base is 0.67 m square
_GAP_M = 0.05  # between a piece and a robot in front of it


@dataclass(frozen=True, slots=True)
class WrittenArea:
    """An area that the board has been told about.

    Attributes:
        name: of its fluent.
        class_name: `SittingArea` or `ManipulationArea`.
        parts: names of its present box and box-pose fluents.
    """

    name: str
    class_name: str
    parts: tuple[str, ...]


def floor_areas(item: FurnitureItem, symmetry_order: int) -> list[tuple[str, BoundingBox]]:
    """Class and place of the areas on the floor at a piece; boxes without height, map frame.

    Args:
        item: the piece.
        symmetry_order: of its class; 1 for a piece with a front.
    """
    box = item.box
    floor = Pose.from_rpy(box.pose.x, box.pose.y, 0.0, yaw=box.pose.yaw_rad)
    if item.placing_area is None:
        return [("SittingArea", BoundingBox(floor, box.x_size, box.y_size, 0.0))]
    along_x = 0.5 * (box.x_size + _DEPTH_M) + _GAP_M
    along_y = 0.5 * (box.y_size + _DEPTH_M) + _GAP_M
    if symmetry_order == 1:
        # Its front is where its pose looks: the box may be turned by a quarter.
        front = item.pose.to_transform().rotation[:, 0]
        ahead = floor.to_transform().rotation.T @ front
        axis = int(np.argmax(np.abs(ahead[:2])))
        sign = 1.0 if ahead[axis] >= 0.0 else -1.0
        places = [(sign * along_x, 0.0) if axis == 0 else (0.0, sign * along_y)]
    elif box.x_size <= box.y_size:
        places = [(along_x, 0.0), (-along_x, 0.0)]
    else:
        places = [(0.0, along_y), (0.0, -along_y)]
    areas: list[tuple[str, BoundingBox]] = []
    for x, y in places:
        T_floor_area = Transform.from_parts(np.eye(3), np.array([x, y, 0.0]))
        pose = Pose.from_transform(floor.to_transform() @ T_floor_area)
        sizes = (_DEPTH_M, box.y_size) if x else (box.x_size, _DEPTH_M)
        areas.append(("ManipulationArea", BoundingBox(pose, *sizes, 0.0)))
    return areas


def area_fluents(
    owner: str,
    item: FurnitureItem,
    areas: Sequence[tuple[str, BoundingBox]],
    known: Sequence[WrittenArea],
    generation: int,
    since: Interval,
) -> tuple[tuple[WrittenArea, ...], list[Fluent], list[str]]:
    """The areas of a piece as fluents, new or with new boxes.

    Args:
        owner: name of the piece.
        item: the piece.
        areas: from `floor_areas`.
        known: what has been written of them.
        generation: number of their present boxes.
        since: since when.

    Returns:
        What has been written then, the fluents to write, and the names of those that end.
    """
    written: list[WrittenArea] = []
    statements: list[Fluent] = []
    for number, (class_name, box) in enumerate(areas):
        before = known[number] if number < len(known) else None
        stem = class_name[0].lower() + class_name[1:] + owner[0].upper() + owner[1:]
        # A name is used once: a piece that was away has new areas.
        again = f"_{generation}" if generation else ""
        name = before.name if before is not None else f"{stem}_{number + 1}{again}"
        tag = f"{name[0].upper()}{name[1:]}_{generation}"
        parts = box_fluents(f"bBox{tag}", f"poseBB{tag}", box, since)
        properties = [Property("hasBoundingBox", "BBox", parts[0].name)]
        if before is None:
            properties.append(Property("isAreaOf", item.class_name, owner))
        start = since if before is None else UNKNOWN
        statements += [*parts, Fluent(name, class_name, start, UNKNOWN, tuple(properties))]
        written.append(WrittenArea(name, class_name, tuple(part.name for part in parts)))
    ended = [part for area in known for part in area.parts]
    ended += [area.name for area in known[len(areas) :]]
    return tuple(written), statements, ended
