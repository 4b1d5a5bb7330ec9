"""The process of a reader: follows the board, answers one question at a time.

Run as `python -m fluentboard.api.readers.reader`; it speaks frames over standard input and output.
It ends when its input does, even in the middle of a query, so it never outlives the service.
"""

from __future__ import annotations

import contextlib
import os
import queue
import signal
import sys
import threading
from pathlib import Path
from typing import IO, Any

from fluentboard.api.answering import Question, answer
from fluentboard.api.readers.frames import read_frame, write_frame
from fluentboard.api.readers.rehearsal import Rehearsal
from fluentboard.board.follower import Follower
from fluentboard.clock import ReplayClock
from fluentboard.config import LimitSettings
from fluentboard.errors import FluentboardError
from fluentboard.model.interval import Certainty

# What a query may take must not starve those who write.
_NICENESS = 5

_Frames = queue.SimpleQueue[tuple[dict[str, Any], bytes]]


def main() -> None:
    """Serves until the input ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the service, which ends us
    output = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # whatever prints by mistake must not get between the frames
    frames: _Frames = queue.SimpleQueue()
    threading.Thread(target=_receive, args=(sys.stdin.buffer, frames), daemon=True).start()
    setup, _ = frames.get()
    _lower_priority()
    limits = LimitSettings.model_validate(setup["limits"])
    # The board's clock, as each question brings it along.
    clock, folder = ReplayClock(), Path(setup["folder"])
    try:
        follower = Follower(Path(setup["journal"]), folder / "store", setup["applied"], clock)
        _limit_memory(limits.query_memory_max_bytes)
    except FluentboardError as problem:
        write_frame(output, _told(problem))
        return
    write_frame(output, {"commit": follower.commit})
    while True:
        header, body = _reply(*frames.get(), follower, limits, clock, folder)
        write_frame(output, header, body)


def _receive(pipe: IO[bytes], frames: _Frames) -> None:
    """Passes frames on; ends the process when the service is gone."""
    try:
        while True:
            frames.put(read_frame(pipe))
    except (EOFError, OSError):
        os._exit(0)


def _reply(
    asked: dict[str, Any],
    packed: bytes,
    follower: Follower,
    limits: LimitSettings,
    clock: ReplayClock,
    folder: Path,
) -> tuple[dict[str, Any], bytes]:
    try:
        follower.wait_for(asked["commit"])
        if packed:
            rehearsal = Rehearsal.unpacked(packed)
            follower.rehearse(rehearsal.operations, rehearsal.query)
        if "question" not in asked:
            return {"commit": follower.commit}, b""
        clock.set(asked["now_s"])
        told = asked["question"]
        question = Question(
            told["text"],
            told["accept"],
            tuple(told["default_graphs"]),
            tuple(told["named_graphs"]),
            told["at"],
            told["as_of"],
            Certainty(told["certainty"]),
        )
        result = answer(follower, question, limits, threading.Event(), folder)
    except FluentboardError as problem:
        return _told(problem), b""
    path: str | None = None
    if result.file is not None:
        path = str(result.file.name)
        result.file.close()
    header = {
        "media_type": result.media_type,
        "commit": result.commit,
        "at_s": result.at_s,
        "is_exact": result.is_exact,
        "size_bytes": result.size_bytes,
        "path": path,
    }
    return header, result.text or b""


def _told(problem: FluentboardError) -> dict[str, Any]:
    return {"error": problem.code, "message": problem.message, "detail": problem.detail}


def _lower_priority() -> None:
    with contextlib.suppress(OSError, AttributeError):  # Windows has no niceness
        os.nice(_NICENESS)


def _limit_memory(more_bytes: int) -> None:
    """Has the process end, rather than the machine run out, when a query needs too much memory."""
    try:
        import resource

        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[5])
    except (ImportError, OSError, ValueError, IndexError):
        return  # where there is no such limit, the time-out has to do
    limit = pages * resource.getpagesize() + more_bytes
    resource.setrlimit(resource.RLIMIT_DATA, (limit, resource.RLIM_INFINITY))


if __name__ == "__main__":
    main()
