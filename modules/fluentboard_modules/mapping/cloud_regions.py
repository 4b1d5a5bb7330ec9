"""A cloud without rows and columns to planar regions in the map frame (section 3.2.1)."""

from __future__ import annotations

import itertools
import logging
from dataclasses import dataclass

import cv2
import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.affinity import affine_transform
from shapely.geometry import MultiPolygon, Polygon

from fluentboard.model.geometry import FloatArray, Transform
from fluentboard_modules.mapping.cloud_normals import fit_cloud_planes
from fluentboard_modules.mapping.cloud_segments import segment_cloud
from fluentboard_modules.mapping.config import CloudConfig, ContourConfig
from fluentboard_modules.mapping.contours import tidy
from fluentboard_modules.mapping.planar_region import (
    PlanarRegion,
    as_multipolygon,
    contour_gap_m,
    region_axes,
)
from fluentboard_modules.mapping.voxel_cloud import VoxelCloud

logger = logging.getLogger(__name__)


_VOXEL_NOISE_M = 0.002


@dataclass(frozen=True, slots=True, eq=False)
class _Segment:
    """Voxels of one plane.

    Attributes:
        voxels: `(k,)`; their rows in the cloud.
        normal: `(3,)`; towards the sensor.
        centre: `(3,)`; mean of the voxels.
        rms_m: of their distances from the plane.
    """

    voxels: NDArray[np.int64]
    normal: FloatArray
    centre: FloatArray
    rms_m: float


def regions_of_cloud(
    cloud: VoxelCloud, config: CloudConfig, contours: ContourConfig
) -> list[PlanarRegion]:
    """The planar regions of a scene, largest first; why there is none goes to the log.

    Args:
        cloud: the scene, from `SceneCloud`.
        config: see `CloudConfig`.
        contours: tolerances of outlines.
    """
    if len(cloud) < config.seed_voxels:
        logger.warning(
            "no planes: the cloud fills %d voxels of %g m, a plane needs %d; points may be "
            "duplicates, in another unit than metres, or invalid",
            len(cloud),
            cloud.voxel_m,
            config.seed_voxels,
        )
        return []
    planes = fit_cloud_planes(cloud)
    labels = segment_cloud(cloud, planes, config)
    if not (labels >= 0).any():
        logger.warning(
            "no planes: in none of %d places do %d voxels lie within %g m of a common plane",
            len(cloud),
            config.seed_voxels,
            config.grow_distance_m,
        )
        return []
    outlined = [
        (segment, region)
        for segment in _segments(cloud, labels, planes.normals)
        if (region := _region(cloud, segment, contours)) is not None
    ]
    regions: list[PlanarRegion] = []
    for group in _coplanar_groups(cloud, outlined, config):
        if len(group) == 1:
            regions.append(outlined[group[0]][1])
            continue
        voxels = np.concatenate([outlined[index][0].voxels for index in group])
        region = _region(cloud, _segment(cloud, voxels, planes.normals), contours)
        if region is not None:
            regions.append(region)
    found = sorted(
        (region for region in regions if region.area_m2 >= contours.smallest_region_m2),
        key=lambda region: -region.area_m2,
    )
    return [region.numbered(index) for index, region in enumerate(found)]


def _segments(cloud: VoxelCloud, labels: NDArray[np.int32], normals: FloatArray) -> list[_Segment]:
    order = np.argsort(labels, kind="stable")
    bounds = np.searchsorted(labels[order], np.arange(int(labels.max()) + 2))
    return [
        _segment(cloud, order[first:last], normals) for first, last in itertools.pairwise(bounds)
    ]


def _segment(cloud: VoxelCloud, voxels: NDArray[np.int64], normals: FloatArray) -> _Segment:
    normal, centre, rms_m = _fitted(cloud.points[voxels])
    if normal @ normals[voxels].sum(axis=0) < 0.0:
        normal = -normal
    return _Segment(voxels, normal, centre, rms_m)


