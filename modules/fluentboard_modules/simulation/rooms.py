"""Rooms: floor and walls, furniture along the walls, tables in the middle, and clutter."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from pydantic import Field

from fluentboard.model.geometry import Pose
from fluentboard_modules.settings import Settings
from fluentboard_modules.simulation import belongings, furniture, tableware
from fluentboard_modules.simulation.placement import (
    FloorPlan,
    Group,
    Place,
    anywhere_on,
    placed_on,
    support_of,
    try_on_support,
)
from fluentboard_modules.simulation.scene import Instance, Model, Scene
from fluentboard_modules.simulation.table_setting import (
    capacity,
    chairs_around,
    lay_table,
    seats,
)

logger = logging.getLogger(__name__)

_WALL = 0.1
_DOOR_M = 1.0


class RoomConfig(Settings):
    """What a furnished room contains; what does not fit is left out and logged."""

    x_size_m: tuple[float, float] = (6.0, 8.5)
    """Range of the room's extent along x."""

    y_size_m: tuple[float, float] = (5.0, 7.0)
    """Range of the room's extent along y."""

    tables: tuple[int, int] = (1, 3)
    chairs_per_table: tuple[int, int] = (2, 4)
    desks: tuple[int, int] = (1, 2)
    shelves: tuple[int, int] = (1, 3)
    counters: tuple[int, int] = (0, 1)
    cabinets: tuple[int, int] = (0, 1)

    laid: float = Field(default=0.6, ge=0.0, le=1.0)
    """Probability that a table is laid for its guests instead of strewn with clutter."""

    filled: float = Field(default=0.75, ge=0.0, le=1.0)
    """How full the shelves are."""

    passage_m: float = Field(default=0.75, ge=0.0)
    """Free way between pieces of furniture that do not belong together."""


def empty_room(x_size: float, y_size: float, height: float = 2.5) -> Scene:
    """Floor and four walls around [0, x_size] x [0, y_size], with a door in the wall at y = 0."""
    door_at = 0.72 * x_size
    left = door_at - 0.5 * _DOOR_M
    right = x_size - left - _DOOR_M
    long_wall = furniture.wall(y_size + 2.0 * _WALL, height, _WALL)
    half = 0.5 * _WALL
    walls = [
        ("wallWest", long_wall, -half, 0.5 * y_size, 0.0),
        ("wallEast", long_wall, x_size + half, 0.5 * y_size, math.pi),
        (
            "wallNorth",
            furniture.wall(x_size, height, _WALL),
            0.5 * x_size,
            y_size + half,
            -math.pi / 2,
        ),
        ("wallSouth1", furniture.wall(left, height, _WALL), 0.5 * left, -half, math.pi / 2),
        (
            "wallSouth2",
            furniture.wall(right, height, _WALL),
            x_size - 0.5 * right,
            -half,
            math.pi / 2,
        ),
    ]
    slab = furniture.floor(x_size + 2.0 * _WALL, y_size + 2.0 * _WALL)
    return Scene(
        (
            Instance("floor", slab, Pose(0.5 * x_size, 0.5 * y_size, 0.0)),
            *(
                Instance(name, model, Pose.from_rpy(x, y, 0.0, yaw=yaw))
                for name, model, x, y, yaw in walls
            ),
        )
    )


def with_floor(scene: Scene, margin_m: float = 0.5) -> Scene:
    """The scene with a floor under everything, for worlds that come without one."""
    low, high = scene.bounds
    x_size, y_size = (float(v) + 2.0 * margin_m for v in (high - low)[:2])
    x, y = (float(v) for v in 0.5 * (low + high)[:2])
    slab = furniture.floor(x_size, y_size)
    return scene.with_instances([Instance(scene.free_name("floor"), slab, Pose(x, y, 0.0))])


def furnished_room(rng: np.random.Generator, config: RoomConfig | None = None) -> Scene:
    """A random room in which a robot can drive around.

    Shelves, counters, cabinets and desks stand along the walls and tables with chairs in the
    middle; shelves hold books, tables are laid or strewn, desks have a screen and a keyboard.

    Args:
        rng: decides everything; the same generator state gives the same room.
        config: ranges for everything.
    """
    config = config if config is not None else RoomConfig()
    x_size, y_size = (float(rng.uniform(*r)) for r in (config.x_size_m, config.y_size_m))
    plan = FloorPlan(empty_room(x_size, y_size))
    numbers = {
        kind: int(rng.integers(low, high + 1))
        for kind, (low, high) in (
            ("shelf", config.shelves),
            ("counter", config.counters),
            ("cabinet", config.cabinets),
            ("desk", config.desks),
        )
    }
    for kind, number in numbers.items():
        for index in range(1, number + 1):
            group = _wall_group(kind, index, rng)
            along = _along_walls(group, x_size, y_size, rng)
            if not plan.try_place(group, along, 0.06):
                logger.info("no room for %s%d along the walls", kind, index)
    tables = int(rng.integers(config.tables[0], config.tables[1] + 1))
    for index in range(1, tables + 1):
        group = _table_group(index, config, rng)

        def middle() -> Place:
            turn = int(rng.integers(4)) * 0.5 * math.pi + float(rng.normal(0.0, 0.05))
            return (
                float(rng.uniform(1.2, x_size - 1.2)),
                float(rng.uniform(1.2, y_size - 1.2)),
                turn,
            )

        if not plan.try_place(group, middle, config.passage_m):
            logger.info("no room for table%d in the middle", index)
    _corner_things(plan, x_size, y_size, rng)
    return _strewn(plan.scene, config, rng)


