"""Mapping of any recording against furniture labels: precision, recall, F1 and errors."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fluentboard.model.geometry import BoundingBox, FloatArray, Pose
from fluentboard_modules.frames.sensor_frame import SensorFrame
from fluentboard_modules.mapping.cad_library import CadLibrary
from fluentboard_modules.mapping.config import MappingConfig
from fluentboard_modules.mapping.evaluation import TruePiece, tolerance_m
from fluentboard_modules.mapping.furniture_item import FurnitureItem
from fluentboard_modules.mapping.furniture_map import FurnitureMap
from fluentboard_modules.mapping.judge import FurnitureJudge
from fluentboard_modules.mapping.planar_region import PlanarRegion
from fluentboard_modules.mapping.protocol import Detection, Row, TrueObject, rate, totals
from fluentboard_modules.mapping.rules import FurnitureRules
from fluentboard_modules.mapping.single_look import look_at
from fluentboard_modules.mapping.surfaces import detect_regions


@dataclass(frozen=True, slots=True)
class LabelledTrial:
    """What came out of a recording with labels.

    Attributes:
        rows: by class, and their `total`, as in Table 3.1.
        found: the furniture.
        size_errors_m: per piece found, the largest error of its three sizes.
        n_frames: how many frames.
    """

    rows: Mapping[str, Row]
    found: tuple[FurnitureItem, ...]
    size_errors_m: tuple[float, ...]
    n_frames: int


def run_labelled(
    frames: Iterable[SensorFrame],
    labels: Sequence[TruePiece],
    rules: FurnitureRules,
    library: CadLibrary,
    config: MappingConfig,
) -> LabelledTrial:
    """Maps a recording as the worker does, and compares the furniture with the labels.

    Args:
        frames: in the map frame.
        labels: what stands there.
        rules: the furniture ontology.
        library: CAD models.
        config: of all steps.
    """
    noise = config.surfaces.noise
    judge = FurnitureJudge(library, config.verification, noise)
    room = FurnitureMap(rules, config.furniture, noise, judge)
    few: list[tuple[SensorFrame, Sequence[PlanarRegion]]] = []
    n_frames = 0
    for frame in frames:
        regions = detect_regions(frame, config.surfaces)
        room.update(frame, regions)
        n_frames += 1
        if n_frames <= config.furniture.look_frames:
            few.append((frame, regions))
    if 0 < n_frames == len(few):
        found = tuple(look_at(few, rules, library, config).furniture)
    else:
        room.settle()
        found = tuple(room.furniture())
    orders = {furniture.name: furniture.symmetry_order for furniture in rules.furniture_classes}
    return LabelledTrial(
        rate_labelled(found, labels, orders),
        found,
        _size_errors(found, labels),
        n_frames,
    )


def rate_labelled(
    found: Sequence[FurnitureItem], labels: Sequence[TruePiece], orders: Mapping[str, int]
) -> dict[str, Row]:
    """The rows of Table 3.1 by class, and their `total`.

    A piece counts as found if it is of the class and as near as the thesis asks: 15 cm for chairs,
    25 cm for shelves and cabinets, 45 cm for the rest, between the middles of the boxes.

    Args:
        found: by mapping.
        labels: what stands there.
        orders: per class, how many turns about the vertical look alike.
    """
    true = [
        TrueObject(
            piece.name,
            piece.class_name,
            piece.class_name,
            _facing(piece.box, piece.box.pose.yaw_rad, orders.get(piece.class_name, 1)),
            orders.get(piece.class_name, 1),
        )
        for piece in labels
    ]
    detections: list[Detection] = []
    for item in found:
        order = orders.get(item.class_name, 1)
        final = initial = _facing(item.box, item.pose.yaw_rad, order)
        if item.cad is not None and item.cad.is_exact:
            # The box moves with the model: what verification changed is undone.
            before, after = item.cad.initial_pose, item.cad.pose
            initial = Pose.from_rpy(
                final.x + before.x - after.x,
                final.y + before.y - after.y,
                final.z,
                yaw=final.yaw_rad + before.yaw_rad - after.yaw_rad,
            )
        detections.append(Detection(item.class_name, final, initial, item.score))
    return totals([rate(detections, true, {one.name for one in true})])


def _facing(box: BoundingBox, front_rad: float, order: int) -> Pose:
    """Middle of a box, looking to the front, or along the longer side of a piece without one."""
    yaw_rad = front_rad
    if order > 1:
        yaw_rad = box.pose.yaw_rad + (0.0 if box.x_size >= box.y_size else 0.5 * math.pi)
    return Pose.from_rpy(box.pose.x, box.pose.y, box.pose.z, yaw=yaw_rad)


def _size_errors(found: Sequence[FurnitureItem], labels: Sequence[TruePiece]) -> tuple[float, ...]:
    """Of each piece found at a label of its class, against the nearest of them."""
    errors: list[float] = []
    for item in found:
        same = [piece for piece in labels if piece.class_name == item.class_name]
        if not same:
            continue
        nearest = min(same, key=lambda piece: _apart_m(piece.box, item.box))
        if _apart_m(nearest.box, item.box) <= tolerance_m(item.class_name):
            errors.append(float(np.abs(_sizes(nearest.box) - _sizes(item.box)).max()))
    return tuple(errors)


def _sizes(box: BoundingBox) -> FloatArray:
    """Shorter and longer side, and height: which is called x says nothing."""
    return np.array([*sorted(box.sizes[:2]), box.z_size])


def _apart_m(a: BoundingBox, b: BoundingBox) -> float:
    return math.hypot(a.pose.x - b.pose.x, a.pose.y - b.pose.y)
