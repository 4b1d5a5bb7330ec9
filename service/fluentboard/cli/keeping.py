"""The commands `backup`, `restore`, `check`, `compact` and `audit`: keeping a board safe."""

from __future__ import annotations

import json
import sys
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from fluentboard.cli.options import DEFAULT_BOARD, Board, Token, connect
from fluentboard.cli.transfer import write_whole
from fluentboard.errors import InvalidInput, MissingExtra

Data = Annotated[
    Path, typer.Option("--data", metavar="DIR", help="Folder of a board that is not served now.")
]
UpTo = Annotated[
    str | None,
    typer.Option(
        "--up-to",
        metavar="COMMIT",
        help="Only up to this commit, or to a time such as 2026-05-01T12:00:00Z.",
    ),
]


def register(app: typer.Typer) -> None:
    """Adds the commands to the app."""
    app.command(
        name="backup",
        epilog="Examples:\n\nfluentboard backup kitchen.sqlite\n\n"
        "fluentboard backup monday.sqlite --up-to 2026-05-04T00:00:00Z",
    )(backup)
    app.command(
        name="restore",
        epilog="Examples:\n\nfluentboard restore kitchen.sqlite --data ./kitchen\n\n"
        "fluentboard restore kitchen.sqlite --data ./before --up-to 1200",
    )(restore)
    app.command(name="check", epilog="Examples:\n\nfluentboard check --data ./kitchen")(check)
    app.command(name="compact", epilog="Examples:\n\nfluentboard compact --data ./kitchen")(compact)
    app.command(
        name="audit",
        epilog="Examples:\n\nfluentboard audit --name mug1\n\n"
        "fluentboard audit --forced --format jsonl",
    )(audit)


def backup(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="The new file.")],
    board: Board = DEFAULT_BOARD,
    up_to: UpTo = None,
    token: Token = None,
) -> None:
    """Back up a board while it is served.

    The file holds the whole journal, or its beginning up to a commit, and the durable
    subscriptions with the keys that posts are signed with: everything that `restore` needs.
    """
    if file.exists():
        raise InvalidInput(f"{file} is there already; give a new file")
    with connect(board, token, timeout_s=600.0) as client:
        write_whole(file, client.backup(up_to))
    typer.echo(f"backed up {board} to {file}: {file.stat().st_size:,} bytes", err=True)


def restore(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="What `backup` wrote.")],
    data: Annotated[
        Path, typer.Option("--data", metavar="DIR", help="Folder for the board; holds none yet.")
    ],
    up_to: Annotated[
        int | None,
        typer.Option("--up-to", metavar="COMMIT", min=0, help="Only up to this commit."),
    ] = None,
) -> None:
    """Make a board from a backup, as of its last commit or an earlier one.

    `fluentboard serve --data DIR` starts it, and builds the RDF store from the journal.
    """
    from fluentboard.board.backup import restore_backup

    last = restore_backup(file, data, up_to)
    typer.echo(f"restored {file} to {data}, up to commit {last:,}", err=True)


def check(data: Data = Path("fluentboard-data")) -> None:
    """Check the journal, and its projections against it.

    Builds the RDF store anew from the journal, beside the one that is there, and tells every
    statement in which they differ. Changes nothing. Exit code 1 if something is wrong.
    """
    try:
        from fluentboard.board.checking import check_board
    except ModuleNotFoundError as problem:
        raise _missing(problem) from problem
    report = check_board(data)
    typer.echo(
        f"commit {report.commit:,}: {report.fluents:,} fluents, {report.statements:,} statements"
    )
    if report.replayed:
        typer.echo(
            f"the store has not seen the last {report.replayed:,} commits; a start does that"
        )
    for fault in report.faults:
        typer.echo(fault)
    if report.is_sound:
        typer.echo("sound")
        return
    left = report.fault_count - len(report.faults)
    if left:
        typer.echo(f"and {left:,} more")
    if any(fault.startswith("journal") for fault in report.faults):
        typer.echo("the journal is damaged: restore a backup")
    else:
        typer.echo(f"the journal is sound: delete {data / 'store'}, and a start builds it anew")
    raise typer.Exit(1)


def compact(data: Data = Path("fluentboard-data")) -> None:
    """Give back the room that the files of a board do not need."""
    try:
        from fluentboard.board.checking import compact_board
    except ModuleNotFoundError as problem:
        raise _missing(problem) from problem
    before, after = compact_board(data)
    typer.echo(f"{data}: {before:,} bytes before, {after:,} bytes after")


def audit(
    board: Board = DEFAULT_BOARD,
    author: Annotated[str | None, typer.Option(help="Only commits of this author.")] = None,
    name: Annotated[
        str | None, typer.Option(metavar="FLUENT", help="Only commits that changed this fluent.")
    ] = None,
    after: Annotated[
        str | None,
        typer.Option(metavar="COMMIT", help="Only commits after this one, or after a time."),
    ] = None,
    up_to: UpTo = None,
    forced: Annotated[
        bool, typer.Option("--forced", help="Only corrections that an admin forced.")
    ] = False,
    format: Annotated[
        Literal["table", "jsonl"], typer.Option(help="A table for people, or JSON Lines.")
    ] = "table",
    token: Token = None,
) -> None:
    """Show who changed what and when, as the journal has it."""
    with connect(board, token) as client:
        for entry in client.audit(
            author=author, name=name, after=after, up_to=up_to, forced=forced
        ):
            typer.echo(json.dumps(entry) if format == "jsonl" else _line(entry))
    sys.stdout.flush()


def _line(entry: dict[str, Any]) -> str:
    when = datetime.fromtimestamp(entry["wall_s"], UTC).isoformat(" ", "milliseconds")
    what = [f"{change['event']} {change['name']}" for change in entry["fluents"][:5]]
    if len(entry["fluents"]) > 5:
        what.append(f"and {len(entry['fluents']) - 5:,} more")
    for said in entry["statements"]:
        where = said["ontology"] or said["graph"] or "default graph"
        what.append(f"{where} +{said['added']} -{said['removed']}")
    reason = f" ({entry['reason']})" if entry["reason"] else ""
    return f"{entry['commit']:>8}  {when}  {entry['author']}: {', '.join(what)}{reason}"


def _missing(problem: ModuleNotFoundError) -> Exception:
    if (problem.name or "").startswith("fluentboard"):
        return problem
    return MissingExtra(
        f"this needs the extra 'service' ({problem.name} is missing); install it with: "
        "pip install 'fluentboard[service]'"
    )