def fill_shelf(
    scene: Scene,
    name: str,
    rng: np.random.Generator,
    books: Sequence[Model] | None = None,
    filled: float = 0.75,
) -> Scene:
    """The scene with rows of books on all boards of a shelf.

    Args:
        scene: has the shelf.
        name: of the shelf.
        rng: decides which books stand where.
        books: models to choose from; a random catalogue if not given.
        filled: share of the boards' length that is used, on average.
    """
    shelf = scene[name]
    books = belongings.book_catalogue(rng) if books is None else books
    added: list[Instance] = []
    numbers = iter(range(1, 10_000))
    for support in shelf.model.supports:
        fitting = [b for b in books if b.mesh.size[2] < min(support.clearance, 0.5) - 0.01]
        left = support.y - 0.5 * support.y_size + 0.01
        right = support.y + 0.5 * support.y_size - 0.01
        free_ends = support.clearance < 1.0  # books on top of a shelf would fall off its sides
        while fitting and free_ends:
            model = fitting[int(rng.integers(len(fitting)))]
            depth, thickness = float(model.mesh.size[0]), float(model.mesh.size[1])
            if left + thickness > right:
                break
            if rng.random() > filled:  # a gap as wide as a few books
                left += float(rng.uniform(0.03, 0.12))
                continue
            x = support.x + 0.5 * support.x_size - 0.5 * depth - float(rng.uniform(0.02, 0.05))
            book = placed_on(
                shelf,
                support,
                model,
                f"{name}Book{next(numbers)}",
                (x, left + 0.5 * thickness, 0.0),
            )
            added.append(book)
            left += thickness + 0.0015
    return scene.with_instances(added)


def _wall_group(kind: str, index: int, rng: np.random.Generator) -> Group:
    """Furniture with its back at x = 0 of the group, facing +x, and free floor before it."""
    name = f"{kind}{index}"
    if kind == "shelf":
        compartments = int(rng.integers(4, 7))
        model = furniture.shelf(
            width=float(rng.choice([0.8, 0.9, 1.0])),
            depth=round(float(rng.uniform(0.35, 0.42)), 2),
            height=round(0.08 + compartments * float(rng.uniform(0.3, 0.35)), 2),
            compartments=compartments,
        )
    elif kind == "counter":
        model = furniture.counter(
            width=round(float(rng.uniform(1.4, 2.2)), 1),
            height=round(float(rng.uniform(0.88, 0.98)), 2),
        )
    elif kind == "cabinet":
        model = furniture.cabinet(height=round(float(rng.uniform(0.8, 1.2)), 1))
    else:
        model = furniture.desk(
            width=round(float(rng.uniform(1.2, 1.6)), 1),
            height=round(float(rng.uniform(0.71, 0.75)), 2),
        )
    back = -float(model.mesh.bounds[0, 0]) + 0.02
    body = Instance(name, model, Pose(back, 0.0, 0.0))
    depth, width = float(model.mesh.size[0]), float(model.mesh.size[1])
    if kind != "desk":
        return Group((body,), ((depth + 0.45, 0.0, 0.8, width),))
    # The user sits between the pedestal and the right panel, looking at the wall.
    chair = furniture.chair(seat_height=round(float(rng.uniform(0.42, 0.47)), 2))
    at = Pose.from_rpy(
        depth + 0.34 + float(rng.uniform(0.0, 0.12)),
        -0.12,
        0.0,
        yaw=math.pi + float(rng.normal(0.0, 0.15)),
    )
    seat = Instance(f"{name}Chair", chair, at)
    return Group((body, seat), ((depth + 0.75, 0.0, 1.0, width),))


def _along_walls(
    group: Group, x_size: float, y_size: float, rng: np.random.Generator
) -> Callable[[], Place]:
    half = 0.5 * float(group.members[0].model.mesh.size[1]) + 0.05

    def draw() -> Place:
        wall = int(rng.integers(4))
        along = float(rng.uniform(half, (y_size if wall < 2 else x_size) - half))
        if wall == 0:
            return 0.0, along, 0.0
        if wall == 1:
            return x_size, along, math.pi
        return (along, y_size, -0.5 * math.pi) if wall == 2 else (along, 0.0, 0.5 * math.pi)

    return draw


