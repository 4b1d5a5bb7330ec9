"""Live frames: a sensor's newest frame from the board, again and again; and sending them there."""

from __future__ import annotations

import logging
import re
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Self
from urllib.parse import unquote, urlsplit

import httpx

from fluentboard.clock import Clock, SystemClock
from fluentboard.errors import BoardUnreachable, FluentboardError, InvalidInput
from fluentboard.model.frame_message import pack_frame, unpack_frame
from fluentboard_client import FrameClient, ReceivedFrame
from fluentboard_modules.frames.frame_encoding import frame_of, message_of
from fluentboard_modules.frames.sensor_frame import FrameSource, SensorFrame

logger = logging.getLogger(__name__)

# Asked for so long at a time, so that a worker that is told to stop does so soon.
_WAIT_S = 1.0
_FIRST_RETRY_S, _LONGEST_RETRY_S = 0.2, 5.0
_SAY_EVERY_S = 10.0
# No board, one that is starting, or a proxy that cannot reach it.
_AWAY = (502, 503, 504)
_PATH = re.compile(r"(?P<base>.*)/frames/(?P<sensor>[^/]+)/?")


class LiveFrames:
    """The frames of a sensor as they come in (a `LiveSource`).

    Who is slower than the sensor gets the newest frame each time and skips the ones between; the
    log says how many. While the board is away or the sensor silent, the iterator waits.

    Args:
        board: address of the board.
        sensor: name under which the robot sends its frames.
        token: bearer token, where the board asks for one.
        transport: how requests are sent; for tests.

    Attributes:
        dropped: frames skipped so far.
    """

    def __init__(
        self,
        board: str,
        sensor: str,
        *,
        token: str | None = None,
        transport: httpx.BaseTransport | None = None,
    ) -> None:
        self.board = board.rstrip("/")
        self.sensor = sensor
        self.dropped = 0
        self._token = token
        self._transport = transport
        self._stopped = threading.Event()
        self._said_s = -_SAY_EVERY_S

    @classmethod
    def from_url(cls, url: str, *, token: str | None = None, start_s: float | None = None) -> Self:
        """The frames at an address such as `http://127.0.0.1:8080/frames/head`.

        Raises:
            InvalidInput: the address is not one of a sensor's frames, or a first stamp is given.
        """
        parts = urlsplit(url)
        match = _PATH.fullmatch(parts.path)
        if match is None or not parts.hostname:
            raise InvalidInput(
                f"{url!r} is no address of live frames; give one such as "
                "http://127.0.0.1:8080/frames/head"
            )
        if start_s is not None:
            raise InvalidInput(
                "live frames are on the board's time axis already; leave out --start"
            )
        board = f"{parts.scheme}://{parts.netloc}{match['base']}"
        return cls(board, unquote(match["sensor"]), token=token)

    @property
    def name(self) -> str:
        """What to call the source in messages."""
        return f"{self.board}/frames/{self.sensor}"

    def __len__(self) -> int:
        raise TypeError("a live source has no length")

    def __iter__(self) -> Iterator[SensorFrame]:
        after: int | None = None
        is_silent = False
        with FrameClient(
            self.board, self.sensor, token=self._token, transport=self._transport
        ) as sensor:
            while not self._stopped.is_set():
                received = self._next(sensor, after)
                if received is None:
                    if after is None and not (is_silent or self._stopped.is_set()):
                        is_silent = True
                        self._say_silent(sensor)
                    continue
                before, after = after, received.index
                self._count_skipped(before, after)
                try:
                    frame = frame_of(unpack_frame(received.content), self.sensor, after)
                except FluentboardError as problem:
                    logger.warning("%s: frame %d skipped: %s", self.name, after, problem.message)
                    continue
                yield frame

    def stop(self) -> None:
        """Ends the iteration after the frame at hand, or while none comes; from any thread."""
        self._stopped.set()

    def _next(self, sensor: FrameClient, after: int | None) -> ReceivedFrame | None:
        """The next frame; None if none came in time, or when told to stop while waiting."""
        wait_s = _FIRST_RETRY_S
        while True:
            try:
                return sensor.newest(after, _WAIT_S)
            except FluentboardError as problem:
                if problem.http_status not in _AWAY:
                    raise
                if wait_s == _FIRST_RETRY_S:
                    logger.warning("%s: waiting for the board: %s", self.name, problem.message)
            if self._stopped.wait(wait_s):
                return None
            wait_s = min(2.0 * wait_s, _LONGEST_RETRY_S)

    def _count_skipped(self, before: int | None, after: int) -> None:
        if before is None or after <= before + 1:
            return
        self.dropped += after - before - 1
        now_s = time.monotonic()
        if now_s - self._said_s >= _SAY_EVERY_S:
            self._said_s = now_s
            logger.warning(
                "%s: %d frames dropped so far: the worker is slower than the sensor and takes the "
                "newest frame each time",
                self.name,
                self.dropped,
            )

    def _say_silent(self, sensor: FrameClient) -> None:
        try:
            known = ", ".join(sensor.sensors()) or "none"
        except BoardUnreachable:
            return  # the next request for a frame says so
        logger.warning("%s: no frame yet; sensors that have sent some: %s", self.name, known)


