"""`fluentboard simulate`: make a recording whose truth is known."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from fluentboard_modules.command_options import Start, Verbose, log_to_stderr, needs_extra


def register(app: typer.Typer) -> None:
    """Adds the command to the app of `fluentboard`."""
    app.command(
        "simulate",
        epilog="Examples:\n\nfluentboard simulate restaurant --out ./restaurant --frames 200\n\n"
        "fluentboard simulate 'tables?scene=3' --out ./table3 --visits 2\n\n"
        "fluentboard simulate office --seed 4 --out ./office --robot Calvin\n\n"
        "fluentboard simulate ./world/scene.json --out ./drive",
    )(simulate)


def simulate(
    scene: Annotated[
        str,
        typer.Argument(
            metavar="SCENE",
            help="restaurant, room, table, tables, office, seminar or search, with or without "
            "sim: and options; or the JSON file of a scene.",
        ),
    ],
    out: Annotated[Path, typer.Option("--out", "-o", metavar="DIR", help="A new folder.")],
    seed: Annotated[
        int | None, typer.Option(min=0, help="Of the scene and of the sensor's noise. Default: 0.")
    ] = None,
    frames: Annotated[
        int | None, typer.Option(min=1, metavar="N", help="How many. Default: by scene, 40 to 200.")
    ] = None,
    visits: Annotated[
        int,
        typer.Option(
            min=1,
            metavar="N",
            help="Drive the way so often; in between things are moved, removed, added, swapped.",
        ),
    ] = 1,
    robot: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="PR2, Calvin, Turtlebot or Kurtana. Default: by scene."),
    ] = None,
    width: Annotated[
        int | None, typer.Option(min=16, metavar="PX", help="Of the images. Default: 640.")
    ] = None,
    exact: Annotated[bool, typer.Option("--exact", help="A camera without noise.")] = False,
    start: Start = None,
    verbose: Verbose = False,
) -> None:
    """Drive a simulated robot through a scene, and write what it sees and what is true.

    The frames are a folder in the 7-Scenes layout with instance labels. `truth.json` holds class,
    pose, box and label of everything, `meshes` the CAD models, `truth.yaml` the true fluents. The
    same seed gives the same bytes.
    """
    log_to_stderr(verbose)
    with needs_extra("mapping"):
        from fluentboard_modules.frames.simulated_sources import drive_of
        from fluentboard_modules.progress import FrameProgress
        from fluentboard_modules.simulation.simulate import simulate as write
    asked = {
        "seed": seed,
        "frames": frames,
        "robot": robot,
        "width": width,
        "noise": 0 if exact else None,
    }
    drive = drive_of(scene, {k: str(v) for k, v in asked.items() if v is not None}, start)
    with FrameProgress() as progress:
        progress.begin("simulating", visits * len(drive))
        made = write(drive, out, visits, lambda done, total: progress.advance(drive.name))
    where = f"in {visits} visits, with {made.changes} changes between them, " if visits > 1 else ""
    typer.echo(f"{made.frames} frames {where}and {made.fluents} true fluents written to {out}")
