"""CAD files of models: binary STL in metres, as verification and other tools read them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from fluentboard.errors import InvalidInput
from fluentboard_modules.simulation.mesh import Mesh
from fluentboard_modules.simulation.scene import Scene

MESH_FOLDER = "meshes"
"""Beside a scene's JSON: `load_scene` looks for the models there."""

_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def write_stl(mesh: Mesh, path: str | Path) -> None:
    """Write a mesh as binary STL; the header names the unit, which STL itself leaves open.

    Raises:
        InvalidInput: the file cannot be written.
    """
    facets = np.zeros(len(mesh.triangles), dtype=_FACET)
    facets["corners"] = mesh.vertices[mesh.triangles]
    facets["normal"] = mesh.normals()
    header = b"fluentboard, units=m, z up".ljust(80)
    count = np.uint32(len(facets)).tobytes()
    try:
        Path(path).write_bytes(header + count + facets.tobytes())
    except OSError as error:
        raise InvalidInput(f"cannot write the mesh {path}: {error.strerror}") from error


def write_meshes(scene: Scene, folder: str | Path) -> int:
    """Write every model of a scene once, as `NAME.stl`; returns how many.

    Args:
        scene: whose models.
        folder: created if missing.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    models = {i.model.name: i.model for i in scene.instances}
    for name, model in models.items():
        write_stl(model.mesh, folder / f"{name}.stl")
    return len(models)
