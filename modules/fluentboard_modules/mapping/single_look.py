"""Recordings of a few frames, such as one cloud: searched in one look, since memory needs more.

Belief by memory takes several frames (`ExistenceConfig`). Of a single image or of one registered
cloud that is all there is, so what verification says of a piece is what is believed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import count

from fluentboard.model.geometry import Plane
from fluentboard_modules.frames.sensor_frame import SensorFrame
from fluentboard_modules.mapping.cad_library import CadLibrary
from fluentboard_modules.mapping.candidates import Candidate, placing_area
from fluentboard_modules.mapping.cloud_regions import regions_of_cloud
from fluentboard_modules.mapping.config import MappingConfig
from fluentboard_modules.mapping.depth_views import ViewMemory
from fluentboard_modules.mapping.floor import sloping_floor
from fluentboard_modules.mapping.furniture_item import FurnitureItem, FurniturePlane, box_overlap
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
    known: Sequence[FurnitureItem] = (),
) -> Look:
    """Searches a few frames for furniture.

    Args:
        frames: with the planar regions of each; one at least.
        rules: the furniture ontology.
        library: CAD models.
        config: of all steps.
        known: what was told of these frames already; what is found there keeps its identifier.
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
    free, taken = list(known), {item.identifier for item in known}
    items: list[FurnitureItem] = []
    for piece in found:
        if piece.fit is None:
            continue
        name, least = piece.furniture.name, config.furniture.same_place_overlap
        here = next((one for one in free if _is_at(one, piece, least)), None)
        if here is not None:
            free.remove(here)
            identifier = here.identifier
        else:
            names = (f"{name[0].lower()}{name[1:]}{number}" for number in count(1))
            identifier = next(one for one in names if one not in taken)
            taken.add(identifier)
        items.append(_described(piece, identifier, stamps, config))
    identifiers = range(len(regions))
    explained = {plane.identifier for item in items for plane in item.planes}
    misses = unexplained(
        classification, identifiers, regions, dict.fromkeys(identifiers, len(frames)), explained
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


def _is_at(item: FurnitureItem, piece: Candidate, least_overlap: float) -> bool:
    is_alike = item.class_name == piece.furniture.name
    return is_alike and box_overlap(item.box, piece.geometry.box) >= least_overlap


def _described(
    piece: Candidate, identifier: str, stamps: tuple[float, ...], config: MappingConfig
) -> FurnitureItem:
    fit, name = piece.fit, piece.furniture.name
    existence = config.furniture.fusion.existence
    planes = tuple(
        FurniturePlane(plane.identifier, plane.label, plane.region, len(stamps))
        for plane in piece.planes
    )
    return FurnitureItem(
        identifier=identifier,
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
