"""CadModel: what a piece of furniture looks like, ready to be compared with depth images."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from fluentboard.model.geometry import FloatArray
from fluentboard_modules.mapping.nearest_samples import NearestSamples
from fluentboard_modules.simulation.mesh import Mesh
from fluentboard_modules.simulation.raycasting import MeshCaster

_SPACING_M = 0.02
_SAMPLES_MAX = 12_000
_ALIKE_M = 0.02
_FULL = 0.9  # of its bounding rectangle: what fills it can stand side by side, an L cannot
_BOARD_SHARE = 0.5  # of the footprint that a board covers
_BOARDS_LEAST = 3
_ORDERS = (8, 6, 4, 3, 2)  # of rotational symmetry about the vertical that are looked for
ROUND = 0
"""The symmetry order of a body of revolution: every turn looks alike."""


@dataclass(frozen=True, slots=True)
class Void:
    """An upright box in the model's frame that nothing fills, such as the space below a seat.

    Attributes:
        low: `(3,)`; lowest corner, metres.
        high: `(3,)`; highest corner, metres.
        must_be_seen: whether the piece is only believed if its being empty was seen.
    """

    low: tuple[float, float, float]
    high: tuple[float, float, float]
    must_be_seen: bool = False


@dataclass(frozen=True, slots=True)
class Surface:
    """Points on a model's surface: `(n, 3)` positions and unit normals, in the model's frame."""

    points: FloatArray
    normals: FloatArray


@dataclass(frozen=True, eq=False)
class CadModel:
    """A model of a kind of furniture.

    Its frame: origin at the centre of its footprint on the floor, z up, +x to the front.

    Attributes:
        name: of the model, such as `billy_80`.
        class_name: class of the furniture ontology that it is a model of.
        mesh: metres.
        is_exact: whether real pieces have this shape and size; if not, it was made up from the
            planes of a hypothesis and says nothing new about size or place.
        voids: where there is nothing in any piece of the class.
    """

    name: str
    class_name: str
    mesh: Mesh
    is_exact: bool = True
    voids: tuple[Void, ...] = ()

    @cached_property
    def caster(self) -> MeshCaster:
        """For rays in the model's frame."""
        return MeshCaster(self.mesh)

    @cached_property
    def void_corners(self) -> FloatArray:
        """`(n, 2, 3)`; lowest and highest corners of its voids, metres."""
        corners = [(void.low, void.high) for void in self.voids]
        return np.array(corners, dtype=np.float64).reshape(-1, 2, 3)

    @cached_property
    def box_corners(self) -> FloatArray:
        """`(8, 3)`; corners of the box around it, metres."""
        low, high = self.mesh.bounds
        sides = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
        return low + sides * (high - low)

    @cached_property
    def surface(self) -> Surface:
        """Evenly spread points on its faces."""
        return sample_surface(self.mesh, _SPACING_M, _SAMPLES_MAX)

    @cached_property
    def tree(self) -> cKDTree:
        """Over the points of its surface."""
        return cKDTree(self.surface.points)

    @cached_property
    def nearest(self) -> NearestSamples:
        """The points of its surface nearest to others."""
        return NearestSamples(self.surface.points)

    @cached_property
    def symmetry_order(self) -> int:
        """How many turns about the vertical within a full circle look alike; `ROUND` if all do."""
        return rotational_symmetry(self.surface.points, self.tree)

    @cached_property
    def top_share(self) -> float:
        """Area of its highest level face as a share of its footprint's bounding rectangle."""
        mesh = self.mesh
        corners = mesh.vertices[mesh.triangles]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        top = mesh.bounds[1, 2]
        is_top = (normals[:, 2] > 0.0) & (corners[:, :, 2] > top - _ALIKE_M).all(axis=1)
        size = (mesh.bounds[1] - mesh.bounds[0])[:2]
        return float(0.5 * normals[is_top, 2].sum() / max(float(size.prod()), 1e-9))

    @property
    def fills_its_footprint(self) -> bool:
        """Whether its top is a rectangle, so that several can stand side by side without a gap."""
        return self.top_share >= _FULL

    @cached_property
    def holds_things(self) -> bool:
        """Whether it has boards one above the other, as shelves have: things stand in it."""
        mesh = self.mesh
        corners = mesh.vertices[mesh.triangles]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        area, height = 0.5 * normals[:, 2], corners[:, :, 2].mean(axis=1)
        level = (area > 0.45 * np.linalg.norm(normals, axis=1)) & (area > 0.0)
        footprint = float((mesh.bounds[1] - mesh.bounds[0])[:2].prod())
        on_level = np.bincount(np.round(height[level] / _ALIKE_M).astype(int), area[level])
        return int(np.count_nonzero(on_level > _BOARD_SHARE * footprint)) >= _BOARDS_LEAST

    def top_faces(self, height_m: float, reach_m: float) -> FloatArray | None:
        """The extent of its level faces near a height.

        Args:
            height_m: above the floor.
            reach_m: how far the faces may be from it.

        Returns:
            `(2, 2)`; lowest and highest x and y of the largest level, None if there is none.
        """
        mesh = self.mesh
        corners = mesh.vertices[mesh.triangles]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        area = 0.5 * np.linalg.norm(normals, axis=1)
        up = normals[:, 2] > 0.9 * 2.0 * np.maximum(area, 1e-12)
        height = corners[:, :, 2].mean(axis=1)
        near = up & (np.abs(height - height_m) <= reach_m)
        if not near.any() or float(area[near].sum()) < 0.02:
            return None
        levels = np.round(height[near] / 0.02).astype(int)
        totals = {level: float(area[near][levels == level].sum()) for level in set(levels)}
        level = max(sorted(totals), key=lambda key: totals[key])
        chosen = corners[near][np.abs(levels - level) <= 1].reshape(-1, 3)[:, :2]
        return np.array([chosen.min(axis=0), chosen.max(axis=0)])


def sample_surface(mesh: Mesh, spacing_m: float, count_max: int) -> Surface:
    """Points on a mesh, about one per square of the spacing, with the normals of their faces.

    The same mesh gives the same points.
    """
    corners = mesh.vertices[mesh.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = 0.5 * np.linalg.norm(normals, axis=1)
    total = max(float(area.sum()), 1e-9)
    count = int(np.clip(total / max(spacing_m, 1e-3) ** 2, 200, count_max))
    rng = np.random.default_rng(0)
    # Systematic along the cumulated area, so that small faces get their share.
    at = (np.arange(count) + 0.5) * total / count
    face = np.minimum(np.searchsorted(np.cumsum(area), at), len(area) - 1)
    u, v = rng.random((2, count))
    flip = u + v > 1.0
    u[flip], v[flip] = 1.0 - u[flip], 1.0 - v[flip]
    a, b, c = (corners[face, k] for k in range(3))
    points = a + u[:, None] * (b - a) + v[:, None] * (c - a)
    unit = normals[face] / np.maximum(2.0 * area[face], 1e-12)[:, None]
    return Surface(points, unit)


def rotational_symmetry(points: FloatArray, tree: cKDTree) -> int:
    """The order of the symmetry about the vertical through the origin; `ROUND` if of any order."""
    thin = points[:: max(1, len(points) // 1500)]

    def alike(order: int) -> bool:
        angle = 2.0 * np.pi / order
        c, s = np.cos(angle), np.sin(angle)
        turned = thin @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        distance, _ = tree.query(turned)
        return bool(np.quantile(distance, 0.98) < 2.0 * _ALIKE_M)

    if alike(7) and alike(9) and alike(11):
        return ROUND
    return next((order for order in _ORDERS if alike(order)), 1)
