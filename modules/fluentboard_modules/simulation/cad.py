"""Load CAD files as meshes in metres with z up: STL, OBJ, PLY, glTF, COLLADA and SDF."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from fluentboard.errors import InvalidGeometry, MissingExtra
from fluentboard_modules.simulation.collada import read_collada
from fluentboard_modules.simulation.mesh import Mesh
from fluentboard_modules.simulation.sdf import read_sdf

Axis = Literal["x", "y", "z"]

CAD_SUFFIXES = (".stl", ".obj", ".ply", ".glb", ".gltf", ".dae", ".sdf")

_UNITS_M = {
    "m": 1.0,
    "meter": 1.0,
    "meters": 1.0,
    "metre": 1.0,
    "metres": 1.0,
    "cm": 0.01,
    "centimeter": 0.01,
    "centimeters": 0.01,
    "centimetres": 0.01,
    "mm": 0.001,
    "millimeter": 0.001,
    "millimeters": 0.001,
    "millimetres": 0.001,
    "in": 0.0254,
    "inch": 0.0254,
    "inches": 0.0254,
    "ft": 0.3048,
    "foot": 0.3048,
    "feet": 0.3048,
}
_UNIT_NOTE = re.compile(rb"units?\s*[:=]\s*([a-zA-Z]+)", re.IGNORECASE)
_TO_Z_UP: dict[Axis, NDArray[np.float64]] = {
    "x": np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]]),
    "y": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),
    "z": np.eye(3),
}


def load_mesh(path: str | Path, unit_m: float | None = None, up: Axis | None = None) -> Mesh:
    """The triangles of a CAD file, in metres with z up.

    COLLADA states its unit and up axis, SDF is in metres with z up, and glTF in metres with y up by
    its standard. STL, OBJ and PLY state neither; a unit noted in their header or comments
    (`units=mm`, `# File units = inches`) is used, and otherwise they are taken as metres with z up.

    Args:
        path: the file; its suffix decides how it is read.
        unit_m: length of one of its units in metres, to overrule what the file says.
        up: which of its axes points upwards, to overrule what the file says.

    Raises:
        InvalidGeometry: the file is missing, of an unknown kind, or holds no triangles.
        MissingExtra: Open3D is needed and not installed.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in CAD_SUFFIXES:
        raise InvalidGeometry(
            f"{path}: unknown kind of CAD file {suffix!r}; give one of {', '.join(CAD_SUFFIXES)}"
        )
    if not path.is_file():
        raise InvalidGeometry(f"{path}: there is no such file")
    if suffix == ".dae":
        mesh, stated_m, stated_up = read_collada(path), 1.0, "z"
    elif suffix == ".sdf":
        mesh, stated_m, stated_up = read_sdf(path, load_mesh), 1.0, "z"
    else:
        mesh = _read_with_open3d(path)
        stated_m = 1.0 if suffix in (".glb", ".gltf") else noted_unit_m(path)
        stated_up = "y" if suffix in (".glb", ".gltf") else "z"
    turn = _TO_Z_UP[up if up is not None else stated_up]
    factor = unit_m if unit_m is not None else stated_m
    if not factor > 0.0:
        raise InvalidGeometry(
            f"{path}: a unit of {factor} m makes no sense; give a positive length"
        )
    placed = Mesh(factor * (mesh.vertices @ turn.T), mesh.triangles, mesh.solids)
    return placed if suffix == ".sdf" else in_pieces(placed)


def noted_unit_m(path: Path) -> float:
    """The unit that the header or the comments of an STL, OBJ or PLY file name; else 1 (metres)."""
    with path.open("rb") as file:
        start = file.read(80 if path.suffix.lower() == ".stl" else 4096)
    note = _UNIT_NOTE.search(start)
    if note is None:
        return 1.0
    return _UNITS_M.get(note.group(1).decode("ascii").lower(), 1.0)


def standing(mesh: Mesh) -> Mesh:
    """The mesh with its origin at the centre of its footprint, standing on z = 0."""
    low, high = mesh.bounds
    return mesh.shifted(-0.5 * (low[0] + high[0]), -0.5 * (low[1] + high[1]), -low[2])


def in_pieces(mesh: Mesh) -> Mesh:
    """The mesh with equal vertices welded and every connected piece a solid of its own.

    Triangles are connected over edges that exactly two of them share, so two boards that touch
    along an edge stay two pieces.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    points, index = np.unique(np.round(mesh.vertices, 6), axis=0, return_inverse=True)
    triangles = index.reshape(-1)[mesh.triangles]
    a, b, c = triangles.T
    triangles = triangles[(a != b) & (b != c) & (c != a)]
    if not len(triangles):
        raise InvalidGeometry("every triangle of the mesh is degenerate; check its unit and scale")
    edges = np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    keys = edges[:, 0] * len(points) + edges[:, 1]
    order = np.argsort(keys, kind="stable")
    _, first, count = np.unique(keys[order], return_index=True, return_counts=True)
    pair = first[count == 2]
    one, other = order[pair] // 3, order[pair + 1] // 3
    graph = coo_array((np.ones(len(pair)), (one, other)), shape=(len(triangles),) * 2)
    _, piece = connected_components(graph, directed=False)
    # A vertex that several pieces touch is given to each of them.
    corner = piece[:, None].astype(np.int64) * len(points) + triangles
    owned, renumbered = np.unique(corner, return_inverse=True)
    ends = np.cumsum(np.bincount(owned // len(points)))
    solids = tuple(zip([0, *ends[:-1].tolist()], ends.tolist(), strict=True))
    return Mesh(points[owned % len(points)], renumbered.reshape(-1, 3).astype(np.int32), solids)


def _read_with_open3d(path: Path) -> Mesh:
    try:
        import open3d as o3d
    except ImportError as error:
        raise MissingExtra(
            f"{path}: reading {path.suffix} files needs Open3D; install fluentboard[mapping]"
        ) from error
    with o3d.utility.VerbosityContextManager(o3d.utility.VerbosityLevel.Error):
        read = o3d.io.read_triangle_mesh(str(path))
    if not read.has_triangles():
        raise InvalidGeometry(f"{path}: no triangles; the file is empty, damaged or a point cloud")
    return Mesh(np.asarray(read.vertices), np.asarray(read.triangles))
