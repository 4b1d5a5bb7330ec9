"""Pictures of scenes: ray-cast with soft daylight, from above or from anywhere."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fluentboard.errors import InvalidInput
from fluentboard.model.geometry import FloatArray, Transform
from fluentboard_modules.frames.sensor_frame import Camera
from fluentboard_modules.simulation.raycasting import SceneCaster
from fluentboard_modules.simulation.scene import Scene
from fluentboard_modules.simulation.sensor import shaded_triangles
from fluentboard_modules.simulation.viewpoint import look_at, pinhole

Image = NDArray[np.uint8]

_LAMP = np.array([-0.35, -0.25, 0.9]) / np.linalg.norm([-0.35, -0.25, 0.9])
_SHADE = 0.72
_EDGE = 0.55


def perspective(
    scene: Scene,
    eye: ArrayLike | None = None,
    target: ArrayLike | None = None,
    width: int = 1280,
    height: int = 800,
    fov_rad: float = 0.9,
    cut_walls: bool = True,
) -> Image:
    """`(h, w, 3)` RGB; the scene seen from a point.

    Args:
        scene: what to show.
        eye: `(3,)`; map frame. By default high up in the south-west, so that all is in view.
        target: `(3,)`; by default the middle of the scene.
        width: pixels.
        height: pixels.
        fov_rad: horizontal field of view.
        cut_walls: leave out the walls between the eye and the room.
    """
    low, high = scene.bounds
    middle = 0.5 * (low + high)
    aim = np.array([middle[0], middle[1], 0.4]) if target is None else np.asarray(target, float)
    if eye is None:
        reach = 0.7 * float(np.hypot(*(high - low)[:2])) / math.tan(0.5 * fov_rad)
        eye = aim + reach * np.array([-0.42, -0.62, 0.66])
    start = np.asarray(eye, dtype=np.float64)
    shown = _without_near_walls(scene, start) if cut_walls else scene
    return _render(shown, pinhole(2 * width, 2 * height, fov_rad), look_at(start, aim))


def save_picture(image: Image, path: str | Path) -> None:
    """Write an image as PNG or JPEG."""
    import cv2

    if not cv2.imwrite(str(path), image[..., ::-1]):
        raise InvalidInput(f"cannot write the picture {path}; is the folder there and writable?")


def _without_near_walls(scene: Scene, eye: FloatArray) -> Scene:
    """Drop the walls that turn their back to the eye."""
    kept = []
    for instance in scene.instances:
        if instance.cls == "Ceiling":
            continue
        if instance.cls == "Wall":
            inwards = instance.T_map_model.rotation[:2, 0]
            if float(inwards @ (eye[:2] - instance.T_map_model.translation[:2])) < 0.0:
                continue
        kept.append(instance)
    return Scene(tuple(kept))


def _render(scene: Scene, camera: Camera, T_map_sensor: Transform) -> Image:
    directions = camera.rays().astype(np.float32)
    rays = np.zeros((*directions.shape[:2], 6), dtype=np.float32)
    rays[..., :3] = T_map_sensor.translation
    rays[..., 3:] = directions @ T_map_sensor.rotation.T.astype(np.float32)
    return _shaded(scene, rays)


def _shaded(scene: Scene, rays: NDArray[np.float32]) -> Image:
    """Half-size image with darkened outlines, and the shadows that things cast, not the room."""
    caster = SceneCaster(scene, threads=0)
    things = SceneCaster(Scene(scene.objects), threads=0) if scene.objects else None
    hits = caster.cast(rays)
    colour = shaded_triangles(caster)[hits.triangle].astype(np.float32)
    hit = np.isfinite(hits.distance)
    normal = caster.triangle_normal[hits.triangle]
    facing = np.sign(np.einsum("hwk,hwk->hw", normal, -rays[..., 3:]))
    points = rays[..., :3] + np.where(hit, hits.distance, 0.0)[..., None] * rays[..., 3:]
    light = np.zeros_like(rays)
    # Start a millimetre off the surface, or every surface would shade itself.
    light[..., :3] = points + 1e-3 * (normal * facing[..., None])
    light[..., 3:] = 20.0 * _LAMP
    if things is not None:
        colour[things.occluded(light) & hit] *= _SHADE
    labels = np.append(caster.triangle_label, np.int32(0))[hits.triangle]
    outline = np.zeros(labels.shape, dtype=np.bool_)
    outline[:, 1:] |= labels[:, 1:] != labels[:, :-1]
    outline[1:, :] |= labels[1:, :] != labels[:-1, :]
    colour[outline] *= _EDGE
    halves = colour.reshape(colour.shape[0] // 2, 2, colour.shape[1] // 2, 2, 3)
    return halves.mean(axis=(1, 3)).astype(np.uint8)
