"""Options that several commands share, and what every command does first."""

from __future__ import annotations

import logging
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from fluentboard.errors import MissingExtra

DEFAULT_BOARD = "http://127.0.0.1:8080"
_OURS = ("fluentboard", "fluentboard_client", "fluentboard_modules", "fluentboard_ontology")

Board = Annotated[
    str,
    typer.Option("--board", "-b", metavar="URL", envvar="FLUENTBOARD_BOARD", help="The board."),
]
Token = Annotated[
    str | None,
    typer.Option(
        metavar="SECRET",
        envvar="FLUENTBOARD_TOKEN",
        help="Bearer token, where the board asks for one.",
    ),
]
Frames = Annotated[
    str,
    typer.Option(
        metavar="SOURCE",
        help="A recording (a folder in 7-Scenes, TUM RGB-D or Open3D layout, a ROS bag), a point "
        "cloud (.pcd, .ply), a simulated drive (sim:restaurant?seed=7) or live frames "
        "(http://host:8080/frames/SENSOR).",
    ),
]
Gravity = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        help="Three numbers: the direction things fall in the recording's world frame. "
        "Default: gravity-direction.txt in the recording, or a world with z up.",
    ),
]
Source = Annotated[
    str,
    typer.Argument(
        metavar="SOURCE",
        help="As for --frames of `work`: a recording, a cloud, sim:..., http://...",
    ),
]
Start = Annotated[
    float | None,
    typer.Option(
        metavar="SECONDS",
        help="Time of the first frame on the board's time axis. Default: the recording's own.",
    ),
]
Config = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help="Settings as YAML; see docs/module-settings.md."),
]
JsonOutput = Annotated[
    Path | None, typer.Option("--output", "-o", metavar="FILE", help="Keep the numbers: JSON.")
]
Verbose = Annotated[bool, typer.Option("--verbose", "-v", help="Log what the worker does.")]


@contextmanager
def needs_extra(extra: str) -> Generator[None, None, None]:
    """Says which extra is missing when an import fails.

    Raises:
        MissingExtra: a package is missing that is not one of ours.
    """
    try:
        yield
    except ModuleNotFoundError as problem:
        package = (problem.name or "").partition(".")[0]
        if package in _OURS:
            raise
        raise MissingExtra(
            f"this command needs the extra '{extra}' ({package} is missing); install it with: "
            f"pip install 'fluentboard[{extra}]'"
        ) from problem


def log_to_stderr(verbose: bool) -> None:
    """Warnings always, the course of events if asked for, and never a line per request."""
    logging.basicConfig(
        level=logging.INFO if verbose else logging.WARNING,
        format="%(levelname)s %(name)s: %(message)s",
    )
    logging.getLogger("httpx").setLevel(logging.WARNING)
