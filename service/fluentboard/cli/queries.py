"""The commands `query` and `watch`: what the board knows, and what changes."""

from __future__ import annotations

import json
import signal
import sys
from types import FrameType
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from fluentboard.cli.options import (
    DEFAULT_BOARD,
    At,
    Board,
    Sparql,
    Token,
    connect,
    parsed_time,
    query_text,
)

if TYPE_CHECKING:
    from fluentboard_client import Event, Row

TableFormat = Literal["table", "json", "csv"]
LineFormat = Literal["text", "json"]

# JSON for people who pipe a SELECT into jq, and the JSON form of graphs for CONSTRUCT.
_MEDIA_TYPES = {
    "json": "application/sparql-results+json, application/ld+json;q=0.9",
    "csv": "text/csv",
}


def register(app: typer.Typer) -> None:
    """Adds the commands to the app."""
    app.command(
        name="query",
        epilog="Examples:\n\n"
        "fluentboard query 'SELECT ?table WHERE { ?table a furniture:Table }'\n\n"
        "fluentboard query 'ASK { ?h a race:Holding }' --at now --certainly\n\n"
        "fluentboard query - --format csv < areas.rq > areas.csv",
    )(query)
    app.command(
        name="watch",
        epilog="Examples:\n\n"
        "fluentboard watch 'SELECT ?table WHERE { ?table a furniture:Table }'\n\n"
        "fluentboard watch 'SELECT ?mug WHERE { ?mug a race:Mug }' --mode fluents --format json\n\n"
        "fluentboard watch 'SELECT ?mug WHERE { ?mug a race:Mug }' --at now --from-commit 3 "
        "--speed 10",
    )(watch)
    app.command(
        name="explain",
        epilog="Examples:\n\n"
        "fluentboard explain 'SELECT ?mug WHERE { ?mug a race:Mug }'\n\n"
        "fluentboard explain 'SELECT ?mug WHERE { ?mug a race:Mug }' --fluent mug1 --at now",
    )(explain)


def query(
    sparql: Sparql,
    board: Board = DEFAULT_BOARD,
    format: Annotated[
        TableFormat,
        typer.Option(help="A table for people, or SPARQL 1.1 results as JSON or CSV."),
    ] = "table",
    at: At = None,
    certainly: Annotated[
        bool, typer.Option("--certainly", help="With --at: only what certainly holds then.")
    ] = False,
    as_of: Annotated[
        int | None, typer.Option(metavar="COMMIT", help="What was believed after that commit.")
    ] = None,
    token: Token = None,
) -> None:
    """Ask the board a SPARQL query (SELECT, ASK, CONSTRUCT or DESCRIBE).

    The prefixes rdf, rdfs, owl, xsd, upper, race, furniture, fb and fluent need no declaration.
    """
    time = parsed_time(at)
    with connect(board, token) as client:
        text = query_text(sparql)
        if format != "table":
            document = client.query_document(
                text, _MEDIA_TYPES[format], at=time, certainly=certainly, as_of=as_of
            )
            sys.stdout.buffer.write(document.rstrip() + b"\n")
            sys.stdout.buffer.flush()
            return
        result = client.query(text, at=time, certainly=certainly, as_of=as_of)
    if isinstance(result, bool):
        typer.echo("yes" if result else "no")
    elif isinstance(result, str):
        typer.echo(result, nl=False)
    else:
        _print_table(result)


