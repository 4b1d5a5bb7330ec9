"""BoardWriter: tells the board about the workers, from a thread that may wait for it."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Sequence

from fluentboard.clock import Clock
from fluentboard.errors import BoardUnreachable, FluentboardError
from fluentboard_client import Client, Command
from fluentboard_modules.supervision.config import StateConfig
from fluentboard_modules.supervision.worker_fluents import (
    ACTIVITY,
    STATUS,
    Told,
    commands_for,
    endings_of_lost_runs,
)
from fluentboard_modules.supervision.worker_run import WorkerRun

logger = logging.getLogger(__name__)

_LOOK_EVERY_S = 1.0
_LAST_TRY_S = 5.0


class BoardWriter:
    """Keeps the fluents of the workers up to date; what the board misses is written later.

    Args:
        board: where to write.
        runs: gives all runs of this supervisor as they are.
        workers: names of the workers.
        clock: of the board's time axis.
        config: how often to write.
    """

    def __init__(
        self,
        board: Client,
        runs: Callable[[], Sequence[WorkerRun]],
        workers: Sequence[str],
        clock: Clock,
        config: StateConfig,
    ) -> None:
        self._board = board
        self._runs = runs
        self._workers = workers
        self._clock = clock
        self._config = config
        self._told: dict[str, Told | None] = {}
        self._has_tidied = False
        self._is_refused = False
        self._is_away = False
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._write_until_stopped, name="state", daemon=True)

    def start(self) -> None:
        """Begins to write."""
        if self._config.fluents:
            self._thread.start()

    def finish(self) -> None:
        """Writes what is left, if the board takes it, and stops."""
        self._stopped.set()
        if self._thread.is_alive():
            self._thread.join(_LAST_TRY_S)

    def write(self) -> None:
        """Writes what has changed; does nothing for a board that is away or refuses it."""
        if self._is_refused:
            return
        try:
            if not self._has_tidied:
                self._tidy_up()
                self._has_tidied = True
            commands, told = self._due()
            if commands:
                self._board.batch(commands)
            self._told = told  # runs that nobody speaks of any more are forgotten
            self._is_away = False
        except BoardUnreachable as problem:
            if not self._is_away:
                logger.info("states of the workers are not written: %s", problem.message)
            self._is_away = True
        except FluentboardError as problem:
            self._is_refused = True
            logger.warning("the board does not take the states of the workers: %s", problem)

    def _write_until_stopped(self) -> None:
        while not self._stopped.wait(_LOOK_EVERY_S):
            self.write()
        self.write()

    def _due(self) -> tuple[list[Command], dict[str, Told | None]]:
        now_s = self._clock.now_s()
        commands: list[Command] = []
        told: dict[str, Told | None] = {}
        for run in self._runs():
            due, told[run.name] = commands_for(run, self._told.get(run.name), now_s, self._config)
            commands += due
        return commands, told

    def _tidy_up(self) -> None:
        ours = {run.name for run in self._runs()}
        activities = [f for f in self._board.fluents(ACTIVITY) if f.name not in ours]
        statuses = {f.name: f for f in self._board.fluents(STATUS, is_open=True)}
        commands = endings_of_lost_runs(activities, statuses, self._workers, self._clock.now_s())
        if commands:
            self._board.batch(commands)
