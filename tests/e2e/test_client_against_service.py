"""Both clients against a real service process, also when it is killed and comes back."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from fluentboard.errors import (
    FluentExists,
    InvalidQuery,
    InvalidYaml,
    NotARefinement,
    UnknownClass,
    UnknownFluent,
    VersionMismatch,
)
from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.interval import Interval
from fluentboard_client import (
    AssertFluent,
    AsyncClient,
    Client,
    Delta,
    EndFluent,
    Event,
    Iri,
    RefineFluent,
    Snapshot,
)
from fluentboard_client.live import Subscription
from fluentboard_client.results import Term
from fluentboard_modules.demo.service_process import ServiceProcess

FLUENT = "https://w3id.org/fluentboard/fluent/"
MUGS = "SELECT ?mug WHERE { ?mug a race:Mug }"


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServiceProcess]:
    with ServiceProcess(tmp_path_factory.mktemp("board")) as running:
        yield running


@pytest.fixture
def board(service: ServiceProcess) -> Iterator[Client]:
    with Client(service.address, author="Jürgen 机器人") as client:
        yield client


def a_mug(name: str, size: float = 0.1) -> Fluent:
    return Fluent(
        name, "Mug", Interval(None, 12.5), properties=(Property("hasXSize", "xsd:float", size),)
    )


def expect(subscription: Subscription, *, rows: int) -> Event:
    """The next event that adds or holds so many rows, within 20 s."""
    while True:
        event = subscription.receive(timeout_s=20.0)
        if isinstance(event, Snapshot) and len(event.rows) == rows:
            return event
        if isinstance(event, Delta) and len(event.added) == rows:
            return event


def test_written_fluent_is_read_back(board: Client) -> None:
    receipt = board.assert_fluents(a_mug("readBack"))
    found = board.fluent("readBack")
    assert found.properties == a_mug("readBack").properties
    assert (found.start, found.version, found.author) == (
        Interval(None, 12.5),
        receipt.commit,
        "Jürgen 机器人",
    )


def test_fluent_is_refined_and_ended(board: Client) -> None:
    board.assert_fluents(a_mug("shortLived"))
    board.refine("shortLived", start=Interval(10.0, 12.5))
    board.end("shortLived", Interval(20.0, 30.0))
    kinds = [change.kind for change in board.history("shortLived")]
    assert kinds == ["added", "refined", "ended"]
    assert board.fluent("shortLived").finish == Interval(20.0, 30.0)


def test_earlier_commit_shows_the_fluent_as_it_was(board: Client) -> None:
    first = board.assert_fluents(a_mug("remembered")).commit
    board.end("remembered", 20.0)
    assert board.fluent("remembered", as_of=first).is_open


def test_batch_is_all_or_nothing(board: Client) -> None:
    board.assert_fluents(a_mug("inBatch"))
    with pytest.raises(NotARefinement):
        board.batch(
            [
                AssertFluent(a_mug("neverThere")),
                RefineFluent("inBatch", start=Interval(99.0, 100.0)),
            ]
        )
    with pytest.raises(UnknownFluent):
        board.fluent("neverThere")
    board.batch([AssertFluent(a_mug("there")), EndFluent("inBatch", 15.0)])
    assert board.fluent("there").is_open
    assert not board.fluent("inBatch").is_open


def test_errors_arrive_as_what_they_were(board: Client) -> None:
    board.assert_fluents(a_mug("unique"))
    with pytest.raises(FluentExists):
        board.assert_fluents(a_mug("unique", size=0.2))
    with pytest.raises(UnknownClass):
        board.assert_fluents(Fluent("strange", "Teapot9"))
    with pytest.raises(VersionMismatch):
        board.end("unique", 20.0, version=1)
    with pytest.raises(InvalidQuery):
        board.query("SELECT WHERE")


def test_same_key_writes_once(board: Client) -> None:
    first = board.assert_fluents(a_mug("keyed"), key="key-1")
    assert board.assert_fluents(a_mug("keyed"), key="key-1") == first


def test_listing_pages_through_a_class(board: Client) -> None:
    board.assert_fluents([Fluent(f"fork{n}", "Fork") for n in range(25)])
    found = [fluent.name for fluent in board.fluents("Fork", page_size=10)]
    assert found == [f"fork{n}" for n in range(25)]


def test_every_query_form_gives_its_kind_of_answer(board: Client) -> None:
    board.assert_fluents(a_mug("asked", size=0.25))
    rows = board.select("SELECT ?size WHERE { fluent:asked upper:hasXSize ?size }")
    assert rows == [{"size": 0.25}]
    assert board.ask("ASK { fluent:asked a race:Mug }")
    triples = board.construct("CONSTRUCT { ?s a race:Mug } WHERE { ?s a race:Mug }")
    assert "asked>" in triples


def test_query_may_look_at_one_time_only(board: Client) -> None:
    query = "ASK { fluent:grasped a race:Mug }"
    board.assert_fluents(a_mug("grasped"))
    before = board.fluent("grasped").version - 1
    board.end("grasped", Interval(20.0, 30.0))
    assert [board.ask(query, at=time_s) for time_s in (10.0, 25.0, 35.0)] == [True, True, False]
    assert not board.ask(query, at=25.0, certainly=True)
    assert not board.ask(query, as_of=before)


def test_export_can_be_imported(board: Client) -> None:
    board.assert_fluents(a_mug("exported"))
    exported = b"".join(board.export("yaml"))
    assert b"Class_Instance: [Mug, exported]" in exported
    board.import_fluents([exported])
    with pytest.raises(InvalidYaml):
        board.import_fluents([b"!Fluent\nClass_Instance: 7\n"])


def test_subscriber_sees_snapshot_and_changes(board: Client) -> None:
    with board.subscribe("SELECT ?plate WHERE { ?plate a race:Plate }") as subscription:
        assert expect(subscription, rows=0)
        commit = board.assert_fluents(Fluent("plate1", "Plate")).commit
        delta = expect(subscription, rows=1)
    assert isinstance(delta, Delta)
    plate = delta.added[0]["plate"]
    assert isinstance(plate, Iri)
    assert (plate.name, delta.commit) == ("plate1", commit)


def test_invalid_subscription_raises_what_the_board_says(board: Client) -> None:
    with board.subscribe("SELECT WHERE") as subscription, pytest.raises(InvalidQuery):
        next(subscription)


def test_closing_from_another_thread_ends_the_iteration(board: Client) -> None:
    subscription = board.subscribe("SELECT ?spoon WHERE { ?spoon a race:Spoon }")
    seen: list[Event] = []
    arrived = threading.Event()

    def listen() -> None:
        for event in subscription:
            seen.append(event)
            arrived.set()

    listener = threading.Thread(target=listen)
    listener.start()
    assert arrived.wait(20.0)
    subscription.close()
    listener.join(20.0)
    assert not listener.is_alive()
    assert len(seen) == 1


def test_subscriber_knows_what_it_missed_while_the_service_was_killed(tmp_path: Path) -> None:
    data = tmp_path / "board"
    mugs: set[Term | None] = set()
    with (
        ServiceProcess(data) as first,
        Client(first.address) as board,
        board.subscribe(MUGS) as subscription,
    ):
        port = int(first.address.rpartition(":")[2])
        board.assert_fluents(a_mug("before"))
        assert expect(subscription, rows=1)
        first.kill()
        with ServiceProcess(data, port):
            board.assert_fluents(a_mug("after"))
            while len(mugs) < 2:  # one delta, or a gap and a snapshot
                event = subscription.receive(timeout_s=20.0)
                if isinstance(event, Snapshot):
                    mugs = {row["mug"] for row in event.rows}
                elif isinstance(event, Delta):
                    mugs = {row["mug"] for row in event.added} | {FLUENT + "before"}
    assert mugs == {FLUENT + "before", FLUENT + "after"}


def test_async_client_does_the_same(service: ServiceProcess) -> None:
    async def use() -> list[str]:
        seen: list[str] = []
        async with AsyncClient(service.address) as board:
            query = "SELECT ?knife WHERE { ?knife a race:Knife }"
            async with board.subscribe(query) as subscription:
                async for event in subscription:
                    seen.append(str(event).partition(": ")[2])
                    if len(seen) == 2:
                        break
                    await board.assert_fluents(Fluent("knife1", "Knife"))
            names = [fluent.name async for fluent in board.fluents("Knife")]
            assert names == ["knife1"]
            assert await board.ask("ASK { fluent:knife1 a race:Knife }")
        return seen

    assert asyncio.run(use()) == ["no rows", "+ knife=knife1"]
