"""The map of a simulated scene before anything was seen: for experiments with an initial map."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fluentboard.model.geometry import FloatArray
from fluentboard_modules.search.config import SensorModelConfig
from fluentboard_modules.search.occupancy import OccupancyMap
from fluentboard_modules.simulation.scene import Instance, Scene


def map_of_scene(
    scene: Scene,
    resolution_m: float = 0.05,
    chosen: Callable[[Instance], bool] = lambda instance: True,
    model: SensorModelConfig | None = None,
) -> OccupancyMap:
    """A map in which the surfaces of a scene are occupied, and all the rest is unknown.

    Unknown cells are transparent to views, so with this map all occlusion is known and yet
    everything is still to be seen.

    Args:
        scene: what stands where.
        resolution_m: side of a cell.
        chosen: which instances are known, such as the walls only.
        model: of the map.
    """
    occupancy = OccupancyMap(resolution_m, model or SensorModelConfig())
    _, _, _, occupied = occupancy.model.log_odds_updates
    for instance in scene.instances:
        if chosen(instance):
            corners = instance.vertices_map[instance.model.mesh.triangles]
            points = surface_points(corners, 0.4 * resolution_m)
            occupancy.set_cells(occupancy.cells_of(points), occupied)
    return occupancy


def surface_points(corners: FloatArray, spacing_m: float) -> FloatArray:
    """`(n, 3)`; points on triangles `(m, 3, 3)`, at most `spacing_m` apart along their edges."""
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    steps = np.maximum(np.ceil(edges / spacing_m).astype(np.int64), 1)
    steps = 1 << np.ceil(np.log2(steps)).astype(np.int64)  # few different ones
    found: list[FloatArray] = [np.zeros((0, 3))]
    for count in np.unique(steps):
        i, j = np.meshgrid(np.arange(count + 1), np.arange(count + 1))
        inside = i + j <= count
        u, v = i[inside] / count, j[inside] / count
        weights = np.stack([1.0 - u - v, u, v], axis=1)
        parts = np.array_split(corners[steps == count], max(1, int(count) ** 2 // 20_000))
        found += [np.einsum("pk,mkc->mpc", weights, part).reshape(-1, 3) for part in parts]
    return np.concatenate(found)
