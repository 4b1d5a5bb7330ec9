"""Subscriptions with a name: REST, event streams, signed posts, dead letters and explanations."""

from __future__ import annotations

import asyncio
import base64
import hashlib
import hmac
from collections.abc import AsyncGenerator, Awaitable, Callable, Iterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import httpx
import orjson
import pytest

from fluentboard.api.app import create_app
from fluentboard.api.event_stream import event_text
from fluentboard.api.live_request import position_from_text, position_text
from fluentboard.api.webhooks import Webhooks, backoff_s, new_secret, signing_key
from fluentboard.board.blackboard import Blackboard
from fluentboard.board.commands import AssertFluent, EndFluent
from fluentboard.board.subscriptions.durable import (
    DurableSubscription,
    DurableSubscriptions,
    Position,
)
from fluentboard.board.subscriptions.messages import Resumed
from fluentboard.board.subscriptions.registry import SubscriptionRegistry
from fluentboard.clock import ReplayClock
from fluentboard.config import SubscriptionSettings as LiveSettings
from fluentboard.config import load_settings
from fluentboard.errors import InvalidInput, SubscriptionExists, UnknownResource
from fluentboard.model.fluent import Fluent
from fluentboard.model.interval import Certainty, Interval

PLATES = "SELECT ?plate WHERE { ?plate a race:Plate }"
TIMEOUT_S = 10.0


@pytest.fixture
def board() -> Iterator[Blackboard]:
    with Blackboard.open(None, clock=ReplayClock(100.0)) as opened:
        yield opened


@pytest.fixture
def api(board: Blackboard, client_of: Callable[..., httpx.Client], tmp_path: Path) -> httpx.Client:
    return client_of(create_app(board, load_settings(flags={"storage.data": tmp_path})))


def put(board: Blackboard, name: str, finish: Interval | None = None) -> int:
    fluent = Fluent(name, "Plate", Interval(1.0, 2.0))
    number = board.execute([AssertFluent(fluent)], "tests").number
    if finish is not None:
        number = board.execute([EndFluent(name, finish)], "tests").number
    return number


def test_durable_subscription_is_made_read_listed_and_deleted(api: httpx.Client) -> None:
    asked = {"name": "plates", "query": PLATES, "at": "now", "certainly": True, "mode": "both"}
    made = api.post("/subscriptions", json=asked)
    assert made.status_code == 201
    assert made.headers["location"] == "/subscriptions/plates"
    assert made.json().items() >= asked.items()
    assert api.get("/subscriptions/plates").json() == made.json()
    assert api.get("/subscriptions").json()["durable"] == [made.json()]
    again = api.post("/subscriptions", json=asked)
    assert (again.status_code, again.json()["code"]) == (409, "subscription-exists")
    assert api.delete("/subscriptions/plates").status_code == 204
    gone = api.get("/subscriptions/plates")
    assert (gone.status_code, gone.json()["code"]) == (404, "unknown-resource")


@pytest.mark.parametrize(
    ("asked", "code"),
    [
        ({"name": "a b"}, "invalid-name"),
        ({"query": "SELECT {"}, "invalid-query"),
        ({"query": 3}, "invalid-input"),
        ({"mode": "all"}, "invalid-input"),
        ({"at": "noon"}, "invalid-input"),
        ({"certainly": True}, "invalid-input"),
        ({"since_at": 3.0}, "invalid-input"),
        ({"colour": "red"}, "invalid-input"),
        ({"webhook": {"url": "ftp://localhost/"}}, "invalid-input"),
        ({"webhook": {"url": "http://example.org/"}}, "not-allowed"),
        ({"webhook": {"url": "http://localhost/", "secret": "short"}}, "invalid-input"),
    ],
)
def test_what_cannot_be_kept_is_refused(
    api: httpx.Client, asked: dict[str, Any], code: str
) -> None:
    reply = api.post("/subscriptions", json={"name": "plates", "query": PLATES, **asked})
    assert reply.json()["code"] == code, reply.text


def test_secret_is_told_once(api: httpx.Client) -> None:
    asked = {"name": "posted", "query": PLATES, "webhook": {"url": "http://127.0.0.1:9/x"}}
    secret = api.post("/subscriptions", json=asked).json()["webhook"]["secret"]
    assert len(signing_key(secret)) == 32
    assert "secret" not in api.get("/subscriptions/posted").json()["webhook"]


def test_position_is_acknowledged(api: httpx.Client) -> None:
    api.post("/subscriptions", json={"name": "seen", "query": PLATES})
    reply = api.post("/subscriptions/seen/acknowledge", json={"position": "4:17@3.5"})
    assert reply.json()["seen"] == {"commit": 17, "at": 3.5}
    assert api.post("/subscriptions/seen/acknowledge", json={"position": "x"}).status_code == 422
    assert api.post("/subscriptions/seen/acknowledge", json={}).status_code == 422


