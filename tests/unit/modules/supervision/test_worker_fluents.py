"""Runs of workers as fluents: heartbeats narrow, crashes are uncertain, nothing is said twice."""

from __future__ import annotations

from dataclasses import replace

from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.interval import UNKNOWN, Interval
from fluentboard_client import AssertFluent, Command, EndFluent, RefineFluent
from fluentboard_modules.pulse import WorkerState
from fluentboard_modules.supervision.config import StateConfig
from fluentboard_modules.supervision.worker_fluents import Told, commands_for, endings_of_lost_runs
from fluentboard_modules.supervision.worker_run import WorkerRun

CONFIG = StateConfig(heartbeat_s=10.0, status_s=30.0)
RUN = WorkerRun("mappingRun1", "mapping", "sim:room", 4711, 2, 100.0, 100.0)
BUSY = WorkerState(17, None, 40, 104.5, 3, "2 tables")


class Board:
    """Carries out commands as the real one does, and refuses what it would refuse."""

    def __init__(self) -> None:
        self.fluents: dict[str, Fluent] = {}

    def take(self, commands: list[Command]) -> None:
        for command in commands:
            match command:
                case AssertFluent(fluent):
                    assert fluent.name not in self.fluents
                    self.fluents[fluent.name] = fluent
                case RefineFluent(name, start, finish, properties):
                    self.fluents[name] = self.fluents[name].refined(start, finish, properties)
                case EndFluent(name, finish):
                    self.fluents[name] = self.fluents[name].ended(finish)


class Scribe:
    """Tells a board about a run again and again."""

    def __init__(self) -> None:
        self.board = Board()
        self.told: Told | None = None

    def tell(self, run: WorkerRun, now_s: float) -> int:
        commands, self.told = commands_for(run, self.told, now_s, CONFIG)
        self.board.take(commands)
        return len(commands)

    def __getitem__(self, name: str) -> Fluent:
        return self.board.fluents[name]


def test_run_is_stated_when_it_starts() -> None:
    scribe = Scribe()
    scribe.tell(RUN, 100.5)
    activity = scribe["mappingRun1"]
    assert activity.class_name == "WorkerActivity"
    assert activity.start == Interval.at(100.0)
    assert activity.finish == Interval(100.0, None)
    assert activity.values("hasWorkerName") == ("mapping",)
    assert activity.values("hasFrameSource") == ("sim:room",)
    assert activity.values("hasRestarts") == (2,)
    assert activity.values("hasProcessId") == (4711,)


def test_heartbeat_narrows_the_finish_now_and_then() -> None:
    scribe = Scribe()
    scribe.tell(RUN, 100.0)
    assert scribe.tell(replace(RUN, heartbeat_s=105.0), 105.0) == 0
    assert scribe.tell(replace(RUN, heartbeat_s=110.0), 110.0) == 1
    assert scribe["mappingRun1"].finish == Interval(110.0, None)


def test_silent_worker_has_no_heartbeat() -> None:
    scribe = Scribe()
    scribe.tell(RUN, 100.0)
    assert scribe.tell(RUN, 500.0) == 0


def test_numbers_are_a_fluent_of_their_own_that_is_replaced() -> None:
    scribe = Scribe()
    scribe.tell(RUN, 100.0)
    scribe.tell(replace(RUN, heartbeat_s=105.0, state=BUSY, last_lag_s=0.5), 105.0)
    status = scribe["mappingRun1Status1"]
    assert status.finish == UNKNOWN
    assert status.values("hasProcessedFrames") == (17,)
    assert status.values("hasLastFrame") == (40,)
    assert status.values("hasLastFrameTime") == (104.5,)
    assert status.values("hasDroppedFrames") == (3,)
    assert status.values("hasLag") == (0.5,)
    later = replace(BUSY, frames=40)
    assert scribe.tell(replace(RUN, heartbeat_s=109.0, state=later), 109.0) == 0  # too soon
    scribe.tell(replace(RUN, heartbeat_s=135.5, state=later), 135.5)
    assert scribe["mappingRun1Status1"].finish == Interval.at(135.5)
    assert scribe["mappingRun1Status2"].start == Interval.at(135.5)
    statuses = scribe["mappingRun1"].values("hasWorkerStatus")
    assert statuses == ("mappingRun1Status1", "mappingRun1Status2")


