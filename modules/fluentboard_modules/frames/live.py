"""Live frames: a sensor's newest frame from the board, again and again; and sending them there."""

from __future__ import annotations

import logging
import re
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from types import TracebackType
from typing import Self
from urllib.parse import unquote, urlsplit

import httpx

from fluentboard.clock import Clock, SystemClock
from fluentboard.errors import BoardUnreachable, FluentboardError, InvalidInput
from fluentboard.model.frame_message import MEDIA_TYPE, pack_frame, unpack_frame
from fluentboard_client import exchange
from fluentboard_modules.frames.frame_encoding import frame_of, message_of
from fluentboard_modules.frames.sensor_frame import FrameSource, SensorFrame

logger = logging.getLogger(__name__)

# Asked for so long at a time, so that a worker that is told to stop does so soon.
_WAIT_S = 1.0
_FIRST_RETRY_S, _LONGEST_RETRY_S = 0.2, 5.0
_TIMEOUT_S = 30.0
_SAY_EVERY_S = 10.0
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
        self.board = exchange.board_address(board)
        self.sensor = sensor
        self.dropped = 0
        self._stopped = threading.Event()
        self._token = token
        self._transport = transport
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
        with _client(self.board, self._token, self._transport) as http:
            while not self._stopped.is_set():
                reply = self._ask(http, after)
                if reply is None:
                    return
                if reply.status_code == 204:
                    if after is None and not is_silent:
                        is_silent = True
                        self._say_silent(http)
                    continue
                before, after = after, int(reply.headers["X-Frame-Index"])
                self._count_skipped(before, after)
                try:
                    frame = frame_of(unpack_frame(reply.content), self.sensor, after)
                except FluentboardError as problem:
                    logger.warning("%s: frame %d skipped: %s", self.name, after, problem.message)
                    continue
                yield frame

    def stop(self) -> None:
        """Ends the iteration after the frame at hand, or while none comes; from any thread."""
        self._stopped.set()

    def _ask(self, http: httpx.Client, after: int | None) -> httpx.Response | None:
        """The next frame or 204; None when told to stop while the board is away."""
        params = {"wait": str(_WAIT_S)} | ({} if after is None else {"after": str(after)})
        wait_s = _FIRST_RETRY_S
        while True:
            try:
                reply = http.get(f"/frames/{self.sensor}", params=params)
                # A board that is starting or stopping behind a proxy: the same as no board.
                if reply.status_code not in (502, 503, 504):
                    exchange.check(reply, self.board)
                    return reply
                problem = f"status {reply.status_code}"
            except httpx.TransportError as failure:
                problem = str(failure) or type(failure).__name__
            if wait_s == _FIRST_RETRY_S:
                logger.warning("%s: the board is away (%s); waiting for it", self.name, problem)
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

    def _say_silent(self, http: httpx.Client) -> None:
        reply = http.get("/frames")
        exchange.check(reply, self.board)
        known = [entry["sensor"] for entry in reply.json()["sensors"]]
        logger.warning(
            "%s: no frame yet; sensors that have sent some: %s",
            self.name,
            ", ".join(known) or "none",
        )


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
        self.board = exchange.board_address(board)
        self._path = f"/frames/{sensor}"
        self._http = _client(self.board, token, transport)

    def send(self, frame: SensorFrame) -> int:
        """Sends one frame; returns the number that the board gave it.

        Raises:
            BoardUnreachable: the board is away.
            FluentboardError: it refuses the frame.
        """
        content = pack_frame(message_of(frame))
        try:
            reply = self._http.post(
                self._path, content=content, headers={"Content-Type": MEDIA_TYPE}
            )
        except httpx.TransportError as failure:
            raise exchange.unreachable(self.board, failure, 1) from failure
        exchange.check(reply, self.board)
        return int(reply.json()["index"])

    def close(self) -> None:
        """Closes the connections."""
        self._http.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()


def publish(
    source: FrameSource,
    publisher: FramePublisher,
    *,
    rate_hz: float | None = None,
    keep_stamps: bool = False,
    is_stopped: Callable[[float], bool],
    sent: Callable[[int], None] = lambda _: None,
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
        sent: called with the number of frames sent so far.
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
        try:
            stamp_s = frame.stamp_s if keep_stamps else now_s + due_s
            publisher.send(replace(frame, stamp_s=stamp_s))
        except BoardUnreachable as problem:
            logger.warning("%s: frame %d lost: %s", source.name, frame.index, problem.message)
            continue
        count += 1
        sent(count)
    return count


def _client(board: str, token: str | None, transport: httpx.BaseTransport | None) -> httpx.Client:
    return httpx.Client(
        base_url=board,
        headers=exchange.headers("", token),
        timeout=_TIMEOUT_S,
        transport=transport,
        trust_env=not exchange.is_loopback(board),
    )