def test_durable_subscriptions_survive_in_their_file(tmp_path: Path) -> None:
    path = tmp_path / "subscriptions.sqlite"
    one = DurableSubscription(
        "a", PLATES, "both", Certainty.CERTAIN, "http://localhost/", new_secret(), "me", 1.0
    )
    kept = DurableSubscriptions(path, dead_letters_max=2)
    kept.add(one)
    kept.advance("a", Position(7, 3.5, 4))
    for number in range(3):
        kept.bury("a", f"msg_{number}", b"{}", 8, "status 500", 9.0)
    with pytest.raises(SubscriptionExists):
        kept.add(one)
    kept.close()
    again = DurableSubscriptions(path)
    found = again.get("a")
    assert (found.at, found.secret, found.seen) == (one.at, one.secret, Position(7, 3.5, 4))
    assert found.is_broken
    assert [letter.delivery for letter in again.dead_letters("a")] == ["msg_1", "msg_2"]
    assert again.discard("a") == 2
    again.remove("a")
    with pytest.raises(UnknownResource):
        again.remove("a")
    again.close()
    assert path.stat().st_mode & 0o077 == 0


@pytest.mark.parametrize("seen", [Position(17, None, 1), Position(17, 1423225357.28, 40)])
def test_position_is_read_back_from_the_id_of_an_event(seen: Position) -> None:
    assert position_from_text(position_text(seen)) == seen
    assert position_from_text("17") == Position(17, None, 1)
    for text in ("x", "1:2:3", "-1", "3@nan", "3@"):
        if text != "3@":
            with pytest.raises(InvalidInput):
                position_from_text(text)


def test_event_holds_its_message_and_where_to_go_on() -> None:
    text = event_text(Resumed(3), "a")
    assert text == b'id: 1:3\ndata: {"type":"resumed","id":"a","commit":3}\n\n'


def test_wait_between_posts_doubles_up_to_a_limit() -> None:
    settings = LiveSettings(webhook_backoff_s=1.0, webhook_backoff_max_s=10.0)
    for attempt, expected_s in ((1, 1.0), (2, 2.0), (3, 4.0), (9, 10.0)):
        assert 0.75 * expected_s <= backoff_s(attempt, settings) <= 1.25 * expected_s


class Receiver:
    """The address that messages are posted to; it answers what it is told to."""

    def __init__(self) -> None:
        self.answers: list[int] = []
        self.posts: list[httpx.Request] = []
        self.changed = asyncio.Event()

    async def __call__(self, request: httpx.Request) -> httpx.Response:
        self.posts.append(request)
        self.changed.set()
        return httpx.Response(self.answers.pop(0) if self.answers else 204)

    async def messages(self, count: int) -> list[dict[str, Any]]:
        """The messages of all posts, once there are that many posts."""
        async with asyncio.timeout(TIMEOUT_S):
            while len(self.posts) < count:
                self.changed.clear()
                await self.changed.wait()
        return [m for post in self.posts[:count] for m in orjson.loads(post.content)["messages"]]


Talk = Callable[[Receiver, DurableSubscriptions, Webhooks], Awaitable[None]]


@asynccontextmanager
async def posting(
    board: Blackboard, receiver: Receiver, durable: DurableSubscriptions, **settings: Any
) -> AsyncGenerator[Webhooks]:
    flags = {f"subscriptions.{key}": value for key, value in settings.items()}
    flags["subscriptions.webhook_backoff_s"] = 0.001
    registry = SubscriptionRegistry(board, outside=board.statements())
    webhooks = Webhooks(
        registry,
        durable,
        load_settings(flags=flags).subscriptions,
        ReplayClock(1_700_000_000.0),
        httpx.MockTransport(receiver),
    )
    await webhooks.start()
    try:
        yield webhooks
    finally:
        await webhooks.close()
        registry.close()


def made(secret: str) -> DurableSubscription:
    return DurableSubscription(
        "plates", PLATES, "bindings", None, "http://localhost/plates", secret, "tests", 1.0
    )


def talk(board: Blackboard, conversation: Talk, **settings: Any) -> None:
    async def run() -> None:
        durable, receiver = DurableSubscriptions(None), Receiver()
        durable.add(made(new_secret()))
        async with posting(board, receiver, durable, **settings) as webhooks:
            await conversation(receiver, durable, webhooks)
        durable.close()

    asyncio.run(run())


async def until(reached: Callable[[], bool]) -> None:
    async with asyncio.timeout(TIMEOUT_S):
        while not reached():
            await asyncio.sleep(0.002)


def test_posts_are_signed_as_standard_webhooks_says(board: Blackboard) -> None:
    commit = put(board, "plate1")

    async def conversation(
        receiver: Receiver, durable: DurableSubscriptions, webhooks: Webhooks
    ) -> None:
        (snapshot,) = await receiver.messages(1)
        assert (snapshot["type"], snapshot["commit"]) == ("snapshot", commit)
        post = receiver.posts[0]
        stamp = post.headers["webhook-timestamp"]
        assert stamp == "1700000000"
        signed = f"{post.headers['webhook-id']}.{stamp}.".encode() + post.content
        secret = durable.get("plates").secret
        assert secret is not None
        digest = hmac.new(signing_key(secret), signed, hashlib.sha256).digest()
        assert post.headers["webhook-signature"] == "v1," + base64.b64encode(digest).decode()
        await until(lambda: durable.get("plates").seen == Position(commit, None, 1))

    talk(board, conversation)


