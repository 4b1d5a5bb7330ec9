"""The only file that talks to Open3D's ray caster (Embree)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fluentboard.errors import InvalidInput, MissingExtra
from fluentboard.model.geometry import Transform
from fluentboard_modules.simulation.mesh import Mesh
from fluentboard_modules.simulation.scene import Scene

Float32Array = NDArray[np.float32]

STEEL_COLOUR = (176, 182, 190)
"""Of polished triangles, whatever the colour of the model."""


@dataclass(frozen=True, slots=True)
class Hits:
    """What rays met first.

    Attributes:
        distance: `(...)` float32; in units of the ray's direction vector, infinite without a hit.
        triangle: `(...)` int32; index into the caster's triangles, -1 without a hit.
    """

    distance: Float32Array
    triangle: NDArray[np.int32]


class SceneCaster:
    """A scene made ready for ray casting; build it once and cast as often as you like.

    Attributes:
        triangle_label: `(m,)` int32; label of the instance of each triangle.
        triangle_normal: `(m, 3)` float32; its unit normal in the map frame.
        triangle_colour: `(m, 3)` float32; the colour of its instance, 0 to 255.
        triangle_polished: `(m,)` bool; whether it is polished metal.

    Raises:
        InvalidInput: the scene is empty.
        MissingExtra: Open3D is not installed.
    """

    def __init__(self, scene: Scene, threads: int = 1) -> None:
        if not scene.instances:
            raise InvalidInput("an empty scene cannot be rendered; add an instance first")
        o3d = _open3d()
        vertices, triangles, labels, colours, polished = [], [], [], [], []
        first = 0
        for instance in scene.instances:
            mesh = instance.model.mesh
            vertices.append(instance.vertices_map)
            triangles.append(mesh.triangles + np.int32(first))
            count = len(mesh.triangles)
            labels.append(np.full(count, instance.label, dtype=np.int32))
            is_polished = np.zeros(count, dtype=np.bool_)
            for begin, end in instance.model.polished:
                is_polished[begin:end] = True
            polished.append(is_polished)
            colours.append(np.where(is_polished[:, None], STEEL_COLOUR, instance.model.colour))
            first += len(mesh.vertices)
        corner = np.concatenate(vertices)
        index = np.concatenate(triangles)
        self.triangle_label: NDArray[np.int32] = np.concatenate(labels)
        self.triangle_colour: Float32Array = np.concatenate(colours).astype(np.float32)
        self.triangle_polished: NDArray[np.bool_] = np.concatenate(polished)
        self.triangle_normal = _unit_normals(corner, index)
        self._threads = threads
        self._tensor = o3d.core.Tensor.from_numpy
        self._caster = o3d.t.geometry.RaycastingScene(nthreads=threads)
        self._caster.add_triangles(
            self._tensor(np.ascontiguousarray(corner, dtype=np.float32)),
            self._tensor(index.astype(np.uint32)),
        )

    def cast(self, rays: Float32Array) -> Hits:
        """The first hits of rays `(..., 6)`: origin and direction in the map frame."""
        answer = self._caster.cast_rays(self._tensor(rays), nthreads=self._threads)
        distance: Float32Array = answer["t_hit"].numpy()
        # Open3D marks a miss with the largest uint32, which is -1 as int32.
        triangle = answer["primitive_ids"].numpy().view(np.int32)
        return Hits(distance, triangle)

    def cast_camera(self, directions_sensor: Float32Array, T_map_sensor: Transform) -> Hits:
        """The first hits along camera rays `(h, w, 3)`; with z = 1 the distance is the depth."""
        rays = np.zeros((*directions_sensor.shape[:-1], 6), dtype=np.float32)
        rays[..., :3] = T_map_sensor.translation
        rays[..., 3:] = directions_sensor @ T_map_sensor.rotation.T.astype(np.float32)
        return self.cast(rays)

    def occluded(self, rays: Float32Array) -> NDArray[np.bool_]:
        """Whether each ray `(..., 6)` meets anything before its direction vector ends."""
        blocked = self._caster.test_occlusions(
            self._tensor(rays), tnear=1e-3, tfar=1.0, nthreads=self._threads
        )
        return blocked.numpy().astype(np.bool_)


def _unit_normals(vertices: NDArray[np.float64], triangles: NDArray[np.int32]) -> Float32Array:
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    length = np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    return (normals / length).astype(np.float32)


def _open3d() -> Any:
    try:
        import open3d
    except ImportError as error:
        raise MissingExtra(
            "the simulator renders with Open3D, which is not installed; "
            "install fluentboard[mapping]"
        ) from error
    return open3d


class MeshCaster:
    """One mesh made ready for ray casting in its own frame.

    Attributes:
        triangle_normal: `(m, 3)` float32; unit normals of its triangles.

    Raises:
        MissingExtra: Open3D is not installed.
    """

    def __init__(self, mesh: Mesh, threads: int = 1) -> None:
        o3d = _open3d()
        self.triangle_normal = _unit_normals(mesh.vertices, mesh.triangles)
        self._threads = threads
        self._tensor = o3d.core.Tensor.from_numpy
        self._caster = o3d.t.geometry.RaycastingScene(nthreads=threads)
        self._caster.add_triangles(
            self._tensor(np.ascontiguousarray(mesh.vertices, dtype=np.float32)),
            self._tensor(mesh.triangles.astype(np.uint32)),
        )

    def cast(self, rays: Float32Array) -> Hits:
        """The first hits of rays `(..., 6)`: origin and direction in the mesh's frame."""
        answer = self._caster.cast_rays(self._tensor(rays), nthreads=self._threads)
        triangle = answer["primitive_ids"].numpy().view(np.int32)
        return Hits(answer["t_hit"].numpy(), triangle)
