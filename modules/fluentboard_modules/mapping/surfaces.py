"""A depth image to planar regions in the map frame (section 3.2.1)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import find_objects
from shapely.affinity import affine_transform

from fluentboard.model.geometry import FloatArray, Transform
from fluentboard_modules.frames.sensor_frame import SensorFrame
from fluentboard_modules.mapping.cloud_regions import regions_of_cloud
from fluentboard_modules.mapping.config import SurfacesConfig
from fluentboard_modules.mapping.contours import trace_contour
from fluentboard_modules.mapping.normals import fit_local_planes
from fluentboard_modules.mapping.planar_region import (
    PlanarRegion,
    as_multipolygon,
    contour_gap_m,
    region_axes,
)
from fluentboard_modules.mapping.plane_merger import PlaneMerger
from fluentboard_modules.mapping.segments import (
    Cells,
    Segments,
    local_directions,
    make_cells,
    plane_distance_m,
    segment_planes,
    summarise,
)
from fluentboard_modules.mapping.voxel_cloud import SceneCloud


def detect_regions(frame: SensorFrame, config: SurfacesConfig) -> list[PlanarRegion]:
    """The planar regions one frame shows, largest first, in the map frame.

    Args:
        frame: a depth image or an unorganised cloud; without a single plane in it the result is
            empty.
        config: see `SurfacesConfig`.
    """
    if frame.cloud_sensor is not None:
        scene = SceneCloud(config.cloud.voxel_m)
        scene.add(frame.T_map_sensor.apply(frame.cloud_sensor), frame.T_map_sensor.translation)
        return regions_of_cloud(scene.voxels(), config.cloud, config.contours)
    depth_m = np.where(frame.valid, frame.depth_m, np.float32(0.0)).astype(np.float32, copy=False)
    if not depth_m.any():
        return []
    local = fit_local_planes(
        depth_m, frame.camera, config.normals, config.noise, config.segmentation.step_px
    )
    cells = make_cells(
        local, frame.camera, config.noise, config.range_max_m, config.segmentation.step_px
    )
    segments = segment_planes(cells, config.segmentation)
    regions = _outline(frame, cells, segments, range(segments.counts.size), config)
    segments, changed = _merge_across_gaps(cells, segments, regions, config)
    if changed:
        kept = {index: region for index, region in regions.items() if index not in changed}
        still_there = [index for index in changed if segments.counts[index] > 0]
        regions = kept | _outline(frame, cells, segments, still_there, config)
    found = sorted(
        (
            region
            for region in regions.values()
            if region.area_m2 >= config.contours.smallest_region_m2
        ),
        key=lambda region: -region.area_m2,
    )
    return [replace(region, index=index) for index, region in enumerate(found)]


def _outline(
    frame: SensorFrame,
    cells: Cells,
    segments: Segments,
    indices: range | list[int],
    config: SurfacesConfig,
) -> dict[int, PlanarRegion]:
    """The regions of the given segments, by segment; those without any contour are left out."""
    windows = find_objects(segments.labels + 1, max_label=segments.counts.size)
    regions: dict[int, PlanarRegion] = {}
    for index in indices:
        rows, columns = windows[index]
        mask = segments.labels[rows, columns] == index
        plane = segments.coefficients[index]
        T_camera_region = _region_axes(cells, (rows, columns), mask, plane, frame.T_map_sensor)
        contour = trace_contour(
            mask,
            (rows.start, columns.start),
            cells.step_px,
            frame.camera,
            plane,
            T_camera_region,
            config.contours,
        )
        if contour.is_empty:
            continue
        # The origin moves to the centre of area.
        centre = contour.centroid
        T_camera_region[:3, 3] += T_camera_region[:3, :2] @ (centre.x, centre.y)
        contour = as_multipolygon(affine_transform(contour, [1, 0, 0, 1, -centre.x, -centre.y]))
        distance = plane_distance_m(cells, plane, (rows, columns))[mask]
        step = cells.step_px
        border = config.contours.edge_margin_px
        regions[index] = PlanarRegion(
            index=index,
            T_map_region=frame.T_map_sensor @ Transform(T_camera_region),
            contour=contour,
            n_points=int(np.count_nonzero(mask)) * step * step,
            rms_m=float(np.sqrt(np.mean(distance**2))),
            touches_edge=bool(
                rows.start * step <= border
                or columns.start * step <= border
                or (rows.stop - 1) * step >= frame.camera.height - 1 - border
                or (columns.stop - 1) * step >= frame.camera.width - 1 - border
            ),
            sensor_position=frame.T_map_sensor.translation,
            excess_m2=float(
                np.mean(distance**2 - _noise_m2(cells, plane, (rows, columns), mask, config))
            ),
            pixel_box=(
                rows.start * step,
                columns.start * step,
                rows.stop * step,
                columns.stop * step,
            ),
            pixel_mask=mask,
        )
    return regions


def _noise_m2(
    cells: Cells,
    plane: FloatArray,
    window: tuple[slice, slice],
    mask: NDArray[np.bool_],
    config: SurfacesConfig,
) -> FloatArray:
    """`(n,)`; variance that the sensor's noise gives to the distance from a plane, per cell."""
    noise = config.noise
    rays = cells.rays[window][mask].astype(np.float64)
    toward = rays @ plane
    depth = 1.0 / np.maximum(toward, 1e-3)
    sigma = noise.constant_m + noise.quadratic_per_m * np.maximum(depth - noise.reference_m, 0) ** 2
    variance = sigma**2 + (noise.quantisation_per_m * depth**2) ** 2
    variance *= 1.0 + noise.doubt_share
    return variance * (toward / np.linalg.norm(plane)) ** 2


