"""The command `trajectory`: where a thing was."""

from __future__ import annotations

import csv
import json
import sys
from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from fluentboard.cli.options import DEFAULT_BOARD, Board, Token, connect, parsed_time, parsed_window

if TYPE_CHECKING:
    from fluentboard.model.interval import Interval
    from fluentboard_client import PoseGap, PoseHeld, Trajectory

Format = Literal["table", "json", "csv"]

_COLUMNS = ("pose", "start", "finish", "x", "y", "z", "roll", "pitch", "yaw")


def register(app: typer.Typer) -> None:
    """Adds the command to the app."""
    app.command(
        name="trajectory",
        epilog="Examples:\n\nfluentboard trajectory mug1\n\n"
        "fluentboard trajectory mug1 --at 120.5 --at now\n\n"
        "fluentboard trajectory mug1 --during 100,160 --format csv > mug1.csv",
    )(trajectory)


def trajectory(
    name: Annotated[str, typer.Argument(metavar="NAME", help="The object, such as mug1.")],
    board: Board = DEFAULT_BOARD,
    at: Annotated[
        list[str] | None,
        typer.Option(metavar="TIME", help="Show its position then: seconds, or 'now'. Repeatable."),
    ] = None,
    during: Annotated[
        str | None,
        typer.Option(metavar="FROM,TO", help="Only poses it may have had in this window."),
    ] = None,
    as_of: Annotated[
        int | None, typer.Option(metavar="COMMIT", help="What was believed after that commit.")
    ] = None,
    format: Annotated[Format, typer.Option(help="A table for people, or JSON or CSV.")] = "table",
    token: Token = None,
) -> None:
    """Show where an object was: its poses over time, and the way that it travelled."""
    times: list[float | Literal["now"]] = [
        time for text in at or () if (time := parsed_time(text)) is not None
    ]
    with connect(board, token) as client:
        found = client.trajectory(name, at=times, during=parsed_window(during), as_of=as_of)
    if format == "json":
        typer.echo(json.dumps(_to_json(found)))
    elif format == "csv":
        writer = csv.writer(sys.stdout)
        writer.writerow(_COLUMNS)
        writer.writerows(_row(held) for held in found.poses)
    else:
        _print(found)


def _print(found: Trajectory) -> None:
    from rich.box import SIMPLE_HEAD
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    console = Console()
    table = Table(box=SIMPLE_HEAD, pad_edge=False)
    for column in _COLUMNS:
        table.add_column(column, justify="left" if column == "pose" else "right", overflow="fold")
    for held in found.poses:
        pose, start, finish, *numbers = _row(held)
        table.add_row(Text(str(pose)), str(start), str(finish), *(f"{n:.3f}" for n in numbers))
    console.print(table)
    for line in _remarks(found):
        console.print(line, highlight=False, markup=False)


def _remarks(found: Trajectory) -> Iterator[str]:
    count = len(found.poses)
    yield f"{count} pose{'' if count == 1 else 's'}, at least {found.distance_m:.3f} m travelled"
    for gap in found.gaps:
        yield _gap_text(gap)
    for time_s, places in found.positions.items():
        told = [f"{at.certainty.name.lower()} at {at.held.fluent}" for at in places]
        yield f"at {time_s:g} s: {' or '.join(told) or 'not known'}"
    if found.missing:
        yield f"not on the board: {', '.join(found.missing)}"


def _gap_text(gap: PoseGap) -> str:
    between = f"between {gap.before} and {gap.after}: perhaps no pose from "
    text = between + " to ".join(_time(time) for time in gap.possible_s) + " s"
    if gap.certain_s is not None:
        text += ", surely none from " + " to ".join(_time(time) for time in gap.certain_s) + " s"
    return text


def _row(held: PoseHeld) -> tuple[Any, ...]:
    pose = held.pose
    return (
        *(held.fluent, _interval(held.start), _interval(held.finish)),
        *(pose.x, pose.y, pose.z, *pose.rpy),
    )


def _interval(interval: Interval) -> str:
    earliest, latest = _time(interval.earliest), _time(interval.latest)
    return earliest if earliest == latest else f"{earliest}..{latest}"


def _time(time_s: float | None) -> str:
    return "?" if time_s is None else f"{time_s:.15g}"


def _to_json(found: Trajectory) -> dict[str, Any]:
    return {
        "name": found.name,
        "poses": [_held_json(held) for held in found.poses],
        "distance_m": found.distance_m,
        "gaps": [
            {
                "before": gap.before,
                "after": gap.after,
                "possible": gap.possible_s,
                "certain": gap.certain_s,
            }
            for gap in found.gaps
        ],
        "missing": found.missing,
        "positions": [
            {
                "at": time_s,
                "poses": [
                    {"certainty": at.certainty.name.lower(), **_held_json(at.held)} for at in places
                ],
            }
            for time_s, places in found.positions.items()
        ],
        "commit": found.commit,
    }


def _held_json(held: PoseHeld) -> dict[str, Any]:
    pose = held.pose
    roll, pitch, yaw = pose.rpy
    return {
        "fluent": held.fluent,
        "start": [held.start.earliest, held.start.latest],
        "finish": [held.finish.earliest, held.finish.latest],
        "pose": {
            **{"x": pose.x, "y": pose.y, "z": pose.z, "roll": roll, "pitch": pitch, "yaw": yaw},
            "quaternion": [pose.qx, pose.qy, pose.qz, pose.qw],
        },
    }
