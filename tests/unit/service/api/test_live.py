"""WebSockets without a network: the messages that the server would carry."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Iterator
from pathlib import Path
from typing import Any

import orjson
import pytest

from fluentboard.api.app import BoardApp, create_app
from fluentboard.board.backup import SUBSCRIPTIONS
from fluentboard.board.blackboard import Blackboard
from fluentboard.board.commands import AssertFluent, EndFluent
from fluentboard.board.subscriptions.durable import (
    DurableSubscription,
    DurableSubscriptions,
    Position,
)
from fluentboard.clock import ReplayClock
from fluentboard.config import load_settings
from fluentboard.model.fluent import Fluent
from fluentboard.model.interval import Interval
from fluentboard_ontology import FLUENT

PLATES = "SELECT ?plate WHERE { ?plate a race:Plate }"
TOKEN = {"name": "viewer", "role": "read", "token": "reader-secret-0001"}
TIMEOUT_S = 10.0


class Socket:
    """A client's end of one WebSocket."""

    def __init__(
        self, app: BoardApp, headers: dict[str, str], path: str = "/subscriptions"
    ) -> None:
        self._to_server: asyncio.Queue[dict[str, Any]] = asyncio.Queue()
        self._from_server: asyncio.Queue[Any] = asyncio.Queue()
        scope: dict[str, Any] = {
            "type": "websocket",
            "path": path,
            "query_string": b"",
            "headers": [(k.encode(), v.encode()) for k, v in headers.items()],
            "client": ("test", 1),
            "extensions": {"websocket.http.response": {}},
        }
        self._to_server.put_nowait({"type": "websocket.connect"})
        self.served = asyncio.create_task(app(scope, self._to_server.get, self._from_server.put))

    async def event(self) -> dict[str, Any]:
        return await asyncio.wait_for(self._from_server.get(), TIMEOUT_S)

    async def message(self) -> dict[str, Any]:
        event = await self.event()
        assert event["type"] == "websocket.send", event
        return orjson.loads(event["text"])

    def say(self, message: Any) -> None:
        text = message if isinstance(message, str) else orjson.dumps(message).decode()
        self._to_server.put_nowait({"type": "websocket.receive", "text": text})

    def subscribe(self, name: str, query: str = PLATES, **more: Any) -> None:
        self.say({"subscribe": {"id": name, "query": query, **more}})

    async def leave(self) -> None:
        self._to_server.put_nowait({"type": "websocket.disconnect", "code": 1005})
        await asyncio.wait_for(self.served, TIMEOUT_S)


Conversation = Callable[[Socket, BoardApp], Awaitable[None]]
Converse = Callable[..., None]


@pytest.fixture
def board() -> Iterator[Blackboard]:
    with Blackboard.open(None) as opened:
        yield opened


@pytest.fixture
def converse(board: Blackboard) -> Converse:
    """Has a conversation on one accepted connection, then leaves."""

    def have(conversation: Conversation, **settings: Any) -> None:
        async def run() -> None:
            flags = {key.replace("__", "."): value for key, value in settings.items()}
            app = create_app(board, load_settings(flags=flags))
            async with app.router.lifespan_context(app):
                socket = Socket(app, {"host": "localhost"})
                assert await socket.event() == {"type": "websocket.accept"}
                await conversation(socket, app)
                if not socket.served.done():
                    await socket.leave()
                assert app.live.connections == 0
                assert app.live.subscriptions == 0

        asyncio.run(run())

    return have


def put(board: Blackboard, *names: str) -> int:
    commands = [AssertFluent(Fluent(name, "Plate", Interval(1.0, 2.0))) for name in names]
    return board.execute(commands, "tests").number


def plates(bindings: Any) -> list[str]:
    return sorted(row["plate"]["value"].removeprefix(FLUENT) for row in bindings)


def test_the_first_message_is_the_present_result(converse: Converse, board: Blackboard) -> None:
    commit = put(board, "plate1")

    async def talk(socket: Socket, app: BoardApp) -> None:
        socket.subscribe("a")
        snapshot = await socket.message()
        assert (snapshot["type"], snapshot["id"]) == ("snapshot", "a")
        assert (snapshot["sequence"], snapshot["commit"]) == (0, commit)
        assert plates(snapshot["result"]["results"]["bindings"]) == ["plate1"]

    converse(talk)


