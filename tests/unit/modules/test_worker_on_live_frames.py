"""The worker loop on a source that does not end by itself."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import httpx
import numpy as np

from fluentboard.model.geometry import Transform
from fluentboard_client import Client, Command, Event
from fluentboard_modules.frames.sensor_frame import Camera, SensorFrame
from fluentboard_modules.worker import StopRequest, run


class Sensor:
    """Gives so many frames, then none until it is stopped."""

    name = "sensor"
    dropped = 3

    def __init__(self, frames: int, stop: StopRequest) -> None:
        self._frames = frames
        self._stop = stop
        self.is_stopped = False

    def __len__(self) -> int:
        raise TypeError

    def __iter__(self) -> Iterator[SensorFrame]:
        for index in range(self._frames):
            depth = np.ones((2, 2), dtype=np.float32)
            yield SensorFrame(
                depth, Camera(2, 2, 1.0, 1.0, 0.5, 0.5), 1.0, Transform.identity(), index=index
            )
        self._stop.ask()  # somebody does while it waits
        assert self.is_stopped

    def stop(self) -> None:
        self.is_stopped = True


class Quiet:
    """Writes nothing, shows nothing."""

    name = "quiet"
    subscription = None

    def begin(self, board: Client) -> Sequence[Command]:
        return []

    def notice(self, event: Event) -> None: ...

    def process(self, frame: SensorFrame) -> Sequence[Command]:
        return []

    def finish(self) -> Sequence[Command]:
        return []

    def status(self) -> str:
        return ""

    def draw(self, directory: Path) -> Sequence[Path]:
        return []


class Silence:
    def begin(self, name: str, frames: int | None) -> None: ...

    def advance(self, status: str) -> None: ...

    def waiting(self, reason: str) -> None: ...


def board() -> Client:
    transport = httpx.MockTransport(lambda _: httpx.Response(200, json={"fluents": []}))
    return Client("http://board", transport=transport, retries=0)


def test_waiting_source_is_stopped_with_the_worker() -> None:
    stop = StopRequest()
    report = run(Quiet(), Sensor(2, stop), board(), progress=Silence(), stop=stop)
    assert (report.frames, report.was_stopped) == (2, True)


def test_worker_that_is_stopped_before_the_first_frame_did_nothing_wrong() -> None:
    stop = StopRequest()
    report = run(Quiet(), Sensor(0, stop), board(), progress=Silence(), stop=stop)
    assert (report.frames, report.was_stopped) == (0, True)


def test_call_that_comes_after_the_request_is_made_at_once() -> None:
    stop = StopRequest()
    stop.ask()
    calls: list[str] = []
    stop.when_asked(lambda: calls.append("stop"))
    assert calls == ["stop"]
