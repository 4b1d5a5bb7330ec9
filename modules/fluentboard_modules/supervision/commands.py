"""`fluentboard up`: the command."""

from __future__ import annotations

import signal
from pathlib import Path
from types import FrameType
from typing import Annotated

import typer

from fluentboard_modules.command_options import Token, Verbose, needs_extra


def register(app: typer.Typer) -> None:
    """Adds the command to the app of `fluentboard`."""
    app.command(
        "up",
        epilog="Examples:\n\nfluentboard up robot.yaml\n\nfluentboard up robot.yaml --check",
    )(up)


def up(
    config: Annotated[
        Path, typer.Argument(metavar="FILE", help="What to run, as YAML; see the reference.")
    ],
    check: Annotated[
        bool, typer.Option("--check", help="Only check the file, and show the command lines.")
    ] = False,
    token: Token = None,
    verbose: Verbose = False,
) -> None:
    """Run a board and its workers: crashed ones are restarted, all stop together.

    Shows how each worker is doing, here and as fluents on the board. Stops at Ctrl-C or SIGTERM:
    the workers first, which still write what they have, then the board.
    """
    with needs_extra("all"):
        from fluentboard_modules.supervision.config import (
            load_config,
            service_command,
            worker_command,
        )
        from fluentboard_modules.supervision.display import Display
        from fluentboard_modules.supervision.supervisor import Supervisor
    settings = load_config(config)
    if check:
        if settings.service is not None:
            typer.echo(" ".join(service_command(settings.service)))
        for worker in settings.workers.values():
            typer.echo(" ".join(worker_command(worker, settings.board or "BOARD")))
        return
    display = Display()
    display.log(verbose)
    supervisor = Supervisor(settings, config.resolve().parent, display.heard, token=token)

    def stop(number: int, frame: FrameType | None) -> None:
        supervisor.ask_to_stop()

    # SIGHUP comes when the terminal is closed.
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    before = {number: signal.signal(number, stop) for number in numbers}
    try:
        with display:
            supervisor.run(lambda: display.show(supervisor))
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