def test_a_write_is_told_to_its_subscribers(converse: Converse, board: Blackboard) -> None:
    async def talk(socket: Socket, app: BoardApp) -> None:
        socket.subscribe("a", mode="both")
        await socket.message()
        commit = put(board, "plate1")
        delta = await socket.message()
        assert (delta["type"], delta["sequence"], delta["commit"]) == ("delta", 1, commit)
        assert (plates(delta["added"]), delta["removed"]) == (["plate1"], [])
        assert [event["fluent"]["name"] for event in delta["events"]] == ["plate1"]

    converse(talk)


def test_several_subscriptions_share_a_connection(converse: Converse, board: Blackboard) -> None:
    async def talk(socket: Socket, app: BoardApp) -> None:
        socket.subscribe("a")
        socket.subscribe("b", "ASK { ?plate a race:Plate }")
        first = {m["id"]: m for m in [await socket.message(), await socket.message()]}
        assert first["b"]["result"] == {"head": {}, "boolean": False}
        put(board, "plate1")
        deltas = {m["id"]: m for m in [await socket.message(), await socket.message()]}
        assert plates(deltas["a"]["added"]) == ["plate1"]
        assert deltas["b"]["boolean"] is True

    converse(talk)


def test_after_unsubscribing_nothing_is_told(converse: Converse, board: Blackboard) -> None:
    async def talk(socket: Socket, app: BoardApp) -> None:
        socket.subscribe("a")
        socket.subscribe("b")
        assert {(await socket.message())["id"], (await socket.message())["id"]} == {"a", "b"}
        socket.say({"unsubscribe": {"id": "a"}})
        assert await socket.message() == {"type": "unsubscribed", "id": "a"}
        put(board, "plate1")
        assert (await socket.message())["id"] == "b"

    converse(talk)


def test_a_client_that_comes_back_gets_what_it_missed(
    converse: Converse, board: Blackboard
) -> None:
    since = put(board, "plate1")
    put(board, "plate2")
    board.execute([EndFluent("plate1", Interval.at(5.0))], "tests")

    async def talk(socket: Socket, app: BoardApp) -> None:
        socket.subscribe("a", since=since)
        resumed = await socket.message()
        assert (resumed["type"], resumed["id"]) == ("resumed", "a")
        delta = await socket.message()
        assert (delta["type"], plates(delta["added"])) == ("delta", ["plate2"])

    converse(talk)


@pytest.mark.parametrize(
    ("said", "code", "name"),
    [
        ("{", "invalid-input", None),
        ("[]", "invalid-input", None),
        ({"hello": {}}, "invalid-input", None),
        ({"subscribe": {}, "unsubscribe": {}}, "invalid-input", None),
        ({"subscribe": {"query": PLATES}}, "invalid-input", None),
        ({"subscribe": {"id": ""}}, "invalid-input", ""),
        ({"subscribe": {"id": "a"}}, "invalid-input", "a"),
        ({"subscribe": {"id": "a", "query": "SELECT {"}}, "invalid-query", "a"),
        ({"subscribe": {"id": "a", "query": PLATES, "mode": "all"}}, "invalid-input", "a"),
        ({"subscribe": {"id": "a", "query": PLATES, "since": "1"}}, "invalid-input", "a"),
        ({"subscribe": {"id": "a", "query": PLATES, "since": -1}}, "invalid-input", "a"),
        ({"subscribe": {"id": "a", "query": PLATES, "qurey": ""}}, "invalid-input", "a"),
        ({"unsubscribe": {"id": "a"}}, "invalid-input", "a"),
    ],
)
def test_what_cannot_be_understood_is_answered_and_the_connection_goes_on(
    converse: Converse, said: Any, code: str, name: str | None
) -> None:
    async def talk(socket: Socket, app: BoardApp) -> None:
        socket.say(said)
        error = await socket.message()
        assert (error["type"], error["problem"]["code"]) == ("error", code)
        assert error.get("id") == name
        socket.subscribe("b")
        assert (await socket.message())["type"] == "snapshot"

    converse(talk)


