"""Live frames over HTTP: sent, waited for, announced, bounded."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import httpx
import orjson
import pytest

from fluentboard.api.app import BoardApp, create_app
from fluentboard.board.blackboard import Blackboard
from fluentboard.config import load_settings
from fluentboard.model.frame_message import MEDIA_TYPE, FrameMessage, PinholeJson, pack_frame
from fluentboard.model.geometry import Transform

Scenario = Callable[[httpx.AsyncClient], Awaitable[None]]
TYPED = {"content-type": MEDIA_TYPE}


def frame(number: int) -> bytes:
    camera = PinholeJson(4, 3, 2.0, 2.0, 1.5, 1.0)
    depth = b"\x89PNG\r\n\x1a\n"
    return pack_frame(FrameMessage(1.0 + number, camera, Transform.identity(), depth))


@pytest.fixture
def app_of(board: Blackboard, tmp_path: Path) -> Callable[..., BoardApp]:
    def make(**settings: Any) -> BoardApp:
        flags = {key.replace("__", "."): value for key, value in settings.items()}
        return create_app(board, load_settings(flags={"storage.data": tmp_path, **flags}))

    return make


def play(app: BoardApp, scenario: Scenario) -> None:
    """Runs a conversation with the application in one event loop."""

    async def run() -> None:
        transport = httpx.ASGITransport(app, raise_app_exceptions=False)
        async with httpx.AsyncClient(transport=transport, base_url="http://board") as client:
            await scenario(client)

    asyncio.run(run())


def test_frame_that_was_sent_is_given(app_of: Callable[..., BoardApp]) -> None:
    async def scenario(client: httpx.AsyncClient) -> None:
        sent = await client.post("/frames/head", content=frame(0), headers=TYPED)
        assert sent.status_code == 201
        expected = {"sensor": "head", "index": 0, "stamp_s": 1.0, "bytes": len(frame(0))}
        assert sent.json() == {**expected, "dropped": 0}
        given = await client.get("/frames/head")
        assert given.content == frame(0)
        assert given.headers["content-type"] == MEDIA_TYPE
        assert given.headers["x-frame-index"] == "0"
        assert given.headers["x-frame-stamp"] == "1.0"
        assert (await client.get("/frames/head/0")).content == frame(0)
        assert (await client.get("/frames/head/1")).status_code == 404
        assert (await client.get("/frames/head/one")).status_code == 422
        assert (await client.get("/frames/head?after=0")).status_code == 204
        assert (await client.get("/frames/tail")).status_code == 204

    play(app_of(), scenario)


def test_slow_reader_gets_the_newest_and_hears_what_it_skipped(
    app_of: Callable[..., BoardApp],
) -> None:
    async def scenario(client: httpx.AsyncClient) -> None:
        for number in range(5):
            await client.post("/frames/head", content=frame(number), headers=TYPED)
        given = await client.get("/frames/head?after=1")
        assert given.headers["x-frame-index"] == "4"
        assert given.headers["x-frames-skipped"] == "2"

    play(app_of(), scenario)


def test_waiting_request_is_answered_by_the_next_frame(app_of: Callable[..., BoardApp]) -> None:
    app = app_of()

    async def scenario(client: httpx.AsyncClient) -> None:
        waiting = asyncio.create_task(client.get("/frames/head?wait=20"))
        while app.frames.waiting == 0:
            await asyncio.sleep(0)
        await client.post("/frames/tail", content=frame(7), headers=TYPED)
        assert not waiting.done()
        await client.post("/frames/head", content=frame(3), headers=TYPED)
        assert (await waiting).content == frame(3)
        assert app.frames.waiting == 0

    play(app, scenario)


def test_waiting_ends_at_the_limit(app_of: Callable[..., BoardApp]) -> None:
    async def scenario(client: httpx.AsyncClient) -> None:
        assert (await client.get("/frames/head?wait=60")).status_code == 204

    play(app_of(frames__wait_max_s=0.01), scenario)


def test_stopping_board_lets_waiting_requests_go(app_of: Callable[..., BoardApp]) -> None:
    app = app_of()

    async def scenario(client: httpx.AsyncClient) -> None:
        waiting = asyncio.create_task(client.get("/frames/head?wait=20"))
        while app.frames.waiting == 0:
            await asyncio.sleep(0)
        app.frames.wake()
        assert (await waiting).status_code == 204

    play(app, scenario)


def test_sensors_are_listed(app_of: Callable[..., BoardApp]) -> None:
    async def scenario(client: httpx.AsyncClient) -> None:
        assert (await client.get("/frames")).json() == {"sensors": []}
        for number in range(3):
            await client.post("/frames/head", content=frame(number), headers=TYPED)
        (sensor,) = (await client.get("/frames")).json()["sensors"]
        assert sensor == {
            "sensor": "head",
            "frames": 2,
            "bytes": 2 * len(frame(0)),
            "oldest": 1,
            "newest": 2,
            "stamp_s": 3.0,
        }

    play(app_of(frames__ring_frames=2), scenario)


@pytest.mark.parametrize(
    ("path", "content", "media_type", "status", "code"),
    [
        ("/frames/head", b"nonsense", MEDIA_TYPE, 422, "invalid-frame"),
        ("/frames/head", frame(0), "image/png", 415, "unsupported-media-type"),
        ("/frames/h%20d", frame(0), MEDIA_TYPE, 422, "invalid-name"),
        ("/frames/head", frame(0) + bytes(5000), MEDIA_TYPE, 413, "too-large"),
    ],
)
def test_bad_frames_are_refused(
    path: str,
    content: bytes,
    media_type: str,
    status: int,
    code: str,
    app_of: Callable[..., BoardApp],
) -> None:
    async def scenario(client: httpx.AsyncClient) -> None:
        headers = {"content-type": media_type}
        reply = await client.post(path, content=content, headers=headers)
        assert (reply.status_code, reply.json()["code"]) == (status, code)
        assert (await client.get("/frames")).json() == {"sensors": []}

    play(app_of(frames__frame_max_bytes=4000), scenario)


@pytest.mark.parametrize("query", ["after=-1", "after=x", "wait=x", "wait=-1", "until=5"])
def test_bad_parameters_are_refused(query: str, app_of: Callable[..., BoardApp]) -> None:
    async def scenario(client: httpx.AsyncClient) -> None:
        assert (await client.get(f"/frames/head?{query}")).status_code == 422

    play(app_of(), scenario)


def test_readers_may_read_and_only_writers_send(app_of: Callable[..., BoardApp]) -> None:
    tokens = [{"name": "eye", "role": "read", "token": "a-secret-of-readers"}]

    async def scenario(client: httpx.AsyncClient) -> None:
        bearer = {"authorization": "Bearer a-secret-of-readers"}
        assert (await client.get("/frames")).status_code == 401
        assert (await client.get("/frames/head", headers=bearer)).status_code == 204
        reply = await client.post("/frames/head", content=frame(0), headers=bearer | TYPED)
        assert reply.status_code == 403

    play(app_of(security__tokens=tokens), scenario)


def test_frames_are_announced_as_events(app_of: Callable[..., BoardApp]) -> None:
    """Talks ASGI itself: the transport of httpx gives a stream only when it has ended."""
    app = app_of()

    async def run() -> None:
        events: asyncio.Queue[bytes] = asyncio.Queue()
        departure = asyncio.Event()
        request = iter([{"type": "http.request", "body": b"", "more_body": False}])

        async def receive() -> dict[str, Any]:
            message = next(request, None)
            if message is None:
                await departure.wait()
                return {"type": "http.disconnect"}
            return message

        async def send(message: Any) -> None:
            if message["type"] == "http.response.body" and message["body"]:
                events.put_nowait(message["body"])

        scope = {
            "type": "http",
            "method": "GET",
            "path": "/frames",
            "query_string": b"",
            "headers": [(b"host", b"board"), (b"accept", b"text/event-stream")],
        }
        stream = asyncio.create_task(app(scope, receive, send))
        assert await events.get() == b"retry: 1000\n\n"
        transport = httpx.ASGITransport(app)
        async with httpx.AsyncClient(transport=transport, base_url="http://board") as client:
            await client.post("/frames/head", content=frame(4), headers=TYPED)
        event = await events.get()
        assert event.startswith(b"event: frame\ndata: ")
        told = orjson.loads(event.removeprefix(b"event: frame\ndata: "))
        assert told == {"sensor": "head", "index": 0, "stamp_s": 5.0, "bytes": len(frame(4))}
        departure.set()  # the subscriber goes away, and nothing is left of it
        await asyncio.wait_for(stream, 5.0)
        assert app.frames.waiting == 0

    asyncio.run(run())


def test_board_without_frames_makes_no_folder(
    app_of: Callable[..., BoardApp], tmp_path: Path
) -> None:
    app_of()
    assert not (tmp_path / "frames").exists()
