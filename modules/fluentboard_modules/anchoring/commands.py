"""`fluentboard evaluate anchoring`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from fluentboard_modules.anchoring.command_options import SceneFrames, SceneWidth
from fluentboard_modules.command_options import (
    Verbose,
    log_to_stderr,
    needs_extra,
)

RecogniserFile = Annotated[
    str,
    typer.Option(
        "--recogniser",
        metavar="FILE",
        help="A trained recogniser, or spin-images: the built-in one.",
    ),
]
AsPrinted = Annotated[
    bool,
    typer.Option(
        "--as-printed",
        help="Features of Tables 4.2 and 4.3 only, confidences multiplied (Eq. 4.7), no priors.",
    ),
]


def register(evaluate: typer.Typer) -> None:
    """Adds the command to the group `evaluate`."""
    evaluate.command(
        "anchoring",
        epilog="Examples:\n\nfluentboard evaluate anchoring\n\n"
        "fluentboard evaluate anchoring --desks kth_desks --rooms sunrgbd_boxes --export out",
    )(evaluate_anchoring)


def evaluate_anchoring(
    scene: Annotated[
        list[int] | None,
        typer.Option(
            metavar="N", help="A simulated table, 1 to 15; may be repeated. Default: all."
        ),
    ] = None,
    desks: Annotated[
        Path | None, typer.Option(metavar="DIR", help="The KTH desks (scenes.json).")
    ] = None,
    rooms: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Furniture of SUN RGB-D (boxes.csv).")
    ] = None,
    clouds: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Labelled clouds (.pcd) to measure segmentation on."),
    ] = None,
    export: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Write the CRF data sets as .npz with the predictions."),
    ] = None,
    skip_tables: Annotated[
        bool, typer.Option("--skip-tables", help="Leave out the simulated tables.")
    ] = False,
    recogniser: RecogniserFile = "spin-images",
    as_printed: AsPrinted = False,
    icm: Annotated[bool, typer.Option("--icm", help="Infer by ICM, as the thesis does.")] = False,
    frames: SceneFrames = 40,
    width: SceneWidth = 640,
    seed: Annotated[int, typer.Option(help="Of the simulated tables; 0 is the data set.")] = 0,
    verbose: Verbose = False,
) -> None:
    """Measure anchoring: Tables 4.4 to 4.7 on simulated tables, and on recordings that are given.

    Simulates a robot's drive past every table, anchors what it sees, and judges similarity,
    association and classification with the scene in question left out of the training.
    """
    log_to_stderr(verbose)
    with needs_extra("anchoring"):
        from fluentboard_modules.anchoring import evaluation_run as evaluation
        from fluentboard_modules.anchoring.config import RecognitionConfig
        from fluentboard_modules.anchoring.evaluation_clouds import cloud_results
        from fluentboard_modules.anchoring.recognisers import recogniser_of
    context = desk = room = None
    if not skip_tables:
        local = recogniser_of(RecognitionConfig(recogniser=recogniser))
        records = evaluation.record_tables(scene or range(1, 16), local, seed, frames, width)
        tables, context = evaluation.table_results(
            records,
            local.classes,
            *evaluation.training_of(as_printed),
            "icm" if icm else "exact",
        )
        evaluation.show(tables)
    if desks is not None:
        tables, desk = evaluation.desk_results(desks)
        evaluation.show(tables)
    if rooms is not None:
        tables, room = evaluation.room_results(rooms)
        evaluation.show(tables)
    if clouds is not None:
        evaluation.show([cloud_results(clouds)])
    if export is not None:
        for path in evaluation.export_results(export, context, desk, room):
            typer.echo(f"wrote {path}", err=True)
