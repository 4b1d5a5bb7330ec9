"""The source of frames that a text names: what `--frames` of the command line accepts.

kitchen/                      a folder: 7-Scenes, TUM RGB-D, Open3D/Redwood, or a ROS 2 bag
table.pcd, table.ply          a point cloud, as one frame
drive.bag, drive.mcap, .db3   a ROS bag
sim:restaurant                a simulated drive; also sim:room and sim:table
http://host:8080/frames/head  frames that a robot sends to a board while they are being made

Options follow a question mark: `kitchen?every=5`, `sim:room?seed=3&frames=40`,
`drive.bag?depth=/camera/depth/image_raw&map=odom`.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from urllib.parse import unquote

from fluentboard.errors import InvalidFrame, InvalidInput
from fluentboard_modules.frames.recordings import Recording
from fluentboard_modules.frames.sensor_frame import FrameSource

SIMULATED = "simulated-restaurant"
"""The older name of `sim:restaurant`; `simulated-restaurant:7` has the seed 7."""

_SIMULATED = re.compile(rf"{SIMULATED}(?::(\d+))?")
_CLOUD_ENDINGS = (".pcd", ".ply")
_BAG_ENDINGS = (".bag", ".db3", ".mcap")
_SCENES = ("restaurant", "room", "table")
_SIMULATOR_OPTIONS = ("seed", "frames", "width", "noise", "rate")
_BAG_OPTIONS = ("depth", "colour", "cloud", "info", "colour_info", "map")
_KINECT_WIDTH = 640


def open_source(
    text: str, *, start_s: float | None = None, token: str | None = None
) -> FrameSource:
    """The source that a text names; see above.

    Args:
        text: value of `--frames`.
        start_s: stamp of the first frame on the board's time axis; None leaves it to the source.
        token: bearer token for live frames, where the board asks for one.

    Raises:
        InvalidFrame: there is no such folder or file, or no recording in it.
        InvalidInput: an option or a simulated scene is unknown.
    """
    if _SIMULATED.fullmatch(text):
        seed = text.partition(":")[2] or "0"
        return _simulated("restaurant", {"seed": seed}, text, start_s)
    place, options = _split(text)
    if place.startswith(("http://", "https://")):
        _check_options(text, options, ())
        from fluentboard_modules.frames.live import LiveFrames

        return LiveFrames.from_url(place, token=token, start_s=start_s)
    if place.startswith("sim:"):
        return _simulated(place.removeprefix("sim:"), options, text, start_s)
    if place.startswith("simulated") and not Path(place).exists():
        raise InvalidInput(
            f"no simulated source is called {text!r}; give sim:{', sim:'.join(_SCENES)}, with a "
            "seed sim:restaurant?seed=7"
        )
    return _every(_recording(Path(place), options, text, start_s), options, text)


def _split(text: str) -> tuple[str, Mapping[str, str]]:
    """What stands before the question mark, and the options behind it."""
    place, mark, tail = text.partition("?")
    if not mark or Path(text).exists():  # a folder's name may have a question mark
        return text, {}
    options: dict[str, str] = {}
    for entry in tail.split("&"):
        name, equals, value = entry.partition("=")
        if not name or not equals or name in options:
            raise InvalidInput(
                f"{text}: the option {entry!r} is not understood; options are name=value, each "
                "once, joined by &"
            )
        options[name] = unquote(value)
    return place, options


def _recording(
    path: Path, options: Mapping[str, str], text: str, start_s: float | None
) -> Recording:
    from fluentboard_modules.frames.folders import check_start, expected_layouts, open_folder

    check_start(text, start_s)
    ending = path.suffix.lower()
    if (ending in _BAG_ENDINGS and not path.is_dir()) or (path / "metadata.yaml").is_file():
        from fluentboard_modules.frames.bags import open_bag

        _check_options(text, options, ("every", *_BAG_OPTIONS))
        chosen = {name: value for name, value in options.items() if name in _BAG_OPTIONS}
        return open_bag(path, start_s=start_s, options=chosen)
    _check_options(text, options, ("every",))
    if ending in _CLOUD_ENDINGS and not path.is_dir():
        from fluentboard_modules.frames.clouds import open_cloud

        return open_cloud(path, start_s=start_s)
    if path.is_file():
        raise InvalidFrame(
            f"{path}: no frames are read from files in {ending or 'no format'}; known are "
            f"{', '.join((*_CLOUD_ENDINGS, *_BAG_ENDINGS))}"
        )
    if not path.exists():
        raise InvalidFrame(
            f"{path}: no such file or folder; give a folder ({expected_layouts()}; or a ROS 2 "
            f"bag), a file ({', '.join((*_CLOUD_ENDINGS, *_BAG_ENDINGS))}), "
            f"sim:{', sim:'.join(_SCENES)}, or http://host:port/frames/sensor"
        )
    inside = sorted(p.name for p in path.iterdir() if p.suffix.lower() in _BAG_ENDINGS)
    if inside:  # a ROS 2 bag that lost its metadata still has its storage
        raise InvalidFrame(f"{path}: no recording itself, but holds {', '.join(inside)}; name one")
    return open_folder(path, start_s=start_s)


def _every(recording: Recording, options: Mapping[str, str], text: str) -> Recording:
    step = _number(text, options, "every", 1, least=1)
    return recording if step == 1 else recording.every(step)


def _simulated(
    scene_name: str, options: Mapping[str, str], text: str, start_s: float | None
) -> FrameSource:
    import numpy as np

    from fluentboard_modules.simulation import drive as drives
    from fluentboard_modules.simulation.noise import NoiseConfig
    from fluentboard_modules.simulation.restaurant import restaurant
    from fluentboard_modules.simulation.rooms import furnished_room
    from fluentboard_modules.simulation.viewpoint import kinect_camera

    _check_options(text, options, _SIMULATOR_OPTIONS)
    seed = _number(text, options, "seed", 0)
    frames = _number(text, options, "frames", 40 if scene_name == "table" else 80, least=1)
    camera = kinect_camera(_number(text, options, "width", _KINECT_WIDTH, least=16))
    is_noisy = _number(text, options, "noise", 1) != 0
    noise = NoiseConfig() if is_noisy else NoiseConfig.none()
    rng = np.random.default_rng(seed)
    if scene_name == "restaurant":
        drive = drives.restaurant_demo_drive(seed, frames)
    elif scene_name == "room":
        drive = drives.room_drive(furnished_room(rng), seed, frames)
    elif scene_name == "table":
        drive = drives.table_drive(restaurant(rng), "table1", seed, frames)
    else:
        raise InvalidInput(
            f"no simulated scene is called {scene_name!r}; give sim:{', sim:'.join(_SCENES)}"
        )
    rate_hz = _number(text, options, "rate", 2, least=1)
    drive = replace(drive, camera=camera, noise=noise, rate_hz=float(rate_hz))
    return drive if start_s is None else replace(drive, start_s=start_s)


def _check_options(text: str, options: Mapping[str, str], known: tuple[str, ...]) -> None:
    unknown = sorted(options.keys() - set(known))
    if unknown:
        raise InvalidInput(
            f"{text}: no option {unknown[0]!r} for this source; options are "
            f"{', '.join(known) or 'none'}"
        )


def _number(text: str, options: Mapping[str, str], name: str, default: int, least: int = 0) -> int:
    value = options.get(name)
    if value is None:
        return default
    if not (value.isascii() and value.isdigit()) or int(value) < least:
        raise InvalidInput(f"{text}: {name}={value}; give a whole number of at least {least}")
    return int(value)
