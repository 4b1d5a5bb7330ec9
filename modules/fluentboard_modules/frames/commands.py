"""`fluentboard frames`: look into a source of frames, copy it, send it to a board."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fluentboard_modules.command_options import (
    DEFAULT_BOARD,
    Board,
    Source,
    Start,
    Token,
    Verbose,
    log_to_stderr,
    needs_extra,
)

if TYPE_CHECKING:
    from rich.progress import Progress

    from fluentboard_modules.frames.sensor_frame import SensorFrame


def register(app: typer.Typer) -> None:
    """Adds the group `frames` to the app of `fluentboard`."""
    frames = typer.Typer(
        help="Look into a source of frames, copy it, or send it to a board.", no_args_is_help=True
    )
    frames.command(
        "info",
        epilog="Examples:\n\nfluentboard frames info ./kitchen\n\n"
        "fluentboard frames info 'drive.bag?depth=/camera/depth/image_raw'",
    )(info)
    frames.command("view", epilog="Examples:\n\nfluentboard frames view ./kitchen --plot pictures")(
        view
    )
    frames.command(
        "record",
        epilog="Examples:\n\nfluentboard frames record 'sim:restaurant?seed=3' ./restaurant3\n\n"
        "fluentboard frames record ./kitchen kitchen.mcap\n\n"
        "fluentboard frames record drive.bag ./drive --layout open3d",
    )(record)
    frames.command(
        "publish",
        epilog="Examples:\n\nfluentboard frames publish sim:restaurant --sensor head\n\n"
        "fluentboard frames publish drive.bag --sensor head --rate 10 --loop",
    )(publish)
    app.add_typer(frames, name="frames")


def info(source: Source, verbose: Verbose = False) -> None:
    """Describe a source: number and size of its frames, camera, time, depth, path, problems."""
    log_to_stderr(verbose)
    with needs_extra("mapping"):
        from fluentboard_modules.frames.report import describe, examine
        from fluentboard_modules.frames.sources import open_source
    typer.echo(describe(examine(open_source(source))))


def view(
    source: Source,
    plot: Annotated[Path, typer.Option(metavar="DIR", help="Where the pictures go.")] = Path(
        "pictures"
    ),
    verbose: Verbose = False,
) -> None:
    """Draw a sheet of a source's frames, and the camera's path from above."""
    log_to_stderr(verbose)
    with needs_extra("mapping"):
        from fluentboard_modules.frames.pictures import draw_source
        from fluentboard_modules.frames.report import describe, examine
        from fluentboard_modules.frames.sources import open_source
    report = examine(open_source(source))
    typer.echo(describe(report))
    if report.frames:
        for file in draw_source(report, plot):
            typer.echo(f"  drawn        {file}")


def record(
    source: Source,
    output: Annotated[
        Path, typer.Argument(metavar="OUTPUT", help="A new folder, or a .bag, .mcap or .db3 file.")
    ],
    layout: Annotated[
        str | None,
        typer.Option(
            metavar="LAYOUT",
            help="7-scenes, tum, open3d, bag, mcap or sqlite3. Default: told by the ending of "
            "OUTPUT; a folder gets 7-scenes.",
        ),
    ] = None,
    start: Start = None,
    verbose: Verbose = False,
) -> None:
    """Copy the frames of a source to disk, in the layout that another tool wants."""
    log_to_stderr(verbose)
    with needs_extra("mapping"):
        from fluentboard_modules.frames.recorder import checked_layout, record_source
        from fluentboard_modules.frames.sources import open_source
    chosen = None if layout is None else checked_layout(layout)
    opened = open_source(source, start_s=start)
    with _bar() as bar:
        task = bar.add_task("recording", total=None)
        count = record_source(
            opened,
            output,
            chosen,
            lambda done, total: bar.update(task, completed=done, total=total),
        )
    typer.echo(f"{count} frames written to {output}")


def publish(
    source: Source,
    sensor: Annotated[str, typer.Option(metavar="NAME", help="Name of the sensor.")] = "camera",
    board: Board = DEFAULT_BOARD,
    rate: Annotated[
        float | None,
        typer.Option(
            metavar="HZ", min=0.001, help="Frames per second. Default: as fast as they were taken."
        ),
    ] = None,
    keep_stamps: Annotated[
        bool,
        typer.Option("--keep-stamps", help="Leave the stamps. Default: taken when sent."),
    ] = False,
    loop: Annotated[bool, typer.Option("--loop", help="Begin again at the end.")] = False,
    token: Token = None,
    verbose: Verbose = False,
) -> None:
    """Send the frames of a source to a board, as a robot does, until its end or Ctrl-C."""
    log_to_stderr(verbose)
    with needs_extra("mapping"):
        from fluentboard_modules.frames.live import FramePublisher
        from fluentboard_modules.frames.live import publish as publish_source
        from fluentboard_modules.frames.sources import open_source
        from fluentboard_modules.pulse import pulse
        from fluentboard_modules.worker import stop_on_signals
    opened = open_source(source)
    count = 0
    with (
        FramePublisher(board, sensor, token=token) as publisher,
        stop_on_signals() as stop,
        pulse() as told,
        _bar() as bar,
    ):
        task = bar.add_task(f"to {sensor}", total=None)

        def sent(done: int, frame: SensorFrame) -> None:
            bar.update(task, completed=done)
            told.advance(frame.index, frame.stamp_s, 0, f"sends to {sensor}")

        while True:
            count += publish_source(
                opened,
                publisher,
                rate_hz=rate,
                keep_stamps=keep_stamps,
                is_stopped=stop.wait,
                sent=sent,
            )
            if stop.is_asked or not loop:
                break
    typer.echo(f"{count} frames sent to {publisher.address}")


def _bar() -> Progress:
    from rich.console import Console
    from rich.progress import Progress

    console = Console(stderr=True)
    return Progress(console=console, disable=not console.is_terminal)
