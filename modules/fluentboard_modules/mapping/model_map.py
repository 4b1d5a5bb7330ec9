"""The mesh of a room with CAD models in place of what they explain (Section 3.2.3)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fluentboard_modules.mapping.cad_library import CadLibrary
from fluentboard_modules.mapping.furniture_item import FurnitureItem
from fluentboard_modules.mapping.scene_mesh import SurfaceMesh, joined

_COVERED_M = 0.05  # a surface this near to a model's is the model's
_COLOURS = ((196, 107, 61), (61, 122, 138), (148, 92, 148), (106, 138, 61), (178, 74, 90))


def with_models(
    mesh: SurfaceMesh, furniture: Sequence[FurnitureItem], library: CadLibrary
) -> SurfaceMesh:
    """Replaces the surfaces that CAD models explain by the models themselves.

    So the mesh also shows what no sensor saw, such as the underside of a table.

    Args:
        mesh: of the room, map frame.
        furniture: what was found there; pieces without a CAD file leave the mesh as it is.
        library: has their models.
    """
    covered = np.zeros(len(mesh.vertices), dtype=np.bool_)
    placed: list[SurfaceMesh] = []
    kinds = sorted({item.class_name for item in furniture})
    for item in furniture:
        model = library.named(item.cad.model) if item.cad is not None else None
        if item.cad is None or model is None:
            continue
        T_map_model = item.cad.pose.to_transform()
        local = T_map_model.inverse().apply(mesh.vertices)
        low, high = model.mesh.bounds
        near = np.flatnonzero(
            ((local >= low - _COVERED_M) & (local <= high + _COVERED_M)).all(axis=1)
        )
        distance, _ = model.tree.query(local[near], distance_upper_bound=_COVERED_M)
        covered[near[np.isfinite(distance)]] = True
        colour = _COLOURS[kinds.index(item.class_name) % len(_COLOURS)]
        placed.append(
            SurfaceMesh.plain(T_map_model.apply(model.mesh.vertices), model.mesh.triangles, colour)
        )
    return joined([mesh.without(covered), *placed])
