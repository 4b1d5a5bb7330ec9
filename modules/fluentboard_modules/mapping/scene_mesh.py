"""Triangle mesh of the environment: fused from many depth images, or of a single one.

The only file of the mapping package that talks to Open3D's volumes and writes meshes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fluentboard.errors import InvalidInput, MissingExtra, StorageFailed
from fluentboard.model.geometry import FloatArray
from fluentboard_modules.frames.sensor_frame import SensorFrame
from fluentboard_modules.mapping.config import MeshConfig

Triangles = NDArray[np.int32]

_SUFFIXES = (".ply", ".glb", ".gltf", ".obj", ".stl")
_GREY = 180


@dataclass(frozen=True, slots=True, eq=False)
class SurfaceMesh:
    """Triangles of a surface, in the map frame.

    Attributes:
        vertices: `(n, 3)`; metres.
        triangles: `(m, 3)` int32; rows of the vertices, counter-clockwise seen from the sensor.
        colours: `(n, 3)` uint8 RGB.
    """

    vertices: FloatArray
    triangles: Triangles
    colours: NDArray[np.uint8]

    @classmethod
    def plain(
        cls,
        vertices: FloatArray,
        triangles: Triangles,
        colour: tuple[int, int, int] = (_GREY, _GREY, _GREY),
    ) -> SurfaceMesh:
        """A mesh of one colour."""
        return cls(vertices, triangles, np.tile(np.array(colour, np.uint8), (len(vertices), 1)))

    def without(self, covered: NDArray[np.bool_]) -> SurfaceMesh:
        """The mesh without the triangles all of whose vertices are covered, `(n,)`."""
        kept = self.triangles[~covered[self.triangles].all(axis=1)]
        used = np.zeros(len(self.vertices), dtype=np.bool_)
        used[kept] = True
        row = np.cumsum(used, dtype=np.int32) - np.int32(1)
        return SurfaceMesh(self.vertices[used], row[kept], self.colours[used])


def joined(meshes: Sequence[SurfaceMesh]) -> SurfaceMesh:
    """One mesh of several."""
    firsts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    return SurfaceMesh(
        np.concatenate([np.zeros((0, 3)), *(mesh.vertices for mesh in meshes)]),
        np.concatenate(
            [
                np.zeros((0, 3), np.int32),
                *(
                    mesh.triangles + np.int32(first)
                    for mesh, first in zip(meshes, firsts, strict=False)
                ),
            ]
        ),
        np.concatenate([np.zeros((0, 3), np.uint8), *(mesh.colours for mesh in meshes)]),
    )


class SceneMesh:
    """A truncated signed distance function of the scene, fused frame by frame (Open3D, CPU).

    Args:
        config: voxel size and range.

    Raises:
        MissingExtra: Open3D is not installed.
    """

    def __init__(self, config: MeshConfig | None = None) -> None:
        self._config = config or MeshConfig()
        o3d = _open3d()
        self._o3d = o3d
        self._device = o3d.core.Device("CPU:0")
        self._grid = o3d.t.geometry.VoxelBlockGrid(
            attr_names=("tsdf", "weight"),
            attr_dtypes=(o3d.core.float32, o3d.core.float32),
            attr_channels=((1), (1)),
            voxel_size=self._config.voxel_m,
            block_resolution=16,
            block_count=self._config.blocks,
            device=self._device,
        )
        self.n_frames = 0

    def add(self, frame: SensorFrame) -> None:
        """Fuses a frame; one without a valid pixel changes nothing."""
        config, o3d = self._config, self._o3d
        depth = np.where(
            frame.valid & (frame.depth_m <= config.range_max_m), frame.depth_m, np.float32(0.0)
        ).astype(np.float32)
        if not depth.any():
            return
        image = o3d.t.geometry.Image(o3d.core.Tensor.from_numpy(np.ascontiguousarray(depth)))
        camera = frame.camera
        intrinsic = o3d.core.Tensor.from_numpy(
            np.array([[camera.fx, 0.0, camera.cx], [0.0, camera.fy, camera.cy], [0.0, 0.0, 1.0]])
        )
        extrinsic = o3d.core.Tensor.from_numpy(
            np.ascontiguousarray(frame.T_map_sensor.inverse().matrix)
        )
        blocks = self._grid.compute_unique_block_coordinates(
            image,
            intrinsic,
            extrinsic,
            depth_scale=1.0,
            depth_max=config.range_max_m,
            trunc_voxel_multiplier=config.truncation_voxels,
        )
        self._grid.integrate(
            blocks,
            image,
            intrinsic,
            extrinsic,
            depth_scale=1.0,
            depth_max=config.range_max_m,
            trunc_voxel_multiplier=config.truncation_voxels,
        )
        self.n_frames += 1

    def mesh(self) -> SurfaceMesh:
        """The surface fused so far; empty before the first frame."""
        if self.n_frames == 0:
            return joined([])
        least = min(self._config.least_weight, 0.9 * self.n_frames)
        mesh = self._grid.extract_triangle_mesh(weight_threshold=least)
        if "indices" not in mesh.triangle or len(mesh.vertex.positions) == 0:
            return joined([])
        return SurfaceMesh.plain(
            mesh.vertex.positions.numpy().astype(np.float64),
            mesh.triangle.indices.numpy().astype(np.int32),
        )


def mesh_of_frame(frame: SensorFrame, config: MeshConfig | None = None) -> SurfaceMesh:
    """The surface of one depth image: two triangles between any four pixels of one surface.

    Args:
        frame: any depth image.
        config: how far neighbouring pixels may be apart.
    """
    config = config or MeshConfig()
    valid = frame.valid & (frame.depth_m <= config.range_max_m)
    depth = np.where(valid, frame.depth_m, np.float32(np.nan))
    number = np.cumsum(valid.ravel(), dtype=np.int32).reshape(valid.shape) - np.int32(1)

    def together(*corners: tuple[slice, slice]) -> NDArray[np.bool_]:
        depths = np.stack([depth[corner] for corner in corners])
        nearest, farthest = depths.min(axis=0), depths.max(axis=0)
        # Noise grows with distance, and a surface seen askew has steps: both are relative.
        return farthest - nearest <= config.edge_share * nearest

    here, last = slice(None, -1), slice(1, None)
    a, b, c, d = (here, here), (here, last), (last, here), (last, last)
    triangles = np.concatenate(
        [
            np.stack([number[corner][ok] for corner in corners], axis=-1)
            for corners in ((a, c, b), (b, c, d))
            for ok in (together(*corners),)
        ]
    ).astype(np.int32)
    vertices = frame.points_map()[valid]
    colour = frame.colour
    if colour is not None and colour.shape[:2] == valid.shape and frame.colour_camera is None:
        return SurfaceMesh(vertices, triangles, np.ascontiguousarray(colour[valid]))
    return SurfaceMesh.plain(vertices, triangles)


def write_mesh(mesh: SurfaceMesh, path: Path) -> None:
    """Writes PLY, glTF (.glb, .gltf), OBJ or STL, by the file's ending.

    Raises:
        InvalidInput: the ending is none of these, or the mesh is empty.
        StorageFailed: the file cannot be written.
    """
    check_mesh_path(path)
    if not len(mesh.triangles):
        raise InvalidInput(f"{path}: the mesh is empty; no frame showed a surface")
    o3d = _open3d()
    legacy = o3d.geometry.TriangleMesh(
        o3d.utility.Vector3dVector(mesh.vertices),
        o3d.utility.Vector3iVector(mesh.triangles),
    )
    legacy.vertex_colors = o3d.utility.Vector3dVector(mesh.colours / 255.0)
    legacy.compute_vertex_normals()
    if not o3d.io.write_triangle_mesh(str(path), legacy):
        raise StorageFailed(f"{path} cannot be written; give a folder that exists and has room")


def check_mesh_path(path: Path) -> None:
    """Refuses a file that `write_mesh` could not write, before anything is worked out for it.

    Raises:
        InvalidInput: its ending is that of no mesh format.
        StorageFailed: its folder is not there.
    """
    if path.suffix.lower() not in _SUFFIXES:
        raise InvalidInput(
            f"{path}: a mesh is written as one of {', '.join(_SUFFIXES)}; change the ending"
        )
    if not path.parent.is_dir():
        raise StorageFailed(f"{path} cannot be written: there is no folder {path.parent}")


def _open3d() -> Any:
    try:
        import open3d
    except ImportError:
        raise MissingExtra(
            "meshes need Open3D; install it with: pip install 'fluentboard[mapping]'"
        ) from None
    return open3d
