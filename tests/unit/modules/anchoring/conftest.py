"""Tables with boxes and cans on them, rendered exactly, and small scenes for joint recognition."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest
from numpy.typing import NDArray

from fluentboard.model.geometry import BoundingBox, FloatArray, Pose
from fluentboard_modules.anchoring.crf_data import LabelledGraphs
from fluentboard_modules.anchoring.datasets import LabelledScene, labelled_graphs
from fluentboard_modules.anchoring.observation import SceneObject, SupportPlane
from fluentboard_modules.anchoring.scene_graph import SceneGraphConfig
from fluentboard_modules.frames.sensor_frame import Camera, SensorFrame
from fluentboard_modules.simulation.viewpoint import look_at

Thing = tuple[float, ...]
"""A box of six numbers (low x y z, high x y z) or an upright can of five (x y radius low high)."""


def box_depth(thing: Thing, eye: FloatArray, rays: FloatArray) -> FloatArray:
    """Depth at which each ray enters a box; infinite where it misses."""
    with np.errstate(divide="ignore", invalid="ignore"):
        a, b = (np.array(thing[:3]) - eye) / rays, (np.array(thing[3:]) - eye) / rays
    enter, leave = np.minimum(a, b).max(axis=-1), np.maximum(a, b).min(axis=-1)
    return np.where((enter < leave) & (enter > 0.0), enter, np.inf)


def can_depth(thing: Thing, eye: FloatArray, rays: FloatArray) -> FloatArray:
    """Depth at which each ray enters a can; infinite where it misses."""
    x, y, radius, low, high = thing
    away = eye[:2] - np.array([x, y])
    a = (rays[..., :2] ** 2).sum(axis=-1)
    b = (rays[..., :2] * away).sum(axis=-1)
    root = b * b - a * (float(away @ away) - radius**2)
    with np.errstate(invalid="ignore", divide="ignore"):
        side = (-b - np.sqrt(root)) / a
        z = eye[2] + side * rays[..., 2]
        side = np.where((root > 0.0) & (z >= low) & (z <= high), side, np.inf)
        lid = (high - eye[2]) / rays[..., 2]
        at = away + lid[..., None] * rays[..., :2]
        on_lid = ((at**2).sum(axis=-1) <= radius**2) & (lid > 0.0)
    return np.minimum(side, np.where(on_lid, lid, np.inf))


@pytest.fixture(scope="session")
def render() -> Callable[..., SensorFrame]:
    """Renders things above a floor as a labelled depth image; labels count the things from 1."""
    camera = Camera(320, 240, 290.0, 290.0, 159.5, 119.5)

    def rendered(
        things: Sequence[Thing],
        *,
        eye: Sequence[float] = (0.0, 0.0, 1.5),
        target: Sequence[float] = (0.0, 1.3, 0.7),
        stamp_s: float = 1.0,
        noise: np.random.Generator | None = None,
    ) -> SensorFrame:
        T_map_sensor = look_at(np.array(eye), np.array(target))
        rays = T_map_sensor.rotate(camera.rays())
        floor = (-4.0, -4.0, -0.1, 4.0, 4.0, 0.0)
        depths = np.stack(
            [
                (box_depth if len(thing) == 6 else can_depth)(thing, np.array(eye), rays)
                for thing in (floor, *things)
            ]
        )
        depth: FloatArray = depths.min(axis=0)
        labels: NDArray[np.int32] = depths.argmin(axis=0).astype(np.int32)
        if noise is not None:
            sigma = 0.0012 + 0.0019 * (np.minimum(depth, 9.0) - 0.4) ** 2
            depth += sigma * noise.standard_normal(depth.shape)
        depth_m = np.where(np.isfinite(depth), depth, 0.0).astype(np.float32)
        return SensorFrame(depth_m, camera, stamp_s, T_map_sensor, labels=labels)

    return rendered


CLASSES = ("Fork", "Knife", "Plate")
SIZES = {"Fork": (0.19, 0.025, 0.015), "Knife": (0.19, 0.025, 0.015), "Plate": (0.26, 0.26, 0.02)}


@pytest.fixture
def table() -> SupportPlane:
    corners = np.array([[-1.0, -0.5], [1.0, -0.5], [1.0, 0.5], [-1.0, 0.5]])
    return SupportPlane(0.75, corners, np.zeros(2), "table1")


@pytest.fixture
def scene_object(table: SupportPlane) -> Callable[..., SceneObject]:
    """Makes an object that stands on the table at x, y."""

    def make(
        name: str,
        x: float,
        y: float,
        size: tuple[float, float, float] = (0.1, 0.1, 0.1),
        *,
        tracked: bool = True,
        confidence: tuple[float, ...] = (),
        on: SupportPlane | None = table,
        yaw: float = 0.0,
    ) -> SceneObject:
        pose = Pose.from_rpy(x, y, 0.75 + 0.5 * size[2], yaw=yaw)
        return SceneObject(name, BoundingBox(pose, *size), np.array(confidence), on, tracked)

    return make


@pytest.fixture
def laid_tables(
    scene_object: Callable[..., SceneObject],
) -> Callable[..., tuple[list[LabelledScene], LabelledGraphs]]:
    """Makes tables with two place settings: fork left, knife right of a plate.

    Local recognition cannot tell forks from knives; only their side of the plate can.
    """

    def setting(x: float, side: float, rng: np.random.Generator) -> list[tuple[SceneObject, str]]:
        made: list[tuple[SceneObject, str]] = []
        for cls, right in (("Fork", -0.17), ("Plate", 0.0), ("Knife", 0.17)):
            dx, dy, turn = rng.normal(0.0, 0.01, 3)
            thing = scene_object(
                f"{cls}{x:+.1f}",
                x - side * right + dx,
                side * 0.33 + dy,
                SIZES[cls],
                confidence=(0.1, 0.1, 0.8) if cls == "Plate" else (0.4, 0.4, 0.2),
                yaw=10.0 * turn,
            )
            made.append((thing, cls))
        return made

    def make(
        count: int, config: SceneGraphConfig | None = None, seed: int = 0
    ) -> tuple[list[LabelledScene], LabelledGraphs]:
        rng = np.random.default_rng(seed)
        scenes: list[LabelledScene] = []
        for k in range(count):
            things = [t for x in (-0.5, 0.5) for t in setting(x, float(rng.choice([-1, 1])), rng)]
            objects, labels = zip(*things, strict=True)
            scenes.append(LabelledScene(f"scene {k}", f"place {k % 3}", objects, labels))
        graphs = labelled_graphs(scenes, CLASSES, config)
        confidence = np.concatenate([[o.confidence for o in s.objects] for s in scenes])
        return scenes, graphs.with_confidence(confidence)

    return make
