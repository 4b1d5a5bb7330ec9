"""Which objects count as present in a frame, and how much of them is in sight."""

from __future__ import annotations

import numpy as np

from fluentboard.model.geometry import Pose
from fluentboard_modules.mapping.cad_models import CadModel
from fluentboard_modules.mapping.presence import Onlooker, Sight
from fluentboard_modules.simulation import furniture
from fluentboard_modules.simulation.noise import NoiseConfig
from fluentboard_modules.simulation.scene import Instance, Scene
from fluentboard_modules.simulation.sensor import RgbdSensor
from fluentboard_modules.simulation.viewpoint import kinect_camera, look_at

TABLE = furniture.table(width=1.2, depth=0.8, height=0.74)


def sight(target_y: float, *others: Instance) -> Sight:
    """Of a table at the origin, from an eye that looks past it."""
    scene = Scene((Instance("table", TABLE, Pose(0.0, 0.0, 0.0)), *others))
    frame = RgbdSensor(kinect_camera(160), NoiseConfig()).look(
        scene,
        look_at(np.array([-2.0, 0.0, 1.4]), np.array([0.0, target_y, 0.5])),
        1.0,
        np.random.default_rng(0),
    )
    model = CadModel(TABLE.name, TABLE.cls, TABLE.mesh)
    return Onlooker(scene, ["table"], [model]).look(frame)["table"]


def test_what_stands_free_is_nearly_all_in_sight() -> None:
    whole = sight(0.0)

    assert whole.share > 0.8
    assert whole.is_expected


def test_the_border_of_the_image_cuts_off_its_share() -> None:
    assert 0.1 < sight(1.2).share < 0.7
    assert sight(0.0).share > sight(0.8).share > sight(1.2).share


def test_what_stands_before_it_hides_its_share() -> None:
    wall = Instance("wall", furniture.wall(1.0), Pose.from_rpy(-1.0, 0.5, 0.0, yaw=np.pi))

    assert sight(0.0, wall).share < 0.7


def test_behind_the_sensor_nothing_is_in_sight() -> None:
    scene = Scene((Instance("table", TABLE, Pose(0.0, 0.0, 0.0)),))
    frame = RgbdSensor(kinect_camera(160), NoiseConfig()).look(
        scene,
        look_at(np.array([-2.0, 0.0, 1.4]), np.array([-4.0, 0.0, 0.5])),
        1.0,
        np.random.default_rng(0),
    )
    model = CadModel(TABLE.name, TABLE.cls, TABLE.mesh)

    assert not Onlooker(scene, ["table"], [model]).look(frame)["table"].is_hint
