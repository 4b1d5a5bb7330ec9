"""The command `fluentboard`: serve, import, export, query and watch, and what other packages add.

Packages add commands through the entry-point group `fluentboard.commands`: a function that takes
the typer app. Frameworks are loaded by the command that needs them, so `--help` stays quick.
"""

from __future__ import annotations

import sys
from importlib.metadata import entry_points
from typing import Annotated

import typer

from fluentboard import __version__
from fluentboard.cli import keeping, objects, queries, serve, transfer
from fluentboard.errors import FluentboardError

ENTRY_POINT_GROUP = "fluentboard.commands"


def create_app() -> typer.Typer:
    """The command with its own sub-commands and those of all installed packages."""
    app = typer.Typer(
        name="fluentboard",
        no_args_is_help=True,
        add_completion=False,
        pretty_exceptions_enable=False,
        rich_markup_mode="markdown",
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    app.callback()(_describe)
    for register in (
        serve.register,
        transfer.register,
        queries.register,
        objects.register,
        keeping.register,
    ):
        register(app)
    for entry_point in sorted(entry_points(group=ENTRY_POINT_GROUP)):
        try:
            entry_point.load()(app)
        except ImportError as problem:
            # A broken plug-in must not keep the board from being served.
            _complain(f"commands of {entry_point.value} are not available: {problem}")
    return app


def main() -> None:
    """Runs the command line; errors are one line on stderr and exit code 1 (2 for wrong usage)."""
    try:
        create_app()(prog_name="fluentboard")
    except FluentboardError as problem:
        _complain(str(problem))
        sys.exit(1)


def _complain(line: str) -> None:
    print(line, file=sys.stderr)  # noqa: T201


def _show_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"fluentboard {__version__}")
        raise typer.Exit


def _describe(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version."),
    ] = False,
) -> None:
    """A robot's long-term memory: facts with uncertain intervals, and who hears of changes."""
