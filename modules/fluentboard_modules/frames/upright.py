"""Which way is up, where a recording does not say: from how cameras are held and from planes seen.

A guess, good to a few degrees where a table top or the floor is in view. A gravity vector of the
recording or of the user is always better.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from fluentboard.model.geometry import FloatArray, Transform
from fluentboard_modules.frames.sensor_frame import SensorFrame

CAMERA_UP = np.array([0.0, -1.0, 0.0])
"""Up in the optical frame (x right, y down, z forward) of a camera that is held level."""

_SAMPLES = 4000
_HYPOTHESES = 400
_LEAST_SHARE = 0.08
# A wall that faces a camera looking up to 50 degrees down is more than this away from CAMERA_UP.
_WIDEST_RAD = np.deg2rad(60.0)
_AGREE_RAD = np.deg2rad(10.0)


def mean_camera_up(poses: Iterable[Transform]) -> FloatArray:
    """`(3,)` unit vector of the world frame: where the top of the images points on average.

    Args:
        poses: `T_world_sensor` of some frames.
    """
    directions = np.array([pose.rotate(CAMERA_UP) for pose in poses]).reshape(-1, 3)
    total = directions.sum(axis=0)
    length = float(np.linalg.norm(total))
    return CAMERA_UP if length < 1e-9 else total / length


def dominant_level_plane(
    points_sensor: FloatArray, rng: np.random.Generator
) -> tuple[FloatArray, float] | None:
    """The upward normal of the largest plane that may be level, and the share of points on it.

    Args:
        points_sensor: `(n, 3)`; points of one view in the optical frame; NaN where unknown.
        rng: draws the samples.

    Returns:
        `(3,)` unit vector in the optical frame, and a share in (0, 1]; None if there is no plane
        within 60 degrees of the top of the image.
    """
    points = points_sensor[np.isfinite(points_sensor).all(axis=1)]
    if len(points) < 50:
        return None
    points = points[rng.choice(len(points), min(_SAMPLES, len(points)), replace=False)]
    corners = points[rng.integers(len(points), size=(_HYPOTHESES, 3))]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    is_plane = lengths > 1e-9
    normals, corners = normals[is_plane] / lengths[is_plane, None], corners[is_plane]
    # Only the side that faces the sensor is seen: of a table its top, of a ceiling its bottom.
    normals *= np.where(np.einsum("ij,ij->i", normals, corners[:, 0]) > 0.0, -1.0, 1.0)[:, None]
    level = normals @ CAMERA_UP > np.cos(_WIDEST_RAD)
    normals, offsets = normals[level], np.einsum("ij,ij->i", normals[level], corners[level, 0])
    if not len(normals):
        return None
    # Depth errors grow with the square of the distance (Nguyen 2012): 1 cm, and 5 mm per m^2.
    tolerance = 0.01 + 0.005 * np.abs(points[:, 2]) ** 2
    on_plane = np.abs(points @ normals.T - offsets) < tolerance[:, None]
    best = on_plane[:, int(np.argmax(on_plane.sum(axis=0)))]
    share = float(best.mean())
    if share < _LEAST_SHARE:
        return None
    middle, normal = _fit(points[best])
    for width in (0.7, 0.4):  # parts of other planes within the tolerance tilt the first fit
        closer = np.abs((points - middle) @ normal) < width * tolerance
        if closer.sum() < 0.5 * best.sum():
            break
        middle, normal = _fit(points[closer])
    return normal * (-1.0 if normal @ middle > 0.0 else 1.0), share


def _fit(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Centre and normal of the plane of least squares."""
    middle = points.mean(axis=0)
    return middle, np.linalg.svd(points - middle, full_matrices=False)[2][2]


def guess_gravity(frames: Sequence[SensorFrame], rng: np.random.Generator) -> FloatArray:
    """`(3,)` unit vector along which things fall, in the frame the given frames are placed in.

    Args:
        frames: a few frames, spread over a recording.
        rng: draws the samples.
    """
    guesses: list[FloatArray] = []
    for frame in frames:
        found = dominant_level_plane(frame.points_sensor().reshape(-1, 3), rng)
        if found is not None:
            guesses.append(frame.T_map_sensor.rotate(found[0]))
    if not guesses:
        return -mean_camera_up(frame.T_map_sensor for frame in frames)
    # One frame may have taken a wall or a slanted screen for the floor: the majority counts.
    ups = np.array(guesses)
    agree = ups @ ups.T > np.cos(_AGREE_RAD)
    chosen = ups[agree[int(np.argmax(agree.sum(axis=0)))]].sum(axis=0)
    return -chosen / np.linalg.norm(chosen)


def is_z_up(poses: Sequence[Transform]) -> bool:
    """Whether a world frame with z up goes with how the camera was held.

    Args:
        poses: `T_world_sensor` of some frames.
    """
    # A camera tilted down by up to 60 degrees, and held neither sideways nor upside down.
    return bool(mean_camera_up(poses)[2] > 0.5)