def test_an_id_is_used_once_at_a_time(converse: Converse) -> None:
    async def talk(socket: Socket, app: BoardApp) -> None:
        socket.subscribe("a")
        await socket.message()
        socket.subscribe("a")
        assert (await socket.message())["problem"]["code"] == "invalid-input"
        assert app.live.subscriptions == 1

    converse(talk)


def test_a_connection_has_only_so_many_subscriptions(converse: Converse) -> None:
    async def talk(socket: Socket, app: BoardApp) -> None:
        socket.subscribe("a")
        await socket.message()
        socket.subscribe("b")
        problem = (await socket.message())["problem"]
        assert (problem["code"], problem["limit"]) == ("too-many-subscriptions", 1)

    converse(talk, subscriptions__per_client_max=1)


def test_a_stopping_service_says_that_it_goes_away(converse: Converse) -> None:
    async def talk(socket: Socket, app: BoardApp) -> None:
        socket.subscribe("a")
        await socket.message()
        await asyncio.wait_for(app.live.close(), TIMEOUT_S)
        assert await socket.event() == {"type": "websocket.close", "code": 1001}

    converse(talk)


def test_a_client_that_vanishes_while_subscribing_leaves_nothing(
    converse: Converse, board: Blackboard
) -> None:
    async def talk(socket: Socket, app: BoardApp) -> None:
        for number in range(20):
            socket.subscribe(f"s{number}")
        await socket.leave()

    converse(talk)


@pytest.mark.parametrize(
    ("headers", "settings", "status", "code"),
    [
        (
            {"host": "localhost", "origin": "https://evil.example"},
            {},
            403,
            "not-allowed",
        ),
        ({"host": "localhost"}, {"security.tokens": [TOKEN]}, 401, "not-authenticated"),
    ],
)
def test_who_may_not_listen_is_told_why_in_the_handshake(
    board: Blackboard,
    headers: dict[str, str],
    settings: dict[str, Any],
    status: int,
    code: str,
) -> None:
    async def run() -> None:
        app = create_app(board, load_settings(flags=settings))
        async with app.router.lifespan_context(app):
            socket = Socket(app, headers)
            start, body = await socket.event(), await socket.event()
            assert start["type"] == "websocket.http.response.start"
            assert start["status"] == status
            assert orjson.loads(body["body"])["code"] == code

    asyncio.run(run())


@pytest.mark.parametrize("path", ["/subscriptions", "/subscribe"])
def test_one_connection_too_many_is_refused_until_another_is_closed(
    board: Blackboard, path: str
) -> None:
    async def run() -> None:
        app = create_app(board, load_settings(flags={"subscriptions.connections_max": 1}))
        async with app.router.lifespan_context(app):
            first = Socket(app, {"host": "localhost"}, path)
            assert await first.event() == {"type": "websocket.accept"}
            refused = Socket(app, {"host": "localhost"}, path)
            assert (await refused.event())["status"] == 429
            problem = orjson.loads((await refused.event())["body"])
            assert (problem["code"], problem["limit"]) == ("too-many-subscriptions", 1)
            await first.leave()
            second = Socket(app, {"host": "localhost"}, path)
            assert await second.event() == {"type": "websocket.accept"}
            await second.leave()

    asyncio.run(run())


def test_a_token_admits_a_listener(board: Blackboard) -> None:
    async def run() -> None:
        app = create_app(board, load_settings(flags={"security.tokens": [TOKEN]}))
        async with app.router.lifespan_context(app):
            socket = Socket(app, {"authorization": f"Bearer {TOKEN['token']}"})
            assert await socket.event() == {"type": "websocket.accept"}
            await socket.leave()

    asyncio.run(run())


