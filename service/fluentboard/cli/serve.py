"""The command `serve`: opens a board and answers for it over HTTP until told to stop."""

from __future__ import annotations

import logging
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from fluentboard import __version__
from fluentboard.errors import MissingExtra

if TYPE_CHECKING:
    from fluentboard.config import Settings


def register(app: typer.Typer) -> None:
    """Adds the command to the app."""
    app.command(
        name="serve",
        epilog="Examples:\n\nfluentboard serve --data ./kitchen\n\n"
        "fluentboard serve --data ./kitchen --port 0 --ontology tools.ttl\n\n"
        "fluentboard serve --print-config > board.yaml",
    )(serve)


def serve(
    host: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", show_default="127.0.0.1", help="Address to listen on."),
    ] = None,
    port: Annotated[
        int | None,
        typer.Option(metavar="PORT", show_default="8080", help="TCP port; 0 takes any free one."),
    ] = None,
    data: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            show_default="fluentboard-data",
            help="Folder of the journal and the store.",
        ),
    ] = None,
    store: Annotated[
        str | None,
        typer.Option(
            metavar="URL",
            help="SPARQL 1.1 endpoint that holds the RDF store; by default it is in the data "
            "folder.",
        ),
    ] = None,
    in_memory: Annotated[
        bool,
        typer.Option(
            "--in-memory",
            help="Keep nothing on disk; for trials and tests. A query that runs over its time is "
            "answered with an error, but goes on in its thread: there is no journal on disk that "
            "another process, which could be ended, would read.",
        ),
    ] = False,
    ontology: Annotated[
        list[Path] | None,
        typer.Option(metavar="FILE", help="Turtle or RDF/XML file to load; may be repeated."),
    ] = None,
    shapes: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="FILE",
            help="SHACL shapes that every write must meet; may be repeated. Needs the extra shacl.",
        ),
    ] = None,
    durability: Annotated[
        Literal["disk", "process"] | None,
        typer.Option(show_default="disk", help="Whether a write waits until it is on the disk."),
    ] = None,
    allow_open: Annotated[
        bool,
        typer.Option(
            "--allow-open", help="Listen without tokens where other machines can reach the board."
        ),
    ] = False,
    token: Annotated[
        str | None,
        typer.Option(
            metavar="SECRET",
            envvar="FLUENTBOARD_TOKEN",
            help="Ask everybody for this bearer token, of at least 16 characters.",
        ),
    ] = None,
    config: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Settings as YAML; flags override them.")
    ] = None,
    print_config: Annotated[
        bool, typer.Option("--print-config", help="Print the settings as YAML and exit.")
    ] = False,
) -> None:
    """Serve a board over HTTP, until Ctrl-C or SIGTERM.

    Settings come from defaults, the file given with --config, `FLUENTBOARD_*` variables and flags,
    each overriding the ones before. When the board is ready, one line with its address is printed.
    """
    from fluentboard.config import load_settings, settings_yaml

    if in_memory and data is not None:
        raise typer.BadParameter("give either --data or --in-memory")
    settings = load_settings(
        config,
        os.environ,
        {
            "server.host": host,
            "server.port": port,
            "storage.data": data,
            "storage.store": store,
            "storage.shapes": shapes or None,
            "storage.ontologies": ontology or None,
            "storage.durability": durability,
            "security.allow_open": allow_open or None,
            # More than one token, and roles, take a settings file.
            "security.tokens": [_operator(token)] if token else None,
        },
    )
    if in_memory:
        storage = settings.storage.model_copy(update={"data": None})
        settings = settings.model_copy(update={"storage": storage})
    if print_config:
        typer.echo(settings_yaml(settings), nl=False)
        return
    _serve(settings)


def _operator(token: str) -> dict[str, str]:
    return {"name": "operator", "role": "admin", "token": token}


def _serve(settings: Settings) -> None:
    try:
        from fluentboard.api import server
    except ModuleNotFoundError as problem:
        if (problem.name or "").startswith("fluentboard"):
            raise  # ours, so not what an extra would install
        raise MissingExtra(
            f"serving a board needs the extra 'service' ({problem.name} is missing); install it "
            "with: pip install 'fluentboard[service]'"
        ) from problem

    def announce(address: str) -> None:
        # Whoever started this process on port 0 waits for this line.
        typer.echo(f"fluentboard {__version__} serves {address}")
        sys.stdout.flush()

    logging.basicConfig(
        level=settings.log.level.upper(),
        format="%(asctime)s %(levelname)-7s %(name)s: %(message)s",
        stream=sys.stderr,
    )
    server.serve(settings, announce)
