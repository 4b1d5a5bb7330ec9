"""Live frames from a board made of a few lines: newest first, patient, honest about losses."""

from __future__ import annotations

import itertools
import logging
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import httpx
import numpy as np
import pytest

from fluentboard.clock import ReplayClock
from fluentboard.errors import BoardUnreachable, InvalidFrame, InvalidInput, NotAuthenticated
from fluentboard.model.frame_message import pack_frame, unpack_frame
from fluentboard_modules.frames.frame_encoding import frame_of, message_of
from fluentboard_modules.frames.live import FramePublisher, LiveFrames, publish
from fluentboard_modules.frames.recordings import LiveSource, Recording
from fluentboard_modules.frames.sensor_frame import SensorFrame
from fluentboard_modules.frames.sources import open_source

Answer = Callable[[httpx.Request], httpx.Response]


def source(answer: Answer) -> LiveFrames:
    return LiveFrames("http://board", "head", transport=httpx.MockTransport(answer))


def reply(frame: SensorFrame, index: int) -> httpx.Response:
    content = pack_frame(message_of(frame, "png"))
    return httpx.Response(200, content=content, headers={"X-Frame-Index": str(index)})


def test_frame_survives_its_message(made: Any) -> None:
    frame = made.frames[2]
    back = frame_of(unpack_frame(pack_frame(message_of(frame, "png"))), "head", 7)
    assert (back.camera, back.stamp_s, back.sensor, back.index) == (
        frame.camera,
        frame.stamp_s,
        "head",
        7,
    )
    assert np.allclose(back.depth_m, frame.depth_m)
    assert np.array_equal(np.asarray(back.colour), frame.colour)
    assert back.T_map_sensor == frame.T_map_sensor


def test_message_with_an_image_of_another_size_is_an_error(made: Any) -> None:
    message = message_of(made.frames[0])
    wider = replace(message, camera=replace(message.camera, width=99))
    with pytest.raises(InvalidFrame, match="frame 7: depth image has shape"):
        frame_of(wider, "head", 7)


def test_slow_worker_gets_the_newest_frame_and_the_log_says_what_was_dropped(
    made: Any, caplog: pytest.LogCaptureFixture
) -> None:
    indices = iter([4, 5, 9, 20])
    asked: list[str | None] = []

    def answer(request: httpx.Request) -> httpx.Response:
        asked.append(request.url.params.get("after"))
        return reply(made.frames[0], next(indices))

    live = source(answer)
    with caplog.at_level(logging.WARNING):
        frames = list(itertools.islice(live, 4))
    assert [frame.index for frame in frames] == [4, 5, 9, 20]
    assert asked == [None, "4", "5", "9"]
    assert live.dropped == 3 + 10
    # Said at once, then not again for a while.
    assert caplog.text.count("frames dropped so far") == 1
    assert "3 frames dropped so far: the worker is slower than the sensor" in caplog.text


def test_emptied_board_is_not_a_gap(made: Any) -> None:
    indices = iter([900, 0, 1])
    live = source(lambda _: reply(made.frames[0], next(indices)))
    assert [frame.index for frame in itertools.islice(live, 3)] == [900, 0, 1]
    assert live.dropped == 0