def test_subscription_at_now_tells_the_time_and_resumes_with_it() -> None:
    clock = ReplayClock(100.0)

    async def run(board: Blackboard) -> None:
        app = create_app(board, load_settings())
        async with app.router.lifespan_context(app):
            socket = Socket(app, {"host": "localhost"})
            await socket.event()
            socket.subscribe("a", at="now", mode="both")
            snapshot = await socket.message()
            assert (snapshot["at"], len(snapshot["result"]["results"]["bindings"])) == (100.0, 1)
            clock.set(200.0)
            delta = await socket.message()
            assert (delta["at"], plates(delta["removed"])) == (200.0, ["plate1"])
            assert [event["event"] for event in delta["events"]] == ["ceased"]
            socket.say({"unsubscribe": {"id": "a"}})
            assert (await socket.message())["type"] == "unsubscribed"
            socket.subscribe("a", at="now", since=snapshot["commit"], since_at=100.0)
            assert (await socket.message())["type"] == "resumed"
            assert plates((await socket.message())["removed"]) == ["plate1"]
            await socket.leave()

    with Blackboard.open(None, clock=clock) as board:
        fluent = Fluent("plate1", "Plate", Interval(1.0, 2.0), Interval.at(150.0))
        board.execute([AssertFluent(fluent)], "tests")
        asyncio.run(run(board))


def test_replay_over_a_websocket_ends_live(converse: Converse, board: Blackboard) -> None:
    first = put(board, "plate1")
    put(board, "plate2")

    async def talk(socket: Socket, app: BoardApp) -> None:
        socket.subscribe("a", replay={"commit": first, "speed": 1e6})
        kinds = [(await socket.message())["type"] for _ in range(3)]
        assert kinds == ["snapshot", "delta", "live"]
        put(board, "plate3")
        assert plates((await socket.message())["added"]) == ["plate3"]
        for wrong in ({"commit": 1, "time": 2.0}, {"pace": 1}, 3, {"commit": 1, "speed": 0}):
            socket.subscribe("b", replay=wrong)
            assert (await socket.message())["problem"]["code"] == "invalid-input"

    converse(talk)


def test_durable_subscription_is_fetched_and_acknowledged(
    converse: Converse, board: Blackboard, tmp_path: Path
) -> None:
    kept = DurableSubscriptions(tmp_path / "subscriptions.sqlite")
    kept.add(DurableSubscription("kept", PLATES, "bindings", None, None, None, "tests", 1.0))
    kept.close()
    commit = put(board, "plate1")

    async def talk(socket: Socket, app: BoardApp) -> None:
        socket.subscribe("b", durable="kept")
        assert (await socket.message())["problem"]["code"] == "invalid-input"
        socket.say({"subscribe": {"id": "a", "durable": "kept"}})
        assert (await socket.message())["type"] == "snapshot"
        socket.say({"acknowledge": {"id": "a", "durable": "kept", "since": commit}})
        told = await socket.message()
        assert told == {"type": "acknowledged", "id": "a", "commit": commit}
        put(board, "plate2")
        assert plates((await socket.message())["added"]) == ["plate2"]
        socket.say({"unsubscribe": {"id": "a"}})
        await socket.message()
        socket.say({"subscribe": {"id": "a", "durable": "kept"}})
        assert (await socket.message())["type"] == "resumed"
        assert plates((await socket.message())["added"]) == ["plate2"]

    converse(talk, storage__data=tmp_path)


def test_reader_of_a_board_that_was_set_back_is_told_of_the_gap(
    board: Blackboard, converse: Converse, tmp_path: Path
) -> None:
    put(board, "plate1")
    kept = DurableSubscriptions(tmp_path / SUBSCRIPTIONS)
    kept.add(DurableSubscription("p", PLATES, "bindings", None, None, None, "ann", 1.0))
    kept.advance("p", Position(1))
    kept.bury("p", "", b"", 0, "the board was set back", 1.0)
    kept.close()

    async def talk(socket: Socket, app: BoardApp) -> None:
        socket.say({"subscribe": {"id": "a", "durable": "p"}})
        assert [(await socket.message())["type"] for _ in range(2)] == ["gap", "snapshot"]

    converse(talk, storage__data=tmp_path)
