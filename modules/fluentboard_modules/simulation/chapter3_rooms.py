"""The two rooms of Section 3.3.1: an office with 13 pieces of furniture, a seminar room with 32.

They are built for what made the real ones hard. The office has five bookshelves filled with books,
three and two of them side by side without a gap, and an L-shaped desk too large for one view. The
seminar room has twelve tables in rows, pushed together in pairs, with twenty chairs between them
that hide each other.
"""

from __future__ import annotations

import math

import numpy as np

from fluentboard.model.geometry import Pose
from fluentboard_modules.simulation import belongings, furniture, office_furniture, tableware
from fluentboard_modules.simulation.placement import Place, anywhere_on, support_of, try_on_support
from fluentboard_modules.simulation.rooms import empty_room, fill_shelf
from fluentboard_modules.simulation.scene import Instance, Model, Scene, Support
from fluentboard_modules.simulation.table_setting import chair_at, chairs_around, seats

OFFICE_X_M = 6.2
OFFICE_Y_M = 5.4
SEMINAR_X_M = 9.0
SEMINAR_Y_M = 8.4

_ROWS = 3
_ROW_STEP_M = 1.95
_AISLE_M = 1.05


def office(rng: np.random.Generator, filled: float = 0.97) -> Scene:
    """An office: an L-shaped desk with its chair, a conference table with five, five bookshelves.

    Args:
        rng: moves the furniture by some centimetres, turns the chairs, fills shelves and tables.
        filled: how full the shelves are.
    """
    jitter = _Jitter(rng)
    scene = empty_room(OFFICE_X_M, OFFICE_Y_M)
    shelf = furniture.shelf(width=0.8, depth=0.38, height=1.86, compartments=5)
    back = 0.5 * 0.38 + 0.015
    along_north = 0.9 + float(rng.uniform(0.0, 0.15))
    along_east = 2.3 + float(rng.uniform(0.0, 0.2))
    shelves = [
        Instance(
            f"shelf{k + 1}",
            shelf,
            Pose.from_rpy(along_north + 0.8 * k, OFFICE_Y_M - back, 0.0, yaw=-0.5 * math.pi),
        )
        for k in range(3)
    ]
    shelves += [
        Instance(
            f"shelf{k + 4}",
            shelf,
            Pose.from_rpy(OFFICE_X_M - back, along_east + 0.8 * k, 0.0, yaw=math.pi),
        )
        for k in range(2)
    ]
    l_desk = office_furniture.l_desk()
    x_desk = 0.5 * float(l_desk.mesh.size[0]) + 0.02
    desk = Instance("desk1", l_desk, Pose.from_rpy(x_desk, 1.05, 0.0))
    sitter = Instance(
        "desk1Chair",
        office_furniture.office_chair(),
        jitter.pose(x_desk + 0.45, 1.25, math.pi, 0.06, 0.5),
    )
    top = office_furniture.plain_table("conference_table", 1.8, 0.9, 0.74)
    table = Instance("table1", top, jitter.pose(3.55, 2.85, 0.5 * math.pi + 0.1, 0.08, 0.06))
    scene = scene.with_instances([*shelves, desk, sitter, table])
    taken = seats(table, 5)
    chair = office_furniture.conference_chair()
    names = [f"table1Chair{k + 1}" for k in range(5)]
    scene = scene.with_instances(chairs_around(table, taken, chair, names, rng))
    books = belongings.book_catalogue(rng)
    for instance in shelves:
        scene = fill_shelf(scene, instance.name, rng, books, filled)
    scene = _strewn(scene, "table1", [belongings.laptop(), tableware.mug()], rng)
    screen = belongings.screen()
    place = (-0.5 * float(l_desk.mesh.size[0]) + 0.2, 0.15, 0.1)
    scene = _put(scene, "desk1", "top", screen, place)
    scene = _put(scene, "desk1", "top", belongings.keyboard(), (place[0] + 0.32, 0.15, 0.0))
    return _strewn(scene, "desk1", [tableware.mug(), office_furniture.paper_stack(rng)], rng)


def seminar_room(rng: np.random.Generator, chairs: int = 20) -> Scene:
    """A seminar room: twelve tables in three rows, pushed together in pairs, and twenty chairs.

    The rows look to the front, which is +x.

    Args:
        rng: decides which seats have a chair, how far it is pushed in, and what lies about.
        chairs: how many; there are 24 seats.
    """
    jitter = _Jitter(rng)
    scene = empty_room(SEMINAR_X_M, SEMINAR_Y_M)
    top = office_furniture.plain_table("seminar_table", 1.4, 0.7, 0.73)
    tables: list[Instance] = []
    for row in range(_ROWS):
        x = 2.35 + row * _ROW_STEP_M + float(rng.uniform(-0.05, 0.05))
        for block in (-1, 1):
            middle = 0.5 * SEMINAR_Y_M + block * (0.5 * _AISLE_M + 1.4)
            T_map_block = jitter.pose(x, middle, 0.0, 0.03, 0.015).to_transform()
            for part in (-0.5, 0.5):
                # Two tables of a block touch: they must be told apart by their size.
                in_block = Pose(0.0, part * 1.401, 0.0).to_transform()
                pose = Pose.from_transform(T_map_block @ in_block)
                tables.append(Instance(f"table{len(tables) + 1}", top, pose))
    scene = scene.with_instances(tables)
    chair = office_furniture.conference_chair()
    spots = [(table, side) for table in tables for side in (-0.35, 0.35)]
    taken = sorted(int(k) for k in rng.permutation(len(spots))[:chairs])
    for number, index in enumerate(taken):
        table, side = spots[index]
        seat = seats(table, 1)[0]
        placed = chair_at(
            table,
            type(seat)(seat.x, seat.y + side, seat.yaw_rad),
            chair,
            f"chair{number + 1}",
            float(rng.uniform(-0.2, 0.12)),
            float(rng.normal(0.0, 0.09)),
        )
        scene = scene.with_instances([placed])
    for table in tables:
        if rng.random() < 0.4:
            things: list[Model] = [office_furniture.paper_stack(rng), belongings.laptop()]
            scene = _strewn(scene, table.name, things[: int(rng.integers(1, 3))], rng)
    return scene


class _Jitter:
    """Poses that are off by a little."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng

    def pose(self, x: float, y: float, yaw: float, shift_m: float, turn_rad: float) -> Pose:
        dx, dy, dyaw = self._rng.uniform(-1.0, 1.0, 3)
        return Pose.from_rpy(x + shift_m * dx, y + shift_m * dy, 0.0, yaw=yaw + turn_rad * dyaw)


def _strewn(scene: Scene, base: str, things: list[Model], rng: np.random.Generator) -> Scene:
    support: Support = support_of(scene[base])
    for model in things:

        def draw() -> Place:
            return anywhere_on(support, rng, 0.15)

        stem = model.cls[0].lower() + model.cls[1:]
        name = scene.free_name(stem)
        thing = try_on_support(scene, scene[base], support, model, name, draw, 0.02)
        if thing is not None:
            scene = scene.with_instances([thing])
    return scene


def _put(scene: Scene, base: str, support_name: str, model: Model, place: Place) -> Scene:
    support = support_of(scene[base], support_name)
    name = scene.free_name(model.cls[0].lower() + model.cls[1:])
    thing = try_on_support(scene, scene[base], support, model, name, lambda: place, tries=1)
    return scene if thing is None else scene.with_instances([thing])