def test_end_of_a_crashed_run_lies_between_heartbeat_and_discovery() -> None:
    scribe = Scribe()
    scribe.tell(replace(RUN, heartbeat_s=105.0, state=BUSY), 105.0)
    over = replace(RUN, heartbeat_s=109.0, state=BUSY, ended_s=112.0, result="crashed: exit code 1")
    scribe.tell(over, 112.0)
    activity = scribe["mappingRun1"]
    assert activity.finish == Interval(109.0, 112.0)
    assert activity.values("hasResult") == ("crashed: exit code 1",)
    assert not scribe["mappingRun1Status1"].is_open
    assert scribe.tell(over, 200.0) == 0


def test_run_that_was_over_before_the_board_heard_of_it_is_told_whole() -> None:
    scribe = Scribe()
    scribe.tell(replace(RUN, heartbeat_s=103.0, state=BUSY, ended_s=104.0, result="succeeded"), 300)
    assert scribe["mappingRun1"].finish == Interval(103.0, 104.0)
    assert scribe["mappingRun1Status1"].finish == Interval.at(104.0)


def test_last_numbers_are_told_at_the_end() -> None:
    scribe = Scribe()
    scribe.tell(replace(RUN, heartbeat_s=105.0, state=BUSY), 105.0)
    last = replace(BUSY, frames=20)
    scribe.tell(replace(RUN, heartbeat_s=106.0, state=last, ended_s=106.5, result="stopped"), 107)
    assert scribe["mappingRun1Status2"].values("hasProcessedFrames") == (20,)
    assert not any(f.is_open for f in scribe.board.fluents.values())


def test_clock_that_is_set_back_widens_nothing() -> None:
    scribe = Scribe()
    scribe.tell(replace(RUN, heartbeat_s=120.0, state=BUSY), 120.0)
    scribe.tell(replace(RUN, heartbeat_s=90.0, state=replace(BUSY, frames=18)), 90.0)
    scribe.tell(replace(RUN, heartbeat_s=91.0, ended_s=91.5, result="stopped"), 92.0)
    finish = scribe["mappingRun1"].finish
    assert (finish.earliest or 0.0) >= 120.0


def test_runs_of_a_supervisor_that_died_are_ended() -> None:
    name = (Property("hasWorkerName", "xsd:string", "mapping"),)
    status = Fluent("lostStatus1", "WorkerStatus", Interval.at(50.0))
    known = Property("hasWorkerStatus", "WorkerStatus", "lostStatus1")
    lost = Fluent("lost", "WorkerActivity", Interval.at(40.0), Interval(60.0, None), (*name, known))
    over = Fluent("over", "WorkerActivity", Interval.at(10.0), Interval(20.0, 21.0), name)
    other = Fluent(
        "other",
        "WorkerActivity",
        Interval.at(40.0),
        Interval(60.0, None),
        (Property("hasWorkerName", "xsd:string", "somebody else's"),),
    )
    board = Board()
    board.fluents = {fluent.name: fluent for fluent in (lost, over, other, status)}
    board.take(
        endings_of_lost_runs([lost, over, other], {"lostStatus1": status}, ["mapping"], 100.0)
    )
    assert board.fluents["lost"].finish == Interval(60.0, 100.0)
    assert board.fluents["lost"].values("hasResult") == ("lost: the supervisor ended before it",)
    assert board.fluents["lostStatus1"].finish == Interval(50.0, 100.0)
    assert board.fluents["over"] == over
    assert board.fluents["other"] == other
