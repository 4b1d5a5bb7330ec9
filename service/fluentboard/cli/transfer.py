"""The commands `import`, `export` and `changes`: boards to and from files, as streams."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import IO, TYPE_CHECKING, Annotated, Literal

import typer

from fluentboard.cli.options import (
    DEFAULT_BOARD,
    At,
    Board,
    Token,
    connect,
    parsed_time,
    parsed_window,
    readable,
)
from fluentboard.errors import InvalidInput

if TYPE_CHECKING:
    from rich.progress import Progress

ImportFormat = Literal["yaml", "jsonl", "turtle", "ntriples", "trig", "nquads", "jsonld", "rdfxml"]
ExportFormat = Literal["yaml", "jsonl", "turtle", "ntriples", "trig", "nquads", "jsonld"]
Vocabulary = Literal["upper", "owl-time"]
ChangesFormat = Literal["rdf-patch", "jsonl"]

_BY_SUFFIX: dict[str, ImportFormat] = {
    ".yaml": "yaml",
    ".yml": "yaml",
    ".jsonl": "jsonl",
    ".ndjson": "jsonl",
    ".ttl": "turtle",
    ".nt": "ntriples",
    ".trig": "trig",
    ".nq": "nquads",
    ".jsonld": "jsonld",
    ".rdf": "rdfxml",
    ".owl": "rdfxml",
}
_BLOCK_BYTES = 64 * 1024
_STANDARD_STREAM = Path("-")


def register(app: typer.Typer) -> None:
    """Adds the commands to the app."""
    app.command(
        name="import",
        epilog="Examples:\n\nfluentboard import kitchen.yaml\n\n"
        "fluentboard export -b http://robot1:8080 --format jsonl | "
        "fluentboard import - --format jsonl\n\n"
        "fluentboard import kitchen.owl --graph urn:kitchen",
    )(import_file)
    app.command(
        name="export",
        epilog="Examples:\n\nfluentboard export > everything.yaml\n\n"
        "fluentboard export --format turtle --at now --output present.ttl\n\n"
        "fluentboard export --during 1423225350,1423225380\n\n"
        "fluentboard export --format jsonld --vocabulary owl-time --class Mug",
    )(export_file)
    app.command(
        name="changes",
        epilog="Examples:\n\nfluentboard changes --since 17 > after17.rdfp\n\n"
        "fluentboard changes --since 17 --follow --format jsonl",
    )(changes)


def import_file(
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="What to import; '-' reads standard input.")
    ],
    board: Board = DEFAULT_BOARD,
    format: Annotated[
        ImportFormat | None, typer.Option(help="Default: by the file's suffix.")
    ] = None,
    graph: Annotated[
        str | None,
        typer.Option(
            metavar="IRI",
            help="Where statements go that are not about fluents and in no graph; or 'default'.",
        ),
    ] = None,
    token: Token = None,
) -> None:
    """Import fluents from YAML, JSON Lines or RDF, and other statements from RDF.

    The file is streamed, so it may be larger than memory. If anything in it is wrong, nothing of it
    is stored. Fluents that the board knows already are refined by what the file says about them.
    An ontology or a map of somebody else is kept as static knowledge in the graph of that name.
    """
    chosen = format or _BY_SUFFIX.get(file.suffix.lower())
    if chosen is None:
        raise typer.BadParameter(f"cannot tell the format of '{file}' by its suffix; give --format")
    size = None if file == _STANDARD_STREAM else readable(file).stat().st_size
    with connect(board, token) as client, _progress() as progress:
        task = progress.add_task(f"Importing {file.name}", total=size)
        with _opened(file) as stream:
            account = client.import_fluents(
                _blocks(stream), chosen, graph=graph, progress=lambda n: progress.advance(task, n)
            )
    said = ", ".join(f"{key} {value}" for key, value in account.items() if not _is_long(value))
    typer.echo(f"imported {file}: {said}", err=True)
    warnings = account.get("warnings", [])
    for warning in warnings[:10]:
        typer.echo(f"warning: {warning}", err=True)
    if len(warnings) > 10:
        typer.echo(f"and {len(warnings) - 10} more warnings", err=True)


def export_file(
    board: Board = DEFAULT_BOARD,
    format: Annotated[ExportFormat, typer.Option(help="How to write it.")] = "yaml",
    at: At = None,
    during: Annotated[
        str | None,
        typer.Option(
            metavar="FROM,TO", help="Only what holds at some time in between, in seconds."
        ),
    ] = None,
    certainly: Annotated[
        bool,
        typer.Option("--certainly", help="With --at or --during: only what certainly holds then."),
    ] = False,
    class_name: Annotated[
        str | None, typer.Option("--class", metavar="CLASS", help="Only fluents of this class.")
    ] = None,
    as_of: Annotated[
        int | None, typer.Option(metavar="COMMIT", help="What was believed after that commit.")
    ] = None,
    vocabulary: Annotated[
        Vocabulary, typer.Option(help="Of RDF: the board's own, or OWL-Time.")
    ] = "upper",
    relations: Annotated[
        bool,
        typer.Option("--relations", help="With owl-time: Allen's relations that certainly hold."),
    ] = False,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="FILE", help="Where to. Default: standard output."),
    ] = None,
    token: Token = None,
) -> None:
    """Export what is on the board.

    TriG, N-Quads and JSON-LD have everything: what is said outside fluents, too.
    """
    time, window = parsed_time(at), parsed_window(during)
    with connect(board, token) as client:
        pieces = client.export(
            format,
            at=time,
            during=window,
            certainly=certainly,
            class_name=class_name,
            as_of=as_of,
            vocabulary=None if vocabulary == "upper" else vocabulary,
            relations=relations,
        )
        if output is None or output == _STANDARD_STREAM:
            for piece in pieces:
                sys.stdout.buffer.write(piece)
            sys.stdout.buffer.flush()
            return
        with _progress() as progress:
            task = progress.add_task(f"Exporting to {output.name}", total=None)
            write_whole(output, _watched(pieces, progress, task))


def changes(
    board: Board = DEFAULT_BOARD,
    since: Annotated[
        int, typer.Option(metavar="COMMIT", help="The last commit that is known; 0 for all.")
    ] = 0,
    until: Annotated[
        int | None, typer.Option(metavar="COMMIT", help="The last commit to tell of.")
    ] = None,
    follow: Annotated[
        bool, typer.Option("--follow", "-f", help="Go on as commits are made, until Ctrl-C.")
    ] = False,
    format: Annotated[
        ChangesFormat, typer.Option(help="RDF Patch, or a JSON object per commit.")
    ] = "rdf-patch",
    token: Token = None,
) -> None:
    """Tell what commits changed: as RDF Patch, which other stores can carry out, or as JSON."""
    with connect(board, token) as client:
        try:
            for piece in client.changes(since, until=until, follow=follow, format=format):
                sys.stdout.buffer.write(piece)
                sys.stdout.buffer.flush()
        except KeyboardInterrupt:
            pass  # the usual way to end it


def write_whole(path: Path, pieces: Iterator[bytes]) -> None:
    """Writes a file that appears under its name only once it is complete."""
    partial = path.with_name(path.name + ".partial")
    try:
        with partial.open("wb") as file:
            for piece in pieces:
                file.write(piece)
        partial.replace(path)
    except OSError as problem:
        raise InvalidInput(f"{path}: cannot be written ({problem.strerror})") from problem
    finally:
        partial.unlink(missing_ok=True)


def _opened(file: Path) -> IO[bytes]:
    try:
        # A duplicate, so that closing it leaves the process its standard input.
        return (
            open(sys.stdin.fileno(), "rb", closefd=False)
            if file == _STANDARD_STREAM
            else file.open("rb")
        )
    except OSError as problem:
        raise InvalidInput(f"{file}: cannot be read ({problem.strerror})") from problem


def _blocks(stream: IO[bytes]) -> Iterator[bytes]:
    while block := stream.read(_BLOCK_BYTES):
        yield block


def _watched(pieces: Iterator[bytes], progress: Progress, task: object) -> Iterator[bytes]:
    from rich.progress import TaskID

    for piece in pieces:
        yield piece
        progress.advance(TaskID(int(str(task))), len(piece))


def _progress() -> Progress:
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        DownloadColumn,
        Progress,
        TextColumn,
        TimeRemainingColumn,
        TransferSpeedColumn,
    )

    console = Console(stderr=True)
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        DownloadColumn(),
        TransferSpeedColumn(),
        TimeRemainingColumn(),
        console=console,
        disable=not console.is_terminal,
    )


def _is_long(value: object) -> bool:
    return isinstance(value, (list, dict))