def watch(
    sparql: Sparql,
    board: Board = DEFAULT_BOARD,
    mode: Annotated[
        Literal["bindings", "fluents", "both"],
        typer.Option(help="Show solutions that come and go, whole fluents that change, or both."),
    ] = "bindings",
    since: Annotated[
        int | None,
        typer.Option(metavar="COMMIT", help="Begin after this commit, not with the whole result."),
    ] = None,
    at: Annotated[
        Literal["now"] | None,
        typer.Option(help="now: show what holds, and what the clock changes of that."),
    ] = None,
    certainly: Annotated[
        bool, typer.Option("--certainly", help="With --at now: only what certainly holds.")
    ] = False,
    from_commit: Annotated[
        int | None, typer.Option(metavar="COMMIT", help="Replay the past after this commit.")
    ] = None,
    from_time: Annotated[
        float | None, typer.Option(metavar="SECONDS", help="Replay the past from this time on.")
    ] = None,
    speed: Annotated[
        float, typer.Option(help="Of a replay: seconds of the past per second.")
    ] = 1.0,
    durable: Annotated[
        bool,
        typer.Option("--durable", help="SPARQL is the name of a durable subscription instead."),
    ] = False,
    format: Annotated[LineFormat, typer.Option(help="Text, or one JSON object per line.")] = "text",
    token: Token = None,
) -> None:
    """Print how the result of a query changes, until Ctrl-C.

    Reconnects when the board restarts, and goes on with what it missed.
    """
    with connect(board, token) as client:
        subscription = client.subscribe(
            "" if durable else query_text(sparql),
            mode=mode,
            since=since,
            at=at,
            certainly=certainly,
            from_commit=from_commit,
            from_time=from_time,
            speed=speed,
            durable=sparql if durable else None,
        )

        def stop(number: int, frame: FrameType | None) -> None:
            raise KeyboardInterrupt

        signal.signal(signal.SIGTERM, stop)
        try:
            for event in subscription:
                typer.echo(json.dumps(_event_json(event)) if format == "json" else str(event))
                sys.stdout.flush()
        except KeyboardInterrupt:
            pass  # the usual way to end a watch
        finally:
            subscription.close()


def explain(
    sparql: Sparql,
    board: Board = DEFAULT_BOARD,
    fluent: Annotated[
        str | None, typer.Option(metavar="NAME", help="Also say why this fluent is in, or is not.")
    ] = None,
    at: Annotated[
        Literal["now"] | None, typer.Option(help="now: explain a subscription to what holds.")
    ] = None,
    certainly: Annotated[
        bool, typer.Option("--certainly", help="With --at now: only what certainly holds.")
    ] = False,
    format: Annotated[LineFormat, typer.Option(help="Text, or a JSON object.")] = "text",
    token: Token = None,
) -> None:
    """Say how a subscription would be evaluated, and why it has nothing to say of a fluent."""
    with connect(board, token) as client:
        text = query_text(sparql)
        found = client.subscriptions.explain(text, fluent=fluent, at=at, certainly=certainly)
    if format == "json":
        typer.echo(json.dumps(found, indent=2))
        return
    typer.echo(f"tier {found['tier']}: {found['reason']}")
    typer.echo(f"concerned by {found['concerned_by']}")
    for shape in found["shapes"]:
        typer.echo(f"  {shape}")
    for one in found["refused"]:
        typer.echo(f"not tier {one['tier']}: {one['reason']}")
    if fluent is not None:
        for one in found["fluent"]["conditions"]:
            mark = "met    " if one["met"] else "not met"
            typer.echo(f"{mark} {one['pattern']}" + (f" ({one['why']})" if one["why"] else ""))
        typer.echo(found["fluent"]["verdict"])


def _print_table(rows: list[Row]) -> None:
    from rich.box import SIMPLE_HEAD
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    from fluentboard_client.results import term_text

    console = Console()
    if rows and rows[0]:
        table = Table(box=SIMPLE_HEAD, pad_edge=False)
        for name in rows[0]:
            is_number = all(isinstance(row[name], (int, float)) for row in rows)
            table.add_column(Text(name), justify="right" if is_number else "left", overflow="fold")
        for row in rows:
            table.add_row(*(Text(term_text(value)) for value in row.values()))
        console.print(table)
    console.print(f"{len(rows)} row{'' if len(rows) == 1 else 's'}", highlight=False)


def _event_json(event: Event) -> dict[str, Any]:
    from fluentboard_client import Delta, Gap, Snapshot
    from fluentboard_client.commands import statement_json

    kind = type(event).__name__.lower()
    if isinstance(event, Gap):
        return {"type": kind, "since": event.since, "commit": event.commit}
    shown: dict[str, Any] = {"type": kind}
    if isinstance(event, (Snapshot, Delta)):
        shown["commit"] = event.commit
        if event.at_s is not None:
            shown["at"] = event.at_s
        if event.boolean is not None:
            shown["boolean"] = event.boolean
    if isinstance(event, Snapshot):
        shown["rows"] = list(event.rows)
    elif isinstance(event, Delta):
        shown["added"], shown["removed"] = list(event.added), list(event.removed)
        if event.fluents:
            shown["events"] = [
                {"event": change.kind, "fluent": statement_json(change.fluent)}
                for change in event.fluents
            ]
    return shown
