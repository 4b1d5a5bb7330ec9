"""A progress bar for workers: frames done, frames per second, what was found so far."""

from __future__ import annotations

import logging
import time
from typing import Self

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    SpinnerColumn,
    Task,
    TextColumn,
    TimeRemainingColumn,
)
from rich.text import Text

logger = logging.getLogger(__name__)

_LOG_EVERY_S = 10.0


class FrameProgress:
    """A bar on a terminal; without one, a line in the log every 10 s."""

    def __init__(self, console: Console | None = None) -> None:
        self._console = console or Console(stderr=True)
        self._bar = Progress(
            SpinnerColumn(finished_text="[green]✓[/]"),
            TextColumn("[bold]{task.description}[/]"),
            BarColumn(bar_width=28),
            MofNCompleteColumn(),
            _RateColumn(),
            TimeRemainingColumn(compact=True),
            TextColumn("{task.fields[status]}", style="dim"),
            console=self._console,
            disable=not self._console.is_terminal,
        )
        self._task = self._bar.add_task("starting", total=None, status="")
        self._name = ""
        self._frames = 0
        self._is_waiting = False
        self._began = self._logged = time.monotonic()

    def begin(self, name: str, frames: int | None) -> None:
        """A worker starts; None frames is a live source."""
        self._name = name
        self._bar.reset(self._task, total=frames, description=name, status="")
        self._began = self._logged = time.monotonic()

    def advance(self, status: str) -> None:
        """One more frame is done."""
        self._frames += 1
        self._is_waiting = False
        self._bar.update(self._task, advance=1, status=status)
        now = time.monotonic()
        if self._bar.disable and now - self._logged > _LOG_EVERY_S:
            self._logged = now
            rate = self._frames / (now - self._began)
            logger.info("%s: %d frames, %.1f/s; %s", self._name, self._frames, rate, status)

    def waiting(self, reason: str) -> None:
        """The board is away."""
        self._bar.update(self._task, status=reason)
        if self._bar.disable and not self._is_waiting:
            logger.warning("%s", reason)
        self._is_waiting = True

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.stop()


class _RateColumn(ProgressColumn):
    def render(self, task: Task) -> Text:
        speed = task.finished_speed or task.speed
        return Text("" if speed is None else f"{speed:4.1f} frames/s", style="cyan")
