"""Triangle meshes and the solids that furniture and tableware are made of."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fluentboard.errors import InvalidGeometry
from fluentboard.model.geometry import FloatArray, Transform

IntArray = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles in metres, in the frame of the thing they describe.

    Attributes:
        vertices: `(n, 3)`; metres.
        triangles: `(m, 3)` int32; vertex indices, counter-clockwise seen from outside.
        solids: vertex ranges `(first, end)` of the pieces whose convex hulls cover the mesh. They
            decide what collides; a mug counts as solid, the space under a table does not.

    Raises:
        InvalidGeometry: the mesh is empty, not finite, or a triangle names a missing vertex.
    """

    vertices: FloatArray
    triangles: IntArray
    solids: tuple[tuple[int, int], ...] = ()

    def __post_init__(self) -> None:
        vertices = np.array(self.vertices, dtype=np.float64)
        triangles = np.array(self.triangles, dtype=np.int32)
        if vertices.ndim != 2 or vertices.shape[1] != 3 or len(vertices) == 0:
            raise InvalidGeometry(f"a mesh needs vertices (n, 3), got shape {vertices.shape}")
        if triangles.ndim != 2 or triangles.shape[1] != 3 or len(triangles) == 0:
            raise InvalidGeometry(f"a mesh needs triangles (m, 3), got shape {triangles.shape}")
        if not np.isfinite(vertices).all():
            raise InvalidGeometry("a mesh has a vertex that is NaN or infinite; repair the file")
        if triangles.min() < 0 or triangles.max() >= len(vertices):
            raise InvalidGeometry(
                f"a triangle names vertex {triangles.max()} of a mesh with {len(vertices)} vertices"
            )
        vertices.setflags(write=False)
        triangles.setflags(write=False)
        object.__setattr__(self, "vertices", vertices)
        object.__setattr__(self, "triangles", triangles)
        if not self.solids:
            object.__setattr__(self, "solids", ((0, len(vertices)),))

    @cached_property
    def bounds(self) -> FloatArray:
        """`(2, 3)`; the lowest and the highest coordinates."""
        return np.array([self.vertices.min(axis=0), self.vertices.max(axis=0)])

    @property
    def size(self) -> FloatArray:
        """`(3,)`; edge lengths of the axis-aligned bounding box."""
        return self.bounds[1] - self.bounds[0]

    @property
    def volume_m3(self) -> float:
        """Enclosed volume; positive when closed and oriented outwards."""
        a, b, c = (self.vertices[self.triangles[:, k]] for k in range(3))
        return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)

    def normals(self) -> FloatArray:
        """`(m, 3)`; unit normals of the triangles, zero for a degenerate one."""
        a, b, c = (self.vertices[self.triangles[:, k]] for k in range(3))
        normals = np.cross(b - a, c - a)
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        return np.divide(normals, length, out=np.zeros_like(normals), where=length > 0.0)

    def moved(self, T_new_this: Transform) -> Mesh:
        """The same mesh in another frame."""
        return Mesh(T_new_this.apply(self.vertices), self.triangles, self.solids)

    def shifted(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Mesh:
        """The mesh moved by so many metres."""
        return Mesh(self.vertices + np.array([x, y, z]), self.triangles, self.solids)

    def turned(self, yaw_rad: float) -> Mesh:
        """The mesh turned about its z axis."""
        c, s = math.cos(yaw_rad), math.sin(yaw_rad)
        rotation = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        return self.moved(Transform.from_parts(rotation, np.zeros(3)))

    def tilted(self, pitch_rad: float) -> Mesh:
        """The mesh turned about its y axis; a positive angle tips +z towards +x."""
        c, s = math.cos(pitch_rad), math.sin(pitch_rad)
        rotation = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
        return self.moved(Transform.from_parts(rotation, np.zeros(3)))

    def scaled(self, factor: float) -> Mesh:
        """The mesh enlarged about its origin, as a change of unit needs it."""
        if not (math.isfinite(factor) and factor > 0.0):
            raise InvalidGeometry(f"a mesh cannot be scaled by {factor}; give a positive number")
        return Mesh(self.vertices * factor, self.triangles, self.solids)


def merge(meshes: Sequence[Mesh]) -> Mesh:
    """One mesh of several, keeping their solids apart."""
    vertices: list[FloatArray] = []
    triangles: list[IntArray] = []
    solids: list[tuple[int, int]] = []
    first = 0
    for mesh in meshes:
        vertices.append(mesh.vertices)
        triangles.append(mesh.triangles + np.int32(first))
        solids.extend((first + begin, first + end) for begin, end in mesh.solids)
        first += len(mesh.vertices)
    return Mesh(np.concatenate(vertices), np.concatenate(triangles), tuple(solids))


def as_one_solid(mesh: Mesh) -> Mesh:
    """The mesh with a single convex solid around all of it."""
    return Mesh(mesh.vertices, mesh.triangles)


def box(
    x_size: float, y_size: float, z_size: float, at: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> Mesh:
    """A box standing on the point `at`: centred in x and y, its bottom at z."""
    signs = np.array([[i, j, k] for k in (0, 1) for j in (-1, 1) for i in (-1, 1)])
    vertices = signs * (0.5 * x_size, 0.5 * y_size, z_size) + np.array(at)
    quads = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (1, 3, 7, 5), (3, 2, 6, 7), (2, 0, 4, 6)]
    triangles = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
    return Mesh(vertices, np.array(triangles, dtype=np.int32))


def loft(rings: Sequence[ArrayLike]) -> Mesh:
    """The closed surface through rings of equally many points, with flat ends.

    Args:
        rings: each `(k, 3)`, counter-clockwise seen against the direction of travel; a ring may
            shrink to a point.
    """
    stack = np.array(rings, dtype=np.float64)
    count, k = stack.shape[:2]
    nxt = np.roll(np.arange(k), -1)
    triangles: list[NDArray[np.int64]] = []
    for i in range(count - 1):
        a, b = i * k + np.arange(k), i * k + nxt
        triangles.append(np.stack([a, b, b + k], axis=1))
        triangles.append(np.stack([a, b + k, a + k], axis=1))
    fan = np.stack([np.zeros(k - 2, dtype=np.int64), np.arange(1, k - 1), np.arange(2, k)], axis=1)
    triangles.append(fan[:, ::-1])
    triangles.append(fan + (count - 1) * k)
    return _without_degenerate(stack.reshape(-1, 3), np.concatenate(triangles))


def _without_degenerate(vertices: FloatArray, triangles: NDArray[np.int64]) -> Mesh:
    """Weld equal vertices, and drop the triangles of a ring that shrank to a point."""
    unique, index = np.unique(np.round(vertices, 9), axis=0, return_inverse=True)
    welded = index.reshape(-1)[triangles]
    proper = (
        (welded[:, 0] != welded[:, 1])
        & (welded[:, 1] != welded[:, 2])
        & (welded[:, 2] != welded[:, 0])
    )
    return Mesh(unique, welded[proper].astype(np.int32))


def lathe(profile: Sequence[tuple[float, float]], segments: int = 40) -> Mesh:
    """A body of revolution about z.

    Args:
        profile: (radius, z) in metres, from the axis at the bottom along the outside and, for a
            vessel, back down the inside to the axis.
        segments: how many sides the circle gets.
    """
    angle = 2.0 * math.pi * np.arange(segments) / segments
    circle = np.stack([np.cos(angle), np.sin(angle), np.zeros(segments)], axis=1)
    return loft([radius * circle + np.array([0.0, 0.0, z]) for radius, z in profile])


def cylinder(radius: float, height: float, segments: int = 32) -> Mesh:
    """An upright cylinder standing on the origin."""
    return lathe([(0.0, 0.0), (radius, 0.0), (radius, height), (0.0, height)], segments)


def tube(path: ArrayLike, radius: float, segments: int = 10) -> Mesh:
    """A round bar along a path `(n, 3)` in the x-z plane, such as the handle of a mug."""
    points = np.array(path, dtype=np.float64)
    tangent = np.gradient(points, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    across = np.array([0.0, 1.0, 0.0])
    angle = 2.0 * math.pi * np.arange(segments) / segments
    rings: list[FloatArray] = []
    for point, direction in zip(points, tangent, strict=True):
        up = np.cross(direction, across)
        circle = np.outer(np.cos(angle), across) + np.outer(np.sin(angle), up)
        rings.append(point + radius * circle)
    return loft(rings)


def bar(stations: Sequence[tuple[float, float, float, float]], y: float = 0.0) -> Mesh:
    """A flat bar along x, such as the handle of a spoon.

    Args:
        stations: (x, z of the underside, width, thickness) in metres, with x increasing.
        y: sideways shift in metres.
    """
    rings = [
        [
            (x, y - 0.5 * width, z),
            (x, y + 0.5 * width, z),
            (x, y + 0.5 * width, z + thickness),
            (x, y - 0.5 * width, z + thickness),
        ]
        for x, z, width, thickness in stations
    ]
    return loft(rings)
