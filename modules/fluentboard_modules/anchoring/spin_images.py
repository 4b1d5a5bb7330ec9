"""Spin images: what the surroundings of a point look like, whatever way they are turned.

A spin image counts the points around a keypoint by their distance from the line along its normal
and by their height along it (Johnson and Hebert). Ten of them, with 5 x 9 = 45 cells each, describe
an object, as in the local recognition of the RACE project.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from fluentboard.errors import InvalidConfiguration
from fluentboard.model.geometry import FloatArray


@dataclass(frozen=True, slots=True)
class SpinImageConfig:
    """Size and number of spin images.

    Attributes:
        radial_cells: along the distance from the normal's line.
        height_cells: along the normal; odd, so that the keypoint lies in a middle cell.
        radius_m: distance from the line up to which points count; heights count to both sides as
            far. The thesis gives no number; 10 cm spans a mug and the length of a fork's head.
        keypoints: per object (thesis: 10).
        normal_radius_m: neighbours within it give the keypoint its normal.
        points_max: clusters are thinned to so many points.

    Raises:
        InvalidConfiguration: a number is not positive.
    """

    radial_cells: int = 5
    height_cells: int = 9
    radius_m: float = 0.10
    keypoints: int = 10
    normal_radius_m: float = 0.02
    points_max: int = 2000

    def __post_init__(self) -> None:
        counts = (self.radial_cells, self.height_cells, self.keypoints, self.points_max)
        if min(counts) < 1 or min(self.radius_m, self.normal_radius_m) <= 0.0:
            raise InvalidConfiguration(f"spin images need positive numbers, got {self}")

    @property
    def components(self) -> int:
        """Cells of one spin image: 45 unless configured otherwise."""
        return self.radial_cells * self.height_cells


def describe(
    points: FloatArray, viewpoint: FloatArray, config: SpinImageConfig | None = None
) -> FloatArray:
    """`(keypoints, components)`; spin images of an object.

    They are the same after any rigid motion of object and viewpoint together. An object of fewer
    points than keypoints repeats some.

    Args:
        points: `(n, 3)`; of the object, in metres; any frame.
        viewpoint: `(3,)`; where they were seen from: normals point there.
        config: sizes and counts.
    """
    config = config if config is not None else SpinImageConfig()
    if not len(points):
        return np.zeros((config.keypoints, config.components))
    if len(points) > config.points_max:
        points = points[np.linspace(0, len(points) - 1, config.points_max).astype(int)]
    keypoints = points[spread_keypoints(points, config.keypoints)]
    normals = normals_at(keypoints, points, viewpoint, config.normal_radius_m)
    return spin_images(keypoints, normals, points, config)


def spread_keypoints(points: FloatArray, count: int) -> np.ndarray:
    """`(count,)`; indices of points far from each other, each the farthest from those before it."""
    chosen = np.zeros(count, dtype=np.int64)
    distance = np.sum((points - points.mean(axis=0)) ** 2, axis=1)
    chosen[0] = int(np.argmax(distance))
    distance = np.sum((points - points[chosen[0]]) ** 2, axis=1)
    for k in range(1, count):
        chosen[k] = int(np.argmax(distance))
        distance = np.minimum(distance, np.sum((points - points[chosen[k]]) ** 2, axis=1))
    return chosen


def normals_at(
    keypoints: FloatArray, points: FloatArray, viewpoint: FloatArray, radius_m: float
) -> FloatArray:
    """`(k, 3)`; unit normals of the surface at the keypoints, towards the viewpoint.

    Where fewer than three neighbours are near, the normal is the line of sight.

    Args:
        keypoints: `(k, 3)`.
        points: `(n, 3)`; of the surface.
        viewpoint: `(3,)`.
        radius_m: how far neighbours reach.
    """
    sight = viewpoint - keypoints
    length = np.linalg.norm(sight, axis=1, keepdims=True)
    sight = np.where(length > 0.0, sight / np.where(length > 0.0, length, 1.0), (0.0, 0.0, 1.0))
    normals = sight.copy()
    tree = cKDTree(points)
    for k, near in enumerate(tree.query_ball_point(keypoints, radius_m)):
        if len(near) < 3:
            continue
        offset = points[near] - points[near].mean(axis=0)
        _, vectors = np.linalg.eigh(offset.T @ offset)
        normal = vectors[:, 0]
        normals[k] = normal if normal @ sight[k] >= 0.0 else -normal
    return normals


def spin_images(
    keypoints: FloatArray, normals: FloatArray, points: FloatArray, config: SpinImageConfig
) -> FloatArray:
    """`(k, components)`; each sums to 1, so that the density of the points does not matter.

    Args:
        keypoints: `(k, 3)`.
        normals: `(k, 3)`; unit.
        points: `(n, 3)`; around them.
        config: sizes and counts.
    """
    offset = points[None] - keypoints[:, None]
    height = np.einsum("knc,kc->kn", offset, normals)
    radial = np.sqrt(np.maximum(np.sum(offset**2, axis=2) - height**2, 0.0))
    # Points are shared among the nearest four cells, so that none jumps from one to the next.
    u = radial / config.radius_m * config.radial_cells - 0.5
    v = (height + config.radius_m) / (2.0 * config.radius_m) * config.height_cells - 0.5
    image = np.zeros((len(keypoints), config.components))
    row = np.broadcast_to(np.arange(len(keypoints))[:, None], u.shape)
    for du in (0, 1):
        for dv in (0, 1):
            i, j = np.floor(u).astype(int) + du, np.floor(v).astype(int) + dv
            weight = (1.0 - np.abs(u - i)) * (1.0 - np.abs(v - j))
            i = np.maximum(i, 0)  # nearer to the line than half a cell
            inside = (i < config.radial_cells) & (j >= 0) & (j < config.height_cells)
            np.add.at(
                image,
                (row[inside], i[inside] * config.height_cells + j[inside]),
                weight[inside],
            )
    total = image.sum(axis=1, keepdims=True)
    return image / np.where(total > 0.0, total, 1.0)
