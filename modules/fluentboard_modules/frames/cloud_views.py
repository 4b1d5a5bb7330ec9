"""A point cloud as a depth image: the camera is recovered from an organised cloud, or made up.

The points of an organised cloud are the pixels of a depth camera, so its intrinsics follow from
them exactly. An unorganised cloud is seen by a virtual camera, with as many pixels as there are
points to fill them.
"""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fluentboard.errors import InvalidFrame
from fluentboard.model.geometry import FloatArray, Transform
from fluentboard_modules.frames.point_cloud import PointCloud
from fluentboard_modules.frames.sensor_frame import Camera, SensorFrame

logger = logging.getLogger(__name__)

# Optical axes (x right, y down, z forward) in the other conventions that clouds come in.
OPTICAL = Transform.identity()
GRAPHICS = Transform(np.diag([1.0, -1.0, -1.0, 1.0]))
"""Of OpenGL and OpenNI viewers: x right, y up, z backward."""
BODY = Transform(
    np.array([[0.0, 0.0, 1.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0, 0, 0, 1.0]])
)
"""Of robots and laser scanners: x forward, y left, z up."""

_NEAREST_M = 0.02
_WIDEST_TANGENT = 1.2  # 50 degrees to each side: beyond, a pinhole image is mostly stretched
_LEAST_IN_VIEW = 0.9
_PIXEL_RMS = 1.0  # a pinhole fits an undistorted image to 0.01 px, a lens to a few pixels
_FIT_POINTS = 20_000
_POINTS_PER_PIXEL = 2.5  # one pixel in twelve stays empty
_LARGEST_FOCAL_LENGTH = 600.0  # a Kinect's resolution; more pixels would tell nothing new
_SMALLEST_SIDE, _LARGEST_SIDE = 8, 1280
# An eye in the south-west and above, from which the tops of tables and two walls are seen.
_OVERVIEW_DIRECTION = np.array([-0.42, -0.62, 0.66]) / np.linalg.norm([-0.42, -0.62, 0.66])


@dataclass(frozen=True, eq=False)
class CloudView:
    """A cloud as a camera sees it.

    Attributes:
        camera: which sees it.
        T_cloud_sensor: takes points of the camera's optical frame to the cloud's frame.
        pixel: `(h, w)` int64; the position in the cloud of what each pixel shows, -1 for nothing.
        is_measured: the cloud is the image of a camera, not seen by one that we made up.
    """

    camera: Camera
    T_cloud_sensor: Transform
    pixel: NDArray[np.int64]
    is_measured: bool


def view_cloud(
    cloud: PointCloud,
    name: str,
    fallback: Transform | None = None,
    level: int = logging.WARNING,
) -> CloudView:
    """How a camera sees a cloud.

    Args:
        cloud: organised or not.
        name: of the cloud, for messages.
        fallback: `T_cloud_sensor` to look from if no direction has nearly all points in front; by
            default the cloud is taken for a scene with z up and seen from outside and above.
        level: at which the log is told about a view that was made up.

    Raises:
        InvalidFrame: there is no point in it.
    """
    if not cloud.valid.any():
        raise InvalidFrame(f"{name}: not one valid point in a cloud of {len(cloud.points)}")
    candidates = [OPTICAL, GRAPHICS, BODY]
    if cloud.T_cloud_sensor is not None and cloud.T_cloud_sensor != OPTICAL:
        candidates.insert(0, cloud.T_cloud_sensor)
    if cloud.is_organised:
        for T_cloud_sensor in candidates:
            camera = fit_pinhole(cloud, T_cloud_sensor)
            if camera is not None:
                pixel = np.arange(len(cloud.points)).reshape(cloud.height, cloud.width)
                pixel = np.where(cloud.valid.reshape(pixel.shape), pixel, -1)
                return CloudView(camera, T_cloud_sensor, pixel, is_measured=True)
        logger.log(
            level,
            "%s: the %d x %d points are not the image of a pinhole camera; seen by a virtual one",
            name,
            cloud.width,
            cloud.height,
        )
    points = cloud.points[cloud.valid]
    for T_cloud_sensor in candidates:
        if _share_in_view(T_cloud_sensor.inverse().apply(points)) >= _LEAST_IN_VIEW:
            return _virtual_view(cloud, T_cloud_sensor, name, level)
    if fallback is not None:
        return _virtual_view(cloud, fallback, name, level)
    logger.log(
        level,
        "%s: no place of a sensor is recorded and the points lie on all sides; taken for a scene "
        "with z up and seen from above",
        name,
    )
    return _virtual_view(cloud, _overview(points), name, level)


