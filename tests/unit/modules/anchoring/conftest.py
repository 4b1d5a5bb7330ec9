"""Small scenes for the tests of joint recognition."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from fluentboard.model.geometry import BoundingBox, Pose
from fluentboard_modules.anchoring.crf_data import LabelledGraphs
from fluentboard_modules.anchoring.datasets import LabelledScene, labelled_graphs
from fluentboard_modules.anchoring.observation import SceneObject, SupportPlane
from fluentboard_modules.anchoring.scene_graph import SceneGraphConfig

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
