"""The stylised restaurant of the RACE demonstrations: two tables, four chairs, a counter."""

from __future__ import annotations

import math

import numpy as np
from pydantic import Field

from fluentboard.model.geometry import Pose
from fluentboard_modules.settings import Settings
from fluentboard_modules.simulation import belongings, furniture, tableware
from fluentboard_modules.simulation.placement import Place, support_of, try_on_support
from fluentboard_modules.simulation.rooms import empty_room, fill_shelf
from fluentboard_modules.simulation.scene import Instance, Model, Scene
from fluentboard_modules.simulation.table_setting import (
    TableSettingConfig,
    chairs_around,
    lay_table,
    seats,
)

RESTAURANT_X_M = 7.2
RESTAURANT_Y_M = 6.0


class RestaurantConfig(Settings):
    """What stands in the restaurant (Section 2.4: two tables, four chairs, a counter)."""

    chairs_per_table: int = Field(default=2, ge=0, le=4)
    guests_per_table: int = Field(default=2, ge=0, le=4)
    shelves: int = Field(default=2, ge=0, le=2)
    on_counter: tuple[str, ...] = ("PepperMill", "PepperMill", "Mug", "Mug", "Plate", "Bottle")
    setting: TableSettingConfig = TableSettingConfig()


def restaurant(rng: np.random.Generator, config: RestaurantConfig | None = None) -> Scene:
    """The restaurant with laid tables, seen from its south-west corner at the origin.

    The furniture wanders by a few centimetres from seed to seed; chairs, tableware and books are
    placed anew.

    Args:
        rng: decides everything.
        config: how much of what.
    """
    config = config if config is not None else RestaurantConfig()

    def near(x: float, y: float, yaw: float, shift: float = 0.08, turn: float = 0.04) -> Pose:
        dx, dy, dyaw = rng.uniform(-1.0, 1.0, 3)
        return Pose.from_rpy(x + shift * dx, y + shift * dy, 0.0, yaw=yaw + turn * dyaw)

    scene = empty_room(RESTAURANT_X_M, RESTAURANT_Y_M)
    table = furniture.table(width=1.2, depth=0.8, height=0.74)
    standing = [
        Instance("counter1", furniture.counter(), Pose.from_rpy(0.345, 3.2, 0.0)),
        Instance("table1", table, near(2.9, 2.15, 0.5 * math.pi)),
        Instance("table2", table, near(4.6, 4.1, 0.0)),
        Instance("plant1", belongings.plant(), near(6.75, 5.55, 0.0, 0.03, math.pi)),
    ]
    shelf = furniture.shelf(width=0.9, depth=0.38, height=1.75, compartments=5)
    low_shelf = furniture.shelf(width=1.0, depth=0.38, height=1.1, compartments=3)
    shelves = [
        Instance(
            "shelf1", shelf, Pose.from_rpy(2.2, RESTAURANT_Y_M - 0.2, 0.0, yaw=-0.5 * math.pi)
        ),
        Instance("shelf2", low_shelf, Pose.from_rpy(RESTAURANT_X_M - 0.2, 2.1, 0.0, yaw=math.pi)),
    ]
    scene = scene.with_instances([*standing, *shelves[: config.shelves]])
    chair = furniture.chair()
    number = 0
    for name in ("table1", "table2"):
        guests, chairs = config.guests_per_table, config.chairs_per_table
        places = seats(scene[name], max(guests, chairs), config.setting.place_width_m)
        names = [f"chair{number + k + 1}" for k in range(chairs)]
        number += chairs
        scene = scene.with_instances(chairs_around(scene[name], places[:chairs], chair, names, rng))
        scene = lay_table(scene, name, guests, rng, config.setting, places)
    books = belongings.book_catalogue(rng)
    for instance in shelves[: config.shelves]:
        scene = fill_shelf(scene, instance.name, rng, books, 0.8)
    return _stocked_counter(scene, config, rng)


def _stocked_counter(scene: Scene, config: RestaurantConfig, rng: np.random.Generator) -> Scene:
    counter = scene["counter1"]
    top = support_of(counter)
    makers = {
        "PepperMill": tableware.pepper_mill,
        "Mug": tableware.mug,
        "Plate": tableware.plate,
        "Bottle": belongings.bottle,
        "Bowl": tableware.bowl,
        "Jug": tableware.jug,
    }
    for cls in config.on_counter:
        model: Model = makers[cls]()

        def draw() -> Place:
            x = top.x + float(rng.uniform(-0.2, 0.2))
            y = top.y + float(rng.uniform(-0.42, 0.42)) * top.y_size
            return x, y, float(rng.uniform(-math.pi, math.pi))

        stem = cls[0].lower() + cls[1:]
        thing = try_on_support(scene, counter, top, model, scene.free_name(stem), draw, 0.04)
        if thing is not None:
            scene = scene.with_instances([thing])
    return scene
