"""SEPA's dialect of live queries, without a network."""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import Awaitable, Callable, Iterator
from typing import Any

import httpx
import orjson
import pytest

from fluentboard.api.app import BoardApp, create_app
from fluentboard.board.blackboard import Blackboard
from fluentboard.board.commands import AssertFluent, CorrectFluent
from fluentboard.config import load_settings
from fluentboard.model.fluent import Fluent
from fluentboard_ontology import FLUENT

PLATES = "SELECT ?plate WHERE { ?plate a race:Plate }"
TOKEN = {"name": "viewer", "role": "read", "token": "reader-secret-0001"}
TIMEOUT_S = 10.0


class Socket:
    """A client's end of one WebSocket."""

    def __init__(self, app: BoardApp, headers: dict[str, str]) -> None:
        self._to_server: asyncio.Queue[dict[str, Any]] = asyncio.Queue()
        self._from_server: asyncio.Queue[Any] = asyncio.Queue()
        scope: dict[str, Any] = {
            "type": "websocket",
            "path": "/subscribe",
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

    async def notification(self) -> dict[str, Any]:
        return (await self.message())["notification"]

    def say(self, message: Any) -> None:
        text = message if isinstance(message, str) else orjson.dumps(message).decode()
        self._to_server.put_nowait({"type": "websocket.receive", "text": text})

    def subscribe(self, alias: str, query: str = PLATES, **more: Any) -> None:
        self.say({"subscribe": {"sparql": query, "alias": alias, **more}})

    async def leave(self) -> None:
        self._to_server.put_nowait({"type": "websocket.disconnect", "code": 1005})
        await asyncio.wait_for(self.served, TIMEOUT_S)


Conversation = Callable[[Socket], Awaitable[None]]
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
                await conversation(socket)
                await socket.leave()
                assert app.live.connections == app.live.subscriptions == 0

        asyncio.run(run())

    return have


def put(board: Blackboard, *names: str) -> None:
    board.execute([AssertFluent(Fluent(name, "Plate")) for name in names], "tests")


def become(board: Blackboard, name: str, class_name: str) -> None:
    board.execute([CorrectFluent(Fluent(name, class_name), "seen better")], "tests")


def plates(results: Any) -> list[str]:
    found = [row["plate"]["value"] for row in results["results"]["bindings"]]
    return sorted(name.removeprefix(FLUENT) for name in found)


def test_the_first_notification_is_the_present_result(
    converse: Converse, board: Blackboard
) -> None:
    put(board, "plate1")

    async def talk(socket: Socket) -> None:
        socket.subscribe("mine")
        first = await socket.notification()
        assert (first["alias"], first["sequence"]) == ("mine", 0)
        assert first["spuid"].startswith("sepa://spuid/")
        assert first["addedResults"]["head"] == {"vars": ["plate"]}
        assert plates(first["addedResults"]) == ["plate1"]
        assert first["removedResults"] == {}

    converse(talk)


def test_later_notifications_tell_what_came_and_went(converse: Converse, board: Blackboard) -> None:
    async def talk(socket: Socket) -> None:
        socket.subscribe("mine")
        empty = await socket.notification()
        assert empty["addedResults"] == {"head": {"vars": ["plate"]}, "results": {"bindings": []}}
        put(board, "plate1")
        came = await socket.notification()
        assert (came["sequence"], plates(came["addedResults"])) == (1, ["plate1"])
        assert came["removedResults"] == {}
        become(board, "plate1", "Mug")
        went = await socket.notification()
        assert (went["sequence"], went["addedResults"]) == (2, {})
        assert plates(went["removedResults"]) == ["plate1"]
        assert went["spuid"] == empty["spuid"]

    converse(talk)


def test_a_client_that_lagged_is_told_the_difference(converse: Converse, board: Blackboard) -> None:
    """SEPA has no word for lost messages, so none may be lost."""

    async def talk(socket: Socket) -> None:
        socket.subscribe("mine")
        found = Counter(plates((await socket.notification())["addedResults"]))
        for number in range(60):
            put(board, f"plate{number}")
        become(board, "plate0", "Mug")
        put(board, "last")
        sequence = 0
        while "last" not in found:
            told = await socket.notification()
            sequence += 1
            assert told["sequence"] == sequence
            found.update(plates(told["addedResults"]) if told["addedResults"] else [])
            found.subtract(plates(told["removedResults"]) if told["removedResults"] else [])
        assert +found == Counter([f"plate{number}" for number in range(1, 60)] + ["last"])

    converse(talk, subscriptions__queue_messages=2)


def test_the_answer_of_an_ask_is_told(converse: Converse, board: Blackboard) -> None:
    async def talk(socket: Socket) -> None:
        socket.subscribe("mine", "ASK { ?plate a race:Plate }")
        assert (await socket.notification())["addedResults"]["boolean"] is False
        put(board, "plate1")
        assert (await socket.notification())["addedResults"]["boolean"] is True

    converse(talk)


def test_graphs_can_be_named_beside_the_query(converse: Converse, board: Blackboard) -> None:
    board.graphs.update('INSERT DATA { GRAPH <urn:g> { <urn:a> <urn:p> "in" } }', "tests")
    board.graphs.update('INSERT DATA { <urn:a> <urn:p> "out" }', "tests")

    async def talk(socket: Socket) -> None:
        query = "SELECT ?x WHERE { <urn:a> <urn:p> ?x }"
        socket.subscribe("mine", query, **{"default-graph-uri": "urn:g"})
        bindings = (await socket.notification())["addedResults"]["results"]["bindings"]
        assert [row["x"]["value"] for row in bindings] == ["in"]

    converse(talk)


def test_unsubscribing_ends_one_subscription(converse: Converse, board: Blackboard) -> None:
    async def talk(socket: Socket) -> None:
        socket.subscribe("one", httpsAgent={"settings": "of the client's own"})
        socket.subscribe("two")
        told = {n["alias"]: n["spuid"] for n in [await socket.notification() for _ in range(2)]}
        socket.say({"unsubscribe": {"spuid": told["one"], "alias": "one"}})
        assert await socket.message() == {"unsubscribed": {"spuid": told["one"], "alias": "one"}}
        put(board, "plate1")
        assert (await socket.notification())["alias"] == "two"

    converse(talk)


@pytest.mark.parametrize(
    ("message", "code", "status"),
    [
        ({"subscribe": {"sparql": "SELECT", "alias": "a"}}, "invalid-query", 400),
        ({"subscribe": {"alias": "a"}}, "invalid-input", 422),
        ({"unsubscribe": {"spuid": "sepa://spuid/none", "alias": "a"}}, "invalid-input", 422),
    ],
)
def test_a_mistake_is_told_with_its_alias(
    converse: Converse, message: dict[str, Any], code: str, status: int
) -> None:
    async def talk(socket: Socket) -> None:
        socket.say(message)
        error = await socket.message()
        assert (error["error"], error["status_code"], error["alias"]) == (code, status, "a")
        assert error["error_description"]
        socket.say("{")
        assert (await socket.message())["error"] == "invalid-input"

    converse(talk)


def test_a_token_may_come_with_every_message(converse: Converse, board: Blackboard) -> None:
    put(board, "plate1")

    async def talk(socket: Socket) -> None:
        socket.subscribe("mine")
        assert (await socket.message())["status_code"] == 401
        socket.subscribe("mine", authorization="Bearer wrong-secret-00001")
        assert (await socket.message())["error"] == "not-authenticated"
        socket.subscribe("mine", authorization=f"Bearer {TOKEN['token']}")
        spuid = (await socket.notification())["spuid"]
        socket.say({"unsubscribe": {"spuid": spuid}})
        assert (await socket.message())["error"] == "not-authenticated"
        # sepy sends the bare token beside the body
        socket.say({"unsubscribe": {"spuid": spuid}, "authorization": TOKEN["token"]})
        assert (await socket.message())["unsubscribed"]["spuid"] == spuid

    converse(talk, security__tokens=[TOKEN])


def test_the_configuration_names_where_everything_is(
    board: Blackboard, client_of: Callable[[BoardApp], httpx.Client]
) -> None:
    api = client_of(create_app(board, load_settings()))
    found = api.get("/subscribe", headers={"Host": "robot1:8080"}).json()
    assert found["host"] == "robot1"
    assert found["sparql11protocol"]["port"] == 8080
    assert found["sparql11protocol"]["update"]["path"] == "/sparql"
    assert found["sparql11seprotocol"]["availableProtocols"] == {
        "ws": {"port": 8080, "path": "/subscribe"}
    }
