"""When a process is started again, and after how long."""

from __future__ import annotations

from typing import Any

import pytest

from fluentboard_modules.supervision.config import RestartConfig
from fluentboard_modules.supervision.restarts import Rest, Restart, after_exit

CONFIG = RestartConfig(first_wait_s=1.0, longest_wait_s=10.0, healthy_after_s=30.0)


def after(code: int, **given: Any) -> Restart | Rest:
    values: dict[str, Any] = {"ran_s": 1.0, "in_a_row": 0, "when": "on-failure", "config": CONFIG}
    return after_exit(code, **{**values, **given})


def test_wait_doubles_with_every_crash_up_to_the_longest() -> None:
    waits: list[float] = []
    in_a_row = 0
    for _ in range(6):
        decision = after(1, in_a_row=in_a_row)
        assert isinstance(decision, Restart)
        waits.append(decision.wait_s)
        in_a_row = decision.in_a_row
    assert waits == [1.0, 2.0, 4.0, 8.0, 10.0, 10.0]


def test_process_that_was_healthy_starts_from_the_first_wait() -> None:
    assert after(1, in_a_row=5, ran_s=31.0) == Restart(1.0, 1)


def test_very_many_crashes_are_no_overflow() -> None:
    assert after(1, in_a_row=5000) == Restart(10.0, 5001)


def test_end_of_the_frames_is_the_end() -> None:
    decision = after(0)
    assert isinstance(decision, Rest)
    assert decision.result == "finished"


@pytest.mark.parametrize("code", [-15, -2])
def test_process_that_somebody_stopped_stays_so(code: int) -> None:
    decision = after(code)
    assert isinstance(decision, Rest)
    assert decision.result == "stopped"


@pytest.mark.parametrize("code", [-9, -11, 1, 137])
def test_killed_or_failed_process_is_restarted(code: int) -> None:
    assert isinstance(after(code), Restart)


@pytest.mark.parametrize("code", [0, -15, 1])
def test_always_means_always(code: int) -> None:
    assert isinstance(after(code, when="always"), Restart)


@pytest.mark.parametrize("when", ["on-failure", "always"])
def test_command_line_that_is_not_understood_is_not_tried_again(when: str) -> None:
    decision = after(2, when=when)
    assert isinstance(decision, Rest)
    assert decision.result == "failed"


def test_never_means_never() -> None:
    decision = after(1, when="never")
    assert isinstance(decision, Rest)
    assert decision == Rest("failed", "exit code 1, and its configuration says restart: never")


def test_restarts_may_be_limited() -> None:
    config = CONFIG.model_copy(update={"at_most": 2})
    assert isinstance(after(-11, in_a_row=1, config=config), Restart)
    assert after(-11, in_a_row=2, config=config) == Rest(
        "failed", "ended by signal 11, given up after 2 restarts"
    )