def _region_axes(
    cells: Cells,
    window: tuple[slice, slice],
    mask: NDArray[np.bool_],
    plane: FloatArray,
    T_map_camera: Transform,
) -> FloatArray:
    """`(4, 4)`; region coordinates to camera coordinates, origin near the middle of the cells."""
    rays = cells.rays[window][mask].astype(np.float64)
    points = rays / np.maximum(rays @ plane, 1e-3)[:, None]
    origin = points.mean(axis=0)
    length = np.linalg.norm(plane)
    origin += plane * (1.0 - float(plane @ origin)) / length**2  # back onto the plane exactly
    normal_map = T_map_camera.rotate(-plane / length)
    # A far cell covers more surface, so it weighs more: area goes with the square of depth.
    axes_map = region_axes(normal_map, T_map_camera.rotate(points - origin), points[:, 2] ** 2)
    T_camera_region = np.eye(4)
    T_camera_region[:3, :3] = T_map_camera.rotation.T @ axes_map
    T_camera_region[:3, 3] = origin
    return T_camera_region


def _merge_across_gaps(
    cells: Cells, segments: Segments, regions: dict[int, PlanarRegion], config: SurfacesConfig
) -> tuple[Segments, set[int]]:
    """Joins coplanar segments that an object in front has cut apart.

    Returns:
        The new segments, numbered as before (a segment that was swallowed has no cells), and which
        segments changed.
    """
    gap = config.segmentation.merge_gap_m
    boxes = {index: region.bounds_map() for index, region in regions.items()}
    outlines = {index: region.outline_map() for index, region in regions.items()}
    indices = sorted(regions)
    pairs: list[tuple[int, int]] = []
    for position, a in enumerate(indices):
        for b in indices[position + 1 :]:
            if regions[a].normal @ regions[b].normal < 0.95:
                continue
            if np.any(boxes[a][0] > boxes[b][1] + gap) or np.any(boxes[b][0] > boxes[a][1] + gap):
                continue
            a_from_b = regions[a].T_map_region.inverse().apply(outlines[b])
            # A cheap bound before the polygons: the other's outline is near this plane.
            if np.median(np.abs(a_from_b[:, 2])) > gap:
                continue
            pairs.append((a, b))
    near = [(a, b) for a, b in pairs if contour_gap_m(regions[a], regions[b]) <= gap]
    if not near:
        return segments, set()
    merger = PlaneMerger(
        segments.moments,
        segments.counts,
        local_directions(cells, segments),
        config.segmentation,
    )
    merger.merge(near)
    root = merger.new_labels()
    swallowed = np.flatnonzero(root != np.arange(root.size))
    if swallowed.size == 0:
        return segments, set()
    labels = np.where(segments.labels >= 0, root[segments.labels], -1).astype(np.int32)
    changed = set(swallowed.tolist()) | set(root[swallowed].tolist())
    return summarise(cells, labels, segments.counts.size), changed