def fit_pinhole(cloud: PointCloud, T_cloud_sensor: Transform) -> Camera | None:
    """The camera whose pixels the points are, None if they are not those of one.

    Column = fx x/z + cx and row = fy y/z + cy are two linear regressions.

    Args:
        cloud: organised.
        T_cloud_sensor: takes points of the optical frame to the cloud's frame.
    """
    places = np.flatnonzero(cloud.valid)
    places = places[:: max(1, len(places) // _FIT_POINTS)]
    points = T_cloud_sensor.inverse().apply(cloud.points[places])
    if len(places) < 10 or (points[:, 2] <= 0.0).any():
        return None
    parameters: list[float] = []
    for along, pixel in (
        (points[:, 0], places % cloud.width),
        (points[:, 1], places // cloud.width),
    ):
        design = np.column_stack([along / points[:, 2], np.ones(len(places))])
        solution, _, rank, _ = np.linalg.lstsq(design, pixel.astype(np.float64), rcond=None)
        rms = float(np.sqrt(np.mean((design @ solution - pixel) ** 2)))
        if rank < 2 or rms > _PIXEL_RMS or solution[0] <= 0.0:
            return None
        # A fit to millions of float32 coordinates is good to six digits; print no more.
        parameters += [round(float(value), 3) for value in solution]
    fx, cx, fy, cy = parameters
    return Camera(cloud.width, cloud.height, fx, fy, cx, cy)


def frame_of_cloud(
    cloud: PointCloud,
    view: CloudView,
    T_map_cloud: Transform,
    stamp_s: float,
    sensor: str,
    index: int = 0,
) -> SensorFrame:
    """The cloud as a sensor frame.

    Args:
        cloud: what is seen.
        view: how it is seen.
        T_map_cloud: takes points of the cloud's frame to the map frame.
        stamp_s: when it was measured.
        sensor: which measured it.
        index: running number.
    """
    points_sensor = view.T_cloud_sensor.inverse().apply(cloud.points)
    seen = view.pixel >= 0
    chosen = view.pixel[seen]
    depth_m = np.zeros(seen.shape, dtype=np.float32)
    depth_m[seen] = points_sensor[chosen, 2]
    colour: NDArray[np.uint8] | None = None
    if cloud.colours is not None:
        colour = np.zeros((*seen.shape, 3), dtype=np.uint8)
        if view.is_measured:  # colour is known where depth is not
            colour = cloud.colours.reshape(*seen.shape, 3)
        else:
            colour[seen] = cloud.colours[chosen]
    labels: NDArray[np.int32] | None = None
    if cloud.labels is not None:
        labels = np.zeros(seen.shape, dtype=np.int32)
        labels[seen] = cloud.labels[chosen]
    return SensorFrame(
        depth_m=depth_m,
        camera=view.camera,
        stamp_s=stamp_s,
        T_map_sensor=T_map_cloud @ view.T_cloud_sensor,
        colour=colour,
        labels=labels,
        sensor=sensor,
        index=index,
        cloud_sensor=None if view.is_measured else points_sensor[cloud.valid],
    )


def _share_in_view(points_sensor: FloatArray) -> float:
    return float(_in_view(points_sensor).mean())


def _in_view(points_sensor: FloatArray) -> NDArray[np.bool_]:
    x, y, z = np.abs(points_sensor[:, 0]), np.abs(points_sensor[:, 1]), points_sensor[:, 2]
    return (z > _NEAREST_M) & (np.maximum(x, y) <= _WIDEST_TANGENT * z)


def _virtual_view(cloud: PointCloud, T_cloud_sensor: Transform, name: str, level: int) -> CloudView:
    """The cloud splatted into the image of a camera just large enough for what it sees."""
    points = T_cloud_sensor.inverse().apply(cloud.points)
    points[~cloud.valid] = 0.0
    places = np.flatnonzero(_in_view(points))
    if not len(places):
        raise InvalidFrame(f"{name}: no point in front of the sensor; check its pose")
    hidden = 1.0 - len(places) / np.count_nonzero(cloud.valid)
    if hidden > 1.0 - _LEAST_IN_VIEW:
        logger.log(level, "%s: %.0f %% of the points are out of view", name, 100.0 * hidden)
    tangents = points[places, :2] / points[places, 2:]
    low, high = tangents.min(axis=0), tangents.max(axis=0)
    extent = np.maximum(high - low, 1e-3)
    focal_length = min(
        math.sqrt(len(places) / (_POINTS_PER_PIXEL * extent[0] * extent[1])),
        _LARGEST_FOCAL_LENGTH,
        (_LARGEST_SIDE - 1) / float(extent.max()),
    )
    width, height = (
        max(_SMALLEST_SIDE, math.ceil(focal_length * side) + 1) for side in extent.tolist()
    )
    camera = Camera(
        width,
        height,
        focal_length,
        focal_length,
        float(-low[0] * focal_length),
        float(-low[1] * focal_length),
    )
    pixels = np.rint(camera.project(points[places])).astype(np.int64)
    pixels = np.clip(pixels, 0, [width - 1, height - 1])
    flat = pixels[:, 1] * width + pixels[:, 0]
    farthest_first = np.argsort(-points[places, 2], kind="stable")  # the nearest is written last
    pixel = np.full(width * height, -1, dtype=np.int64)
    pixel[flat[farthest_first]] = places[farthest_first]
    return CloudView(camera, T_cloud_sensor, pixel.reshape(height, width), is_measured=False)


def _overview(points_cloud: FloatArray) -> Transform:
    """`T_cloud_sensor` of a camera that has the whole cloud in view, from the south-west."""
    low, high = np.percentile(points_cloud, [1.0, 99.0], axis=0)
    middle = 0.5 * (low + high)
    distance_m = 1.2 * float(np.linalg.norm(high - low)) + 0.1
    forward = -_OVERVIEW_DIRECTION
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    rotation = np.column_stack([right, np.cross(forward, right), forward])
    return Transform.from_parts(rotation, middle + distance_m * _OVERVIEW_DIRECTION)
