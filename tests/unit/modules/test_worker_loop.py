"""The loop that all workers share, with a board and a module made of a few lines."""

from __future__ import annotations

import json
import logging
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

from fluentboard.errors import BoardUnreachable, InvalidFrame, UnknownClass
from fluentboard.model.fluent import Fluent
from fluentboard.model.geometry import Transform
from fluentboard_client import AssertFluent, Client, Command, Event
from fluentboard_modules.frames.sensor_frame import Camera, SensorFrame
from fluentboard_modules.worker import StopRequest, WorkReport, run

CAMERA = Camera(2, 2, 1.0, 1.0, 0.5, 0.5)


class Frames:
    """A recording of so many frames."""

    name = "frames"

    def __init__(self, count: int) -> None:
        self._count = count

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[SensorFrame]:
        for index in range(self._count):
            depth = np.ones((2, 2), dtype=np.float32)
            yield SensorFrame(depth, CAMERA, 1.0 + index, Transform.identity(), index=index)


class Counter:
    """Asserts one fluent per frame and one at either end."""

    name = "counter"
    subscription = None

    def __init__(self, on_frame: Callable[[int], None] = lambda _: None) -> None:
        self._on_frame = on_frame

    def begin(self, board: Client) -> Sequence[Command]:
        return [AssertFluent(Fluent("begin", "Mug"))]

    def notice(self, event: Event) -> None:
        raise AssertionError("nothing was subscribed to")

    def process(self, frame: SensorFrame) -> Sequence[Command]:
        self._on_frame(frame.index)
        return [AssertFluent(Fluent(f"frame{frame.index}", "Mug"))]

    def finish(self) -> Sequence[Command]:
        return [AssertFluent(Fluent("finish", "Mug"))]

    def status(self) -> str:
        return "counting"

    def draw(self, directory: Path) -> Sequence[Path]:
        return []


class Silence:
    """A progress bar that nobody sees."""

    def begin(self, name: str, frames: int | None) -> None: ...

    def advance(self, status: str) -> None: ...

    def waiting(self, reason: str) -> None: ...


class Board:
    """Keeps the batches it gets; may be away for some requests."""

    def __init__(self, away: Sequence[int] = ()) -> None:
        self.names: list[str] = []
        self.keys: list[str] = []
        self._away = set(away)
        self._requests = 0

    def __call__(self, request: httpx.Request) -> httpx.Response:
        if request.url.path == "/ready":
            return httpx.Response(200)
        self._requests += 1
        self.keys.append(request.headers["Idempotency-Key"])
        if self._requests in self._away:
            raise httpx.ConnectError("Connection refused", request=request)
        commands: list[dict[str, Any]] = json.loads(request.content)["commands"]
        self.names += [command["fluent"]["name"] for command in commands]
        return httpx.Response(200, json={"commit": self._requests, "events": [], "warnings": []})

    def client(self) -> Client:
        return Client("http://board", transport=httpx.MockTransport(self), retries=0)


def work(
    board: Board, module: Counter, frames: int = 3, stop: StopRequest | None = None
) -> WorkReport:
    return run(module, Frames(frames), board.client(), progress=Silence(), stop=stop)


def test_recording_is_worked_to_its_end() -> None:
    board = Board()
    report = work(board, Counter())
    assert board.names == ["begin", "frame0", "frame1", "frame2", "finish"]
    assert (report.frames, report.commands, report.was_stopped) == (3, 5, False)


def test_report_says_what_was_found() -> None:
    report = work(Board(), Counter())
    assert report.told("mapping").startswith("mapping: counting; 3 frames in ")
    assert report.told("mapping").endswith("5 commands written, commit 5")
    nothing = replace(report, frames=1, found="", was_stopped=True)
    assert nothing.told("anchoring").startswith("anchoring: nothing found; 1 frame in ")
    assert nothing.told("anchoring").endswith(" (stopped)")


def test_stopping_finishes_the_current_frame_and_its_writes() -> None:
    board, stop = Board(), StopRequest()

    def stop_at_frame_one(index: int) -> None:
        if index == 1:
            stop.ask()

    report = work(board, Counter(stop_at_frame_one), frames=9, stop=stop)
    assert board.names == ["begin", "frame0", "frame1", "finish"]
    assert report.was_stopped


def test_write_is_repeated_under_its_key_when_the_board_comes_back(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("fluentboard_modules.worker._FIRST_WAIT_S", 0.0)
    board = Board(away=[2])
    work(board, Counter(), frames=1)
    assert board.names == ["begin", "frame0", "finish"]
    assert board.keys[1] == board.keys[2]
    assert len({*board.keys}) == 3


def test_last_writes_that_nobody_takes_are_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fluentboard_modules.worker._FIRST_WAIT_S", 0.0)
    monkeypatch.setattr("fluentboard_modules.worker._LAST_CHANCE_S", 0.0)
    board, stop = Board(away=range(2, 99)), StopRequest()
    with pytest.raises(BoardUnreachable, match="without 1 commands that it did not take"):
        work(board, Counter(lambda _: stop.ask()), stop=stop)


def test_frame_that_cannot_be_processed_is_skipped_with_a_warning(
    caplog: pytest.LogCaptureFixture,
) -> None:
    def refuse_frame_one(index: int) -> None:
        if index == 1:
            raise InvalidFrame("nothing but noise")

    board = Board()
    with caplog.at_level(logging.WARNING):
        work(board, Counter(refuse_frame_one))
    assert board.names == ["begin", "frame0", "frame2", "finish"]
    assert "frame 1 skipped: invalid-frame: nothing but noise" in caplog.text


def test_source_without_a_readable_frame_is_an_error() -> None:
    with pytest.raises(InvalidFrame, match="not one frame could be read"):
        work(Board(), Counter(), frames=0)


def test_write_that_the_board_refuses_ends_the_worker() -> None:
    def refuse(request: httpx.Request) -> httpx.Response:
        if request.url.path == "/ready":
            return httpx.Response(200)
        body = {"code": "unknown-class", "message": "no class Mug", "status": 422}
        return httpx.Response(422, json=body)

    client = Client("http://board", transport=httpx.MockTransport(refuse), retries=0)
    with pytest.raises(UnknownClass, match="no class Mug"):
        run(Counter(), Frames(1), client, progress=Silence())
