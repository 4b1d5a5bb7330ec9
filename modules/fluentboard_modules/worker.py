"""The loop all modules share: take a frame, process it, write what follows from it, stop cleanly.

A module is a class with the methods of `Module`; it knows nothing of connections, signals or
progress bars. A worker process is one call of `run`.
"""

from __future__ import annotations

import logging
import queue
import signal
import threading
import time
import uuid
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Protocol

from fluentboard.errors import BoardUnreachable, FluentboardError, InvalidFrame
from fluentboard_client import Client, Command, Event
from fluentboard_modules.frames.recordings import LiveSource
from fluentboard_modules.frames.sensor_frame import FrameSource, SensorFrame
from fluentboard_modules.pulse import pulse

logger = logging.getLogger(__name__)

_FIRST_WAIT_S, _LONGEST_WAIT_S = 0.2, 5.0
# How long a worker that is told to stop waits for an absent board to take its last writes.
_LAST_CHANCE_S = 10.0
# Below the board's limit of commands per batch, with room for a lower setting.
_BATCH_MAX = 1000


class Module(Protocol):
    """What a perception module does; `run` calls the methods in this order, from one thread."""

    @property
    def name(self) -> str:
        """Author of its commits, such as `mapping`."""
        ...

    @property
    def subscription(self) -> str | None:
        """A SPARQL query whose changes it wants to hear of, or None."""
        ...

    def begin(self, board: Client) -> Sequence[Command]:
        """Learns what the board knows already; returns what to write before the first frame."""
        ...

    def notice(self, event: Event) -> None:
        """Hears of a change of its subscription."""
        ...

    def process(self, frame: SensorFrame) -> Sequence[Command]:
        """What one frame leads to; written as one atomic batch."""
        ...

    def finish(self) -> Sequence[Command]:
        """What is left to write after the last frame, or when the worker is told to stop."""
        ...

    def status(self) -> str:
        """What it has found so far, in a few words, for the progress bar."""
        ...

    def draw(self, directory: Path) -> Sequence[Path]:
        """Draws its pictures into a directory; returns the files."""
        ...


class Progress(Protocol):
    """Shows how far a worker is."""

    def begin(self, name: str, frames: int | None) -> None:
        """A worker starts; None frames is a live source."""
        ...

    def advance(self, status: str) -> None:
        """One more frame is done."""
        ...

    def waiting(self, reason: str) -> None:
        """The board is away."""
        ...


class StopRequest:
    """Whether somebody asked the process to stop."""

    def __init__(self) -> None:
        self._asked = threading.Event()
        self._then: list[Callable[[], object]] = []

    def ask(self) -> None:
        """Asks; the current frame is still finished and written."""
        self._asked.set()
        for call in self._then:
            call()

    def when_asked(self, call: Callable[[], object]) -> None:
        """Has something called when somebody asks, perhaps from a signal handler."""
        self._then.append(call)
        if self.is_asked:
            call()

    @property
    def is_asked(self) -> bool:
        """Somebody asked."""
        return self._asked.is_set()

    def wait(self, timeout_s: float) -> bool:
        """Waits until somebody asks, at most so long; returns whether somebody did."""
        return self._asked.wait(timeout_s)


@dataclass(frozen=True, slots=True)
class WorkReport:
    """What a worker did.

    Attributes:
        frames: processed.
        commands: written.
        commit: the last commit it made, 0 if it wrote nothing.
        duration_s: from the first frame to the last write.
        was_stopped: before the end of the source.
        found: what the module knew in the end, in a few words.
    """

    frames: int
    commands: int
    commit: int
    duration_s: float
    was_stopped: bool
    found: str = ""

    def told(self, name: str) -> str:
        """One line for people: what the module of that name did, and what it found."""
        frames = "1 frame" if self.frames == 1 else f"{self.frames} frames"
        commands = "1 command" if self.commands == 1 else f"{self.commands} commands"
        stopped = " (stopped)" if self.was_stopped else ""
        return (
            f"{name}: {self.found or 'nothing found'}; {frames} in {self.duration_s:.1f} s, "
            f"{commands} written, commit {self.commit}{stopped}"
        )


def run(
    module: Module,
    source: FrameSource,
    board: Client,
    *,
    progress: Progress,
    stop: StopRequest | None = None,
) -> WorkReport:
    """Processes a source to its end, or until asked to stop.

    When the board goes away, the worker waits for it and repeats the write that failed, under the
    same idempotency key. Frames that cannot be processed are skipped with a warning.

    Args:
        module: the module.
        source: where its frames come from.
        board: where its fluents go.
        progress: shows how far it is.
        stop: how to ask it to stop; see `stop_on_signals`.

    Raises:
        BoardUnreachable: the worker was asked to stop while the board was away, and what it had to
            write is lost.
        FluentboardError: the board refused a write, or there was no frame to process.
    """
    stop = stop or StopRequest()
    writer = BatchWriter(board, progress, stop)
    first = _begun(module, board, writer)
    if first is None:
        return WorkReport(0, 0, 0, 0.0, was_stopped=True)
    progress.begin(module.name, _length(source))
    if isinstance(source, LiveSource):
        stop.when_asked(source.stop)
    began = time.monotonic()
    frames = 0
    with pulse() as told, _listening(module, board) as noticed:
        told.begin(_length(source))
        writer.write(first)
        for frame in source:
            for event in noticed():
                module.notice(event)
            try:
                commands = module.process(frame)
            except FluentboardError as problem:
                logger.warning("%s: frame %d skipped: %s", source.name, frame.index, problem)
                commands = ()
            writer.write(commands)
            frames += 1
            progress.advance(module.status())
            told.advance(frame.index, frame.stamp_s, _dropped(source), module.status())
            if stop.is_asked:
                logger.info("%s: asked to stop after frame %d", module.name, frame.index)
                break
        writer.write(module.finish())
    if frames == 0 and not stop.is_asked:
        raise InvalidFrame(f"{source.name}: not one frame could be read; the log says why")
    return WorkReport(
        frames,
        writer.commands,
        writer.commit,
        time.monotonic() - began,
        stop.is_asked,
        module.status(),
    )


