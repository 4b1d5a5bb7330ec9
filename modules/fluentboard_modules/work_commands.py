"""`fluentboard work mapping|anchoring`: the workers, wired to their frames and to the board."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from fluentboard_modules.command_options import (
    DEFAULT_BOARD,
    Board,
    Config,
    Frames,
    Gravity,
    Start,
    Token,
    Verbose,
    log_to_stderr,
    needs_extra,
)


def register(work: typer.Typer) -> None:
    """Adds the commands to the group `work`."""
    work.command(
        "mapping",
        epilog="Examples:\n\nfluentboard work mapping --frames ./kitchen --plot pictures\n\n"
        "fluentboard work mapping --frames simulated-restaurant:7 -b http://robot1:8080\n\n"
        "fluentboard work mapping --frames ./office --models ./cad",
    )(work_mapping)
    work.command(
        "anchoring",
        epilog="Examples:\n\nfluentboard work anchoring --frames ./kitchen --plot pictures\n\n"
        "fluentboard work anchoring --frames 'sim:table?seed=3' --association murty",
    )(work_anchoring)


def work_mapping(
    frames: Frames,
    board: Board = DEFAULT_BOARD,
    gravity: Gravity = None,
    start: Start = None,
    plot: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Draw pictures of the result there.")
    ] = None,
    config: Config = None,
    frame_out: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help='Write the map frame there, as {"T_map_world": 4x4}.'),
    ] = None,
    models: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="CAD models (STL, OBJ, PLY, glTF, COLLADA, SDF) named after furniture classes, "
            "such as Chair.stl or Shelf/billy.dae: hypotheses are verified with them.",
        ),
    ] = None,
    ontology: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="FILE",
            help="More classes of furniture in Turtle, as learn-furniture writes them; may be "
            "repeated.",
        ),
    ] = None,
    reasoner: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="compiled, or pellet: the reasoner of the thesis, in a Java process of its own.",
        ),
    ] = "compiled",
    mesh: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Write the mesh of the room there (.ply, .glb), with the CAD models in place of "
            "what they explain.",
        ),
    ] = None,
    seed: Annotated[
        int, typer.Option(help="Of whatever is random; mapping draws no random numbers.")
    ] = 0,
    token: Token = None,
    verbose: Verbose = False,
) -> None:
    """Map furniture: planes, classified by the rules of the ontology, verified with CAD models.

    Writes furniture with poses, boxes and the planes and rules that explain it, placing areas, and
    the map frame. Waits for the board if it is away. Ends with the recording, or cleanly at
    SIGTERM and Ctrl-C.
    """
    log_to_stderr(verbose)
    with needs_extra("mapping"):
        from fluentboard_modules.mapping.config import MappingConfig
        from fluentboard_modules.mapping.worker import run_mapping
        from fluentboard_modules.settings import read_settings
    report = run_mapping(
        frames,
        board,
        config=read_settings(MappingConfig, config, {}),
        gravity=gravity,
        start_s=start,
        plot=plot,
        frame_out=frame_out,
        token=token,
        models=models,
        mesh=mesh,
        ontologies=ontology or (),
        reasoner=reasoner,
    )
    typer.echo(report.told("mapping"), err=True)


def work_anchoring(
    frames: Frames,
    board: Board = DEFAULT_BOARD,
    gravity: Gravity = None,
    start: Start = None,
    plot: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Draw the anchors over the frames there.")
    ] = None,
    config: Config = None,
    recogniser: Annotated[
        str | None,
        typer.Option(
            metavar="FILE",
            help="A trained recogniser; spin-images: the built-in one for tableware; household: "
            "for what else stands about, too; detections: what an external detector posts to the "
            "board. Default: geometric, by size and shape.",
        ),
    ] = None,
    context: Annotated[
        str | None,
        typer.Option(
            metavar="FILE",
            help="A trained context model (CRF), or tableware: the built-in one, for spin-images. "
            "Default: none.",
        ),
    ] = None,
    mismatch: Annotated[
        str | None,
        typer.Option(metavar="FILE", help="A trained mismatch. Default: the built-in one."),
    ] = None,
    association: Annotated[
        str | None,
        typer.Option(
            metavar="METHOD",
            help="gnn (one assignment with discover columns; the default), nn, thesis (Algorithm "
            "4.1 as printed) or murty (k best).",
        ),
    ] = None,
    seed: Annotated[int, typer.Option(help="Of the samples by which tops are found.")] = 0,
    token: Token = None,
    verbose: Verbose = False,
) -> None:
    """Anchor the objects on tables: each gets a name and keeps it.

    Writes objects with poses, boxes, the placing areas that they stand on, and the evidence for
    every decision. Objects that the board knows keep their names; what others write about objects,
    such as that a gripper holds one, is honoured. Waits for the board if it is away. Ends with the
    recording, or cleanly at SIGTERM and Ctrl-C.
    """
    log_to_stderr(verbose)
    with needs_extra("anchoring"):
        from fluentboard_modules.anchoring.config import AnchoringConfig
        from fluentboard_modules.anchoring.worker import run_anchoring
        from fluentboard_modules.map_placing import open_placed
        from fluentboard_modules.settings import read_settings
    settings = read_settings(
        AnchoringConfig,
        config,
        {
            "recognition.recogniser": recogniser,
            "recognition.context": context,
            "world.association.model": mismatch,
            "world.association.method": association,
        },
    )
    placed = open_placed(frames, board, gravity=gravity, start_s=start, token=token)
    report = run_anchoring(
        placed.source,
        board,
        config=settings,
        first=placed.first,
        plot=plot,
        seed=seed,
        token=token,
    )
    typer.echo(report.told("anchoring"), err=True)