def _fitted(points: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """Unit normal, mean and root mean square distance of points `(n, 3)` from their plane."""
    centre = points.mean(axis=0)
    spread = points - centre
    values, vectors = np.linalg.eigh(spread.T @ spread / len(points))
    return vectors[:, 0], centre, float(np.sqrt(max(values[0], 0.0)))


def _region(cloud: VoxelCloud, segment: _Segment, contours: ContourConfig) -> PlanarRegion | None:
    """The outlined region of a segment; None if it is too ragged to have an outline."""
    points = cloud.points[segment.voxels]
    axes = region_axes(segment.normal, points - segment.centre)
    on_plane = (points - segment.centre) @ axes[:, :2]
    contour = outline_of_points(on_plane, cloud.voxel_m, contours)
    if contour.is_empty:
        return None
    middle = contour.centroid
    origin = segment.centre + axes[:, :2] @ (middle.x, middle.y)
    towards = cloud.towards_sensor[segment.voxels].sum(axis=0)
    length = float(np.linalg.norm(towards))
    return PlanarRegion(
        index=0,
        T_map_region=Transform.from_parts(axes, origin),
        contour=as_multipolygon(affine_transform(contour, [1, 0, 0, 1, -middle.x, -middle.y])),
        n_points=int(cloud.counts[segment.voxels].sum()),
        rms_m=segment.rms_m,
        # Of many views only the mean direction is known; a metre along it faces the same side.
        sensor_position=origin + (towards / length if length > 0.0 else segment.normal),
        # The mean of a voxel's points has little noise left.
        excess_m2=segment.rms_m**2 - _VOXEL_NOISE_M**2,
    )


def outline_of_points(points: FloatArray, cell_m: float, config: ContourConfig) -> MultiPolygon:
    """The outline, with holes, of the cells that points fill.

    Args:
        points: `(n, 2)`; on the plane, metres, about one per cell.
        cell_m: edge length of a cell.
        config: tolerances.
    """
    low = points.min(axis=0) - 0.5 * cell_m  # points lie near the middles of cells
    columns, rows = ((points - low) / cell_m).astype(np.int64).T
    filled = np.zeros((int(rows.max()) + 1, int(columns.max()) + 1), dtype=np.uint8)
    filled[rows, columns] = 1
    # Twice as fine, so that the outline, which runs through the centres of pixels, leaves no cell
    # out; voxels askew to the cells leave single ones empty, which closing fills.
    fine = np.pad(filled.repeat(2, axis=0).repeat(2, axis=1), 6)
    fine = cv2.morphologyEx(fine, cv2.MORPH_CLOSE, np.ones((5, 5), np.uint8))
    rings, hierarchy = cv2.findContours(fine, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_SIMPLE)
    if hierarchy is None:
        return MultiPolygon()
    corners = [((ring[:, 0, :] - 6.0) / 2.0 + 0.25) * cell_m + low for ring in rings]
    parts: list[Polygon] = []
    for number, (_, _, _, parent) in enumerate(hierarchy[0]):
        if parent < 0 and len(corners[number]) >= 3:
            holes = [
                corners[child]
                for child, (_, _, _, its_parent) in enumerate(hierarchy[0])
                if its_parent == number and len(corners[child]) >= 3
            ]
            parts.append(Polygon(corners[number], holes))
    contour = MultiPolygon(parts)
    if not contour.is_valid:
        contour = as_multipolygon(shapely.make_valid(contour))
    # From the centres of the outermost pixels to the edges of their cells.
    grown = contour.buffer(0.25 * cell_m, join_style="mitre")
    return tidy(as_multipolygon(grown), config)


def _coplanar_groups(
    cloud: VoxelCloud,
    outlined: list[tuple[_Segment, PlanarRegion]],
    config: CloudConfig,
) -> list[list[int]]:
    """Which segments are one surface that only a shadow parts; alone where there is no other.

    Two are joined if either fits the common plane hardly worse than its own, as in the image.
    """
    groups: dict[int, list[int]] = {index: [index] for index in range(len(outlined))}
    if len(outlined) < 2:
        return list(groups.values())
    normals = np.array([segment.normal for segment, _ in outlined])
    centres = np.array([segment.centre for segment, _ in outlined])
    boxes = np.array([region.bounds_map() for _, region in outlined])
    gap = config.merge_gap_m
    alike = normals @ normals.T >= np.cos(np.deg2rad(config.merge_angle_deg))
    # The plane of one of them passes near the other's centre.
    offset = np.abs(np.einsum("ik,ijk->ij", normals, centres[None, :] - centres[:, None]))
    alike &= np.minimum(offset, offset.T) <= config.merge_distance_m
    alike &= (boxes[:, None, 0] <= boxes[None, :, 1] + gap).all(axis=2)
    alike &= (boxes[None, :, 0] <= boxes[:, None, 1] + gap).all(axis=2)
    root = list(range(len(outlined)))
    for a, b in np.argwhere(np.triu(alike, 1)).tolist():
        first, second = root[a], root[b]
        if first == second or contour_gap_m(outlined[a][1], outlined[b][1]) > gap:
            continue
        parts = [
            np.concatenate([cloud.points[outlined[index][0].voxels] for index in groups[one]])
            for one in (first, second)
        ]
        normal, centre, _ = _fitted(np.concatenate(parts))
        misfit = max(float(np.sqrt(np.mean(((part - centre) @ normal) ** 2))) for part in parts)
        if misfit > config.merge_misfit_m:
            continue
        groups[first] += groups.pop(second)
        root = [first if one == second else one for one in root]
    return list(groups.values())
