"""Child: one process that we started, what it says, and how it is doing."""

from __future__ import annotations

import os
import subprocess
import threading
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import IO

from fluentboard.errors import InvalidConfiguration
from fluentboard_modules.pulse import PULSE_VARIABLE, WorkerState, state_of_line

_TAIL_LINES = 20


class Child:
    """A running process.

    It has a session of its own, so that Ctrl-C reaches only us and we stop it in order.

    Args:
        command: program and arguments.
        folder: where it runs.
        environment: variables besides our own.
        heard: called with every line that it writes, from another thread.
        beat: called whenever it says how it is doing, from another thread.

    Raises:
        InvalidConfiguration: there is no such program.
    """

    def __init__(
        self,
        command: Sequence[str],
        folder: Path,
        environment: Mapping[str, str],
        heard: Callable[[str], object],
        beat: Callable[[WorkerState], object],
    ) -> None:
        self.tail: deque[str] = deque(maxlen=_TAIL_LINES)
        reader, writer = os.pipe()
        try:
            self._process = subprocess.Popen(
                command,
                cwd=folder,
                env={
                    **os.environ,
                    "PYTHONUNBUFFERED": "1",
                    **environment,
                    PULSE_VARIABLE: str(writer),
                },
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
                errors="replace",
                pass_fds=(writer,),
                start_new_session=True,
            )
        except OSError as problem:
            os.close(reader)
            raise InvalidConfiguration(
                f"{command[0]!r} cannot be started: {problem.strerror}; correct its command"
            ) from problem
        finally:
            os.close(writer)
        assert self._process.stdout is not None
        self._threads = [
            threading.Thread(target=self._listen, args=(self._process.stdout, heard), daemon=True),
            threading.Thread(target=_feel, args=(reader, beat), daemon=True),
        ]
        for thread in self._threads:
            thread.start()

    @property
    def pid(self) -> int:
        """Number of the process."""
        return self._process.pid

    def exit_code(self) -> int | None:
        """The exit code, or None while it runs; all that it wrote has been heard by then."""
        code = self._process.poll()
        if code is not None:
            for thread in self._threads:
                # A grandchild may hold the pipes open; what it writes is not ours to wait for.
                thread.join(1.0)
        return code

    def terminate(self) -> None:
        """Asks it to stop."""
        if self._process.poll() is None:
            self._process.terminate()

    def kill(self) -> None:
        """Ends it at once."""
        if self._process.poll() is None:
            self._process.kill()
        self._process.wait()

    def _listen(self, lines: IO[str], heard: Callable[[str], object]) -> None:
        with lines:
            for line in lines:
                text = line.rstrip()
                if text:
                    self.tail.append(text)
                    heard(text)


def _feel(reader: int, beat: Callable[[WorkerState], object]) -> None:
    with os.fdopen(reader, "rb") as lines:
        for line in lines:
            state = state_of_line(line)
            if state is not None:
                beat(state)