def _begun(module: Module, board: Client, writer: BatchWriter) -> Sequence[Command] | None:
    """What the module writes first, once there is a board; None if asked to stop before."""
    while writer.await_board():
        try:
            return module.begin(board)
        except BoardUnreachable as problem:  # gone again while the module was reading
            logger.info("%s", problem)
    return None


@contextmanager
def stop_on_signals() -> Generator[StopRequest, None, None]:
    """Turns the first SIGTERM or SIGINT into a stop request; a second one ends the process."""
    request = StopRequest()
    numbers = (signal.SIGTERM, signal.SIGINT)
    before = {number: signal.getsignal(number) for number in numbers}

    def ask(number: int, _frame: FrameType | None) -> None:
        request.ask()
        signal.signal(number, before[signal.Signals(number)])

    for number in numbers:
        signal.signal(number, ask)
    try:
        yield request
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


class BatchWriter:
    """Writes batches, each exactly once, however often the board goes away in between."""

    def __init__(self, board: Client, progress: Progress, stop: StopRequest) -> None:
        self._board = board
        self._progress = progress
        self._stop = stop
        self._run = uuid.uuid4().hex
        self._batches = 0
        self._warned: set[str] = set()
        self.commands = 0
        self.commit = 0

    def await_board(self) -> bool:
        """Waits until the board is ready; False if asked to stop before it is."""
        wait_s = _FIRST_WAIT_S
        while not self._board.ready():
            self._progress.waiting(f"waiting for {self._board.board}")
            if self._stop.wait(wait_s):
                return False
            wait_s = min(2.0 * wait_s, _LONGEST_WAIT_S)
        return True

    def write(self, commands: Sequence[Command]) -> None:
        """Writes the commands as one atomic batch (several, if they are very many)."""
        for first in range(0, len(commands), _BATCH_MAX):
            self._write_batch(commands[first : first + _BATCH_MAX])

    def _write_batch(self, commands: Sequence[Command]) -> None:
        self._batches += 1
        key = f"{self._run}-{self._batches}"
        wait_s = _FIRST_WAIT_S
        deadline: float | None = None
        while True:
            try:
                receipt = self._board.batch(commands, key=key)
            except BoardUnreachable as problem:
                if self._stop.is_asked:
                    deadline = deadline or time.monotonic() + _LAST_CHANCE_S
                    if time.monotonic() > deadline:
                        raise BoardUnreachable(
                            f"{problem.message}; stopping without {len(commands)} commands that "
                            "it did not take"
                        ) from problem
                    time.sleep(wait_s)
                else:
                    logger.info("%s; again in %.1f s", problem, wait_s)
                    self._progress.waiting(f"waiting for {self._board.board}")
                    self._stop.wait(wait_s)
                wait_s = min(2.0 * wait_s, _LONGEST_WAIT_S)
                continue
            for warning in receipt.warnings:
                if warning not in self._warned:  # the same for every batch, so once is enough
                    self._warned.add(warning)
                    logger.warning("%s", warning)
            self.commands += len(commands)
            self.commit = receipt.commit
            return


@contextmanager
def _listening(module: Module, board: Client) -> Generator[_Notices, None, None]:
    """Hears of the module's subscription in a thread of its own while the block runs."""
    if module.subscription is None:
        yield _Notices()
        return
    subscription = board.subscribe(module.subscription, mode="both")
    notices = _Notices()

    def hear() -> None:
        try:
            for event in subscription:
                notices.put(event)
        except FluentboardError as problem:
            notices.put(problem)

    thread = threading.Thread(target=hear, name=f"{module.name}-subscription", daemon=True)
    thread.start()
    try:
        yield notices
    finally:
        subscription.close()
        thread.join()


class _Notices:
    """Events that came in since the last call; the error that ended the subscription is raised."""

    def __init__(self) -> None:
        self._queue: queue.SimpleQueue[Event | FluentboardError] = queue.SimpleQueue()

    def put(self, notice: Event | FluentboardError) -> None:
        """Keeps a notice for the next call."""
        self._queue.put(notice)

    def __call__(self) -> Iterator[Event]:
        while not self._queue.empty():
            notice = self._queue.get()
            if isinstance(notice, FluentboardError):
                raise notice
            yield notice


def _length(source: FrameSource) -> int | None:
    try:
        return len(source)
    except TypeError:  # a live source has no length
        return None


def _dropped(source: FrameSource) -> int:
    return source.dropped if isinstance(source, LiveSource) else 0
