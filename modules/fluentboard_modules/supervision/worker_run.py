"""WorkerRun: one run of a worker, from start to end, as the board is to know it."""

from __future__ import annotations

from dataclasses import dataclass

from fluentboard_modules.pulse import WorkerState


@dataclass(frozen=True, slots=True)
class WorkerRun:
    """What is known about a run at some time; times are seconds on the board's axis.

    Attributes:
        name: of the fluent; unique.
        worker: its name in the configuration.
        source: where its frames come from; empty for other programs than modules.
        process_id: number of the process.
        restarts: how often the worker had been restarted before.
        started_s: when it started.
        heartbeat_s: when it last gave a sign of life.
        state: what it said then.
        last_lag_s: how long after it was taken the last live frame was done; None for recordings.
        ended_s: when its end was noticed; None while it runs.
        result: how it ended; empty while it runs.
    """

    name: str
    worker: str
    source: str
    process_id: int
    restarts: int
    started_s: float
    heartbeat_s: float
    state: WorkerState = WorkerState()  # noqa: RUF009 - immutable
    last_lag_s: float | None = None
    ended_s: float | None = None
    result: str = ""
