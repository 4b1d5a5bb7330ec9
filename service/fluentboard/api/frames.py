"""Frames: robots send them, workers wait for the newest; nobody who is slow makes anybody wait."""

from __future__ import annotations

import asyncio
import shutil
import tempfile
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import orjson

from fluentboard.api.exchange import Call, HeaderList, Reply, StreamedReply, json_reply
from fluentboard.api.operations import Answer, Content, Operation, Parameter
from fluentboard.api.parameters import optional_number, seconds, text, whole_number
from fluentboard.api.schemas.upkeep import FrameReceipt, Sensors
from fluentboard.board.frame_ring import FrameRing, KeptFrame, check_sensor
from fluentboard.board.frame_settings import FrameSettings
from fluentboard.errors import (
    InvalidFrame,
    InvalidInput,
    InvalidName,
    StorageFailed,
    TooLarge,
    UnknownResource,
    UnsupportedMediaType,
)
from fluentboard.model.frame_message import MEDIA_TYPE

_ACCEPTED = (MEDIA_TYPE, "application/octet-stream")
_EVENT_STREAM = "text/event-stream"
_ALL_SENSORS = ""  # the name of no sensor: who waits under it hears of all
_DEFAULT_WAIT_S = 0.0
# Proxies close connections on which nothing is sent for a minute.
_SSE_HEARTBEAT_S = 15.0
_FRAME_HEADERS = {
    "X-Frame-Index": "Number of the frame among all of its sensor.",
    "X-Frame-Stamp": "When it was taken, in seconds.",
    "X-Frames-Skipped": "Frames that were sent after `after` and before this one.",
}


