"""Where a robot searches: a simulated room, a scene file, or a saved occupancy map."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, runtime_checkable
from urllib.parse import parse_qsl

import numpy as np

from fluentboard.errors import InvalidInput
from fluentboard.model.geometry import BoundingBox
from fluentboard_modules.search.map_robot import MapRobot, costmap_of
from fluentboard_modules.search.octomap_files import read_octomap
from fluentboard_modules.simulation.navigation import Costmap, costmap
from fluentboard_modules.simulation.noise import NoiseConfig
from fluentboard_modules.simulation.robots import ROBOTS, Robot, RobotModel, View
from fluentboard_modules.simulation.scene import Instance, Scene
from fluentboard_modules.simulation.scene_json import load_scene
from fluentboard_modules.simulation.search_scenes import hidden_pepper_mill
from fluentboard_modules.simulation.watchful_robot import WatchfulSimulatedRobot

IMAGE_WIDTH = 320
RECOGNITION_WIDTH = 640
"""Pixels across an image in which tableware can be recognised; the map needs fewer."""


@runtime_checkable
class IdleRobot(Protocol):
    """A robot whose clock stands still while it has nothing to do, as in a simulation."""

    def idle_until(self, time_s: float) -> None:
        """Does nothing up to a time on the board's time axis."""
        ...


@dataclass(frozen=True, eq=False)
class SearchWorld:
    """A robot and what it stands in.

    Attributes:
        robot: ready to search.
        costmap: where it can drive.
        volumes: boxes that the world itself names, such as those of a scene file.
        things: per label of the robot's frames the thing; empty where frames carry no labels.
    """

    robot: Robot
    costmap: Costmap
    volumes: Mapping[str, BoundingBox]
    things: Mapping[int, Instance]


def open_world(
    source: str,
    model: str = "PR2",
    seed: int = 0,
    start_s: float = 1.0,
    image_width: int = IMAGE_WIDTH,
) -> SearchWorld:
    """The world of a source.

    Args:
        source: `sim:search?seed=1` (a room with a hidden pepper mill), a scene file
            (`world.json`) or an OctoMap (`kitchen.bt`, `kitchen.ot`).
        model: name of the robot.
        seed: of the sensor noise, and of the start in a file.
        start_s: the robot's clock at the beginning, on the board's time axis.
        image_width: of the simulated camera, in pixels.

    Raises:
        InvalidInput: the source or the robot is unknown.
    """
    if model not in ROBOTS:
        raise InvalidInput(f"no robot is called {model!r}; there are {', '.join(ROBOTS)}")
    robot = ROBOTS[model]
    place, _, options = source.partition("?")
    rng = np.random.default_rng(seed)
    if place == "sim:search":
        chosen = dict(parse_qsl(options))
        number = chosen.get("seed", "0")
        if not number.isdecimal() or set(chosen) - {"seed"}:
            raise InvalidInput(f"{source!r} is no room to search; give sim:search?seed=1")
        room = hidden_pepper_mill(int(number))
        return world_in_scene(room.scene, robot, room.start, rng, start_s, image_width)
    path = Path(source.removeprefix("sim:"))
    if path.suffix == ".json":
        scene = load_scene(path)
        return world_in_scene(
            scene,
            robot,
            _some_view(costmap(scene, robot.radius_m), rng),
            rng,
            start_s,
            image_width,
        )
    if path.suffix in (".bt", ".ot"):
        world = read_octomap(path)
        start = _within_limits(_some_view(costmap_of(world, robot), rng), robot)
        walker = MapRobot(robot, world, start, start_s=start_s)
        return SearchWorld(walker, walker.costmap, {}, {})
    raise InvalidInput(
        f"{source!r} is nothing to search in; give sim:search?seed=1, a scene (.json) or an "
        "OctoMap (.bt, .ot)"
    )


def world_in_scene(
    scene: Scene,
    model: RobotModel,
    start: View,
    rng: np.random.Generator,
    start_s: float,
    image_width: int = IMAGE_WIDTH,
) -> SearchWorld:
    """A robot in a simulated scene.

    Args:
        scene: what it stands in.
        model: of the robot.
        start: where it stands; its tilt is brought within the robot's limits.
        rng: draws the sensor noise.
        start_s: its clock at the beginning, on the board's time axis.
        image_width: of its camera, in pixels.
    """
    view = _within_limits(start, model)
    robot = WatchfulSimulatedRobot(
        model, scene, view, rng, NoiseConfig(), image_width=image_width, start_s=start_s
    )
    return SearchWorld(
        robot,
        robot.costmap,
        {v.name.replace(" ", "_"): v.box for v in scene.search_volumes},
        {thing.label: thing for thing in scene.objects},
    )


def _within_limits(view: View, model: RobotModel) -> View:
    """The same place and heading, the camera tilted as the robot can."""
    low, high = model.tilt_rad
    return View(view.x, view.y, view.yaw_rad, tilt_rad=min(max(view.tilt_rad, low), high))


def _some_view(room: Costmap, rng: np.random.Generator) -> View:
    """A random place in the largest connected part of the floor."""
    from scipy.ndimage import label

    parts, count = label(room.cost < 253, np.ones((3, 3)))
    if not count:
        raise InvalidInput("the robot can stand nowhere there; use a smaller one")
    largest = int(np.bincount(parts.ravel())[1:].argmax()) + 1
    rows, columns = np.nonzero(parts == largest)
    chosen = int(rng.integers(len(rows)))
    x, y = room.position(int(rows[chosen]), int(columns[chosen]))
    return View(x, y, float(rng.uniform(-math.pi, math.pi)))
