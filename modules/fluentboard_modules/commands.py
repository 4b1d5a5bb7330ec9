"""The commands that the modules add to `fluentboard`: work, demo, frames and evaluate."""

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
        help="A folder with a recording (7-Scenes, TUM RGB-D or Open3D layout), a point cloud "
        "(.pcd, .ply), or simulated-restaurant, with a seed simulated-restaurant:7.",
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
Start = Annotated[
    float | None,
    typer.Option(
        metavar="SECONDS",
        help="Time of the first frame on the board's time axis. Default: the recording's own.",
    ),
]
Verbose = Annotated[bool, typer.Option("--verbose", "-v", help="Log what the worker does.")]


def register(app: typer.Typer) -> None:
    """Adds the commands to the app of `fluentboard`."""
    work = typer.Typer(
        help="Run a perception module: a worker that reads frames and writes fluents.",
        no_args_is_help=True,
    )
    work.command(
        "mapping",
        epilog="Examples:\n\nfluentboard work mapping --frames ./kitchen --plot pictures\n\n"
        "fluentboard work mapping --frames simulated-restaurant:7 -b http://robot1:8080",
    )(work_mapping)
    app.add_typer(work, name="work")
    evaluate = typer.Typer(
        help="Measure a perception module against the truth.", no_args_is_help=True
    )
    evaluate.command(
        "mapping", epilog="Examples:\n\nfluentboard evaluate mapping --seed 1 --seed 2"
    )(evaluate_mapping)
    app.add_typer(evaluate, name="evaluate")
    app.command(
        "demo",
        epilog="Examples:\n\nfluentboard demo\n\nfluentboard demo --keep\n\n"
        "fluentboard demo --frames ./kitchen --gravity ./kitchen/gravity-direction.txt",
    )(demo)
    app.command(
        "frames",
        epilog="Examples:\n\nfluentboard frames ./kitchen\n\n"
        "fluentboard frames simulated-restaurant:3 --output ./restaurant3",
    )(frames)


def work_mapping(
    frames: Frames,
    board: Board = DEFAULT_BOARD,
    gravity: Gravity = None,
    start: Start = None,
    plot: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Draw pictures of the result there.")
    ] = None,
    frame_out: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help='Write the map frame there, as {"T_map_world": 4x4}.'),
    ] = None,
    seed: Annotated[
        int, typer.Option(help="Of whatever is random; mapping draws no random numbers.")
    ] = 0,
    token: Token = None,
    verbose: Verbose = False,
) -> None:
    """Map furniture: planes of the frames, classified by the rules of the ontology.

    Writes furniture with poses, boxes and the planes and rules that explain it, placing areas, and
    the map frame. Waits for the board if it is away. Ends with the recording, or cleanly at
    SIGTERM and Ctrl-C.
    """
    _log_to_stderr(verbose)
    with _needs("mapping"):
        from fluentboard_modules.mapping.worker import run_mapping
    report = run_mapping(
        frames,
        board,
        gravity=gravity,
        start_s=start,
        plot=plot,
        frame_out=frame_out,
        token=token,
    )
    typer.echo(
        f"mapping: {report.frames} frames in {report.duration_s:.1f} s, {report.commands} commands "
        f"written, commit {report.commit}" + (" (stopped)" if report.was_stopped else ""),
        err=True,
    )


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

    Starts a service on a free port, maps the recording, shows the notifications as they arrive,
    asks a SPARQL query, and writes pictures and all fluents to the output folder.
    """
    _log_to_stderr(verbose)
    with _needs("all"):
        from fluentboard_modules.demo.run import run_demo
    run_demo(frames, gravity=gravity, keep=keep, output=output)


def evaluate_mapping(
    seed: Annotated[
        list[int] | None,
        typer.Option(
            metavar="N", help="A simulated restaurant; may be repeated. Default: 0, 1, 2."
        ),
    ] = None,
) -> None:
    """Map simulated restaurants and count what was found, invented and missed.

    A piece counts as found within the distances of the thesis: 15 cm for chairs, 25 cm for shelves,
    45 cm for the rest.
    """
    with _needs("mapping"):
        from fluentboard_modules.mapping.evaluate import evaluate_mapping as run
    run(seed or [0, 1, 2])


def frames(
    source: Annotated[str, typer.Argument(metavar="SOURCE", help="As for --frames of `work`.")],
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", metavar="DIR", help="Write the frames there, in the 7-Scenes layout."
        ),
    ] = None,
) -> None:
    """Describe a source of frames, or write it to a folder as a recording."""
    with _needs("mapping"):
        from fluentboard_modules.frames.report import describe, write
    if output is None:
        typer.echo(describe(source))
    else:
        typer.echo(f"{write(source, output)} frames written to {output}")


@contextmanager
def _needs(extra: str) -> Generator[None, None, None]:
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


def _log_to_stderr(verbose: bool) -> None:
    """Warnings always, the course of events if asked for, and never a line per request."""
    logging.basicConfig(
        level=logging.INFO if verbose else logging.WARNING,
        format="%(levelname)s %(name)s: %(message)s",
    )
    logging.getLogger("httpx").setLevel(logging.WARNING)
