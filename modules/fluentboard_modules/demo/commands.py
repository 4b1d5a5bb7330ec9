"""`fluentboard demo`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from fluentboard_modules.command_options import (
    Frames,
    Gravity,
    Verbose,
    log_to_stderr,
    needs_extra,
)


def register(app: typer.Typer) -> None:
    """Adds the command to `fluentboard`."""
    app.command(
        "demo",
        epilog="Examples:\n\nfluentboard demo\n\nfluentboard demo --keep\n\n"
        "fluentboard demo --frames ./kitchen --gravity ./kitchen/gravity-direction.txt",
    )(demo)


def demo(
    frames: Frames = "simulated-restaurant",
    gravity: Gravity = None,
    keep: Annotated[
        bool, typer.Option("--keep", help="Leave the service up until Ctrl-C.")
    ] = False,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="DIR", help="Where pictures and fluents go.")
    ] = Path("demo-out"),
    verbose: Verbose = False,
) -> None:
    """Show the whole path: an empty board, a recording, and what the board knows in the end.

    Starts a service on a free port, maps the recording, shows the notifications as they arrive and
    asks a SPARQL query. In a simulated restaurant a robot then searches for the pepper mill that a
    guest asks for. Pictures and all fluents go to the output folder.
    """
    log_to_stderr(verbose)
    with needs_extra("all"):
        from fluentboard_modules.demo.run import run_demo
    run_demo(frames, gravity=gravity, keep=keep, output=output)
