"""Simulated drives by name: `sim:restaurant`, `sim:tables?scene=3`, and their options."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from fluentboard.errors import InvalidInput
from fluentboard_modules.frames.source_options import check_options, whole_number

if TYPE_CHECKING:
    from fluentboard_modules.simulation.drive import SimulatedDrive

_COMMON_OPTIONS = ("seed", "frames", "width", "noise", "rate")
_KINECT_WIDTH = 640

Options = Mapping[str, str]


@dataclass(frozen=True, slots=True)
class _Kind:
    """A kind of simulated drive.

    Attributes:
        make: the drive, from the whole text, the options, the seed and the number of frames.
        frames: how many unless asked otherwise.
        options: that only this kind has.
    """

    make: Callable[[str, Options, int, int], SimulatedDrive]
    frames: int
    options: tuple[str, ...] = ()


def _restaurant(text: str, options: Options, seed: int, frames: int) -> SimulatedDrive:
    from fluentboard_modules.simulation.drive import restaurant_demo_drive

    return restaurant_demo_drive(seed, frames)


def _room(text: str, options: Options, seed: int, frames: int) -> SimulatedDrive:
    import numpy as np

    from fluentboard_modules.simulation.drive import room_drive
    from fluentboard_modules.simulation.rooms import furnished_room

    return room_drive(furnished_room(np.random.default_rng(seed)), seed, frames)


def _table(text: str, options: Options, seed: int, frames: int) -> SimulatedDrive:
    import numpy as np

    from fluentboard_modules.simulation.drive import table_drive
    from fluentboard_modules.simulation.restaurant import restaurant

    return table_drive(restaurant(np.random.default_rng(seed)), "table1", seed, frames)


def _tables(text: str, options: Options, seed: int, frames: int) -> SimulatedDrive:
    from fluentboard_modules.simulation.table_scenes import table_scene_drive

    return table_scene_drive(whole_number(text, options, "scene", 1, least=1), seed, frames)


_KINDS: Mapping[str, _Kind] = {
    "restaurant": _Kind(_restaurant, 80),
    "room": _Kind(_room, 80),
    "table": _Kind(_table, 40),
    "tables": _Kind(_tables, 72, ("scene",)),
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
    from fluentboard_modules.simulation.noise import NoiseConfig

    kind = _KINDS.get(scene_name)
    if kind is None:
        raise InvalidInput(
            f"no simulated scene is called {scene_name!r}; give {', '.join(SIMULATED_SCENES)}"
        )
    check_options(text, options, (*_COMMON_OPTIONS, *kind.options))
    seed = whole_number(text, options, "seed", 0)
    frames = whole_number(text, options, "frames", kind.frames, least=1)
    width = whole_number(text, options, "width", _KINECT_WIDTH, least=16)
    is_noisy = whole_number(text, options, "noise", 1) != 0
    rate_hz = whole_number(text, options, "rate", 2, least=1)
    drive = replace(
        kind.make(text, options, seed, frames),
        noise=NoiseConfig() if is_noisy else NoiseConfig.none(),
        rate_hz=float(rate_hz),
    )
    if width != drive.camera.width:
        drive = replace(drive, camera=drive.camera.resized(width))
    return drive if start_s is None else replace(drive, start_s=start_s)
