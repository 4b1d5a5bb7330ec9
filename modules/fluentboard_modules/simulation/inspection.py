"""How a robot inspects a table: from place to place around it, turning towards it at each.

Section 4.3.1: the robot was "driving around a table and turning towards it from different
locations", so that it sees a part of the table at a time and loses track of it on the way.
"""

from __future__ import annotations

import math

import numpy as np
from pydantic import Field

from fluentboard.errors import InvalidInput, UnreachableView
from fluentboard.model.geometry import FloatArray, Transform
from fluentboard_modules.settings import Settings
from fluentboard_modules.simulation.navigation import Costmap
from fluentboard_modules.simulation.robots import RobotModel, View
from fluentboard_modules.simulation.scene import Support

_TRIES = 300


class InspectionConfig(Settings):
    """Where and how long the robot looks."""

    places: int = Field(default=7, ge=1)
    """How many places around the table it looks from."""

    reach_m: tuple[float, float] = (0.85, 1.4)
    """How far from the base the point it looks at may be; a fixed camera has but one distance."""

    travelling: float = Field(default=0.2, ge=0.0, lt=1.0)
    """Share of the frames that are taken on the way between two places."""

    sweep_rad: float = Field(default=0.12, ge=0.0)
    """The robot turns by so much to either side while it looks."""

    aside: float = Field(default=0.4, ge=0.0, le=0.5)
    """How far from the middle of the table the looks may aim, as a share of its size."""


def inspection(
    T_map_table: Transform,
    top: Support,
    free: Costmap,
    robot: RobotModel,
    frames: int,
    rng: np.random.Generator,
    config: InspectionConfig,
) -> tuple[Transform, ...]:
    """`T_map_sensor` of so many looks from places around a table and from the way between them.

    Args:
        T_map_table: takes the frame of `top` to the map frame.
        top: the surface to look at.
        free: where the robot's base may stand.
        robot: its camera, and the limits of its head.
        frames: how many looks.
        rng: decides the places.
        config: how many places, how far away.

    Raises:
        InvalidInput: there are fewer frames than one.
        UnreachableView: the robot can stand nowhere near the table.
    """
    if frames < 1:
        raise InvalidInput(f"an inspection of {frames} frames; give at least 1")
    places = _places(T_map_table, top, free, robot, rng, config)
    on_the_way = round(config.travelling * frames) if len(places) > 1 else 0
    dwelling = _shares(frames - on_the_way, len(places))
    between = _shares(on_the_way, len(places) - 1)
    poses: list[Transform] = []
    for k, place in enumerate(places):
        poses += [
            robot.T_map_sensor(_turned(place, sweep, robot))
            for sweep in _sweep(dwelling[k], config.sweep_rad)
        ]
        if k + 1 < len(places):
            poses += _travel(place, places[k + 1], free, robot, between[k])
    return tuple(poses)


def _places(
    T_map_table: Transform,
    top: Support,
    free: Costmap,
    robot: RobotModel,
    rng: np.random.Generator,
    config: InspectionConfig,
) -> list[View]:
    """Views of the table, counter-clockwise around it, each from a free place."""
    first = float(rng.uniform(-math.pi, math.pi))
    found: list[View] = []
    reachable: FloatArray | None = None
    for k in range(config.places):
        for _ in range(_TRIES):
            angle = first + (k + float(rng.uniform(-0.4, 0.4))) * 2.0 * math.pi / config.places
            aim = np.array(
                [
                    top.x + config.aside * top.x_size * float(rng.uniform(-1.0, 1.0)),
                    top.y + config.aside * top.y_size * float(rng.uniform(-1.0, 1.0)),
                    top.z,
                ]
            )
            reach = _reach(robot, float(aim[2]), config, rng)
            away = reach * np.array([math.cos(angle), math.sin(angle), 0.0])
            stand = T_map_table.apply(aim + away)
            cell = free.cell(float(stand[0]), float(stand[1]))
            if cell is None or not free.is_free(float(stand[0]), float(stand[1])):
                continue
            if reachable is not None and not np.isfinite(reachable[cell]):
                continue
            if reachable is None:
                reachable = free.path_costs(float(stand[0]), float(stand[1]))
            found.append(_towards(stand, T_map_table.apply(aim), robot))
            break
    if not found:
        raise UnreachableView(
            f"{robot.name} can stand nowhere near the table; its surroundings are too narrow"
        )
    return found


def _reach(
    robot: RobotModel, height_m: float, config: InspectionConfig, rng: np.random.Generator
) -> float:
    """How far from the base to look: where a fixed camera looks, or somewhere within the limits."""
    low, high = robot.tilt_rad
    if high - low > 1e-6 or robot.camera_height_m < height_m + 0.1:
        return float(rng.uniform(*config.reach_m))
    return (robot.camera_height_m - height_m) / math.tan(max(low, 0.1)) + robot.camera_x_m


def _towards(stand: FloatArray, aim: FloatArray, robot: RobotModel) -> View:
    yaw = math.atan2(float(aim[1] - stand[1]), float(aim[0] - stand[0]))
    reach = max(math.hypot(float(aim[1] - stand[1]), float(aim[0] - stand[0])), 1e-6)
    tilt = math.atan2(robot.camera_height_m - float(aim[2]), reach - robot.camera_x_m)
    tilt = min(max(tilt, robot.tilt_rad[0]), robot.tilt_rad[1])
    return View(float(stand[0]), float(stand[1]), yaw, robot.torso_m[0], 0.0, tilt)


def _turned(view: View, turn_rad: float, robot: RobotModel) -> View:
    """The view with the head, or else the base, turned aside."""
    low, high = robot.pan_rad
    if low <= turn_rad <= high:
        return View(view.x, view.y, view.yaw_rad, view.torso_m, turn_rad, view.tilt_rad)
    return View(view.x, view.y, view.yaw_rad + turn_rad, view.torso_m, 0.0, view.tilt_rad)


def _sweep(count: int, reach_rad: float) -> FloatArray:
    """Angles of so many looks from one place, there and back like a slow swing."""
    return reach_rad * np.sin(2.0 * math.pi * (np.arange(count) + 0.5) / max(count, 1))


def _travel(
    start: View, goal: View, free: Costmap, robot: RobotModel, count: int
) -> list[Transform]:
    """Looks on the way from one place to another, in the direction of travel."""
    if count == 0:
        return []
    points = free.path((start.x, start.y), (goal.x, goal.y)).points
    step = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    level = min(max(0.35, robot.tilt_rad[0]), robot.tilt_rad[1])
    found: list[Transform] = []
    for share in (np.arange(count) + 1.0) / (count + 1.0):
        x, y = (float(np.interp(share * step[-1], step, points[:, k])) for k in range(2))
        ahead = [
            float(np.interp(min(share * step[-1] + 0.3, step[-1]), step, points[:, k]))
            for k in range(2)
        ]
        dx, dy = ahead[0] - x, ahead[1] - y
        yaw = math.atan2(dy, dx) if math.hypot(dx, dy) > 1e-3 else goal.yaw_rad
        found.append(robot.T_map_sensor(View(x, y, yaw, start.torso_m, 0.0, level)))
    return found


def _shares(count: int, parts: int) -> list[int]:
    """A number in so many parts as equal as possible."""
    if parts < 1:
        return []
    return [count * (k + 1) // parts - count * k // parts for k in range(parts)]
