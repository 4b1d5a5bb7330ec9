"""CAD models in the mesh of a room."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fluentboard.model.geometry import BoundingBox, Pose
from fluentboard_modules.mapping.cad_library import library_of
from fluentboard_modules.mapping.furniture_item import CadFit, FurnitureItem
from fluentboard_modules.mapping.model_map import with_models
from fluentboard_modules.mapping.scene_mesh import SurfaceMesh
from fluentboard_modules.simulation import furniture

TABLE = furniture.table(width=1.2, depth=0.8, height=0.74)
LIBRARY = library_of([TABLE])
ITEM = FurnitureItem(
    "table1",
    "Table",
    Pose(2.0, 0.0, 0.74),
    BoundingBox(Pose(2.0, 0.0, 0.37), 0.8, 1.2, 0.74),
    None,
    0.9,
    5,
    5,
    (),
    (),
    (),
    1.0,
    3.0,
    CadFit(
        TABLE.name, True, Pose(2.0, 0.0, 0.0), 0.9, Pose(2.0, 0.0, 0.0), 0.9, np.eye(3) * 1e-4, 5
    ),
)


def sheet(x: float, z: float) -> SurfaceMesh:
    """A square of 0.4 m at a place."""
    corners = np.array([[x, 0.0, z], [x + 0.4, 0.0, z], [x, 0.4, z], [x + 0.4, 0.4, z]])
    return SurfaceMesh.plain(corners, np.array([[0, 1, 2], [1, 3, 2]], dtype=np.int32))


def test_what_a_model_explains_is_replaced_by_it() -> None:
    top = with_models(sheet(1.8, 0.75), [ITEM], LIBRARY)

    assert len(top.triangles) == len(TABLE.mesh.triangles)
    assert np.allclose(top.vertices.max(axis=0), [2.4, 0.6, 0.74])


def test_everything_else_stays() -> None:
    elsewhere = with_models(sheet(4.0, 0.75), [ITEM], LIBRARY)
    on_the_table = with_models(sheet(1.8, 0.9), [ITEM], LIBRARY)
    unknown = with_models(sheet(1.8, 0.75), [replace(ITEM, cad=None)], LIBRARY)

    assert len(elsewhere.triangles) == len(on_the_table.triangles) == len(TABLE.mesh.triangles) + 2
    assert len(unknown.triangles) == 2
