"""The fifteen table scenes of Section 4.3.1, made anew from a seed, and the drives past them.

The thesis recorded 15 scenes with 144 objects of nine categories on a table, 5 with a PR2 and 10
with Calvin, driving around the table and turning towards it from different places. Here scenes 1 to
5 are the PR2's and 6 to 15 Calvin's; tables, guests, meals, tableware and disorder vary from scene
to scene. The robot sees a part of the table from each place, and loses sight of it on its way to
the next. What stands on the table is named by its class and a number; `truth.json` of a recording
and the label images tell which pixel is what.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fluentboard.errors import InvalidInput
from fluentboard.model.geometry import Pose, Transform
from fluentboard_modules.simulation import belongings, furniture, tableware
from fluentboard_modules.simulation.drive import SimulatedDrive
from fluentboard_modules.simulation.inspection import InspectionConfig, inspection
from fluentboard_modules.simulation.navigation import costmap
from fluentboard_modules.simulation.noise import NoiseConfig
from fluentboard_modules.simulation.placement import placed_on, support_of
from fluentboard_modules.simulation.robots import CALVIN, PR2, RobotModel
from fluentboard_modules.simulation.rooms import empty_room, with_clutter
from fluentboard_modules.simulation.scene import Instance, Scene
from fluentboard_modules.simulation.table_service import random_service
from fluentboard_modules.simulation.table_setting import (
    TableSettingConfig,
    capacity,
    chairs_around,
    lay_table,
    seats,
)
from fluentboard_modules.simulation.viewpoint import kinect_camera

TABLE_SCENES = 15
INSPECTED = "table1"
"""Name of the table that the robot inspects in every scene."""

FRAMES_PER_SCENE = 72

_ROOM_X_M = 7.0
_ROOM_Y_M = 6.4
_SHARED = ("TableSign", "Jug", "SugarPot", "MilkPot")


@dataclass(frozen=True, slots=True)
class TableScene:
    """One of the scenes.

    Attributes:
        number: 1 to 15.
        scene: the room; what stands on `table1` is what the data set is about.
        robot: which one looks at it.
    """

    number: int
    scene: Scene
    robot: RobotModel

    @property
    def objects(self) -> tuple[Instance, ...]:
        """What stands on the inspected table."""
        return self.scene.standing_on(INSPECTED)


def table_scene(number: int, seed: int = 0) -> TableScene:
    """A scene of the data set.

    Args:
        number: 1 to 15; another number is another table.
        seed: of the data set; another seed is another fifteen tables.

    Raises:
        InvalidInput: there is no scene of that number.
    """
    if not 1 <= number <= TABLE_SCENES:
        raise InvalidInput(
            f"no table scene has the number {number}; they are 1 to {TABLE_SCENES}, and another "
            "seed makes fifteen others"
        )
    rng = np.random.default_rng([seed, number, 0x7AB1E])
    robot = PR2 if number <= 5 else CALVIN
    scene = _furnished(rng)
    table = scene[INSPECTED]
    guests = int(rng.choice([1, 2, 3], p=[0.45, 0.4, 0.15]))
    places = seats(table, min(capacity(table), 4))
    places = tuple(places[k] for k in rng.permutation(len(places)))
    guests = min(guests, len(places))
    chair = furniture.chair(seat_height=0.45, slats=int(rng.choice([0, 2])))
    names = [f"chair{k + 1}" for k in range(guests)]
    scene = scene.with_instances(chairs_around(table, places[:guests], chair, names, rng))
    setting = TableSettingConfig(
        meal="coffee" if rng.random() < 0.2 else "dinner",
        untidiness=float(rng.choice([0.6, 1.0, 2.0], p=[0.3, 0.4, 0.3])),
        missing=0.12,
        left_handed=0.1,
        shared=tuple(cls for cls in _SHARED if rng.random() < 0.75),
    )
    scene = lay_table(scene, INSPECTED, guests, rng, setting, places, random_service(rng))
    return TableScene(number, scene, robot)


def table_scene_drive(
    number: int,
    seed: int = 0,
    frames: int = FRAMES_PER_SCENE,
    width: int = 640,
    noise: NoiseConfig | None = None,
    robot: RobotModel | None = None,
) -> SimulatedDrive:
    """A robot's drive around the table of a scene.

    Args:
        number: of the scene, 1 to 15.
        seed: of the data set.
        frames: how many; about a fifth of them are on the way from one place to the next.
        width: of the images in pixels.
        noise: a Kinect's if not given.
        robot: another than the scene's own.
    """
    made = table_scene(number, seed)
    robot = made.robot if robot is None else robot
    rng = np.random.default_rng([seed, number, 0xD21FE])
    free = costmap(made.scene, robot.radius_m, robot.camera_height_m + robot.torso_m[1])
    top = support_of(made.scene[INSPECTED])
    poses: tuple[Transform, ...] = inspection(
        made.scene[INSPECTED].T_map_model, top, free, robot, frames, rng, InspectionConfig()
    )
    return SimulatedDrive(
        name=f"table scene {number}",
        scene=made.scene,
        poses=poses,
        seed=seed * TABLE_SCENES + number,
        camera=kinect_camera(width),
        noise=noise if noise is not None else NoiseConfig(),
    )


def _furnished(rng: np.random.Generator) -> Scene:
    """A room with the table in the middle, a counter at the wall, and another table in a corner."""
    width, depth = round(float(rng.uniform(1.1, 1.6)), 2), round(float(rng.uniform(0.75, 0.95)), 2)
    height = round(float(rng.uniform(0.71, 0.76)), 2)
    model = furniture.table(width=width, depth=depth, height=height)
    yaw = float(rng.uniform(-math.pi, math.pi))
    at = (0.5 * _ROOM_X_M + 0.1 * rng.standard_normal(), 0.5 * _ROOM_Y_M)
    table = Instance(INSPECTED, model, Pose.from_rpy(float(at[0]), float(at[1]), 0.0, yaw=yaw))
    counter = Instance("counter1", furniture.counter(), Pose.from_rpy(0.36, 3.0, 0.0))
    other = Instance("table2", furniture.round_table(), Pose(_ROOM_X_M - 0.62, 0.62, 0.0))
    scene = empty_room(_ROOM_X_M, _ROOM_Y_M).with_instances([table, counter, other])
    scene = with_clutter(scene, "counter1", 3, rng)
    mug = placed_on(
        other,
        support_of(other),
        tableware.mug(),
        "elsewhereMug1",
        (0.1, -0.1, float(rng.uniform())),
    )
    bottle = placed_on(
        other, support_of(other), belongings.bottle(), "elsewhereBottle1", (-0.15, 0.1, 0.0)
    )
    return scene.with_instances([mug, bottle])
