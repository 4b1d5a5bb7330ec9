"""Where things can stand on a piece of furniture, read off its mesh; and what stands on what."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fluentboard.model.geometry import FloatArray
from fluentboard_modules.simulation.mesh import Mesh
from fluentboard_modules.simulation.scene import Instance, Scene, Support

_LEVEL_M = 0.01
_SMALLEST_SIDE_M = 0.12
_FILLED = 0.8
_SINKS_M = 0.02
_HOVERS_M = 0.06


def horizontal_supports(mesh: Mesh) -> tuple[Support, ...]:
    """The horizontal rectangles of a mesh that face upwards, from the lowest to the highest.

    Faces within 1 cm of height count as one surface. A surface whose triangles fill less than four
    fifths of its rectangle, or with a side under 12 cm, is left out.
    """
    corners = mesh.vertices[mesh.triangles]
    normals = mesh.normals()
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    upward = np.flatnonzero((normals[:, 2] > 0.99) & (area > 1e-6))
    level = corners[:, :, 2].mean(axis=1)
    upward = upward[np.argsort(level[upward], kind="stable")]
    if not len(upward):
        return ()
    starts = np.flatnonzero(np.diff(level[upward], prepend=-np.inf) > _LEVEL_M)
    found: list[Support] = []
    for group in np.split(upward, starts[1:]):
        points = corners[group].reshape(-1, 3)
        low, high = points.min(axis=0), points.max(axis=0)
        side = high - low
        if min(side[:2]) < _SMALLEST_SIDE_M or area[group].sum() < _FILLED * side[0] * side[1]:
            continue
        x, y = 0.5 * (low[:2] + high[:2])
        z = float(high[2])
        free = _free_height(corners, low, high)
        name = f"surface{len(found) + 1}"
        found.append(Support(name, float(x), float(y), z, float(side[0]), float(side[1]), free))
    return tuple(found)


def _free_height(corners: FloatArray, low: FloatArray, high: FloatArray) -> float:
    """Height from the rectangle to the lowest triangle whose box covers its centre."""
    x, y = 0.5 * (low[:2] + high[:2])
    least, most = corners.min(axis=1), corners.max(axis=1)
    above = (
        (least[:, 0] < x)
        & (most[:, 0] > x)
        & (least[:, 1] < y)
        & (most[:, 1] > y)
        & (least[:, 2] > high[2] + _LEVEL_M)
    )
    return float(least[above, 2].min() - high[2]) if above.any() else 2.0


def support_under(instance: Instance, scene: Scene) -> tuple[str, str] | None:
    """Name of the instance and of its support that the instance stands on, if any.

    It may hover up to 6 cm above it or sink in up to 2 cm, as objects of hand-made worlds do.
    """
    low, high = instance.bounds_map
    foot = np.array([0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), low[2]])
    best: tuple[float, str, str] | None = None
    for other in scene.objects:
        if other.name == instance.name:
            continue
        local = other.T_map_model.inverse().apply(foot)
        for support in other.model.supports:
            gap = float(local[2]) - support.z
            inside = (
                abs(local[0] - support.x) <= 0.5 * support.x_size
                and abs(local[1] - support.y) <= 0.5 * support.y_size
            )
            if inside and -_SINKS_M <= gap <= _HOVERS_M and (best is None or abs(gap) < best[0]):
                best = (abs(gap), other.name, support.name)
    return None if best is None else best[1:]


def with_supports_resolved(scene: Scene) -> Scene:
    """The scene with `on` and `support` filled in from the geometry where they are missing."""
    resolved: list[Instance] = []
    for instance in scene.instances:
        under = None if instance.on or instance.is_background else support_under(instance, scene)
        if under is not None:
            instance = replace(instance, on=under[0], support=under[1])
        resolved.append(instance)
    return replace(scene, instances=tuple(resolved))
