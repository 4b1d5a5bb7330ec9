"""Laid tables: plate, fork left, knife and spoon right, mug, and what guests share."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from pydantic import Field

from fluentboard.errors import InvalidInput
from fluentboard.model.geometry import Pose
from fluentboard_modules.settings import Settings
from fluentboard_modules.simulation.placement import (
    Place,
    fits,
    support_of,
    try_on_support,
)
from fluentboard_modules.simulation.scene import Instance, Model, Scene
from fluentboard_modules.simulation.table_service import TableService


class TableSettingConfig(Settings):
    """How a table is laid."""

    place_width_m: float = Field(default=0.6, gt=0.4)
    """Edge of the table that one guest needs (usual in restaurants)."""

    untidiness: float = Field(default=1.0, ge=0.0, le=2.0)
    """Factor on the scatter: 1 cm and 4 deg for cutlery, 2 cm for mugs; 0 is ruler-straight."""

    missing: float = Field(default=0.06, ge=0.0, le=1.0)
    """Probability that an item of a place is not there."""

    left_handed: float = Field(default=0.0, ge=0.0, le=1.0)
    """Probability that a place is laid the other way round."""

    meal: Literal["dinner", "coffee"] = "dinner"
    """Dinner: plate, fork left, knife and spoon right, mug. Coffee: a plate, a mug to its right and
    a spoon between them."""

    shared: tuple[str, ...] = ("TableSign", "Jug", "SugarPot", "MilkPot")
    """Classes of what stands in the middle, in the order of placing."""


@dataclass(frozen=True, slots=True)
class Seat:
    """Where a guest sits at a table, in the frame of the table.

    Attributes:
        x: middle of the guest's piece of the edge, metres.
        y: metres.
        yaw_rad: the way the guest looks.
    """

    x: float
    y: float
    yaw_rad: float

    def place(self, right: float, forward: float, yaw_rad: float = 0.0) -> Place:
        """A place to the right of the guest and so far in from the edge; yaw 0 looks away."""
        c, s = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        return (
            self.x + forward * c + right * s,
            self.y + forward * s - right * c,
            self.yaw_rad + yaw_rad,
        )


def capacity(table: Instance, place_width_m: float = 0.6) -> int:
    """How many guests can be seated at a table."""
    per_side, heads = _room(table, place_width_m)
    return 2 * per_side + heads


def _room(table: Instance, place_width_m: float) -> tuple[int, int]:
    top = support_of(table)
    per_side = max(1, math.floor(top.y_size / place_width_m + 1e-6))
    # Heads of the table only where their plates do not push the others aside.
    heads = 2 if top.x_size >= 0.6 and top.y_size - per_side * place_width_m >= 0.3 else 0
    return per_side, heads


def seats(table: Instance, count: int, place_width_m: float = 0.6) -> tuple[Seat, ...]:
    """Seats for so many people, in pairs that face each other across the table.

    Args:
        table: the longer sides of its top run along its y axis.
        count: how many people are to sit there.
        place_width_m: edge of the table that one of them needs.

    Raises:
        InvalidInput: the table has fewer seats.
    """
    per_side, heads = _room(table, place_width_m)
    if not 0 <= count <= 2 * per_side + heads:
        raise InvalidInput(
            f"{table.name!r} seats {2 * per_side + heads} guests, asked for {count}; "
            "use a larger table or fewer guests"
        )
    top = support_of(table)
    pairs = min(per_side, max(1, math.ceil(count / 2)))
    step = max(place_width_m, min(top.y_size / pairs, 0.75))
    found: list[Seat] = []
    for k in range(pairs):
        y = top.y + (k - 0.5 * (pairs - 1)) * step
        found.append(Seat(top.x - 0.5 * top.x_size, y, 0.0))
        found.append(Seat(top.x + 0.5 * top.x_size, y, math.pi))
    found.append(Seat(top.x, top.y - 0.5 * top.y_size, 0.5 * math.pi))
    found.append(Seat(top.x, top.y + 0.5 * top.y_size, -0.5 * math.pi))
    return tuple(found[:count])


def chair_at(
    table: Instance, seat: Seat, model: Model, name: str, pulled_m: float, yaw_rad: float = 0.0
) -> Instance:
    """A chair at a seat, its front edge that far from the table's edge (negative: pushed under)."""
    reach = float(model.mesh.bounds[1, 0]) + pulled_m
    x, y, yaw = seat.place(0.0, -reach, yaw_rad)
    pose = Pose.from_transform(table.T_map_model @ Pose.from_rpy(x, y, 0.0, yaw=yaw).to_transform())
    return Instance(name, model, pose)


def chairs_around(
    table: Instance,
    taken: Sequence[Seat],
    model: Model,
    names: Sequence[str],
    rng: np.random.Generator,
) -> tuple[Instance, ...]:
    """Chairs at those seats, pulled out or pushed in by a random amount that leaves them free."""
    alone = Scene((table,))
    found: list[Instance] = []
    for seat, name in zip(taken, names, strict=True):
        for _ in range(40):
            pulled = float(rng.uniform(-0.12, 0.16))
            turn = float(rng.normal(0.0, 0.1))
            chair = chair_at(table, seat, model, name, pulled, turn)
            if fits(chair, alone, 0.005):
                break
        else:
            chair = chair_at(table, seat, model, name, 0.05)
        found.append(chair)
        alone = alone.with_instances([chair])
    return tuple(found)