def test_post_that_fails_is_tried_again_as_the_same_delivery(board: Blackboard) -> None:
    async def conversation(
        receiver: Receiver, durable: DurableSubscriptions, webhooks: Webhooks
    ) -> None:
        await receiver.messages(1)
        receiver.answers = [500, 503]
        put(board, "plate1")
        await receiver.messages(4)
        ids = {post.headers["webhook-id"] for post in receiver.posts[1:]}
        assert len(ids) == 1
        await until(lambda: webhooks.delivered == 2)
        assert webhooks.failed == 2
        assert durable.dead_letters("plates") == []

    talk(board, conversation)


def test_post_given_up_becomes_a_dead_letter_and_the_next_says_gap(board: Blackboard) -> None:
    async def conversation(
        receiver: Receiver, durable: DurableSubscriptions, webhooks: Webhooks
    ) -> None:
        await receiver.messages(1)
        receiver.answers = [500, 500]
        put(board, "plate1")
        await until(lambda: len(durable.dead_letters("plates")) == 1)
        (letter,) = durable.dead_letters("plates")
        assert (letter.attempts, letter.reason) == (2, "status 500")
        assert orjson.loads(letter.body)["messages"][0]["type"] == "delta"
        gap, snapshot = (await receiver.messages(4))[-2:]
        assert (gap["type"], snapshot["type"]) == ("gap", "snapshot")
        assert len(snapshot["result"]["results"]["bindings"]) == 1
        assert snapshot["sequence"] == 1
        await until(lambda: not durable.get("plates").is_broken)

    talk(board, conversation, webhook_attempts=2)


def test_address_that_is_gone_pauses_the_subscription(board: Blackboard) -> None:
    async def conversation(
        receiver: Receiver, durable: DurableSubscriptions, webhooks: Webhooks
    ) -> None:
        await receiver.messages(1)
        receiver.answers = [410]
        put(board, "plate1")
        await until(lambda: not webhooks.is_delivering("plates"))
        assert durable.get("plates").is_paused
        assert durable.dead_letters("plates") == []

    talk(board, conversation)


def test_posts_go_on_after_a_restart_with_exactly_what_was_missed(board: Blackboard) -> None:
    async def run() -> None:
        durable, receiver = DurableSubscriptions(None), Receiver()
        durable.add(made(new_secret()))
        async with posting(board, receiver, durable):
            await receiver.messages(1)
            await until(lambda: durable.get("plates").seen is not None)
        put(board, "plate1")
        last = put(board, "plate2")
        async with posting(board, receiver, durable):
            # They may come in one post or in several.
            await until(lambda: durable.get("plates").seen == Position(last, None, 3))
            resumed, *deltas = (await receiver.messages(len(receiver.posts)))[1:]
            assert resumed["type"] == "resumed"
            assert [len(delta["added"]) for delta in deltas] == [1, 1]
            assert [delta["sequence"] for delta in deltas] == [1, 2]
        durable.close()

    asyncio.run(run())


def test_explanation_says_which_tier_and_why_not_a_cheaper_one(api: httpx.Client) -> None:
    star = api.get("/explain", params={"query": PLATES}).json()
    assert (star["tier"], star["refused"], star["shapes"]) == (1, [], ["any rdf:type race:Plate"])
    count = "SELECT (COUNT(?x) AS ?n) { ?x a race:Plate }"
    counted = api.get("/explain", params={"query": count, "at": "now"}).json()
    assert counted["tier"] == 4
    assert [one["tier"] for one in counted["refused"]] == [1, 2, 3]
    assert counted["changes_with_the_clock"]
    assert api.get("/explain").status_code == 422
    assert api.get("/explain", params={"query": PLATES, "fluent": "nobody"}).status_code == 404


def test_explanation_says_why_a_fluent_does_not_matter(
    board: Blackboard, api: httpx.Client
) -> None:
    put(board, "plate1", Interval.at(50.0))

    def why(query: str, **more: str) -> dict[str, Any]:
        params = {"query": query, "fluent": "plate1", **more}
        return api.get("/explain", params=params).json()["fluent"]

    here = why(PLATES)
    assert (here["solutions"], here["conditions"][0]["met"]) == (1, True)
    assert "is in the result" in here["verdict"]
    gone = why(PLATES, at="now")
    assert (gone["solutions"], gone["holds"]) == (0, False)
    assert "does not hold now" in gone["verdict"]
    lacking = why("SELECT ?x { ?x a race:Plate ; upper:hasPose ?pose }")
    assert [one["met"] for one in lacking["conditions"]] == [True, False]
    assert "it has no upper:hasPose" in lacking["verdict"]
    other = why("SELECT ?x { ?x a race:Mug }")
    assert "its rdf:type is race:Plate" in other["verdict"]
    assert not other["last_change"]["touched"]
    filtered = why("SELECT ?x { ?x a race:Plate FILTER(?x = fluent:plate2) }")
    assert "meets each pattern by itself" in filtered["verdict"]
