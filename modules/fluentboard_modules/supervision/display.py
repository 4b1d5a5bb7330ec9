"""What `fluentboard up` shows: a table that stays below the log on a terminal, lines elsewhere."""

from __future__ import annotations

import logging
import sys
import time
from collections.abc import Sequence
from typing import Self

from rich.console import Console
from rich.live import Live
from rich.logging import RichHandler
from rich.table import Table
from rich.text import Text

from fluentboard_modules.supervision.supervisor import Supervisor
from fluentboard_modules.supervision.watched import Watched

_COLOURS = {
    "running": "green",
    "waiting": "yellow",
    "failed": "red",
    "finished": "cyan",
    "stopped": "dim",
}
_NAME_COLOURS = ("cyan", "magenta", "blue", "yellow", "green", "bright_cyan", "bright_magenta")
_REDRAW_S = 0.5


class Display:
    """Shows the processes of a supervisor, and what they write.

    Args:
        console: where; standard error by default.
    """

    def __init__(self, console: Console | None = None) -> None:
        self._console = console or Console(stderr=True)
        self._live: Live | None = None
        self._drawn_s = 0.0
        self._names: list[str] = []

    def heard(self, name: str, line: str) -> None:
        """Shows a line that a process wrote."""
        if name not in self._names:
            self._names.append(name)
        if not self._console.is_terminal:
            sys.stderr.write(f"{name} | {line}\n")
            sys.stderr.flush()
            return
        colour = _NAME_COLOURS[self._names.index(name) % len(_NAME_COLOURS)]
        self._console.print(Text.assemble((f"{name} ", colour), ("│ ", "dim"), line))

    def show(self, supervisor: Supervisor) -> None:
        """Draws the table again, if it is time to."""
        if self._live is None or time.monotonic() - self._drawn_s < _REDRAW_S:
            return
        self._drawn_s = time.monotonic()
        self._live.update(state_table(supervisor.watched, supervisor.address))

    def log(self, verbose: bool) -> None:
        """Sends the log of this process where its lines do not disturb the table."""
        handler: logging.Handler
        if self._console.is_terminal:
            handler = RichHandler(console=self._console, show_path=False, show_time=True)
            form = "%(message)s"
        else:
            handler, form = logging.StreamHandler(), "%(asctime)s %(levelname)-7s %(message)s"
        level = logging.INFO
        logging.basicConfig(level=level, format=form, handlers=[handler])
        logging.getLogger("httpx").setLevel(logging.INFO if verbose else logging.WARNING)

    def __enter__(self) -> Self:
        if self._console.is_terminal:
            self._live = Live(
                console=self._console, auto_refresh=True, refresh_per_second=2, transient=False
            )
            self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._live is not None:
            self._live.stop()


def state_table(watched: Sequence[Watched], address: str) -> Table:
    """One row per process: its state, and how far it is."""
    table = Table(box=None, pad_edge=False, title=f"fluentboard up · {address}", title_style="bold")
    for column in ("name", "state", "frames", "lag", "dropped", "restarts"):
        table.add_column(column, justify="left" if column in ("name", "state") else "right")
    table.add_column("found", overflow="ellipsis", no_wrap=True)
    for one in watched:
        table.add_row(*_cells(one))
    return table


def _cells(one: Watched) -> list[Text | str]:
    situation: str = one.situation
    if one.situation == "waiting" and one.restarts:
        situation = f"restarts in {one.wait_s:.0f} s"
    run = one.run
    frames = lag = dropped = found = ""
    if run is not None and run.state.frames:
        state = run.state
        frames = str(state.frames) if state.total is None else f"{state.frames}/{state.total}"
        lag = "" if run.last_lag_s is None else f"{run.last_lag_s:.2f} s"
        dropped = str(state.dropped) if state.dropped else ""
        found = state.status
    if one.reason and one.situation != "running":
        found = one.reason
    colour = _COLOURS[one.situation]
    restarts = str(one.restarts) if one.restarts else ""
    return [one.name, Text(situation, style=colour), frames, lag, dropped, restarts, found]
