"""A watched process: started, restarted, given up, stopped; with processes made of a few lines."""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import dataclass, field

import pytest
from rich.console import Console

from fluentboard.clock import ReplayClock
from fluentboard_modules.pulse import WorkerState
from fluentboard_modules.supervision.config import RestartConfig
from fluentboard_modules.supervision.display import state_table
from fluentboard_modules.supervision.watched import Watched, When

Beat = Callable[[WorkerState], object]


@dataclass
class Process:
    """Runs until it is told its exit code."""

    pid: int
    beat: Beat
    code: int | None = None

    def exit_code(self) -> int | None:
        return self.code

    def terminate(self) -> None:
        self.code = -15

    def kill(self) -> None:
        self.code = -9


@dataclass
class Machine:
    """Starts processes; its clocks stand still until they are moved."""

    started: list[Process] = field(default_factory=list[Process])
    clock: ReplayClock = field(default_factory=lambda: ReplayClock(1000.0))

    def launch(self, beat: Beat) -> Process:
        self.started.append(Process(100 + len(self.started), beat))
        return self.started[-1]

    def wait(self, seconds: float) -> None:
        self.clock.set(self.clock.now_s() + seconds)

    def watch(self, when: When = "on-failure") -> Watched:
        return Watched(
            "mapping",
            self.launch,
            when,
            RestartConfig(first_wait_s=1.0),
            self.clock,
            self.clock.now_s,
            "sim:room",
        )


@pytest.fixture
def machine() -> Machine:
    return Machine()


def test_process_is_started_once(machine: Machine) -> None:
    watched = machine.watch()
    for _ in range(3):
        watched.tick()
    assert len(machine.started) == 1
    assert watched.situation == "running"


def test_crashed_process_is_started_again_after_a_wait(
    machine: Machine, caplog: pytest.LogCaptureFixture
) -> None:
    watched = machine.watch()
    watched.tick()
    machine.wait(3.0)
    machine.started[0].code = 1
    watched.tick()
    assert watched.situation == "waiting"
    assert "mapping: crashed after 3.0 s (exit code 1); restart 1 in 1.0 s" in caplog.text
    watched.tick()
    assert len(machine.started) == 1
    machine.wait(1.0)
    watched.tick()
    assert len(machine.started) == 2
    assert [run.restarts for run in watched.runs()] == [0, 1]
    assert [run.result for run in watched.runs()] == ["crashed: exit code 1", ""]
    assert len({run.name for run in watched.runs()}) == 2


def test_process_at_the_end_of_its_frames_rests(machine: Machine) -> None:
    watched = machine.watch()
    watched.tick()
    machine.started[0].code = 0
    watched.tick()
    assert watched.is_at_rest
    assert watched.runs()[0].result == "succeeded"


def test_what_a_process_says_is_kept_with_its_lag(machine: Machine) -> None:
    watched = machine.watch()
    watched.tick()
    machine.wait(5.0)
    machine.started[0].beat(WorkerState(7, None, 12, 1004.2, 0, "a table"))
    run = watched.run
    assert run is not None
    assert run.heartbeat_s == 1005.0
    assert run.state.frames == 7
    assert run.last_lag_s == pytest.approx(0.8)
    machine.wait(5.0)
    machine.started[0].beat(WorkerState(7, None, 12, 1004.2, 0, "a table"))
    run = watched.run
    assert run is not None
    assert run.heartbeat_s == 1010.0
    assert run.last_lag_s == pytest.approx(0.8)  # it is idle, not late


def test_recording_has_no_lag(machine: Machine) -> None:
    watched = machine.watch()
    watched.tick()
    machine.started[0].beat(WorkerState(7, 80, 12, 4.2, 0, ""))
    run = watched.run
    assert run is not None
    assert run.last_lag_s is None


def test_dropped_frames_are_logged(machine: Machine, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level("INFO")
    watched = machine.watch()
    watched.tick()
    machine.started[0].beat(WorkerState(7, None, 12, 1000.0, 4, ""))
    assert "mapping: dropped 4 frames, 4 in all: slower than its sensor" in caplog.text
    machine.started[0].beat(WorkerState(8, None, 15, 1000.0, 6, ""))
    assert "6 in all" not in caplog.text  # not every second
    machine.wait(11.0)
    machine.started[0].beat(WorkerState(9, None, 18, 1011.0, 9, ""))
    assert "mapping: dropped 5 frames, 9 in all: slower than its sensor" in caplog.text


def test_late_word_of_a_dead_process_is_not_that_of_the_next(machine: Machine) -> None:
    watched = machine.watch()
    watched.tick()
    machine.started[0].code = 1
    watched.tick()
    machine.started[0].beat(WorkerState(99, None, 99, 1000.0, 0, ""))
    assert watched.runs()[0].state.frames == 0


def test_stopped_process_is_over(machine: Machine) -> None:
    watched = machine.watch()
    watched.tick()
    watched.stopped(0)
    assert watched.situation == "stopped"
    assert watched.runs()[0].result == "stopped"


def test_table_shows_every_process(machine: Machine) -> None:
    watched = machine.watch()
    watched.tick()
    machine.started[0].beat(WorkerState(7, None, 12, 999.5, 3, "2 tables"))
    crashed = machine.watch()
    crashed.tick()
    machine.started[1].code = -11
    crashed.tick()
    console = Console(file=io.StringIO(), width=120)
    console.print(state_table([watched, crashed], "http://board"))
    text = console.file.getvalue()  # type: ignore[attr-defined]
    for word in ("running", "2 tables", "0.50 s", "restarts in 1 s", "crashed, ended by signal 11"):
        assert word in text
