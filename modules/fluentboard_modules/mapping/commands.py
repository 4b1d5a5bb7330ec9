"""`fluentboard learn-furniture` and `fluentboard evaluate mapping`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from fluentboard.errors import InvalidInput
from fluentboard_modules.command_options import (
    Gravity,
    JsonOutput,
    needs_extra,
)


def register(app: typer.Typer, evaluate: typer.Typer) -> None:
    """Adds the commands to `fluentboard` and `fluentboard evaluate`."""
    evaluate.command(
        "mapping",
        epilog="Examples:\n\nfluentboard evaluate mapping --scene office --mode map --frames 100",
    )(evaluate_mapping)
    app.command(
        "learn-furniture",
        epilog="Examples:\n\nfluentboard learn-furniture bar_table.stl --class BarTable\n\n"
        "fluentboard serve --data ./board --ontology BarTable.ttl\n\n"
        "fluentboard work mapping --frames ./bar --ontology BarTable.ttl",
    )(learn_furniture)


def learn_furniture(
    model: Annotated[
        Path,
        typer.Argument(
            metavar="MODEL",
            help="A CAD file (STL, OBJ, PLY, glTF, COLLADA, SDF), z up and its front along +x.",
        ),
    ],
    class_name: Annotated[
        str, typer.Option("--class", metavar="NAME", help="Of the new class, such as BarTable.")
    ],
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="FILE", help="Default: NAME.ttl."),
    ] = None,
) -> None:
    """Learn a class of furniture from its CAD model.

    Measures the model's planes and writes a class with its definition and SWRL rules as Turtle,
    with the thesis's margin of 5 cm (Section 3.2.2). Give the file to serve --ontology and to work
    mapping --ontology.
    """
    with needs_extra("mapping"):
        from fluentboard_modules.mapping.cad_library import stood_up
        from fluentboard_modules.mapping.cad_models import CadModel
        from fluentboard_modules.mapping.learning import learn_furniture as learn
        from fluentboard_modules.simulation.cad import load_mesh
    cad = CadModel(model.stem, class_name, stood_up(load_mesh(model), str(model)))
    path = output or Path(f"{class_name}.ttl")
    path.write_text(learn(cad, class_name), encoding="utf-8")
    typer.echo(
        f"{path}: class {class_name} with its rules; for the board: serve --ontology {path}, for "
        f"the worker: work mapping --ontology {path}",
        err=True,
    )


def evaluate_mapping(
    scene: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="office, seminar or restaurant; may be repeated. Default: office and seminar.",
        ),
    ] = None,
    mode: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="frames (each by itself), map (all, with memory) or scene (all registered into "
            "one cloud); may be repeated. Default: all three.",
        ),
    ] = None,
    frames: Annotated[int, typer.Option(metavar="N", min=2, help="Frames of each drive.")] = 60,
    seed: Annotated[
        list[int] | None,
        typer.Option(metavar="N", help="Of the rooms; may be repeated. Default: 1."),
    ] = None,
    output: JsonOutput = None,
    recording: Annotated[
        str | None,
        typer.Option(
            metavar="SOURCE",
            help="A recording with labels instead of the simulated rooms; any source of frames.",
        ),
    ] = None,
    labels: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Its furniture: class, pose and size in YAML, or fluents. Default: labels.yaml or "
            "truth.yaml in or beside the recording.",
        ),
    ] = None,
    gravity: Gravity = None,
    models: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="CAD models for the recording, as for work mapping."),
    ] = None,
    ontology: Annotated[
        list[Path] | None,
        typer.Option(metavar="FILE", help="More classes, as for work mapping; may be repeated."),
    ] = None,
) -> None:
    """Repeat the experiments of Section 3.3: furniture found, invented and missed.

    The rooms are built like those of the thesis: an office with 13 pieces of furniture and a
    seminar room with 32. A piece counts as found within the distances of the thesis: 15 cm for
    chairs, 25 cm for shelves, 45 cm for the rest. Prints the columns of Table 3.1 and the times of
    Table 3.2 for each room.

    With --recording the same for frames of your own, all of them with memory, against labels.
    """
    with needs_extra("mapping"):
        from fluentboard_modules.mapping.evaluate import evaluate_mapping as run
        from fluentboard_modules.mapping.evaluate import evaluate_recording
    if recording is not None:
        if scene or mode or seed:
            raise InvalidInput("--recording goes without --scene, --mode and --seed")
        evaluate_recording(
            recording,
            labels,
            gravity=gravity,
            models=models,
            ontologies=ontology or [],
            output=output,
        )
        return
    if labels or gravity or models or ontology:
        raise InvalidInput("--labels, --gravity, --models and --ontology go with --recording")
    run(
        scene or ["office", "seminar"],
        mode or ["frames", "map", "scene"],
        seed or [1],
        frames,
        output,
    )
