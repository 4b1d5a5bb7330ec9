"""The commands that the modules add to `fluentboard`: work, demo, frames, simulate and evaluate."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from fluentboard.errors import InvalidInput
from fluentboard_modules.anchoring import commands as anchoring_commands
from fluentboard_modules.command_options import (
    DEFAULT_BOARD,
    Board,
    Start,
    Token,
    Verbose,
    log_to_stderr,
    needs_extra,
)
from fluentboard_modules.frames import commands as frame_commands
from fluentboard_modules.search import commands as search_commands
from fluentboard_modules.simulation import commands as simulation_commands
from fluentboard_modules.supervision import commands as supervision_commands

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


def register(app: typer.Typer) -> None:
    """Adds the commands to the app of `fluentboard`."""
    work = typer.Typer(
        help="Run a perception module: a worker that reads frames and writes fluents.",
        no_args_is_help=True,
    )
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
    app.add_typer(work, name="work")
    evaluate = typer.Typer(
        help="Measure a perception module against the truth.", no_args_is_help=True
    )
    evaluate.command(
        "mapping",
        epilog="Examples:\n\nfluentboard evaluate mapping --scene office --mode map --frames 100",
    )(evaluate_mapping)
    search_commands.register(app, work, evaluate)
    app.add_typer(evaluate, name="evaluate")
    train = typer.Typer(
        help="Train what a perception module recognises with.", no_args_is_help=True
    )
    anchoring_commands.register(train, evaluate)
    app.add_typer(train, name="train")
    app.command(
        "learn-furniture",
        epilog="Examples:\n\nfluentboard learn-furniture bar_table.stl --class BarTable\n\n"
        "fluentboard work mapping --frames ./bar --ontology BarTable.ttl",
    )(learn_furniture)
    app.command(
        "demo",
        epilog="Examples:\n\nfluentboard demo\n\nfluentboard demo --keep\n\n"
        "fluentboard demo --frames ./kitchen --gravity ./kitchen/gravity-direction.txt",
    )(demo)
    frame_commands.register(app)
    simulation_commands.register(app)
    supervision_commands.register(app)


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
        from fluentboard_modules.mapping.worker import run_mapping
    report = run_mapping(
        frames,
        board,
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
    config: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Settings as YAML; see docs/configuration.md."),
    ] = None,
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
        from fluentboard_modules.anchoring.settings import read_settings
        from fluentboard_modules.anchoring.worker import run_anchoring
        from fluentboard_modules.map_placing import open_placed
    settings = read_settings(
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
    with the thesis's margin of 5 cm (Section 3.2.2). Give the file to work mapping --ontology.
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
        f"{path}: class {class_name} with its rules; use it with work mapping --ontology {path}",
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

    Starts a service on a free port, maps the recording, shows the notifications as they arrive and
    asks a SPARQL query. In a simulated restaurant a robot then searches for the pepper mill that a
    guest asks for. Pictures and all fluents go to the output folder.
    """
    log_to_stderr(verbose)
    with needs_extra("all"):
        from fluentboard_modules.demo.run import run_demo
    run_demo(frames, gravity=gravity, keep=keep, output=output)


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
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="FILE", help="Keep the results: JSON.")
    ] = None,
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