def test_absent_board_is_waited_for(
    made: Any, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr("fluentboard_modules.frames.live._FIRST_RETRY_S", 0.0)
    tries = itertools.count()

    def answer(request: httpx.Request) -> httpx.Response:
        match next(tries):
            case 0:
                raise httpx.ConnectError("Connection refused", request=request)
            case 1:
                problem = {"code": "board-unreachable", "message": "it is starting"}
                return httpx.Response(503, json=problem)
            case _:
                return reply(made.frames[0], 3)

    (frame,) = itertools.islice(source(answer), 1)
    assert frame.index == 3
    assert (
        "waiting for the board: http://board cannot be reached: Connection refused" in caplog.text
    )


def test_silent_sensor_is_remarked_with_the_sensors_there_are(
    made: Any, caplog: pytest.LogCaptureFixture
) -> None:
    tries = itertools.count()

    def answer(request: httpx.Request) -> httpx.Response:
        if request.url.path == "/frames":
            return httpx.Response(200, json={"sensors": [{"sensor": "tail"}]})
        return httpx.Response(204) if next(tries) < 3 else reply(made.frames[0], 0)

    assert next(iter(source(answer))).index == 0
    assert caplog.text.count("no frame yet; sensors that have sent some: tail") == 1


def test_damaged_frame_is_skipped_with_a_warning(
    made: Any, caplog: pytest.LogCaptureFixture
) -> None:
    replies = iter(
        [
            httpx.Response(200, content=b"damaged", headers={"X-Frame-Index": "0"}),
            reply(made.frames[0], 1),
        ]
    )
    assert next(iter(source(lambda _: next(replies)))).index == 1
    assert "frame 0 skipped" in caplog.text


def test_stopping_ends_the_iteration(made: Any) -> None:
    live = source(lambda _: reply(made.frames[0], 0))
    frames = iter(live)
    next(frames)
    live.stop()
    assert list(frames) == []


def test_stopping_ends_the_wait_for_an_absent_board() -> None:
    def answer(request: httpx.Request) -> httpx.Response:
        live.stop()
        raise httpx.ConnectError("Connection refused", request=request)

    live = source(answer)
    assert list(live) == []


def test_refusal_of_the_board_is_an_error() -> None:
    problem = {"code": "not-authenticated", "message": "this board needs a token", "status": 401}
    with pytest.raises(NotAuthenticated, match="this board needs a token"):
        next(iter(source(lambda _: httpx.Response(401, json=problem))))


def test_address_names_board_and_sensor() -> None:
    live = open_source("http://127.0.0.1:8080/robots/pr2/frames/head%2D1", token="secret")
    assert isinstance(live, LiveFrames)
    assert isinstance(live, LiveSource)
    assert not isinstance(live, Recording)
    assert (live.board, live.sensor) == ("http://127.0.0.1:8080/robots/pr2", "head-1")
    with pytest.raises(TypeError):
        len(live)


@pytest.mark.parametrize(
    "text", ["http://board", "http://board/frames", "http:///frames/head", "http://b/frames/a/3"]
)
def test_address_of_something_else_is_explained(text: str) -> None:
    with pytest.raises(InvalidInput, match="is no address of live frames; give one such as"):
        open_source(text)


def test_live_frames_keep_their_stamps() -> None:
    with pytest.raises(InvalidInput, match="leave out --start"):
        open_source("http://board/frames/head", start_s=5.0)


class Taker:
    """A board that takes frames, unless it is away."""

    def __init__(self, away: set[int] | None = None) -> None:
        self.stamps_s: list[float] = []
        self._away = away or set()
        self._requests = itertools.count()

    def __call__(self, request: httpx.Request) -> httpx.Response:
        if next(self._requests) in self._away:
            raise httpx.ConnectError("Connection refused", request=request)
        assert request.url.path == "/frames/head"
        self.stamps_s.append(unpack_frame(request.content).stamp_s)
        return httpx.Response(201, json={"index": len(self.stamps_s) - 1})

    def publisher(self) -> FramePublisher:
        return FramePublisher("http://board", "head", transport=httpx.MockTransport(self))


def test_frames_are_sent_as_if_they_were_taken_now(made: Any) -> None:
    board, waits = Taker(), list[float]()

    def wait(seconds: float) -> bool:
        waits.append(seconds)
        return False

    count = publish(made, board.publisher(), is_stopped=wait, clock=ReplayClock(500.0))
    assert count == 5
    assert np.allclose(board.stamps_s, 500.0 + 0.1 * np.arange(5))
    # Nothing really waits here, so the waits add up to those since the first frame.
    assert waits[0] == 0.0
    assert 0.3 < waits[4] <= 0.4


def test_stamps_follow_the_rate(made: Any) -> None:
    board = Taker()
    publish(
        made,
        board.publisher(),
        rate_hz=2.0,
        is_stopped=lambda _: False,
        clock=ReplayClock(500.0),
    )
    assert np.allclose(board.stamps_s, 500.0 + 0.5 * np.arange(5))


def test_stamps_and_rate_may_be_chosen(made: Any) -> None:
    board, waits = Taker(), list[float]()

    def wait(seconds: float) -> bool:
        waits.append(seconds)
        return False

    publish(made, board.publisher(), rate_hz=2.0, keep_stamps=True, is_stopped=wait)
    assert np.allclose(board.stamps_s, 1.0 + 0.1 * np.arange(5))
    assert 1.9 < waits[4] <= 2.0


def test_frame_for_an_absent_board_is_lost_and_said_so(
    made: Any, caplog: pytest.LogCaptureFixture
) -> None:
    board = Taker(away={1, 2})
    assert publish(made, board.publisher(), is_stopped=lambda _: False) == 3
    assert "made: frame 1 lost" in caplog.text
    with pytest.raises(BoardUnreachable):
        Taker(away={0}).publisher().send(made.frames[0])


def test_sending_stops_when_asked(made: Any) -> None:
    board = Taker()
    answers = iter([False, False, True])
    assert publish(made, board.publisher(), is_stopped=lambda _: next(answers)) == 2
