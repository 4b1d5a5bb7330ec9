"""`fluentboard work mapping`: wires recording, mapping module and board together."""

from __future__ import annotations

from pathlib import Path

from fluentboard_client import Client
from fluentboard_modules.frames.sources import open_source
from fluentboard_modules.mapping.config import MappingConfig
from fluentboard_modules.mapping.worker import (
    MappingModule,
    place,
    read_gravity,
    write_transform,
)
from fluentboard_modules.progress import FrameProgress
from fluentboard_modules.worker import WorkReport, run, stop_on_signals


def run_mapping(
    frames: str,
    board: str,
    *,
    gravity: Path | None = None,
    start_s: float | None = None,
    plot: Path | None = None,
    frame_out: Path | None = None,
    token: str | None = None,
) -> WorkReport:
    """Maps a source to its end, or until told to stop.

    Args:
        frames: as for `open_source`.
        board: address of the board.
        gravity: file with the direction things fall.
        start_s: time of the first frame.
        plot: folder for pictures.
        frame_out: file for the map frame.
        token: bearer token for the board.

    Raises:
        FluentboardError: the source, the board or a file is not what it should be.
    """
    config = MappingConfig()
    with stop_on_signals() as stop:
        source, T_map_world = place(
            open_source(frames, start_s=start_s), config, gravity and read_gravity(gravity)
        )
        if frame_out is not None:
            write_transform(frame_out, T_map_world)
        module = MappingModule(source.name, T_map_world, config)
        with Client(board, author=module.name, token=token) as client, FrameProgress() as progress:
            report = run(module, source, client, progress=progress, stop=stop)
        if plot is not None:
            plot.mkdir(parents=True, exist_ok=True)
            module.draw(plot)
    return report
