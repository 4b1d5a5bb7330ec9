"""The source of frames that a command line names: a folder, or a simulated drive.

kitchen/                 a folder in a layout that `frames.folders` knows
simulated-restaurant     a drive through the simulated restaurant
simulated-restaurant:7   the same with another seed: furniture and noise differ
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

from fluentboard.errors import InvalidInput
from fluentboard_modules.frames.sensor_frame import FrameSource

SIMULATED = "simulated-restaurant"
_CLOUD_SUFFIXES = (".pcd", ".ply")
_SIMULATED = re.compile(rf"{SIMULATED}(?::(\d+))?")


def open_source(text: str, *, start_s: float | None = None) -> FrameSource:
    """The source that a text names; see above.

    Args:
        text: value of `--frames`.
        start_s: stamp of the first frame on the board's time axis; None leaves it to the source.

    Raises:
        InvalidFrame: there is no such folder or file, or no recording in it.
        InvalidInput: the simulator is named in a way it does not know.
    """
    match = _SIMULATED.fullmatch(text)
    if match:
        from fluentboard_modules.simulation.drive import restaurant_demo_drive

        drive = restaurant_demo_drive(int(match.group(1) or 0))
        return drive if start_s is None else replace(drive, start_s=start_s)
    if text.startswith("simulated") and not Path(text).exists():
        raise InvalidInput(
            f"no simulated source is called {text!r}; there is {SIMULATED}, or with a seed "
            f"{SIMULATED}:7"
        )
    if Path(text).suffix.lower() in _CLOUD_SUFFIXES and not Path(text).is_dir():
        from fluentboard_modules.frames.clouds import open_cloud

        return open_cloud(text, start_s=start_s)
    from fluentboard_modules.frames.folders import open_folder

    return open_folder(text, start_s=start_s)