def _table_group(index: int, config: RoomConfig, rng: np.random.Generator) -> Group:
    height = round(float(rng.uniform(0.71, 0.76)), 2)
    if rng.random() < 0.25:
        model = furniture.round_table(round(float(rng.uniform(0.8, 1.0)), 1), height)
    else:
        model = furniture.table(
            width=round(float(rng.uniform(1.2, 1.8)), 1),
            depth=round(float(rng.uniform(0.75, 0.95)), 2),
            height=height,
        )
    table = Instance(f"table{index}", model, Pose(0.0, 0.0, 0.0))
    wanted = int(rng.integers(config.chairs_per_table[0], config.chairs_per_table[1] + 1))
    taken = seats(table, min(wanted, capacity(table)))
    chair = furniture.chair(
        seat_height=round(float(rng.uniform(0.42, 0.47)), 2),
        height=round(float(rng.uniform(0.82, 0.95)), 2),
        slats=int(rng.choice([0, 0, 2, 3])),
    )
    names = [f"table{index}Chair{k + 1}" for k in range(len(taken))]
    return Group((table, *chairs_around(table, taken, chair, names, rng)))


def _corner_things(plan: FloorPlan, x_size: float, y_size: float, rng: np.random.Generator) -> None:
    for name, model in (("plant1", belongings.plant()), ("wasteBin1", belongings.waste_bin())):
        group = Group((Instance(name, model, Pose(0.0, 0.0, 0.0)),))

        def near_wall() -> Place:
            margin = 0.35
            x, y = (
                float(rng.uniform(margin, x_size - margin)),
                float(rng.uniform(margin, y_size - margin)),
            )
            if rng.random() < 0.5:
                x = margin if rng.random() < 0.5 else x_size - margin
            else:
                y = y_size - margin
            return x, y, float(rng.uniform(-math.pi, math.pi))

        if not plan.try_place(group, near_wall, 0.1):
            logger.info("no room for %s", name)


def _strewn(scene: Scene, config: RoomConfig, rng: np.random.Generator) -> Scene:
    """Put the small things: books, settings, screens, clutter."""
    for instance in scene.objects:
        if instance.cls == "Shelf":
            scene = fill_shelf(scene, instance.name, rng, filled=config.filled)
        elif instance.cls == "Desk":
            scene = _equipped_desk(scene, instance, rng)
        elif instance.cls == "Table" and rng.random() < config.laid:
            guests = sum(i.name.startswith(f"{instance.name}Chair") for i in scene.objects)
            scene = lay_table(scene, instance.name, guests, rng)
        elif instance.cls in ("Table", "Counter", "Cabinet"):
            scene = with_clutter(scene, instance.name, int(rng.integers(1, 5)), rng)
    return scene


def with_clutter(scene: Scene, name: str, count: int, rng: np.random.Generator) -> Scene:
    """The scene with up to so many everyday things strewn on the largest support of an instance."""
    base = scene[name]
    support = support_of(base)
    lying = belongings.book(0.03, 0.16, 0.23, belongings.BOOK_COLOURS[int(rng.integers(8))])
    kinds = (
        belongings.carton(),
        belongings.bottle(),
        tableware.mug(),
        tableware.bowl(),
        tableware.pepper_mill(),
        belongings.laptop(),
        replace(lying, name=f"book_lying_{bytes(lying.colour).hex()}"),
        belongings.candle(),
    )
    for _ in range(count):
        model = kinds[int(rng.integers(len(kinds)))]
        stem = model.cls[0].lower() + model.cls[1:]
        thing = try_on_support(
            scene,
            base,
            support,
            model,
            scene.free_name(stem),
            lambda: anywhere_on(support, rng, 0.12),
            0.02,
        )
        if thing is not None:
            scene = scene.with_instances([thing])
    return scene


def _equipped_desk(scene: Scene, desk: Instance, rng: np.random.Generator) -> Scene:
    support = support_of(desk)
    screen, keyboard = belongings.screen(), belongings.keyboard()
    y = float(rng.uniform(-0.1, 0.1))
    back, front = -0.5 * support.x_size, 0.5 * support.x_size
    spots: list[tuple[Model, Place]] = [
        (screen, (back + 0.16, y, float(rng.normal(0.0, 0.12)))),
        (keyboard, (front - 0.2, y, float(rng.normal(0.0, 0.05)))),
        (tableware.mug(), (front - 0.25, y - 0.38, float(rng.uniform(-3.0, 3.0)))),
    ]
    for model, spot in spots:
        stem = model.cls[0].lower() + model.cls[1:]
        thing = try_on_support(
            scene,
            desk,
            support,
            model,
            scene.free_name(stem),
            lambda spot=spot: spot,
            0.005,
            tries=1,
        )
        if thing is not None:
            scene = scene.with_instances([thing])
    return scene
