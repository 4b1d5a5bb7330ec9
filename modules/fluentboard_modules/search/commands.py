"""The commands of active search: `work search`, `search` and `evaluate search`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from fluentboard.errors import InvalidInput
from fluentboard_modules.command_options import needs_extra

_EXPERIMENTS = ("offline", "known", "unknown")


def register(app: typer.Typer, work: typer.Typer, evaluate: typer.Typer) -> None:
    """Adds the commands to `fluentboard`, `fluentboard work` and `fluentboard evaluate`."""
    evaluate.command(
        "search",
        epilog="Examples:\n\nfluentboard evaluate search --trials 5\n\n"
        "fluentboard evaluate search --scene race_world/scene.json --export instances",
    )(evaluate_search)


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
            metavar="FILE", help="A scene with search volumes. Default: a simulated room of ours."
        ),
    ] = None,
    trials: Annotated[int, typer.Option(min=1, help="Random starts of each experiment.")] = 20,
    seed: Annotated[int, typer.Option(min=0, help="Of starts and views.")] = 0,
    export: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Write the offline trials there: instance-NN.npz with cells, views and transition "
            "times, plans-NN.json with each planner's sequence and E[T].",
        ),
    ] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="FILE", help="The numbers as JSON.")
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
        from fluentboard_modules.search.evaluate import evaluate_search as run
    run(chosen, scene=scene, trials=trials, seed=seed, export=export, output=output)
