"""Runs of workers to the commands that put them on the board (pure).

A heartbeat narrows the finish of the run's fluent: it certainly lasted until then. So a run that
crashes has an uncertain end, between its last heartbeat and the moment we noticed.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.interval import Interval
from fluentboard_client import AssertFluent, Command, EndFluent, RefineFluent
from fluentboard_modules.pulse import WorkerState
from fluentboard_modules.supervision.config import StateConfig
from fluentboard_modules.supervision.worker_run import WorkerRun

ACTIVITY, STATUS = "WorkerActivity", "WorkerStatus"
LOST = "lost: the supervisor ended before it"


@dataclass(frozen=True, slots=True)
class Told:
    """What the board knows about a run.

    Attributes:
        heartbeat_s: the last one written.
        status: number of the run's last status fluent; 0 if it has none.
        state: what that status says.
        status_s: when it began to hold.
        is_over: the end of the run is written.
    """

    heartbeat_s: float
    status: int = 0
    state: WorkerState | None = None
    status_s: float = 0.0
    is_over: bool = False


def commands_for(
    run: WorkerRun, told: Told | None, now_s: float, config: StateConfig
) -> tuple[list[Command], Told | None]:
    """What to write about a run, and what the board knows once that is written.

    Args:
        run: as it is.
        told: what the board knows; None if it knows nothing.
        now_s: the present.
        config: how often to write.
    """
    commands: list[Command] = []
    heartbeat_s = max(run.started_s, run.heartbeat_s)
    if told is None:
        commands.append(AssertFluent(_activity(run, heartbeat_s), merge=True))
        told = Told(heartbeat_s)
    if told.is_over:
        return [], told
    # The system's clock may be set back; what was certain stays certain.
    heartbeat_s = max(heartbeat_s, told.heartbeat_s)
    ended_s = None if run.ended_s is None else max(run.ended_s, heartbeat_s, told.status_s)
    due = now_s - told.status_s >= config.status_s or told.state is None or ended_s is not None
    properties: tuple[Property, ...] = ()
    if due and run.state != told.state and run.state.frames:
        at_s = max(told.status_s, heartbeat_s if ended_s is None else ended_s)
        if told.status:
            commands.append(EndFluent(_status_name(run, told.status), at_s))
        number = told.status + 1
        finish = Interval() if ended_s is None else Interval.at(ended_s)
        commands.append(AssertFluent(_status(run, number, at_s, finish), merge=True))
        properties = (Property("hasWorkerStatus", STATUS, _status_name(run, number)),)
        told = Told(told.heartbeat_s, number, run.state, at_s)
    elif ended_s is not None and told.status:
        commands.append(EndFluent(_status_name(run, told.status), ended_s))
    if ended_s is not None:
        result = Property("hasResult", "xsd:string", run.result)
        # An orderly end is seen as it happens; a crash some time after the last heartbeat.
        finish = Interval(heartbeat_s, ended_s)
        commands.append(RefineFluent(run.name, finish=finish, properties=(*properties, result)))
        return commands, Told(heartbeat_s, told.status, told.state, told.status_s, is_over=True)
    is_due = heartbeat_s - told.heartbeat_s >= config.heartbeat_s
    if properties or is_due:
        finish = Interval(heartbeat_s, None)
        commands.append(RefineFluent(run.name, finish=finish, properties=properties))
        told = Told(heartbeat_s, told.status, told.state, told.status_s)
    return commands, told


def endings_of_lost_runs(
    activities: Iterable[Fluent],
    statuses: Mapping[str, Fluent],
    workers: Sequence[str],
    now_s: float,
) -> list[Command]:
    """What to write about runs whose supervisor ended before them, as when the power failed.

    Args:
        activities: the WorkerActivity fluents on the board.
        statuses: the open WorkerStatus fluents on the board, by name.
        workers: names of our workers; runs of others may still go on.
        now_s: the present.
    """
    commands: list[Command] = []
    for activity in activities:
        is_ours = any(value in workers for value in activity.values("hasWorkerName"))
        if not is_ours or activity.finish.latest is not None:
            continue
        earliest = activity.finish.earliest
        ended_s = now_s if earliest is None else max(now_s, earliest)
        result = Property("hasResult", "xsd:string", LOST)
        commands.append(
            RefineFluent(activity.name, finish=Interval(earliest, ended_s), properties=(result,))
        )
        for name in activity.values("hasWorkerStatus"):
            status = statuses.get(str(name))
            if status is not None:
                begins = status.start.latest or ended_s
                commands.append(EndFluent(status.name, Interval(begins, max(begins, ended_s))))
    return commands


def _activity(run: WorkerRun, heartbeat_s: float) -> Fluent:
    properties = [
        Property("hasWorkerName", "xsd:string", run.worker),
        Property("hasProcessId", "xsd:integer", run.process_id),
        Property("hasRestarts", "xsd:integer", run.restarts),
    ]
    if run.source:
        properties.append(Property("hasFrameSource", "xsd:string", run.source))
    return Fluent(
        run.name,
        ACTIVITY,
        start=Interval.at(run.started_s),
        finish=Interval(heartbeat_s, None),
        properties=tuple(properties),
    )


def _status(run: WorkerRun, number: int, at_s: float, finish: Interval) -> Fluent:
    state = run.state
    properties = [
        Property("hasProcessedFrames", "xsd:integer", state.frames),
        Property("hasDroppedFrames", "xsd:integer", state.dropped),
    ]
    if state.last_frame is not None:
        properties.append(Property("hasLastFrame", "xsd:integer", state.last_frame))
    if state.last_stamp_s is not None:
        properties.append(Property("hasLastFrameTime", "xsd:double", state.last_stamp_s))
    if run.last_lag_s is not None:
        properties.append(Property("hasLag", "xsd:double", round(run.last_lag_s, 3)))
    return Fluent(
        _status_name(run, number),
        STATUS,
        start=Interval.at(at_s),
        finish=finish,
        properties=tuple(properties),
    )


def _status_name(run: WorkerRun, number: int) -> str:
    return f"{run.name}Status{number}"
