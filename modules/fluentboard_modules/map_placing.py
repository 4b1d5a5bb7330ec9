"""Frames in the map frame that a board has, or gets: for modules that do not map themselves.

Wiring between mapping, which knows how to find the floor, and the other modules, which meet it on
the board only.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from fluentboard.model.fluent import Fluent
from fluentboard.model.geometry import Transform
from fluentboard_client import Client
from fluentboard_modules.frames.recordings import Recording
from fluentboard_modules.frames.sensor_frame import FrameSource
from fluentboard_modules.frames.sources import open_source
from fluentboard_modules.mapping.config import MappingConfig
from fluentboard_modules.mapping.map_frame import (
    map_frame_fluents,
    place,
    read_gravity,
    written_map_frame,
)
from fluentboard_modules.statements import Statement

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class PlacedSource:
    """A source with its frames in the map frame.

    Attributes:
        source: the frames.
        T_map_world: takes the recording's world frame to the map frame.
        first: gives what a module has to write about the map frame before anything else.
    """

    source: FrameSource
    T_map_world: Transform
    first: Callable[[Client], Sequence[Statement]]


def open_placed(
    frames: str,
    board: str,
    *,
    gravity: Path | None = None,
    start_s: float | None = None,
    token: str | None = None,
) -> PlacedSource:
    """Opens a source and places it: as the board says, or by gravity and floor.

    Args:
        frames: as for `open_source`.
        board: address of the board. If it is away, the source is placed without it.
        gravity: file with the direction things fall; overrides what the board says.
        start_s: time of the first frame.
        token: bearer token for the board.

    Raises:
        FluentboardError: the source or a file is not what it should be.
    """
    source = open_source(frames, start_s=start_s, token=token)
    written: Transform | None = None
    if isinstance(source, Recording) and gravity is None:
        with Client(board, token=token) as client:
            written = written_map_frame(source.name, *_told(client)) if client.ready() else None
    if written is not None and isinstance(source, Recording):
        logger.info("%s: in the map frame that the board has", source.name)
        placed, T_map_world = source.in_map(written), written
    else:
        placed, T_map_world = place(source, MappingConfig(), gravity and read_gravity(gravity))

    def first(client: Client) -> Sequence[Statement]:
        return map_frame_fluents(source.name, T_map_world, *_told(client))

    return PlacedSource(placed, T_map_world, first)


def _told(board: Client) -> tuple[dict[str, Fluent], dict[str, Fluent]]:
    """Map frames and open poses of the board, by name."""
    frames = {fluent.name: fluent for fluent in board.fluents("MapFrame")}
    return frames, {fluent.name: fluent for fluent in board.fluents("Pose", is_open=True)}
