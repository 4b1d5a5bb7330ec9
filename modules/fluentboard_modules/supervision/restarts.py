"""When a process that ended is started again."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from fluentboard_modules.supervision.config import RestartConfig

USAGE_ERROR = 2
"""Exit code of a command line that is not understood: trying again changes nothing."""

_ORDERLY_SIGNALS = (-2, -15)  # SIGINT, SIGTERM: somebody stopped it on purpose


@dataclass(frozen=True, slots=True)
class Restart:
    """Start it again.

    Attributes:
        wait_s: after so many seconds.
        in_a_row: how often it was restarted without having been healthy in between.
    """

    wait_s: float
    in_a_row: int


@dataclass(frozen=True, slots=True)
class Rest:
    """Leave it.

    Attributes:
        result: `finished`, `stopped` or `failed`.
        reason: why, in a few words.
    """

    result: Literal["finished", "stopped", "failed"]
    reason: str


def after_exit(
    code: int,
    ran_s: float,
    in_a_row: int,
    when: Literal["on-failure", "always", "never"],
    config: RestartConfig,
) -> Restart | Rest:
    """What to do after a process has ended by itself.

    Args:
        code: its exit code; minus the number of the signal that ended it.
        ran_s: how long it ran.
        in_a_row: restarts since it was last healthy.
        when: what its configuration says.
        config: how long to wait.
    """
    if when != "always":
        if code == 0:
            return Rest("finished", "came to the end of its frames")
        if code in _ORDERLY_SIGNALS:
            return Rest("stopped", "somebody stopped it")
    if code == USAGE_ERROR:
        return Rest("failed", "its command line is not understood; correct the configuration")
    if when == "never":
        return Rest("failed", f"{exit_text(code)}, and its configuration says restart: never")
    so_far = 0 if ran_s >= config.healthy_after_s else in_a_row
    if config.at_most is not None and so_far >= config.at_most:
        return Rest("failed", f"{exit_text(code)}, given up after {so_far} restarts")
    # Beyond 2^40 the longest wait is long reached.
    wait_s = min(config.first_wait_s * 2.0 ** min(so_far, 40), config.longest_wait_s)
    return Restart(wait_s, so_far + 1)


def exit_text(code: int) -> str:
    """How a process ended, in words."""
    return f"ended by signal {-code}" if code < 0 else f"exit code {code}"
