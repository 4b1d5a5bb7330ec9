"""Watched: one entry of the configuration: its present process, its past, and what comes next."""

from __future__ import annotations

import logging
import math
import threading
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Literal, Protocol

from fluentboard.clock import Clock
from fluentboard_modules.pulse import WorkerState
from fluentboard_modules.supervision.config import RestartConfig
from fluentboard_modules.supervision.restarts import Rest, Restart, after_exit, exit_text
from fluentboard_modules.supervision.worker_run import WorkerRun

logger = logging.getLogger(__name__)

Situation = Literal["waiting", "running", "finished", "stopped", "failed"]
When = Literal["on-failure", "always", "never"]


class Process(Protocol):
    """What is asked of a running process; `Child` is one."""

    @property
    def pid(self) -> int:
        """Number of the process."""
        ...

    def exit_code(self) -> int | None:
        """The exit code, None while it runs."""
        ...

    def terminate(self) -> None:
        """Asks it to stop."""
        ...

    def kill(self) -> None:
        """Ends it at once."""
        ...


Launch = Callable[[Callable[[WorkerState], object]], Process]
"""Starts the process; its argument is called whenever the process says how it is doing."""


_DROPS_TOLD_EVERY_S = 10.0


class Watched:
    """Starts a process, and starts it again when it crashes.

    Args:
        name: in the configuration and in the log.
        launch: starts the process.
        when: to start it again.
        config: how long to wait before that.
        clock: of the board's time axis.
        monotonic_s: a clock that is never set back.
        source: where its frames come from.
    """

    def __init__(
        self,
        name: str,
        launch: Launch,
        when: When,
        config: RestartConfig,
        clock: Clock,
        monotonic_s: Callable[[], float],
        source: str = "",
    ) -> None:
        self.name = name
        self.situation: Situation = "waiting"
        self.reason = ""
        self.restarts = 0
        self.process: Process | None = None
        self._launch = launch
        self._when: When = when
        self._config = config
        self._clock = clock
        self._monotonic_s = monotonic_s
        self._source = source
        self._in_a_row = 0
        self._start_at_s = monotonic_s()
        self._launched_at_s = 0.0
        self._lock = threading.Lock()
        self._run: WorkerRun | None = None
        self._ended: list[WorkerRun] = []
        self._told_dropped = 0
        self._told_at_s = -math.inf

    @property
    def is_at_rest(self) -> bool:
        """It does not run and will not be started again."""
        return self.situation in ("finished", "stopped", "failed")

    @property
    def wait_s(self) -> float:
        """Seconds until it is started again."""
        return max(0.0, self._start_at_s - self._monotonic_s())

    def runs(self) -> Sequence[WorkerRun]:
        """The runs that ended lately, and the present one."""
        with self._lock:
            return [*self._ended, *((self._run,) if self._run is not None else ())]

    @property
    def run(self) -> WorkerRun | None:
        """The present or last run."""
        runs = self.runs()
        return runs[-1] if runs else None

    def tick(self) -> None:
        """Notices an end, and starts what is due; called a few times a second."""
        if self.situation == "running":
            self._look()
        if self.situation == "waiting" and self.wait_s <= 0.0:
            self._start()

    def stopped(self, code: int) -> None:
        """It has ended because we asked it to."""
        self._end("stopped" if code in (0, -2, -15) else exit_text(code))
        self.situation, self.process = "stopped", None

    def _start(self) -> None:
        self._launched_at_s = self._monotonic_s()
        started_s = self._clock.now_s()
        name = f"{self.name}Run{round(started_s * 1000)}"
        # The process may speak before we know its number.
        with self._lock:
            self._told_dropped, self._told_at_s = 0, -math.inf
            self._run = WorkerRun(
                name, self.name, self._source, 0, self.restarts, started_s, started_s
            )
        self.process = process = self._launch(self._beat)
        with self._lock:
            self._run = replace(self._run, process_id=process.pid)
        self.situation = "running"
        logger.info("%s: started, process %d", self.name, process.pid)

    def _beat(self, state: WorkerState) -> None:
        now_s = self._clock.now_s()
        with self._lock:
            run = self._run
            if run is None:
                return
            lag_s = run.last_lag_s
            if state.total is None and state.last_stamp_s is not None and state != run.state:
                lag_s = now_s - state.last_stamp_s
            self._run = replace(run, heartbeat_s=now_s, state=state, last_lag_s=lag_s)
        self._tell_dropped(state.dropped)

    def _tell_dropped(self, dropped: int) -> None:
        """Says so when frames are dropped: at once, and then at most every 10 s."""
        now_s = self._monotonic_s()
        with self._lock:
            before = self._told_dropped
            if dropped <= before or now_s - self._told_at_s < _DROPS_TOLD_EVERY_S:
                return
            self._told_dropped, self._told_at_s = dropped, now_s
        logger.info(
            "%s: dropped %d frames, %d in all: slower than its sensor",
            self.name,
            dropped - before,
            dropped,
        )

    def _look(self) -> None:
        assert self.process is not None
        code = self.process.exit_code()
        if code is None:
            return
        self.process = None
        ran_s = self._monotonic_s() - self._launched_at_s
        decision = after_exit(code, ran_s, self._in_a_row, self._when, self._config)
        match decision:
            case Rest(result, reason):
                self._end("succeeded" if result == "finished" else f"{result}: {reason}")
                self.situation, self.reason = result, reason
                level = logging.WARNING if result == "failed" else logging.INFO
                logger.log(level, "%s: %s after %.1f s: %s", self.name, result, ran_s, reason)
            case Restart(wait_s, in_a_row):
                how = "ended" if code == 0 else "crashed"
                self._end("succeeded" if code == 0 else f"crashed: {exit_text(code)}")
                self.situation, self.reason = "waiting", f"{how}, {exit_text(code)}"
                self.restarts += 1
                self._in_a_row = in_a_row
                self._start_at_s = self._monotonic_s() + wait_s
                logger.warning(
                    "%s: %s after %.1f s (%s); restart %d in %.1f s",
                    self.name,
                    how,
                    ran_s,
                    exit_text(code),
                    self.restarts,
                    wait_s,
                )

    def _end(self, result: str) -> None:
        with self._lock:
            if self._run is None or self._run.ended_s is not None:
                return
            ended_s = max(self._clock.now_s(), self._run.heartbeat_s)
            self._ended.append(replace(self._run, ended_s=ended_s, result=result))
            # The board has heard of all but the last ones, unless it is away for very long.
            del self._ended[:-50]
            self._run = None