def lay_table(
    scene: Scene,
    table_name: str,
    guests: int,
    rng: np.random.Generator,
    config: TableSettingConfig | None = None,
    places: Sequence[Seat] | None = None,
    service: TableService | None = None,
) -> Scene:
    """The scene with that table laid for so many guests.

    Args:
        scene: has the table.
        table_name: name of an instance with a support.
        guests: number of place settings.
        rng: scatter, missing items and the colours of the mugs.
        config: how tidy and how complete.
        places: where the guests sit, if the table has more chairs than guests.
        service: what to lay it with; plain tableware if not given.

    Raises:
        InvalidInput: the table has fewer seats.
    """
    config = config if config is not None else TableSettingConfig()
    table = scene[table_name]
    taken = seats(table, guests, config.place_width_m) if places is None else places[:guests]
    service = service if service is not None else TableService()
    for seat in taken:
        scene = _lay_place(scene, table, seat, rng, config, service)
    return _lay_middle(scene, table, rng, config, service) if guests else scene


# Class, steps to the right and forward from the edge, yaw, and their scatter.
_PLACE: dict[str, tuple[tuple[str, float, float, float, float, float], ...]] = {
    "dinner": (
        ("Plate", 0.0, 0.17, 0.0, 0.008, math.pi),
        ("Fork", -0.165, 0.15, 0.0, 0.008, 0.06),
        ("Knife", 0.16, 0.155, 0.0, 0.006, 0.05),
        ("Spoon", 0.215, 0.15, 0.0, 0.006, 0.05),
        ("Mug", 0.19, 0.33, -0.5 * math.pi, 0.018, 0.5),
    ),
    "coffee": (
        ("Plate", -0.06, 0.17, 0.0, 0.02, math.pi),
        ("Spoon", 0.115, 0.16, 0.0, 0.01, 0.15),
        ("Mug", 0.2, 0.2, -0.5 * math.pi, 0.025, 0.8),
    ),
}


def _lay_place(
    scene: Scene,
    table: Instance,
    seat: Seat,
    rng: np.random.Generator,
    config: TableSettingConfig,
    service: TableService,
) -> Scene:
    colour = service.mug_colours[int(rng.integers(len(service.mug_colours)))]
    plain = service.model("Mug")
    # Models of one name are alike, their colour too: a scene file has one entry for each name.
    mug = replace(plain, name=f"{plain.name}_{bytes(colour).hex()}", colour=colour)
    side = -1.0 if config.left_handed > 0.0 and rng.random() < config.left_handed else 1.0
    top = support_of(table)
    mess = config.untidiness
    for cls, right, forward, yaw, shift, turn in _PLACE[config.meal]:
        if rng.random() < config.missing:
            continue
        model = mug if cls == "Mug" else service.model(cls)

        def draw(
            right: float = side * right,
            forward: float = forward,
            yaw: float = yaw,
            shift: float = shift * mess,
            turn: float = turn * mess,
        ) -> Place:
            dx, dy, dyaw = rng.standard_normal(3)
            return seat.place(right + shift * dx, forward + shift * dy, yaw + turn * dyaw)

        thing = try_on_support(
            scene, table, top, model, scene.free_name(_stem(model.cls)), draw, tries=30
        )
        if thing is not None:
            scene = scene.with_instances([thing])
    return scene


def _lay_middle(
    scene: Scene,
    table: Instance,
    rng: np.random.Generator,
    config: TableSettingConfig,
    service: TableService,
) -> Scene:
    top = support_of(table)
    jug: Place | None = None
    for cls in config.shared:
        model: Model = service.model(cls)
        beside = jug if cls in ("SugarPot", "MilkPot") else None

        def draw(cls: str = cls, beside: Place | None = beside) -> Place:
            turn = float(rng.uniform(-math.pi, math.pi))
            if beside is not None:  # sugar and milk stand next to the coffee
                angle, distance = (
                    float(rng.uniform(-math.pi, math.pi)),
                    float(rng.uniform(0.12, 0.24)),
                )
                x, y = math.cos(angle) * distance, math.sin(angle) * distance
                return beside[0] + x, beside[1] + y, turn
            # Along the middle line; the sign closest to the middle, its faces to the long sides.
            spread = 0.06 if cls == "TableSign" else 0.22
            dx, dy, dyaw = rng.standard_normal(3)
            x, y = top.x + 0.03 * dx, top.y + min(spread, 0.25 * top.y_size) * dy
            return x, y, 0.15 * dyaw if cls == "TableSign" else turn

        name = scene.free_name(_stem(cls))
        thing = try_on_support(scene, table, top, model, name, draw, gap_m=0.01, tries=120)
        if thing is None:
            continue
        scene = scene.with_instances([thing])
        if cls == "Jug":
            local = table.T_map_model.inverse() @ thing.T_map_model
            jug = (float(local.translation[0]), float(local.translation[1]), 0.0)
    return scene


def _stem(cls: str) -> str:
    return cls[0].lower() + cls[1:]
