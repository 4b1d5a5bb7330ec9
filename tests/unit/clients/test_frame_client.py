"""A sensor's frames as the client sends and gets them."""

from __future__ import annotations

from collections.abc import Callable

import httpx
import pytest

from fluentboard.errors import BoardUnreachable, TooLarge
from fluentboard.model.frame_message import MEDIA_TYPE
from fluentboard_client import FrameClient, ReceivedFrame
from fluentboard_client.frames import FRAME_MEDIA_TYPE

Answer = Callable[[httpx.Request], httpx.Response]


def client(answer: Answer, **options: str) -> FrameClient:
    return FrameClient(
        "http://board/", "head", transport=httpx.MockTransport(answer), token=options.get("token")
    )


def test_frame_is_sent_under_its_media_type() -> None:
    seen: list[httpx.Request] = []

    def answer(request: httpx.Request) -> httpx.Response:
        seen.append(request)
        return httpx.Response(201, json={"index": 5})

    with client(answer, token="secret") as sensor:
        assert sensor.send(b"frame") == 5
        assert sensor.address == "http://board/frames/head"
    assert (seen[0].method, seen[0].url.path, seen[0].content) == ("POST", "/frames/head", b"frame")
    assert seen[0].headers["content-type"] == FRAME_MEDIA_TYPE == MEDIA_TYPE
    assert seen[0].headers["authorization"] == "Bearer secret"


def test_newest_frame_is_asked_for_after_the_last_one() -> None:
    def answer(request: httpx.Request) -> httpx.Response:
        assert dict(request.url.params) == {"after": "4", "wait": "2.5"}
        return httpx.Response(200, content=b"frame", headers={"X-Frame-Index": "7"})

    assert client(answer).newest(4, 2.5) == ReceivedFrame(7, b"frame")


def test_no_new_frame_is_none() -> None:
    assert client(lambda _: httpx.Response(204)).newest() is None


def test_sensors_are_named() -> None:
    body = {"sensors": [{"sensor": "a"}, {"sensor": "b"}]}
    assert client(lambda _: httpx.Response(200, json=body)).sensors() == ["a", "b"]


def test_refusal_is_the_boards_error() -> None:
    body = {"code": "too-large", "message": "the frame is too long", "status": 413}
    with pytest.raises(TooLarge, match="the frame is too long"):
        client(lambda _: httpx.Response(413, json=body)).send(b"frame")


def test_absent_board_is_unreachable_and_nothing_is_repeated() -> None:
    tries: list[str] = []

    def answer(request: httpx.Request) -> httpx.Response:
        tries.append(request.method)
        raise httpx.ConnectError("Connection refused", request=request)

    with pytest.raises(BoardUnreachable, match="http://board cannot be reached"):
        client(answer).send(b"frame")
    assert tries == ["POST"]
