"""Options and arguments that several commands share."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from fluentboard.errors import InvalidInput

if TYPE_CHECKING:
    from fluentboard_client import Client

Board = Annotated[
    str,
    typer.Option("--board", "-b", metavar="URL", envvar="FLUENTBOARD_BOARD", help="The board."),
]
Token = Annotated[
    str | None,
    typer.Option(
        metavar="SECRET",
        envvar="FLUENTBOARD_TOKEN",
        show_envvar=True,
        help="Bearer token, where the board asks for one.",
    ),
]
At = Annotated[
    str | None,
    typer.Option(
        metavar="TIME", help="Only what holds then: seconds, or 'now'. Default: all of history."
    ),
]
Sparql = Annotated[
    str, typer.Argument(metavar="SPARQL", help="The query; '-' reads it from standard input.")
]

DEFAULT_BOARD = "http://127.0.0.1:8080"


def connect(board: str, token: str | None, *, timeout_s: float = 60.0) -> Client:
    """A client of the board, for one command."""
    from fluentboard_client import Client

    return Client(board, author="cli", token=token, timeout_s=timeout_s)


def parsed_time(text: str | None) -> float | Literal["now"] | None:
    """The value of `--at`; a usage error if it is neither seconds nor `now`."""
    if text is None or text == "now":
        return text
    try:
        return float(text)
    except ValueError:
        raise typer.BadParameter(f"{text!r} is neither a number of seconds nor 'now'") from None


def parsed_window(text: str | None) -> tuple[float, float] | None:
    """The value of `--during`; a usage error if it is not two numbers of seconds."""
    if text is None:
        return None
    try:
        begin, end = map(float, text.split(","))
    except ValueError:
        raise typer.BadParameter(f"{text!r} is no window; give two times such as 100,160") from None
    return begin, end


def query_text(argument: str) -> str:
    """The query that an argument stands for."""
    return sys.stdin.read() if argument == "-" else argument


def readable(path: Path) -> Path:
    """The path, if a file can be read there.

    Raises:
        InvalidInput: there is no file.
    """
    if not path.is_file():
        raise InvalidInput(f"{path}: no such file; give one, or '-' for standard input")
    return path
