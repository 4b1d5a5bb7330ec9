"""Recordings of a few frames, such as one cloud: searched in one look, since memory needs more.

Belief by memory takes several frames (`ExistenceConfig`). Of a single image or of one registered
cloud that is all there is, so what verification says of a piece is what is believed.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from fluentboard.model.geometry import Plane
from fluentboard_modules.frames.sensor_frame import SensorFrame
from fluentboard_modules.mapping.cad_library import CadLibrary
from fluentboard_modules.mapping.candidates import Candidate, placing_area
from fluentboard_modules.mapping.cloud_regions import regions_of_cloud
from fluentboard_modules.mapping.config import MappingConfig
from fluentboard_modules.mapping.depth_views import ViewMemory
from fluentboard_modules.mapping.floor import sloping_floor
from fluentboard_modules.mapping.furniture_item import FurnitureItem, FurniturePlane
from fluentboard_modules.mapping.loose_planes import unexplained
from fluentboard_modules.mapping.near_misses import NearMiss
from fluentboard_modules.mapping.planar_region import PlanarRegion
from fluentboard_modules.mapping.rules import Classification, FurnitureRules
from fluentboard_modules.mapping.single_frame import find_furniture
from fluentboard_modules.mapping.voxel_cloud import SceneCloud


@dataclass(frozen=True, eq=False)
class Look:
    """What one look at a few frames found.

    Attributes:
        furniture: the pieces.
        regions: the planes.
        classification: what the ontology says about them.
        near_misses: planes that nearly are furniture and belong to no piece, the nearest first.
    """

    furniture: list[FurnitureItem]
    regions: list[PlanarRegion]
    classification: Classification
    near_misses: list[tuple[NearMiss, FurniturePlane]]


def look_at(
    frames: Sequence[tuple[SensorFrame, Sequence[PlanarRegion]]],
    rules: FurnitureRules,
    library: CadLibrary,
    config: MappingConfig,
) -> Look:
    """Searches a few frames for furniture.

    Args:
        frames: with the planar regions of each; one at least.
        rules: the furniture ontology.
        library: CAD models.
        config: of all steps.
    """
    views = ViewMemory(config.surfaces.noise)
    for frame, _ in frames:
        views.add(frame)
    regions = _regions_of(frames, config)
    floor: Plane | None = None
    if len(frames) > 1 or frames[0][0].cloud_sensor is not None:
        floor = sloping_floor(regions, config.furniture.floor_reach_m)
    classification = rules.classify(regions, floor=floor)
    found = find_furniture(regions, views.since(), rules, library, config, floor).furniture
    stamps = tuple(frame.stamp_s for frame, _ in frames)
    numbers: Counter[str] = Counter()
    items: list[FurnitureItem] = []
    for piece in found:
        if piece.fit is not None:
            numbers[piece.furniture.name] += 1
            items.append(_described(piece, numbers[piece.furniture.name], stamps, config))
    identifiers = range(len(regions))
    taken = {plane.identifier for item in items for plane in item.planes}
    misses = unexplained(
        classification, identifiers, regions, dict.fromkeys(identifiers, len(frames)), taken
    )
    return Look(items, regions, classification, misses)


def _regions_of(
    frames: Sequence[tuple[SensorFrame, Sequence[PlanarRegion]]], config: MappingConfig
) -> list[PlanarRegion]:
    """The planes of one frame, or of several registered into one cloud."""
    if len(frames) == 1:
        return list(frames[0][1])
    cloud = SceneCloud(config.surfaces.cloud.voxel_m)
    for frame, _ in frames:
        near = frame.valid & (frame.depth_m <= config.surfaces.range_max_m)
        cloud.add(frame.points_map()[near], frame.T_map_sensor.translation)
    return regions_of_cloud(cloud.voxels(), config.surfaces.cloud, config.surfaces.contours)


def _described(
    piece: Candidate, number: int, stamps: tuple[float, ...], config: MappingConfig
) -> FurnitureItem:
    fit, name = piece.fit, piece.furniture.name
    existence = config.furniture.fusion.existence
    planes = tuple(
        FurniturePlane(plane.identifier, plane.label, plane.region, len(stamps))
        for plane in piece.planes
    )
    return FurnitureItem(
        identifier=f"{name[0].lower()}{name[1:]}{number}",
        class_name=name,
        pose=piece.geometry.pose,
        box=piece.geometry.box,
        placing_area=placing_area(piece, config.furniture.hypotheses),
        score=min(0.0 if fit is None else fit.score, existence.belief_max),
        n_frames=len(stamps),
        n_direct=len(stamps),
        planes=planes,
        rules=piece.hypothesis.rules,
        alternatives=(),
        first_seen_s=stamps[0],
        last_seen_s=stamps[-1],
        cad=fit,
        frames_s=stamps,
    )
