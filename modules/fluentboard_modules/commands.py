"""The commands that the modules add to `fluentboard`: work, demo, frames, simulate and the like."""

from __future__ import annotations

import typer

from fluentboard_modules import work_commands
from fluentboard_modules.anchoring import commands as anchoring_commands
from fluentboard_modules.anchoring import training_commands
from fluentboard_modules.demo import commands as demo_commands
from fluentboard_modules.frames import commands as frame_commands
from fluentboard_modules.mapping import commands as mapping_commands
from fluentboard_modules.search import commands as search_commands
from fluentboard_modules.simulation import commands as simulation_commands
from fluentboard_modules.supervision import commands as supervision_commands


def register(app: typer.Typer) -> None:
    """Adds the commands to the app of `fluentboard`."""
    work = typer.Typer(
        help="Run a perception module: a worker that reads frames and writes fluents.",
        no_args_is_help=True,
    )
    app.add_typer(work, name="work")
    evaluate = typer.Typer(
        help="Measure a perception module against the truth.", no_args_is_help=True
    )
    app.add_typer(evaluate, name="evaluate")
    train = typer.Typer(
        help="Train what a perception module recognises with.", no_args_is_help=True
    )
    work_commands.register(work)
    mapping_commands.register(app, evaluate)
    anchoring_commands.register(evaluate)
    training_commands.register(train)
    search_commands.register(app, work, evaluate)
    demo_commands.register(app)
    app.add_typer(train, name="train")
    frame_commands.register(app)
    simulation_commands.register(app)
    supervision_commands.register(app)
