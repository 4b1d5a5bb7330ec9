"""`fluentboard train recogniser|crf|mismatch`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from fluentboard.errors import InvalidInput
from fluentboard_modules.anchoring.command_options import SceneFrames, SceneWidth
from fluentboard_modules.command_options import Verbose, log_to_stderr, needs_extra

Output = Annotated[
    Path, typer.Option("--output", "-o", metavar="FILE", help="The trained model, .npz.")
]


def register(train: typer.Typer) -> None:
    """Adds the commands to the group `train`."""
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
    frames: SceneFrames = 40,
    width: SceneWidth = 640,
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
