"""A board service as a child process: started on a free port, stopped by its handle."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import IO, Self

from fluentboard.errors import BoardUnreachable

_ANNOUNCEMENT = re.compile(r"serves (https?://\S+)")
_START_TIMEOUT_S = 60.0
_STOP_TIMEOUT_S = 15.0
_LOG_TAIL_CHARACTERS = 2000
_SETTINGS = "FLUENTBOARD_"


class ServiceProcess:
    """`fluentboard serve` for as long as the context lasts.

    Args:
        data: folder of the board.
        port: TCP port; 0 takes any free one.
        arguments: further arguments of `fluentboard serve`.

    Raises:
        BoardUnreachable: it did not come up; the message holds the end of its log.
    """

    def __init__(self, data: Path, port: int = 0, arguments: tuple[str, ...] = ()) -> None:
        self._command = [
            *(sys.executable, "-m", "fluentboard", "serve", "--port", str(port)),
            *("--data", str(data), *arguments),
        ]
        self._process: subprocess.Popen[str] | None = None
        self._log: IO[str] = tempfile.TemporaryFile("w+", encoding="utf-8")  # noqa: SIM115
        self._announced = threading.Event()
        self.address = ""

    def start(self) -> None:
        """Starts the service and waits until it says where it listens."""
        self._process = subprocess.Popen(
            self._command,
            stdout=subprocess.PIPE,
            stderr=self._log,
            text=True,
            # The settings of somebody's real board must not change this one.
            env={key: value for key, value in os.environ.items() if not key.startswith(_SETTINGS)},
            # Ctrl-C reaches all processes of a session; this one is stopped when its work is done.
            start_new_session=True,
        )
        threading.Thread(target=self._read_announcement, args=(self._process,), daemon=True).start()
        deadline = time.monotonic() + _START_TIMEOUT_S
        while not self._announced.wait(0.05):
            if self._process.poll() is not None or time.monotonic() > deadline:
                self.stop()
                log = self.log
                self._log.close()
                raise BoardUnreachable(f"the service did not come up; its log ends:\n{log}")

    def stop(self) -> int:
        """Asks the service to stop, waits until it has, and returns its exit code."""
        process, self._process = self._process, None
        if process is None:
            return 0
        process.terminate()
        try:
            return process.wait(_STOP_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            process.kill()
            return process.wait()

    def kill(self) -> None:
        """Ends the service at once, as a crash would."""
        process, self._process = self._process, None
        if process is not None:
            process.kill()
            process.wait()
        self._log.close()

    @property
    def log(self) -> str:
        """The end of what the service wrote to its log."""
        self._log.seek(0)
        return self._log.read()[-_LOG_TAIL_CHARACTERS:]

    def _read_announcement(self, process: subprocess.Popen[str]) -> None:
        assert process.stdout is not None
        with process.stdout as lines:
            for line in lines:  # to the end, so that the pipe never fills up
                found = _ANNOUNCEMENT.search(line)
                if found and not self._announced.is_set():
                    self.address = found.group(1)
                    self._announced.set()

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()
        self._log.close()