class FramePublisher:
    """Sends frames to a board, as a robot does. As a context manager it closes its connections.

    Args:
        board: address of the board.
        sensor: name of the sensor.
        token: bearer token, where the board asks for one.
        transport: how requests are sent; for tests.
    """

    def __init__(
        self,
        board: str,
        sensor: str,
        *,
        token: str | None = None,
        transport: httpx.BaseTransport | None = None,
    ) -> None:
        self._sensor = FrameClient(board, sensor, token=token, transport=transport)

    @property
    def address(self) -> str:
        """Where the frames go."""
        return self._sensor.address

    def send(self, frame: SensorFrame) -> int:
        """Sends one frame; returns the number that the board gave it.

        Raises:
            BoardUnreachable: the board is away.
            FluentboardError: it refuses the frame.
        """
        return self._sensor.send(pack_frame(message_of(frame)))

    def close(self) -> None:
        """Closes the connections."""
        self._sensor.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def publish(
    source: FrameSource,
    publisher: FramePublisher,
    *,
    rate_hz: float | None = None,
    keep_stamps: bool = False,
    is_stopped: Callable[[float], bool],
    sent: Callable[[int, SensorFrame], object] = lambda count, frame: None,
    clock: Clock | None = None,
) -> int:
    """Sends the frames of a source at the pace at which they were taken; returns how many.

    A frame that the board does not take because it is away is lost, as on a real robot.

    Args:
        source: its frames.
        publisher: where they go.
        rate_hz: frames per second; by default as their stamps say.
        keep_stamps: leave the stamps; by default the frames are taken while they are sent.
        is_stopped: waits for so many seconds, and says whether to stop.
        sent: called with the number of frames sent so far and the last one.
        clock: says what now is.

    Raises:
        FluentboardError: the board refuses a frame.
    """
    clock = clock or SystemClock()
    count = 0
    began_s = time.monotonic()
    first: SensorFrame | None = None
    now_s = 0.0
    for position, frame in enumerate(source):
        if first is None:
            first = frame
            began_s, now_s = time.monotonic(), clock.now_s()
        due_s = frame.stamp_s - first.stamp_s if rate_hz is None else position / rate_hz
        if is_stopped(max(0.0, began_s + due_s - time.monotonic())):
            break
        # A source that is slower than its own pace takes its frames later.
        taken_s = now_s + max(due_s, time.monotonic() - began_s)
        live = frame if keep_stamps else replace(frame, stamp_s=taken_s)
        try:
            publisher.send(live)
        except BoardUnreachable as problem:
            logger.warning("%s: frame %d lost: %s", source.name, frame.index, problem.message)
            continue
        count += 1
        sent(count, live)
    return count
