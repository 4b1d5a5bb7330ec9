"""The source of frames that a text names: what `--frames` of the command line accepts.

kitchen/                      a folder: 7-Scenes, TUM RGB-D, Open3D/Redwood, or a ROS 2 bag
table.pcd, table.ply          a point cloud, as one frame
drive.bag, drive.mcap, .db3   a ROS bag
sim:restaurant                a simulated drive; also sim:room, sim:table, sim:tables?scene=3
http://host:8080/frames/head  frames that a robot sends to a board while they are being made

Options follow a question mark: `kitchen?every=5`, `sim:room?seed=3&frames=40`,
`drive.bag?depth=/camera/depth/image_raw&map=odom`.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from fluentboard.errors import InvalidFrame, InvalidInput
from fluentboard_modules.frames.recordings import Recording
from fluentboard_modules.frames.sensor_frame import FrameSource
from fluentboard_modules.frames.simulated_sources import SIMULATED_SCENES, simulated_drive
from fluentboard_modules.frames.source_options import (
    check_options,
    split_options,
    whole_number,
)

SIMULATED = "simulated-restaurant"
"""The older name of `sim:restaurant`; `simulated-restaurant:7` has the seed 7."""

_SIMULATED = re.compile(rf"{SIMULATED}(?::(\d+))?")
_CLOUD_ENDINGS = (".pcd", ".ply")
_BAG_ENDINGS = (".bag", ".db3", ".mcap")
_BAG_OPTIONS = ("depth", "colour", "cloud", "info", "colour_info", "map")


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
        return simulated_drive("restaurant", {"seed": seed}, text, start_s)
    place, options = split_options(text)
    if place.startswith(("http://", "https://")):
        check_options(text, options, ())
        from fluentboard_modules.frames.live import LiveFrames

        return LiveFrames.from_url(place, token=token, start_s=start_s)
    if place.startswith("sim:"):
        return simulated_drive(place.removeprefix("sim:"), options, text, start_s)
    if place.startswith("simulated") and not Path(place).exists():
        raise InvalidInput(
            f"no simulated source is called {text!r}; give {', '.join(SIMULATED_SCENES)}, with a "
            "seed sim:restaurant?seed=7"
        )
    return _every(_recording(Path(place), options, text, start_s), options, text)


def _recording(
    path: Path, options: Mapping[str, str], text: str, start_s: float | None
) -> Recording:
    from fluentboard_modules.frames.folders import check_start, expected_layouts, open_folder

    check_start(text, start_s)
    ending = path.suffix.lower()
    if (ending in _BAG_ENDINGS and not path.is_dir()) or (path / "metadata.yaml").is_file():
        from fluentboard_modules.frames.bags import open_bag

        check_options(text, options, ("every", *_BAG_OPTIONS))
        chosen = {name: value for name, value in options.items() if name in _BAG_OPTIONS}
        return open_bag(path, start_s=start_s, options=chosen)
    check_options(text, options, ("every",))
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
            f"{', '.join(SIMULATED_SCENES)}, or http://host:port/frames/sensor"
        )
    inside = sorted(p.name for p in path.iterdir() if p.suffix.lower() in _BAG_ENDINGS)
    if inside:  # a ROS 2 bag that lost its metadata still has its storage
        raise InvalidFrame(f"{path}: no recording itself, but holds {', '.join(inside)}; name one")
    return open_folder(path, start_s=start_s)


def _every(recording: Recording, options: Mapping[str, str], text: str) -> Recording:
    step = whole_number(text, options, "every", 1, least=1)
    return recording if step == 1 else recording.every(step)
