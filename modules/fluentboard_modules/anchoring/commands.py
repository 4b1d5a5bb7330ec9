"""`fluentboard train recogniser|crf|mismatch` and `fluentboard evaluate anchoring`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from fluentboard.errors import InvalidInput
from fluentboard_modules.command_options import Verbose, log_to_stderr, needs_extra

Output = Annotated[
    Path, typer.Option("--output", "-o", metavar="FILE", help="The trained model, .npz.")
]
Frames = Annotated[int, typer.Option(min=4, help="Per simulated scene.")]
Width = Annotated[int, typer.Option(min=160, max=640, help="Of the simulated images in pixels.")]
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


def register(train: typer.Typer, evaluate: typer.Typer) -> None:
    """Adds the commands to the groups `train` and `evaluate`."""
    train.command(
        "recogniser",
        epilog="Examples:\n\nfluentboard train recogniser --models ./cad -o mugs.npz",
    )(train_recogniser)
    train.command(
        "crf",
        epilog="Examples:\n\nfluentboard train crf --graphs out/tables_anchored.npz -o table.npz",
    )(train_crf)
    train.command(
        "mismatch",
        epilog="Examples:\n\nfluentboard train mismatch --scene 1 --scene 7 -o mismatch.json",
    )(train_mismatch)
    evaluate.command(
        "anchoring",
        epilog="Examples:\n\nfluentboard evaluate anchoring\n\n"
        "fluentboard evaluate anchoring --desks kth_desks --rooms sunrgbd_boxes --export out",
    )(evaluate_anchoring)


def train_recogniser(
    output: Output = Path("recogniser.npz"),
    models: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="CAD files, a folder per class: Mug/blue.stl. Default: simulated tableware.",
        ),
    ] = None,
    household: Annotated[
        bool,
        typer.Option(
            "--household",
            help="Without files: also what else stands about in a house, seen from farther away.",
        ),
    ] = False,
    clusters: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Labelled clusters instead: point clouds (.pcd, .ply) of single objects in the "
            "sensor's frame, a folder per class.",
        ),
    ] = None,
    views: Annotated[int, typer.Option(min=2, help="Per class of CAD models.")] = 24,
    seed: Annotated[int, typer.Option(help="Of places, views and sensor noise.")] = 77,
    verbose: Verbose = False,
) -> None:
    """Train local recognition: spin images and nearest neighbours.

    CAD models are put on a table, looked at from all sides with a simulated Kinect, and segmented
    as anchoring would; the clusters are the examples.
    """
    log_to_stderr(verbose)
    _check_folder(output)
    with needs_extra("anchoring"):
        from fluentboard_modules.anchoring import recogniser_training as examples
        from fluentboard_modules.anchoring.recogniser_spin_images import train_recogniser as run
        from fluentboard_modules.progress import FrameProgress
    if clusters is not None:
        found, labels = examples.stored_clusters(clusters)
    else:
        config = examples.ViewingConfig(views=views)
        if models is not None:
            chosen = examples.models_in_folder(models)
        elif household:
            chosen = examples.household_models(seed)
            config = examples.ViewingConfig(views=views, distance_m=(0.8, 2.1))
        else:
            chosen = examples.tableware_models(seed)
        with FrameProgress() as progress:
            progress.begin("models", examples.frame_count(chosen, config))
            found, labels = examples.seen_models(chosen, config, seed, progress.advance)
    trained = run(found, labels)
    trained.save(output)
    typer.echo(f"{output}: {len(labels)} examples of {', '.join(trained.classes)}", err=True)


def train_crf(
    graphs: Annotated[
        Path,
        typer.Option(
            metavar="FILE",
            help="Labelled scene graphs, as `evaluate anchoring --export` writes them.",
        ),
    ],
    output: Output = Path("crf.npz"),
    context_range: Annotated[
        float,
        typer.Option(min=0.01, help="Within which the graphs have edges, in metres."),
    ] = 0.4,
    without_local: Annotated[
        bool, typer.Option("--without-local", help="Do without local recognition (CRF+A).")
    ] = False,
    every: Annotated[
        int, typer.Option(min=1, help="Train on every so many graphs: neighbours are alike.")
    ] = 4,
    verbose: Verbose = False,
) -> None:
    """Train joint recognition: the CRF, by pseudo-likelihood.

    The model keeps the fingerprint of what it was trained on, and refuses recognisers that know
    other classes.
    """
    log_to_stderr(verbose)
    _check_folder(output)
    with needs_extra("anchoring"):
        import numpy as np

        from fluentboard_modules.anchoring.crf_data import load_graphs
        from fluentboard_modules.anchoring.crf_files import save_crf
        from fluentboard_modules.anchoring.crf_training import TrainingConfig
        from fluentboard_modules.anchoring.crf_training import train_crf as run
        from fluentboard_modules.anchoring.scene_graph import SceneGraphConfig
    data = load_graphs(graphs)
    chosen = data.only(np.arange(len(data)) % every == 0)
    trained = run(chosen, TrainingConfig("none" if without_local else "logarithm"))
    config = SceneGraphConfig(context_range, 12, data.node_names, data.edge_names)
    save_crf(output, trained.model, config)
    typer.echo(
        f"{output}: trained on {len(chosen)} graphs ({trained.model.trained_on}), "
        f"{trained.iterations} iterations, objective {trained.objective:.3f}"
        + ("" if trained.has_converged else ", stopped before it converged"),
        err=True,
    )


def train_mismatch(
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FILE", help="The trained mismatch, .json.")
    ] = Path("mismatch.json"),
    scene: Annotated[
        list[int] | None,
        typer.Option(
            metavar="N", help="A simulated table, 1 to 15; may be repeated. Default: all of them."
        ),
    ] = None,
    features: Annotated[
        str,
        typer.Option(metavar="SET", help="Of Table 4.4: a (the thesis's choice), b, c or d."),
    ] = "a",
    recogniser: Annotated[
        list[str] | None,
        typer.Option(
            metavar="FILE",
            help="Local recognition: spin-images, geometric, or a trained file. May be repeated: "
            "the mismatch then suits all of them. Default: spin-images.",
        ),
    ] = None,
    frames: Frames = 40,
    width: Width = 640,
    seed: Annotated[
        list[int] | None,
        typer.Option(
            metavar="N",
            help="Of the data set: fifteen tables each; may be repeated. Default: 1, since "
            "`evaluate anchoring` measures on those of 0.",
        ),
    ] = None,
    verbose: Verbose = False,
) -> None:
    """Train the mismatch of object and anchor: a linear SVM over the features of Table 4.1.

    Anchoring runs past simulated tables, every new track is given to its true anchor, and all pairs
    of a new track and an untracked anchor are the examples (Section 4.3.3.1). Then the boundary is
    moved to where most decisions of the assignment are right. Takes about four minutes per seed.
    """
    log_to_stderr(verbose)
    _check_folder(output)
    with needs_extra("anchoring"):
        from fluentboard_modules.anchoring import similarity
        from fluentboard_modules.anchoring.config import RecognitionConfig
        from fluentboard_modules.anchoring.evaluation_run import record_tables
        from fluentboard_modules.anchoring.mismatch_training import train_on_runs
        from fluentboard_modules.anchoring.recognisers import recogniser_of
    names = similarity.FEATURE_SETS.get(features)
    if names is None:
        raise InvalidInput(f"no feature set is called {features!r}; give a, b, c or d")
    recognisers = [
        recogniser_of(RecognitionConfig(recogniser=r)) for r in recogniser or ["spin-images"]
    ]
    classes = recognisers[0].classes if len({local.classes for local in recognisers}) == 1 else ()
    if not classes and "diff_object_types_vector" in names:
        raise InvalidInput(
            f"the recognisers know different classes, which feature set {features!r} compares one "
            "by one; give a or c, or recognisers of the same classes"
        )
    runs = [
        run
        for local in recognisers
        for number in seed or [1]
        for run in record_tables(scene or range(1, 16), local, number, frames, width)
    ]
    trained = train_on_runs(runs, names, classes)
    trained.model.save(output)
    typer.echo(
        f"{output}: trained on {trained.pairs} pairs, {trained.same} of them of one object; "
        f"{100.0 * trained.right:.1f} % of the decisions on the training tables are right",
        err=True,
    )


def _check_folder(output: Path) -> None:
    """Refuses an output that could not be written, before minutes of work."""
    if not output.parent.is_dir():
        raise InvalidInput(f"{output}: there is no folder {output.parent}; make it first")


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
    frames: Frames = 40,
    width: Width = 640,
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
