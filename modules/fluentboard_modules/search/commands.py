"""The commands of active search: `work search`, `search` and `evaluate search`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from fluentboard.errors import InvalidInput
from fluentboard.model.fluent import Fluent
from fluentboard_modules.command_options import (
    DEFAULT_BOARD,
    Board,
    Config,
    JsonOutput,
    Token,
    Verbose,
    log_to_stderr,
    needs_extra,
)

_EXPERIMENTS = ("offline", "known", "unknown")


def register(app: typer.Typer, work: typer.Typer, evaluate: typer.Typer) -> None:
    """Adds the commands to `fluentboard`, `fluentboard work` and `fluentboard evaluate`."""
    work.command(
        "search",
        epilog="Examples:\n\nfluentboard work search --frames 'sim:search?seed=1' --recognise\n\n"
        "fluentboard work search --frames kitchen.bt --once",
    )(work_search)
    app.command(
        "search",
        epilog="Examples:\n\nfluentboard search PepperMill\n\n"
        "fluentboard search Mug --volume table:0.4:2.9,2.2,0.9:1.2,0.8,0.3 --budget 300\n\n"
        "fluentboard search --name mug1 --probabilities co-occurrence",
    )(search)
    evaluate.command(
        "search",
        epilog="Examples:\n\nfluentboard evaluate search --trials 5\n\n"
        "fluentboard evaluate search --scene race_world/scene.json --export instances\n\n"
        "fluentboard evaluate search --experiment known --no-grid --keep trials",
    )(evaluate_search)


def work_search(
    frames: Annotated[
        str,
        typer.Option(
            metavar="SOURCE",
            help="Where the robot is: sim:search?seed=1 (a room with a hidden pepper mill), a "
            "scene (.json), or an OctoMap (.bt, .ot) that it looks into.",
        ),
    ],
    board: Board = DEFAULT_BOARD,
    robot: Annotated[
        str, typer.Option(metavar="MODEL", help="PR2, Calvin, Turtlebot or Kurtana.")
    ] = "PR2",
    name: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="Of the robot on the board. Several share a search by claiming views. "
            "Default: the model.",
        ),
    ] = "",
    map_file: Annotated[
        Path | None,
        typer.Option(
            "--map", metavar="FILE", help="Keep the map there (.bt, .ot); read if it exists."
        ),
    ] = None,
    planner: Annotated[
        str | None,
        typer.Option(
            metavar="METHOD",
            help="local-search, branch-and-bound (the thesis's) or greedy. Default: greedy, best "
            "for robots that look while they drive, as these do.",
        ),
    ] = None,
    config: Config = None,
    forget: Annotated[
        float | None,
        typer.Option(
            metavar="SECONDS",
            min=0.001,
            help="The map fades: confidence halves in that time, until a cell is unknown again.",
        ),
    ] = None,
    publish: Annotated[
        bool,
        typer.Option("--publish", help="Send the frames to the board, for an anchoring worker."),
    ] = False,
    recognition_time: Annotated[
        float,
        typer.Option(
            metavar="SECONDS",
            min=0.0,
            help="After every look, wait so long for an anchoring worker to write what is sought: "
            "a simulated robot is faster than it.",
        ),
    ] = 0.0,
    recognise: Annotated[
        bool,
        typer.Option(
            "--recognise",
            help="In simulation: write what is sought to the board when a frame shows it.",
        ),
    ] = False,
    once: Annotated[bool, typer.Option("--once", help="End after one search.")] = False,
    plot: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Draw pictures of the searches there.")
    ] = None,
    seed: Annotated[int, typer.Option(help="Of the views drawn and the sensor noise.")] = 0,
    token: Token = None,
    verbose: Verbose = False,
) -> None:
    """Search for what the board asks for: plan, move, look, until an anchor of it is on the board.

    Takes open SearchObjectActivity fluents one after the other; writes claims, progress and the
    result. Ending the activity cancels its search. Waits for the board if it is away. Ends cleanly
    at SIGTERM and Ctrl-C.
    """
    log_to_stderr(verbose)
    with needs_extra("search"):
        from fluentboard_modules.search.config import SearchConfig
        from fluentboard_modules.search.run import run_search_worker
        from fluentboard_modules.search.search_fluents import story
        from fluentboard_modules.settings import read_settings
    flags = {"fade_half_life_s": forget, "method": planner}
    records = run_search_worker(
        frames,
        board,
        robot=robot,
        name=name,
        map_file=map_file,
        publish=publish,
        recognition_s=recognition_time,
        recognise=recognise,
        once=once,
        seed=seed,
        token=token,
        config=read_settings(SearchConfig, config, flags),
        plot=plot,
    )
    for record in records:
        typer.echo(f"search: {story(record)}", err=True)


def search(
    target: Annotated[
        str | None, typer.Argument(metavar="CLASS", help="Class of what is sought, such as Mug.")
    ] = None,
    name: Annotated[
        str | None, typer.Option(metavar="NAME", help="Instead of a class: an object's name.")
    ] = None,
    board: Board = DEFAULT_BOARD,
    volume: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME:P:X,Y,Z:L,W,H[:YAW]",
            help="A box to search: probability, centre and edge lengths in metres, yaw in radians; "
            "may be repeated. Default: above the placing areas on the board.",
        ),
    ] = None,
    probabilities: Annotated[
        str,
        typer.Option(
            metavar="SOURCE",
            help="user (those of --volume), co-occurrence (the board's memory), context (the "
            "anchoring module answers) or uniform.",
        ),
    ] = "",
    budget: Annotated[
        float | None, typer.Option(metavar="SECONDS", min=0.0, help="The robot's time.")
    ] = None,
    threshold: Annotated[
        float | None,
        typer.Option(metavar="P", help="Give up when all that is left promises less."),
    ] = None,
    recall: Annotated[
        float | None, typer.Option(metavar="P", help="Of the detector, per look; 1 if not given.")
    ] = None,
    object_size: Annotated[
        float | None,
        typer.Option(metavar="M", help="Gaps that cannot hold such a cube need no look."),
    ] = None,
    detector_range: Annotated[
        float | None,
        typer.Option(metavar="M", help="Farther things are not recognised. Default: the camera's."),
    ] = None,
    confidence: Annotated[
        float | None,
        typer.Option(
            metavar="P", help="An object whose class is less sure does not end the search."
        ),
    ] = None,
    afresh: Annotated[
        bool,
        typer.Option("--afresh", help="Forget what is known of the volumes: things have moved."),
    ] = False,
    wait: Annotated[
        float | None,
        typer.Option(
            metavar="SECONDS", help="Wait so long at most; 0 only asks. Default: to the end."
        ),
    ] = None,
    stop: Annotated[
        str | None,
        typer.Option("--cancel", metavar="SEARCH", help="Instead: end the search of that name."),
    ] = None,
    token: Token = None,
) -> None:
    """Ask the robots of a board to search for an object, and tell how it goes.

    Exits with 0 if the object was found, else with 1. Ctrl-C cancels the search.
    """
    log_to_stderr(False)
    if stop is not None:
        _cancel(stop, board, token)
        return
    if (target is None) == (name is None):
        raise InvalidInput("give the class of what is sought, or --name and an object's name")
    with needs_extra("search"):
        from fluentboard_modules.search.run import ask_for
        from fluentboard_modules.search.volume_text import volume_of_text
    settings = {
        "hasTimeBudget": budget,
        "hasProbabilityThreshold": threshold,
        "hasDetectorRecall": recall,
        "hasMinimumObjectSize": object_size,
        "hasDetectorRange": detector_range,
        "hasMinimumConfidence": confidence,
    }
    try:
        activity = ask_for(
            board,
            target_class=target or "",
            target_name=name or "",
            volumes=[volume_of_text(text) for text in volume or ()],
            source=probabilities,
            settings={key: value for key, value in settings.items() if value is not None},
            is_afresh=afresh,
            wait_s=wait,
            token=token,
            told=_tell,
        )
    except KeyboardInterrupt:
        typer.echo("search: cancelled", err=True)
        raise typer.Exit(130) from None
    results = activity.values("hasResult")
    found = activity.values("hasFoundObject")
    typer.echo(
        f"{activity.name}: {results[-1] if results else 'asked for'}"
        + (f", {found[-1]}" if found else "")
    )
    if wait != 0.0 and not found:
        raise typer.Exit(1)


def _cancel(search: str, board_url: str, token: str | None) -> None:
    with needs_extra("search"):
        from fluentboard_modules.search.run import cancel
    cancel(board_url, search, token)
    typer.echo(f"{search}: cancelled")


def _tell(progress: Fluent) -> None:
    def number(key: str) -> float:
        values = progress.values(key)
        return float(values[-1]) if values else 0.0

    typer.echo(
        f"{number('hasElapsedTime'):6.0f} s  {number('hasViewCount'):3.0f} views  "
        f"{100 * number('hasCumulativeProbability'):3.0f} % seen  "
        f"{number('hasExpectedTime'):5.0f} s expected",
        err=True,
    )


def evaluate_search(
    experiment: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="offline (one plan, full map), known (planning again after every look, full map) "
            "or unknown (walls only); may be repeated. Default: all three.",
        ),
    ] = None,
    scene: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="A scene with search volumes. Default: two simulated rooms."
        ),
    ] = None,
    trials: Annotated[int, typer.Option(min=1, help="Random starts of each experiment.")] = 20,
    seed: Annotated[int, typer.Option(min=0, help="Of starts and views.")] = 0,
    on_the_way: Annotated[
        bool,
        typer.Option(
            "--looks-on-the-way/--looks-at-views-only",
            help="Whether the robot also looks while it drives, its camera on what is unseen.",
        ),
    ] = False,
    whole_grid: Annotated[
        bool,
        typer.Option(
            "--grid/--no-grid",
            help="Branch and bound with all settings, or only with those of the original software.",
        ),
    ] = True,
    export: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Write the offline trials there: instance-NN.npz with cells, views and transition "
            "times, plans-NN.json with each planner's sequence and E[T].",
        ),
    ] = None,
    keep: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Keep the results of every trial there, and do not run again what is there.",
        ),
    ] = None,
    output: JsonOutput = None,
    picture: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Draw Figure 5.9 there (PNG).")
    ] = None,
) -> None:
    """Measure search planners as in Section 5.3: Table 5.1 and Figure 5.9.

    Greedy, the thesis's branch and bound over a grid of its parameters, and the default planner
    get the same starts, views and transition times. Times are of one core.
    """
    chosen = experiment or list(_EXPERIMENTS)
    for name in chosen:
        if name not in _EXPERIMENTS:
            raise InvalidInput(
                f"no experiment is called {name!r}; there are {', '.join(_EXPERIMENTS)}"
            )
    with needs_extra("search"):
        from fluentboard_modules.search.evaluate import EvaluationOptions
        from fluentboard_modules.search.evaluate import evaluate_search as run
    run(
        chosen,
        EvaluationOptions(
            scene, trials, seed, on_the_way, whole_grid, export, keep, output, picture
        ),
    )
