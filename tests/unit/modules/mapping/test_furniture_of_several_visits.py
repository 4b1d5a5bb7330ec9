"""Furniture that comes and goes between visits of a room, in one run."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fluentboard.model.geometry import Pose
from fluentboard_modules.mapping.cad_library import library_of
from fluentboard_modules.mapping.config import MappingConfig
from fluentboard_modules.mapping.furniture_item import FurnitureItem
from fluentboard_modules.mapping.furniture_map import FurnitureMap
from fluentboard_modules.mapping.judge import FurnitureJudge
from fluentboard_modules.mapping.rules import FurnitureRules
from fluentboard_modules.mapping.surfaces import detect_regions
from fluentboard_modules.simulation import furniture
from fluentboard_modules.simulation.noise import NoiseConfig
from fluentboard_modules.simulation.scene import Instance, Model, Scene
from fluentboard_modules.simulation.sensor import RgbdSensor
from fluentboard_modules.simulation.viewpoint import kinect_camera, look_at

CHAIR, SHELF = furniture.chair(), furniture.shelf()
WALL = furniture.wall(6.0)
BESIDE = 0.5 * float(np.ptp(SHELF.mesh.bounds[:, 1]))
Thing = tuple[Model, Pose]


def found_after(visits: Sequence[Sequence[Thing]], rules: FurnitureRules) -> list[FurnitureItem]:
    """Looks at a place from six sides in each visit, a hundred seconds after the one before."""
    config = MappingConfig()
    noise = config.surfaces.noise
    judge = FurnitureJudge(library_of([CHAIR, SHELF]), config.verification, noise)
    room = FurnitureMap(rules, config.furniture, noise, judge)
    sensor = RgbdSensor(kinect_camera(320), NoiseConfig())
    for visit, things in enumerate(visits):
        scene = Scene(
            (
                Instance("floor", furniture.floor(12.0, 12.0), Pose(0.0, 0.0, 0.0)),
                Instance("wall", WALL, Pose(-1.0, 0.0, 0.0)),
                *(Instance(f"thing{k}", model, pose) for k, (model, pose) in enumerate(things)),
            )
        )
        for k, bearing in enumerate(np.linspace(-0.9, 0.9, 6)):
            eye = np.array([2.2 * np.cos(bearing), 2.2 * np.sin(bearing), 1.5])
            pose = look_at(eye, np.array([0.0, 0.0, 0.6]))
            rng = np.random.default_rng(10 * visit + k)
            frame = sensor.look(scene, pose, 1.0 + 100.0 * visit + k, rng)
            room.update(frame, detect_regions(frame, config.surfaces))
    room.settle()
    return room.furniture()


def test_what_comes_where_nothing_stood_is_found(furniture_rules: FurnitureRules) -> None:
    chair = (CHAIR, Pose.from_rpy(0.0, 0.0, 0.0, yaw=0.4))

    (found,) = found_after([[], [chair]], furniture_rules)

    assert found.class_name == "Chair"


def test_what_is_taken_out_of_a_row_is_gone(furniture_rules: FurnitureRules) -> None:
    left = (SHELF, Pose.from_rpy(-0.7, -BESIDE, 0.0))
    right = (SHELF, Pose.from_rpy(-0.7, BESIDE, 0.0))

    before = found_after([[left, right]], furniture_rules)
    (after,) = found_after([[left, right], [left]], furniture_rules)

    assert [piece.class_name for piece in before] == ["Shelf", "Shelf"]
    assert after.class_name == "Shelf"
    assert abs(after.box.pose.y + BESIDE) < 0.05
