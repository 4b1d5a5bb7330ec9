"""Write any source as a recording, in the layout that other tools want."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, get_args

import numpy as np

from fluentboard.errors import InvalidInput
from fluentboard_modules.frames.bag_writers import write_bag
from fluentboard_modules.frames.calibration_files import GRAVITY_FILE
from fluentboard_modules.frames.folder_writers import write_redwood, write_tum
from fluentboard_modules.frames.gravity import align_with_gravity
from fluentboard_modules.frames.recordings import Recording
from fluentboard_modules.frames.registration import registered_colour
from fluentboard_modules.frames.sensor_frame import FrameSource, SensorFrame

Layout = Literal["7-scenes", "tum", "open3d", "bag", "mcap", "sqlite3"]

Progress = Callable[[int, int], None]
"""Called with the number of frames written and the number of all frames."""

_STORAGE_ENDINGS = {"mcap": ".mcap", "sqlite3": ".db3"}


def record_source(
    source: FrameSource,
    output: Path,
    layout: Layout | None = None,
    progress: Progress | None = None,
) -> int:
    """Writes the frames of a source; returns how many.

    Args:
        source: any source that ends.
        output: a new or empty folder, or a file that does not exist yet.
        layout: by default told by the ending of `output`; a folder gets the layout of 7-Scenes.
        progress: called after every frame.

    Raises:
        InvalidInput: there is something at `output`, or the layout cannot hold the frames.
    """
    layout = layout or _layout_of(output)
    if layout == "7-scenes":
        return _write_seven_scenes(source, output, progress)
    if layout in ("tum", "open3d"):
        write = write_tum if layout == "tum" else write_redwood
        count = write(source, output, progress)
        _write_gravity(source, output)
        return count
    # By REP 105 the frame `map` has z up, and a bag has no other place for gravity.
    if isinstance(source, Recording):
        source = source.in_map(align_with_gravity(source.gravity_world))
    ending = _STORAGE_ENDINGS.get(layout)
    if ending is None or output.suffix != ending:
        return write_bag(source, output, layout, progress)
    return _write_storage_file(source, output, layout, progress)


def checked_layout(text: str) -> Layout:
    """The layout of that name.

    Raises:
        InvalidInput: there is none.
    """
    for layout in get_args(Layout):
        if text == layout:
            return layout
    raise InvalidInput(f"layout {text!r}; give one of {', '.join(get_args(Layout))}")


def _layout_of(output: Path) -> Layout:
    endings: dict[str, Layout] = {".bag": "bag", ".mcap": "mcap", ".db3": "sqlite3"}
    return endings.get(output.suffix, "7-scenes")


def _write_seven_scenes(source: FrameSource, output: Path, progress: Progress | None) -> int:
    from fluentboard_modules.simulation.recording import record

    scene = getattr(source, "scene", None)
    count = record(_Registered(source), output, scene, progress)
    _write_gravity(source, output)
    return count


def _write_gravity(source: FrameSource, folder: Path) -> None:
    """Beside the frames, in the world frame that their poses are given in."""
    if isinstance(source, Recording) and source.gravity_world is not None:
        np.savetxt(folder / GRAVITY_FILE, source.gravity_world[None], fmt="%.8f")


def _write_storage_file(
    source: FrameSource, output: Path, layout: Layout, progress: Progress | None
) -> int:
    """One file instead of a folder: the storage of a ROS 2 bag stands alone."""
    if output.exists():
        raise InvalidInput(f"{output} exists already; choose another name")
    output.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=output.parent, prefix=f".{output.stem}-") as folder:
        bag = Path(folder) / output.stem
        assert layout in ("mcap", "sqlite3")
        count = write_bag(source, bag, layout, progress)
        (storage,) = (path for path in bag.iterdir() if path.suffix == output.suffix)
        shutil.move(storage, output)
    return count


@dataclass(frozen=True)
class _Registered:
    """The frames of a source with their colour registered to depth."""

    source: FrameSource

    @property
    def name(self) -> str:
        return self.source.name

    def __len__(self) -> int:
        return len(self.source)

    def __iter__(self) -> Iterator[SensorFrame]:
        for frame in self.source:
            colour = registered_colour(frame)
            yield replace(frame, colour=colour, colour_camera=None, T_colour_depth=None)
