"""The command `serve`: opens a board and answers for it over HTTP until told to stop."""

from __future__ import annotations

import contextlib
import logging
import os
import signal
import socket
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from fluentboard import __version__
from fluentboard.errors import InvalidConfiguration, MissingExtra

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
        str | None, typer.Option(metavar="ADDRESS", help="Address to listen on. [127.0.0.1]")
    ] = None,
    port: Annotated[
        int | None, typer.Option(metavar="PORT", help="TCP port; 0 takes any free one. [8080]")
    ] = None,
    data: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Folder of the journal and the store. [fluentboard-data]"),
    ] = None,
    in_memory: Annotated[
        bool, typer.Option("--in-memory", help="Keep nothing on disk; for trials and tests.")
    ] = False,
    ontology: Annotated[
        list[Path] | None,
        typer.Option(metavar="FILE", help="Turtle or RDF/XML file to load; may be repeated."),
    ] = None,
    durability: Annotated[
        Literal["disk", "process"] | None,
        typer.Option(help="Whether a write waits until it is on the disk. [disk]"),
    ] = None,
    allow_open: Annotated[
        bool,
        typer.Option(
            "--allow-open", help="Listen without tokens where other machines can reach the board."
        ),
    ] = False,
    config: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Settings as YAML; flags override them.")
    ] = None,
    print_config: Annotated[
        bool, typer.Option("--print-config", help="Print the settings as YAML and exit.")
    ] = False,
) -> None:
    """Serve a board over HTTP, until Ctrl-C or SIGTERM.

    Settings come from defaults, the file given with --config, FLUENTBOARD_* variables and flags,
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
            "storage.ontologies": ontology or None,
            "storage.durability": durability,
            "security.allow_open": allow_open or None,
        },
    )
    if in_memory:
        storage = settings.storage.model_copy(update={"data": None})
        settings = settings.model_copy(update={"storage": storage})
    if print_config:
        typer.echo(settings_yaml(settings), nl=False)
        return
    _serve(settings)


def _serve(settings: Settings) -> None:
    try:
        import uvicorn

        from fluentboard.api.app import create_app
        from fluentboard.board.blackboard import Blackboard
    except ImportError as problem:
        raise MissingExtra(
            f"serving a board needs the extra 'service' ({problem.name} is missing); install it "
            "with: pip install 'fluentboard[service]'"
        ) from problem

    logging.basicConfig(
        level=settings.log.level.upper(),
        format="%(asctime)s %(levelname)-7s %(name)s: %(message)s",
        stream=sys.stderr,
    )

    class Server(uvicorn.Server):
        async def startup(self, sockets: list[socket.socket] | None = None) -> None:
            await super().startup(sockets)
            if self.started:
                # The line that whoever started this process on port 0 waits for.
                typer.echo(f"fluentboard {__version__} serves {address}")
                sys.stdout.flush()

    storage = settings.storage
    with _bound(settings) as listener:
        name, port = listener.getsockname()[:2]
        address = f"http://[{name}]:{port}" if ":" in name else f"http://{name}:{port}"
        with Blackboard.open(
            storage.data,
            durability=storage.durability,
            ontologies=storage.ontologies,
            builtin_ontologies=storage.builtin_ontologies,
        ) as board:
            server = Server(
                uvicorn.Config(
                    create_app(board, settings),
                    root_path=settings.server.root_path,
                    log_config=None,
                    access_log=settings.server.access_log,
                    server_header=False,
                    timeout_keep_alive=settings.server.keep_alive_s,
                    timeout_graceful_shutdown=int(settings.server.shutdown_timeout_s) or 1,
                    ws_max_size=settings.subscriptions.message_max_bytes,
                    ws_ping_interval=settings.subscriptions.heartbeat_s,
                    ws_ping_timeout=settings.subscriptions.heartbeat_s,
                )
            )
            # Uvicorn stops on a signal and then raises it again for whoever else cares; here nobody
            # does, and the default action would end the process before the board is closed.
            signal.signal(signal.SIGTERM, signal.SIG_IGN)
            with contextlib.suppress(KeyboardInterrupt):
                server.run(sockets=[listener])
    if not server.started:
        sys.exit(1)


def _bound(settings: Settings) -> socket.socket:
    """A socket on the wanted address.

    Raises:
        InvalidConfiguration: the address is not one of this machine, or the port is in use.
    """
    host, port = settings.server.host, settings.server.port
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        listener = socket.socket(family, kind, protocol)
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind(address)
    except OSError as problem:
        raise InvalidConfiguration(
            f"cannot listen on {host} port {port}: {problem.strerror}; "
            "choose another --port (0 takes any free one) or --host"
        ) from problem
    return listener
