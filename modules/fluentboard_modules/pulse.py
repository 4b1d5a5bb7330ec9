"""Pulse: a worker tells whoever started it how it is doing, a JSON line at a time, through a pipe.

`fluentboard up` starts its workers with a pipe whose number is in `FLUENTBOARD_PULSE_FD`. Without
the variable nothing is told. A line a second says that the process lives; when nobody reads any
more, the parent has died, and the worker stops as if it had been asked to.
"""

from __future__ import annotations

import json
import logging
import os
import signal
import threading
from collections.abc import Callable, Generator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace

from fluentboard.errors import InvalidConfiguration

logger = logging.getLogger(__name__)

PULSE_VARIABLE = "FLUENTBOARD_PULSE_FD"
_PERIOD_S = 1.0


@dataclass(frozen=True, slots=True)
class WorkerState:
    """How far a worker is.

    Attributes:
        frames: processed so far.
        total: frames of its source; None if it is live.
        last_frame: number of the last frame processed, within its source.
        last_stamp_s: when that frame was taken, in seconds.
        dropped: frames of a live source that were skipped.
        status: what it has found, in a few words.
    """

    frames: int = 0
    total: int | None = None
    last_frame: int | None = None
    last_stamp_s: float | None = None
    dropped: int = 0
    status: str = ""

    def to_line(self) -> bytes:
        """The state as a line of JSON."""
        return json.dumps(asdict(self)).encode() + b"\n"


def state_of_line(line: bytes) -> WorkerState | None:
    """The state that a line tells; None if it is none, as when its writer was cut off."""
    try:
        return WorkerState(**json.loads(line))
    except (ValueError, TypeError):
        return None


class Pulse:
    """Sends a state once a second, and the last one at the end.

    Args:
        write: takes a line; None to tell nobody.
        orphaned: called once when nobody reads any more.
    """

    def __init__(
        self, write: Callable[[bytes], object] | None, orphaned: Callable[[], object]
    ) -> None:
        self._write = write
        self._orphaned = orphaned
        self._ended = threading.Event()
        self.state = WorkerState()

    def begin(self, total: int | None) -> None:
        """The worker starts on its source."""
        self.state = replace(self.state, total=total)

    def advance(self, frame: int, stamp_s: float, dropped: int, status: str) -> None:
        """One more frame is done."""
        self.state = WorkerState(
            self.state.frames + 1, self.state.total, frame, stamp_s, dropped, status
        )

    def run(self) -> None:
        """Sends until `end`; in a thread of its own."""
        while self._write is not None:
            ended = self._ended.is_set()
            try:
                self._write(self.state.to_line())
            except OSError:
                if not ended:
                    self._orphaned()
                return
            if ended:
                return
            self._ended.wait(_PERIOD_S)

    def end(self) -> None:
        """Lets the last state be sent."""
        self._ended.set()


@contextmanager
def pulse(environment: Mapping[str, str] | None = None) -> Generator[Pulse]:
    """The pulse of this process while the block runs.

    Args:
        environment: where the number of the pipe is; by default that of the process.

    Raises:
        InvalidConfiguration: the number is none.
    """
    given = (os.environ if environment is None else environment).get(PULSE_VARIABLE)
    if given is None:
        yield Pulse(None, _stop_this_process)
        return
    if not given.isdigit():
        raise InvalidConfiguration(
            f"{PULSE_VARIABLE} is {given!r}; it is set by `fluentboard up` to the number of a pipe"
        )
    pipe = int(given)
    beating = Pulse(lambda line: os.write(pipe, line), _stop_this_process)
    thread = threading.Thread(target=beating.run, name="pulse", daemon=True)
    thread.start()
    try:
        yield beating
    finally:
        beating.end()
        thread.join(_PERIOD_S)


def _stop_this_process() -> None:
    logger.warning("the process that started this worker is gone; stopping")
    os.kill(os.getpid(), signal.SIGTERM)
