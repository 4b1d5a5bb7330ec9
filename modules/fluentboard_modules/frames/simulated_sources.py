"""Simulated drives by name: `sim:restaurant`, `sim:tables?scene=3`, and their options."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fluentboard.errors import InvalidInput
from fluentboard_modules.frames.source_options import check_options, split_options, whole_number

if TYPE_CHECKING:
    from fluentboard_modules.simulation.drive import SimulatedDrive
    from fluentboard_modules.simulation.robots import RobotModel
    from fluentboard_modules.simulation.scene import Scene

_COMMON_OPTIONS = ("seed", "frames", "width", "noise", "rate", "visit", "robot")
_KINECT_WIDTH = 640

Options = Mapping[str, str]


@dataclass(frozen=True, slots=True)
class _Wanted:
    """What every simulated drive is asked for.

    Attributes:
        text: all of the source, for messages.
        options: what stands behind the question mark.
        seed: of the scene and of the noise.
        frames: how many.
        robot: who drives, if not the usual one.
    """

    text: str
    options: Options
    seed: int
    frames: int
    robot: RobotModel | None

    def rng(self) -> np.random.Generator:
        return np.random.default_rng(self.seed)


@dataclass(frozen=True, slots=True)
class _Kind:
    """A kind of simulated drive.

    Attributes:
        make: the drive.
        frames: how many unless asked otherwise.
        options: that only this kind has.
    """

    make: Callable[[_Wanted], SimulatedDrive]
    frames: int
    options: tuple[str, ...] = ()


def _restaurant(wanted: _Wanted) -> SimulatedDrive:
    from fluentboard_modules.simulation.drive import restaurant_demo_drive

    return restaurant_demo_drive(wanted.seed, wanted.frames, wanted.robot)


def _room(wanted: _Wanted) -> SimulatedDrive:
    from fluentboard_modules.simulation.rooms import furnished_room

    return _through(furnished_room(wanted.rng()), wanted, "room", wanted.robot)


def _table(wanted: _Wanted) -> SimulatedDrive:
    from fluentboard_modules.simulation.drive import table_drive
    from fluentboard_modules.simulation.restaurant import restaurant
    from fluentboard_modules.simulation.robots import PR2

    driver = wanted.robot if wanted.robot is not None else PR2
    scene, height = restaurant(wanted.rng()), driver.camera_height_m
    return table_drive(scene, "table1", wanted.seed, wanted.frames, height)


def _tables(wanted: _Wanted) -> SimulatedDrive:
    from fluentboard_modules.simulation.table_scenes import table_scene_drive

    number = whole_number(wanted.text, wanted.options, "scene", 1, least=1)
    return table_scene_drive(number, wanted.seed, wanted.frames, robot=wanted.robot)


def _office(wanted: _Wanted) -> SimulatedDrive:
    from fluentboard_modules.simulation.chapter3_rooms import office

    return _through(office(wanted.rng()), wanted, "office", wanted.robot or _kurtana())


def _seminar(wanted: _Wanted) -> SimulatedDrive:
    from fluentboard_modules.simulation.chapter3_rooms import seminar_room

    scene = seminar_room(wanted.rng())
    return _through(scene, wanted, "seminar room", wanted.robot or _kurtana())


def _search(wanted: _Wanted) -> SimulatedDrive:
    from fluentboard_modules.simulation.search_scenes import hidden_pepper_mill

    rooms = whole_number(wanted.text, wanted.options, "rooms", 1, least=1)
    scene = hidden_pepper_mill(wanted.seed, rooms).scene
    return _through(scene, wanted, "room with a hidden pepper mill", wanted.robot)


def _through(scene: Scene, wanted: _Wanted, name: str, robot: RobotModel | None) -> SimulatedDrive:
    from fluentboard_modules.simulation.drive import room_drive

    return room_drive(scene, wanted.seed, wanted.frames, name=name, robot=robot)


def _kurtana() -> RobotModel:
    from fluentboard_modules.simulation.robots import KURTANA

    return KURTANA


_KINDS: Mapping[str, _Kind] = {
    "restaurant": _Kind(_restaurant, 80),
    "room": _Kind(_room, 80),
    "table": _Kind(_table, 40),
    "tables": _Kind(_tables, 72, ("scene",)),
    "office": _Kind(_office, 200),
    "seminar": _Kind(_seminar, 200),
    "search": _Kind(_search, 80, ("rooms",)),
}

SIMULATED_SCENES = tuple(f"sim:{name}" for name in _KINDS)
"""What a simulated source may be called, without its options."""


def simulated_drive(
    scene_name: str, options: Options, text: str, start_s: float | None
) -> SimulatedDrive:
    """The drive of that name.

    Args:
        scene_name: what stands behind `sim:`.
        options: what stands behind the question mark.
        text: all of it, for messages.
        start_s: stamp of the first frame; None leaves it at 1 s.

    Raises:
        InvalidInput: there is no such scene or option.
    """
    kind = _KINDS.get(scene_name)
    if kind is None and scene_name.endswith(".json"):
        kind = _Kind(partial(_from_file, scene_name), 80)
    if kind is None:
        raise InvalidInput(
            f"no simulated scene is called {scene_name!r}; give {', '.join(SIMULATED_SCENES)}, or "
            "the JSON file of a scene (sim:FILE.json)"
        )
    check_options(text, options, (*_COMMON_OPTIONS, *kind.options))
    seed = whole_number(text, options, "seed", 0)
    frames = whole_number(text, options, "frames", kind.frames, least=1)
    drive = kind.make(_Wanted(text, options, seed, frames, _robot(text, options)))
    drive = _as_asked(drive, text, options)
    drive = drive if start_s is None else replace(drive, start_s=start_s)
    number = whole_number(text, options, "visit", 1, least=1)
    if number == 1:
        return drive
    from fluentboard_modules.simulation.visits import visits

    return visits(drive, number)[-1].drive


def _as_asked(drive: SimulatedDrive, text: str, options: Options) -> SimulatedDrive:
    """The drive with the wanted image width, noise and rate."""
    from fluentboard_modules.simulation.noise import NoiseConfig

    width = whole_number(text, options, "width", _KINECT_WIDTH, least=16)
    if whole_number(text, options, "noise", 1) == 0:
        drive = replace(drive, noise=NoiseConfig.none())
    if width != drive.camera.width:
        drive = replace(drive, camera=drive.camera.resized(width))
    return replace(drive, rate_hz=float(whole_number(text, options, "rate", 2, least=1)))


def _from_file(path: str, wanted: _Wanted) -> SimulatedDrive:
    """A drive through the scene of a JSON file, with a floor if it has none."""
    from fluentboard_modules.simulation.rooms import with_floor
    from fluentboard_modules.simulation.scene_json import load_scene

    scene = load_scene(path)
    if not scene.of_class("Floor"):
        scene = with_floor(scene)
    return _through(scene, wanted, Path(path).stem, wanted.robot)


def _robot(text: str, options: Options) -> RobotModel | None:
    from fluentboard_modules.simulation.robots import ROBOTS

    name = options.get("robot")
    if name is None:
        return None
    for model in ROBOTS.values():
        if model.name.lower() == name.lower():
            return model
    raise InvalidInput(f"{text}: no robot is called {name!r}; give one of {', '.join(ROBOTS)}")


def drive_of(scene: str, asked: Options, start_s: float | None = None) -> SimulatedDrive:
    """The drive that a command is asked for: a scene as text, and further options.

    Args:
        scene: such as `restaurant`, `sim:tables?scene=3` or `world/scene.json`.
        asked: options; none of them may stand in the text, too.
        start_s: stamp of the first frame.

    Raises:
        InvalidInput: there is no such scene or option, or an option stands there twice.
    """
    place, options = split_options(scene)
    twice = sorted(options.keys() & asked.keys())
    if twice:
        raise InvalidInput(f"{scene}: {twice[0]} is given twice; leave one of them out")
    return simulated_drive(place.removeprefix("sim:"), {**options, **asked}, scene, start_s)