class FrameRoutes:
    """`/frames`: live frames in and out.

    Args:
        folder: where the frames are kept; None for a temporary folder.
        settings: limits.
    """

    def __init__(self, folder: Path | None, settings: FrameSettings) -> None:
        self._folder = folder
        self._temporary: Path | None = None
        self._ring: FrameRing | None = None
        self._settings = settings
        self._waiting: dict[str, set[asyncio.Event]] = {}
        self._is_closing = False

    @property
    def ring(self) -> FrameRing:
        """What is kept; opened when it is first asked for, as most boards never see a frame."""
        if self._ring is None:
            folder = self._folder
            if folder is None:
                folder = self._temporary = Path(tempfile.mkdtemp(prefix="fluentboard-frames-"))
            self._ring = FrameRing(folder, self._settings)
        return self._ring

    @property
    def size_bytes(self) -> int:
        """Of all frames kept."""
        return 0 if self._ring is None else self._ring.size_bytes

    @property
    def dropped(self) -> int:
        """Frames that made room for newer ones."""
        return 0 if self._ring is None else self._ring.dropped

    @property
    def waiting(self) -> int:
        """Requests that wait for a frame."""
        return sum(len(events) for events in self._waiting.values())

    def wake(self) -> None:
        """Lets all waiting requests go; those that come later do not wait."""
        self._is_closing = True
        for events in self._waiting.values():
            for event in events:
                event.set()

    def close(self) -> None:
        """Deletes the frames if they are in a temporary folder."""
        if self._temporary is not None:
            shutil.rmtree(self._temporary, ignore_errors=True)

    async def post(self, call: Call) -> Reply:
        """`POST /frames/{sensor}`."""
        sensor = call.arguments["sensor"]
        check_sensor(sensor)
        if call.media_type not in _ACCEPTED:
            raise UnsupportedMediaType(
                f"the body is {call.media_type or 'untyped'}; send it with Content-Type "
                f"{MEDIA_TYPE}",
                accepted=list(_ACCEPTED),
            )
        content = await call.body(self._settings.frame_max_bytes)
        before = self.ring.dropped
        frame = await asyncio.to_thread(self.ring.add, sensor, content)
        for event in (*self._waiting.get(sensor, ()), *self._waiting.get(_ALL_SENSORS, ())):
            event.set()
        return json_reply({**_told(frame), "dropped": self.ring.dropped - before}, status=201)

    async def newest(self, call: Call) -> Reply:
        """`GET /frames/{sensor}`."""
        sensor = call.arguments["sensor"]
        check_sensor(sensor)
        after, wait_s = self._waiting_parameters(call)
        deadline = asyncio.get_running_loop().time() + wait_s
        while True:
            frame = await self._next(sensor, after, deadline)
            if frame is None:
                return Reply(status=204)
            try:
                content = await asyncio.to_thread(self.ring.read, sensor, frame.index)
            except UnknownResource:
                continue  # pushed out while it was being read: there is a newer one
            return Reply(content, MEDIA_TYPE.encode(), headers=_headers(frame, after))

    async def kept(self, call: Call) -> Reply:
        """`GET /frames/{sensor}/{index}`."""
        sensor, number = call.arguments["sensor"], call.arguments["index"]
        index = whole_number(number)
        if index is None:
            raise InvalidInput(f"the frame is {number!r}; give a whole number")
        content = await asyncio.to_thread(self.ring.read, sensor, index)
        return Reply(content, MEDIA_TYPE.encode())

    async def list_sensors(self, call: Call) -> Reply | StreamedReply:
        """`GET /frames`: the sensors, or as an event stream every frame that comes in."""
        if call.header(b"accept") == _EVENT_STREAM:
            return StreamedReply(
                self._announcements(call),
                _EVENT_STREAM.encode(),
                headers=[(b"cache-control", b"no-store")],
            )
        found: list[dict[str, Any]] = [
            {
                "sensor": state.sensor,
                "frames": state.frames,
                "bytes": state.size_bytes,
                "oldest": state.oldest.index,
                "newest": state.newest.index,
                "stamp_s": state.newest.stamp_s,
            }
            for state in self.ring.sensors()
        ]
        return json_reply({"sensors": found})

    def operations(self) -> list[Operation]:
        """The routes, documented."""
        return [
            Operation(
                "GET",
                "/frames",
                self.list_sensors,
                "listSensors",
                "List the sensors that send frames",
                f"With `Accept: {_EVENT_STREAM}` every frame is announced by an event `frame` as "
                "it comes in. A subscriber that is too slow for all of them hears of the newest.",
                tag="frames",
                answers={
                    200: Answer(
                        "What is kept of each sensor.",
                        {
                            "application/json": Content(Sensors),
                            _EVENT_STREAM: Content(FrameReceipt),
                        },
                    )
                },
            ),
            Operation(
                "POST",
                "/frames/{sensor}",
                self.post,
                "postFrame",
                "Send a frame",
                "The body is the length of a JSON header (four bytes, little-endian), the header "
                "and the encoded images. The newest frames are kept on disk within a limit; the "
                "oldest make room. Frames never become fluents.",
                tag="frames",
                role="write",
                body={
                    media_type: Content({"type": "string", "format": "binary"})
                    for media_type in _ACCEPTED
                },
                body_description="Header and images; see the reference of frames.",
                answers={201: Answer("It is kept.", {"application/json": Content(FrameReceipt)})},
                errors=(InvalidFrame, InvalidName, TooLarge, UnsupportedMediaType, StorageFailed),
            ),
            Operation(
                "GET",
                "/frames/{sensor}",
                self.newest,
                "getNewestFrame",
                "Wait for the newest frame of a sensor",
                "Answers at once if there is a frame that the caller does not have, else with the "
                "next one that comes in. A caller that is slower than the sensor skips frames.",
                tag="frames",
                parameters=(
                    Parameter(
                        "after",
                        "Number of the last frame that the caller has.",
                        {"type": "integer", "minimum": 0},
                        example=41,
                    ),
                    Parameter(
                        "wait",
                        "Seconds to wait for a frame; by default none.",
                        {"type": "number", "minimum": 0},
                        example=20,
                    ),
                ),
                answers={
                    200: Answer(
                        "The frame.",
                        {MEDIA_TYPE: Content({"type": "string", "format": "binary"})},
                        _FRAME_HEADERS,
                    ),
                    204: Answer("No new frame came in time."),
                },
                errors=(InvalidName,),
            ),
            Operation(
                "GET",
                "/frames/{sensor}/{index}",
                self.kept,
                "getFrame",
                "Read a frame that is still kept",
                tag="frames",
                answers={
                    200: Answer(
                        "The frame.", {MEDIA_TYPE: Content({"type": "string", "format": "binary"})}
                    )
                },
                errors=(UnknownResource,),
            ),
        ]

    def _waiting_parameters(self, call: Call) -> tuple[int | None, float]:
        values = call.parameters()
        after = optional_number(values, "after")
        given = text(values, "wait")
        wait_s = _DEFAULT_WAIT_S if given is None else seconds(given, "wait")
        if wait_s < 0.0:
            raise InvalidInput(f"the parameter wait is {given!r}; give at least 0 seconds")
        return after, min(wait_s, self._settings.wait_max_s)

    async def _next(self, sensor: str, after: int | None, deadline: float) -> KeptFrame | None:
        """The newest frame, or the next one by the deadline of the event loop's clock."""
        event = asyncio.Event()
        events = self._waiting.setdefault(sensor, set())
        events.add(event)
        try:
            while True:
                event.clear()
                frame = self.ring.newest(sensor, after)
                left_s = deadline - asyncio.get_running_loop().time()
                if frame is not None or left_s <= 0.0 or self._is_closing:
                    return frame
                try:
                    await asyncio.wait_for(event.wait(), left_s)
                except TimeoutError:
                    return self.ring.newest(sensor, after)
        finally:
            events.discard(event)
            if not events:
                self._waiting.pop(sensor, None)

    async def _announcements(self, call: Call) -> AsyncIterator[bytes]:
        """Server-sent events; of frames that come in between two of them, the newest counts."""
        event = asyncio.Event()
        events = self._waiting.setdefault(_ALL_SENSORS, set())
        events.add(event)
        told = {state.sensor: state.newest.index for state in self.ring.sensors()}
        gone = asyncio.create_task(_departure(call))
        gone.add_done_callback(lambda _: event.set())
        try:
            yield b"retry: 1000\n\n"
            while not (self._is_closing or gone.done()):
                try:
                    await asyncio.wait_for(event.wait(), _SSE_HEARTBEAT_S)
                except TimeoutError:
                    yield b": still here\n\n"
                event.clear()
                for state in self.ring.sensors():
                    if told.get(state.sensor) != state.newest.index:
                        told[state.sensor] = state.newest.index
                        yield b"event: frame\ndata: " + orjson.dumps(_told(state.newest)) + b"\n\n"
        finally:
            gone.cancel()
            events.discard(event)


async def _departure(call: Call) -> None:
    """Returns when the client has gone: nothing else comes after the end of its request."""
    await call.drain(1)
    await call.drain(1)


def _told(frame: KeptFrame) -> dict[str, Any]:
    return {
        "sensor": frame.sensor,
        "index": frame.index,
        "stamp_s": frame.stamp_s,
        "bytes": frame.size_bytes,
    }


def _headers(frame: KeptFrame, after: int | None) -> HeaderList:
    skipped = 0 if after is None else max(0, frame.index - after - 1)
    return [
        (b"x-frame-index", b"%d" % frame.index),
        (b"x-frame-stamp", repr(frame.stamp_s).encode()),
        (b"x-frames-skipped", b"%d" % skipped),
        (b"cache-control", b"no-store"),
    ]
