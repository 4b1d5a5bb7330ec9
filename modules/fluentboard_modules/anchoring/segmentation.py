"""One frame to the clusters of points that stand on its tops (Section 4.2.1).

Points above a top are joined across neighbouring pixels of nearly the same depth, so that an object
before another is not one with it; fragments return to the part they were torn off; touching objects
are cut where their common silhouette has a waist (`splitting`). What continues below or beside the
top, such as the back of a chair or a wall, stands on the floor and is left out.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from fluentboard.model.geometry import BoundingBox, FloatArray, Pose
from fluentboard_modules.anchoring.config import SegmentationConfig
from fluentboard_modules.anchoring.extents import quantile, turned_extent
from fluentboard_modules.anchoring.fragments import PartMask, rejoined
from fluentboard_modules.anchoring.hollows import joined_around_hollows
from fluentboard_modules.anchoring.observation import Cluster, SupportPlane
from fluentboard_modules.anchoring.organised import OrganisedPoints
from fluentboard_modules.anchoring.pixel_parts import join_pixels, rises, windows
from fluentboard_modules.anchoring.splitting import split_touching
from fluentboard_modules.anchoring.supports import Top
from fluentboard_modules.frames.sensor_frame import SensorFrame

_TOP, _ABOVE, _OTHER = 1, 2, 3  # classes of pixels, as `rises` gives them
_REACH_M = 0.04  # objects may stand over the edge by this
_TRIM = 1.0  # per cent of the points at either side that may be flying pixels
_TURN_POINTS = 400  # are enough to tell how a box is turned


@dataclass(frozen=True, slots=True, eq=False)
class Segmentation:
    """What a frame shows of tops and the objects on them.

    Attributes:
        clusters: the objects.
        tops: what they stand on.
        labels: `(h, w)` int32; number of the cluster of each pixel from 1, 0 for none.
    """

    clusters: tuple[Cluster, ...]
    tops: tuple[Top, ...]
    labels: NDArray[np.int32]


def segment(
    frame: SensorFrame, points: OrganisedPoints, tops: Sequence[Top], config: SegmentationConfig
) -> Segmentation:
    """The objects on tops.

    Args:
        frame: placed in the map.
        points: of the frame.
        tops: of the frame, perhaps completed by what was seen before.
        config: what an object is.
    """
    labels = np.zeros(points.depth_m.shape, dtype=np.int32)
    clusters: list[Cluster] = []
    for top in tops:
        kind, rise = _classified(points, top, config)
        kind[labels > 0] = _OTHER
        parts, count = join_pixels(
            kind,
            points.points_map,
            points.depth_m,
            np.array([config.join_m, config.join_sigma * config.noise.quadratic_per_m]),
            config.join_gap_px,
        )
        parts = rejoined(parts, count, points, config)
        parts, count = split_touching(parts, count, points, top, config)
        parts = joined_around_hollows(parts, count, kind, rise, points, config)
        support = top.support()
        found = windows(parts, count)
        for number in np.argsort(-found[:, 0], kind="stable").tolist():
            if found[number, 0] < config.points_min:
                break
            mask = PartMask.of(parts, number, found[number])
            cluster = _cluster(mask, frame, points, kind, top, support, config)
            if cluster is not None:
                clusters.append(cluster)
                labels[tuple(cluster.pixels.T)] = len(clusters)
    return Segmentation(tuple(clusters), tuple(tops), labels)


def _classified(
    points: OrganisedPoints, top: Top, config: SegmentationConfig
) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
    """Per pixel: nothing, on the top, above it, or anything else; and how high above."""
    raster = top.raster
    grow = 2 * math.ceil(_REACH_M / raster.cell_m) + 1
    near = cv2.dilate(np.pad(raster.inside.astype(np.uint8), grow), np.ones((grow, grow), np.uint8))
    return rises(
        points.points_map,
        points.height_sigma_m,
        near,
        raster.corner_map - grow * raster.cell_m,
        raster.cell_m,
        np.array([*top.centre_map, *top.coefficients]),
        np.array([config.rise_m, config.rise_sigma, config.height_max_m]),
    )


def _cluster(
    mask: PartMask,
    frame: SensorFrame,
    points: OrganisedPoints,
    kind: NDArray[np.uint8],
    top: Top,
    support: SupportPlane,
    config: SegmentationConfig,
) -> Cluster | None:
    """The cluster of a part; None if it is no object on the top."""
    pixels = mask.pixels
    rows, columns = pixels.T
    cloud = points.points_map[rows, columns].astype(np.float64)
    covered = top.raster.covers(cloud)
    if covered.mean() < config.off_top_share:
        return None
    rise = np.sort(cloud[:, 2] - top.height_at(cloud))
    sigma = float(points.height_sigma_m[rows, columns].mean())
    tall = float(quantile(rise, 0.95))
    if tall < config.flat_m:
        tall -= _surroundings(mask, points, kind, top)
        if tall < config.height_min_m + config.height_min_sigma * sigma:
            return None
        if top.raster.borders(cloud, config.rim_m + config.rim_sigma * sigma):
            return None
    elif top.raster.core(config.rim_m).covers(cloud).mean() < config.core_share:
        return None  # seen over the edge: the back of a chair
    if rise[0] > 0.10:  # floats: a part of something that stands elsewhere
        return None
    if _hangs(mask, points, kind) > config.hang_share:
        return None
    box = upright_box(cloud, top)
    if max(box.x_size, box.y_size) > config.width_max_m or box.z_size >= config.height_max_m:
        return None
    margin = config.edge_margin_px
    height, width = points.depth_m.shape
    is_cut_off = bool(
        rows.min() < margin
        or columns.min() < margin
        or rows.max() >= height - margin
        or columns.max() >= width - margin
        or _borders_nothing(mask, points)
    )
    return Cluster(
        points_map=cloud,
        pixels=pixels,
        box=box,
        stamp_s=frame.stamp_s,
        viewpoint_map=points.viewpoint_map,
        colours=_colours(frame, pixels),
        support=support,
        is_cut_off=is_cut_off,
        is_occluded=_is_occluded(mask, points),
        sensor=frame.sensor,
    )


def _colours(frame: SensorFrame, pixels: NDArray[np.int64]) -> NDArray[np.uint8] | None:
    """`(n, 3)`; colours of depth pixels; black where the colour camera does not look."""
    if frame.colour is None:
        return None
    rows, columns = pixels.T
    if frame.colour_camera is None and frame.colour.shape[:2] == frame.depth_m.shape:
        return frame.colour[rows, columns]
    camera = frame.camera
    depth = frame.depth_m[rows, columns].astype(np.float64)
    rays = np.stack([(columns - camera.cx) / camera.fx, (rows - camera.cy) / camera.fy], axis=-1)
    cloud = np.concatenate([rays * depth[:, None], depth[:, None]], axis=1)
    if frame.T_colour_depth is not None:
        cloud = frame.T_colour_depth.apply(cloud)
    cloud[:, 2] = np.maximum(cloud[:, 2], 1e-3)
    places = np.rint((frame.colour_camera or camera).project(cloud))
    height, width = frame.colour.shape[:2]
    seen = np.all((places >= 0) & (places < (width, height)), axis=1)
    colours = np.zeros((len(pixels), 3), dtype=np.uint8)
    u, v = places[seen].astype(np.int64).T
    colours[seen] = frame.colour[v, u]
    return colours


def _surroundings(
    mask: PartMask, points: OrganisedPoints, kind: NDArray[np.uint8], top: Top
) -> float:
    """How high the top around a part lies above where it should be: cameras bend far corners."""
    window = (mask.rows, mask.columns)
    ring = mask.ring(4) & ~mask.ring(1) & (kind[window] == _TOP)
    around = points.points_map[window][ring].astype(np.float64)
    return float(np.median(around[:, 2] - top.height_at(around))) if len(around) else 0.0


def _hangs(mask: PartMask, points: OrganisedPoints, kind: NDArray[np.uint8]) -> float:
    """Share of the surroundings that continues the part but belongs to no top."""
    window = (mask.rows, mask.columns)
    ring = mask.ring(2)
    depth = points.depth_m[window]
    inner = np.where(mask.inside, depth, 0.0).astype(np.float32)
    nearby = cv2.dilate(inner, np.ones((7, 7), np.uint8))  # farthest depth of the part around
    close = np.abs(depth - nearby) < 0.03
    other = ring & (kind[window] == _OTHER) & close
    return float(other.sum()) / max(1, int(ring.sum()))


def _is_occluded(mask: PartMask, points: OrganisedPoints) -> bool:
    """Whether something nearer to the camera borders on a noticeable part of the outline."""
    window = (mask.rows, mask.columns)
    ring = mask.ring(3)
    depth = points.depth_m[window]
    inner = np.where(mask.inside, depth, np.inf).astype(np.float32)
    nearest = -cv2.dilate(-inner, np.ones((9, 9), np.uint8))
    nearer = ring & (depth > 0.0) & (depth < nearest - 0.03)
    return float(nearer.sum()) > 0.08 * max(1, int(ring.sum()))


def _borders_nothing(mask: PartMask, points: OrganisedPoints) -> bool:
    """Whether the depth image ends beside the part: registered images have an empty margin."""
    depth = points.depth_m
    rows, columns = depth.shape
    beside = 12
    left = mask.columns.start < 40 and not depth[mask.rows, : mask.columns.start].any()
    right = mask.columns.stop > columns - 40 and not depth[mask.rows, mask.columns.stop :].any()
    above = mask.rows.start < 40 and not depth[: mask.rows.start, mask.columns].any()
    below = mask.rows.stop > rows - beside and not depth[mask.rows.stop :, mask.columns].any()
    return bool(left or right or above or below)


def upright_box(cloud_map: FloatArray, top: Top) -> BoundingBox:
    """The smallest box turned about the vertical only, from the top to the highest points.

    Args:
        cloud_map: `(n, 3)`; points of an object.
        top: what it stands on.
    """
    centre = cloud_map[:, :2].mean(axis=0)
    # Flying pixels at silhouettes must not decide about the size: trim along each axis.
    angle, *ends = turned_extent(cloud_map[:, :2] - centre, 0.01 * _TRIM, _TURN_POINTS)
    low, high = np.array(ends[0::2]), np.array(ends[1::2])
    axes = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
    middle = centre + (0.5 * (low + high)) @ axes
    rise = np.sort(cloud_map[:, 2] - top.height_at(cloud_map))
    tall = max(0.005, float(quantile(rise, 1.0 - 0.01 * _TRIM)))
    floor = float(top.height_at(middle[None])[0])
    pose = Pose.from_rpy(
        float(middle[0]), float(middle[1]), floor + 0.5 * tall, yaw=math.remainder(angle, math.pi)
    )
    sizes = np.maximum(high - low, 0.005)
    return BoundingBox(pose, float(sizes[0]), float(sizes[1]), tall)
