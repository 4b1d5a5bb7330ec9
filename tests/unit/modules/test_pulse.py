"""What a worker tells the process that started it."""

from __future__ import annotations

import os
import threading

import pytest

from fluentboard.errors import InvalidConfiguration
from fluentboard_modules.pulse import PULSE_VARIABLE, Pulse, WorkerState, pulse, state_of_line


def test_state_survives_its_line() -> None:
    state = WorkerState(3, None, 17, 1690000000.25, 4, "2 tables")
    assert state_of_line(state.to_line()) == state


@pytest.mark.parametrize("line", [b"", b"{", b"[1]\n", b'{"frames": 1, "mood": 2}\n', b"null\n"])
def test_line_that_is_no_state_is_none(line: bytes) -> None:
    assert state_of_line(line) is None


def test_last_state_is_told_at_the_end() -> None:
    lines: list[bytes] = []
    told = Pulse(lines.append, orphaned=lambda: None)
    told.begin(2)
    told.advance(0, 1.0, 0, "nothing")
    told.advance(5, 2.5, 4, "a mug")
    told.end()
    told.run()
    assert [state_of_line(line) for line in lines] == [WorkerState(2, 2, 5, 2.5, 4, "a mug")]


def test_worker_whose_parent_died_stops_once() -> None:
    def fail(line: bytes) -> None:
        raise BrokenPipeError

    asked: list[str] = []
    Pulse(fail, orphaned=lambda: asked.append("stop")).run()
    assert asked == ["stop"]


def test_pipe_of_the_environment_is_written_to() -> None:
    reader, writer = os.pipe()
    with pulse({PULSE_VARIABLE: str(writer)}) as told:
        told.begin(9)
        assert threading.active_count() > 1
    os.close(writer)
    with os.fdopen(reader, "rb") as lines:
        states = [state_of_line(line) for line in lines]
    assert states[-1] == WorkerState(total=9)


def test_nobody_is_told_without_the_variable() -> None:
    with pulse({}) as told:
        told.advance(1, 1.0, 0, "")
    assert told.state.frames == 1


def test_variable_that_is_no_number_is_an_error() -> None:
    with (
        pytest.raises(InvalidConfiguration, match="it is set by `fluentboard up`"),
        pulse({PULSE_VARIABLE: "x"}),
    ):
        pass
