"""Supervisor: the board first, then its workers; at the end the workers first, then the board."""

from __future__ import annotations

import logging
import re
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Literal

from fluentboard.clock import Clock, SystemClock
from fluentboard.errors import BoardUnreachable
from fluentboard_client import Client
from fluentboard_modules.pulse import WorkerState
from fluentboard_modules.supervision.board_writer import BoardWriter
from fluentboard_modules.supervision.child import Child
from fluentboard_modules.supervision.config import (
    ServiceConfig,
    UpConfig,
    WorkerConfig,
    service_command,
    source_of,
    worker_command,
)
from fluentboard_modules.supervision.watched import Process, Watched
from fluentboard_modules.supervision.worker_run import WorkerRun

logger = logging.getLogger(__name__)

SERVICE = "board"
"""Name of the board among the processes."""

_ANNOUNCEMENT = re.compile(r"serves (https?://\S+)")
_TICK_S = 0.1
_BOARD_TIMEOUT_S = 5.0

Heard = Callable[[str, str], object]
"""Called with the name of a process and a line that it wrote."""


class Supervisor:
    """Runs what a configuration says until it is asked to stop.

    Args:
        config: what to run.
        folder: where processes run; relative paths of the configuration start there.
        heard: what to do with the lines that processes write.
        token: bearer token of the board.
        clock: of the board's time axis.
        monotonic_s: a clock that is never set back.
    """

    def __init__(
        self,
        config: UpConfig,
        folder: Path,
        heard: Heard,
        *,
        token: str | None = None,
        clock: Clock | None = None,
        monotonic_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self._config = config
        self._folder = folder
        self._heard = heard
        self._token = token
        self._clock = clock or SystemClock()
        self._monotonic_s = monotonic_s
        self._stop = threading.Event()
        self._hurry = False
        self.address = config.board or ""
        self.service: Watched | None = None
        self.workers: list[Watched] = []

    def ask_to_stop(self) -> None:
        """Lets `run` come to its end; asked again, it kills what still runs."""
        self._hurry = self._stop.is_set()
        self._stop.set()

    @property
    def watched(self) -> Sequence[Watched]:
        """Everything that is run, the board first."""
        return [*((self.service,) if self.service is not None else ()), *self.workers]

    def run(self, shown: Callable[[], object] = lambda: None) -> None:
        """Runs everything; returns when all of it has stopped.

        Args:
            shown: called after every look at the processes.

        Raises:
            BoardUnreachable: the board did not come up.
        """
        try:
            if self._config.service is not None:
                self._start_service(self._config.service)
            self.workers = [
                self._watched_worker(name, worker) for name, worker in self._config.workers.items()
            ]
            if not self._stop.is_set():
                self._watch(shown)
        finally:
            self._stop_all(shown)

    def _watch(self, shown: Callable[[], object]) -> None:
        with Client(
            self.address,
            author="supervisor",
            token=self._token,
            timeout_s=_BOARD_TIMEOUT_S,
            retries=0,
        ) as board:
            names = [watched.name for watched in self.workers]
            writer = BoardWriter(board, self._runs, names, self._clock, self._config.state)
            writer.start()
            try:
                while not self._stop.is_set():
                    for watched in self.watched:
                        watched.tick()
                    shown()
                    if self._config.stop_when_done and self._is_done():
                        logger.info("all workers are done")
                        break
                    self._stop.wait(_TICK_S)
                self._stop_processes(self.workers, shown)
            finally:
                writer.finish()

    def _is_done(self) -> bool:
        return all(watched.is_at_rest for watched in self.workers)

    def _runs(self) -> list[WorkerRun]:
        return [run for watched in self.workers for run in watched.runs()]

    def _start_service(self, service: ServiceConfig) -> None:
        """Starts the board and waits for its address."""
        announced = threading.Event()

        def heard(line: str) -> None:
            found = _ANNOUNCEMENT.search(line)
            if found and not announced.is_set():
                self.address = found.group(1)
                announced.set()
            self._heard(SERVICE, line)

        def launch(beat: Callable[[WorkerState], object]) -> Process:
            # The port that the system chose the first time is the one that the workers know.
            port = int(self.address.rpartition(":")[2]) if self.address else None
            return Child(service_command(service, port), self._folder, {}, heard, beat)

        self.service = self._watch_over(SERVICE, launch, "always")
        self.service.tick()
        child = self.service.process
        assert isinstance(child, Child)
        while not announced.wait(_TICK_S):
            code = child.exit_code()
            if code is not None and not announced.is_set():
                self.service.stopped(code)
                lines = "\n".join(child.tail)
                raise BoardUnreachable(f"the board did not come up; it said:\n{lines}")
            if self._stop.is_set():
                return

    def _watched_worker(self, name: str, worker: WorkerConfig) -> Watched:
        def launch(beat: Callable[[WorkerState], object]) -> Process:
            return Child(
                worker_command(worker, self.address),
                self._folder,
                worker.environment,
                lambda line: self._heard(name, line),
                beat,
            )

        return self._watch_over(name, launch, worker.restart, source_of(worker, self.address))

    def _watch_over(
        self,
        name: str,
        launch: Callable[[Callable[[WorkerState], object]], Process],
        when: Literal["on-failure", "always", "never"],
        source: str = "",
    ) -> Watched:
        return Watched(
            name, launch, when, self._config.restart, self._clock, self._monotonic_s, source
        )

    def _stop_all(self, shown: Callable[[], object]) -> None:
        self._stop_processes(self.workers, shown)
        if self.service is not None:
            self._stop_processes([self.service], shown)

    def _stop_processes(self, watched: Sequence[Watched], shown: Callable[[], object]) -> None:
        """Asks processes to stop, waits, and kills those that do not."""
        running = [one for one in watched if one.process is not None]
        for one in running:
            assert one.process is not None
            logger.info("%s: stopping", one.name)
            one.process.terminate()
        deadline_s = self._monotonic_s() + self._config.stop_timeout_s
        while running:
            is_late = self._monotonic_s() > deadline_s or self._hurry
            for one in running:
                assert one.process is not None
                if is_late:
                    logger.warning("%s: does not stop; killed", one.name)
                    one.process.kill()
                code = one.process.exit_code()
                if code is not None:
                    logger.info("%s: stopped", one.name)
                    one.stopped(code)
            running = [one for one in running if one.process is not None]
            shown()
            if running:
                time.sleep(0.5 * _TICK_S)
