"""What the client sends and how it reads the replies, with a board made of functions."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator

import httpx
import pytest

from fluentboard.errors import (
    BoardUnreachable,
    FluentboardError,
    InvalidInput,
    InvalidName,
    InvalidQuery,
    UnknownFluent,
    VersionMismatch,
)
from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.interval import UNKNOWN, Interval
from fluentboard.model.json_format import fluent_to_json
from fluentboard_client import AssertFluent, Client, EndFluent, Iri, RefineFluent

MUG = Fluent("mug1", "Mug", Interval(None, 12.5), UNKNOWN, (Property("hasSize", "xsd:float", 0.1),))
Handler = Callable[[httpx.Request], httpx.Response]


def a_client(handler: Handler, retries: int = 0) -> Client:
    return Client("http://board", transport=httpx.MockTransport(handler), retries=retries)


def problem(code: str, status: int, **particulars: object) -> httpx.Response:
    body = {"type": f"https://example.org#{code}", "code": code, "status": status}
    body |= {"title": "a title", "message": "what happened", "detail": "what happened"}
    return httpx.Response(status, json={**body, **particulars})


def test_assertion_sends_statements_without_provenance_and_with_a_key() -> None:
    seen: list[httpx.Request] = []

    def board(request: httpx.Request) -> httpx.Response:
        seen.append(request)
        return httpx.Response(201, json={"commit": 7, "fluents": [], "warnings": ["note"]})

    receipt = a_client(board).assert_fluents(MUG, merge=True)

    assert (receipt.commit, receipt.warnings) == (7, ("note",))
    assert str(seen[0].url) == "http://board/fluents?merge=true"
    assert seen[0].headers["Idempotency-Key"]
    assert json.loads(seen[0].content) == {
        "fluents": [
            {
                "name": "mug1",
                "class": "Mug",
                "start": [None, 12.5],
                "finish": [None, None],
                "properties": [{"property": "hasSize", "type": "xsd:float", "value": 0.1}],
            }
        ]
    }


def test_refinement_sends_only_what_changes_and_the_version() -> None:
    seen: list[httpx.Request] = []

    def board(request: httpx.Request) -> httpx.Response:
        seen.append(request)
        return httpx.Response(200, json=fluent_to_json(MUG), headers={"X-Commit": "9"})

    receipt = a_client(board).refine("mug 1", finish=Interval(20.0, 30.0), version=4)

    assert receipt.commit == 9
    assert seen[0].method == "PATCH"
    assert seen[0].url.raw_path == b"/fluents/mug%201"
    assert seen[0].headers["If-Match"] == '"4"'
    assert json.loads(seen[0].content) == {"finish": [20.0, 30.0]}


@pytest.mark.parametrize(
    ("at", "body"),
    [(None, {}), (30.0, {"at": 30.0}), (Interval(20.0, 30.0), {"at": [20.0, 30.0]})],
)
def test_ending_says_when(at: float | Interval | None, body: object) -> None:
    def board(request: httpx.Request) -> httpx.Response:
        assert request.url.path == "/fluents/mug1/end"
        assert json.loads(request.content) == body
        return httpx.Response(200, json=fluent_to_json(MUG), headers={"X-Commit": "3"})

    assert a_client(board).end("mug1", at).commit == 3


def test_batch_sends_commands_in_order_with_the_given_key() -> None:
    def board(request: httpx.Request) -> httpx.Response:
        commands = json.loads(request.content)["commands"]
        assert [c["op"] for c in commands] == ["assert", "refine", "end"]
        assert commands[1] == {"op": "refine", "name": "a", "start": [1.0, 2.0]}
        assert commands[2] == {"op": "end", "name": "b", "finish": [3.0, None], "version": 5}
        assert request.headers["Idempotency-Key"] == "run-1"
        return httpx.Response(200, json={"commit": 4, "events": [], "warnings": []})

    batch = [
        AssertFluent(MUG),
        RefineFluent("a", start=Interval(1.0, 2.0)),
        EndFluent("b", Interval(3.0, None), version=5),
    ]
    assert a_client(board).batch(batch, key="run-1").commit == 4


def test_listing_follows_the_cursor_and_keeps_the_filter() -> None:
    def board(request: httpx.Request) -> httpx.Response:
        params = request.url.params
        assert (params["class"], params["open"], params["during"]) == ("Mug", "true", "1.0,2.5")
        following = "2" if "cursor" not in params else None
        name = "mug1" if following else "mug2"
        entry = fluent_to_json(Fluent(name, "Mug"))
        return httpx.Response(200, json={"fluents": [entry], "next": following, "commit": 1})

    found = a_client(board).fluents("Mug", is_open=True, during=(1.0, 2.5))
    assert [fluent.name for fluent in found] == ["mug1", "mug2"]


def test_select_gives_python_values() -> None:
    xsd = "http://www.w3.org/2001/XMLSchema#"

    def board(request: httpx.Request) -> httpx.Response:
        assert request.headers["Content-Type"] == "application/x-www-form-urlencoded"
        binding = {
            "a": {"type": "uri", "value": "https://example.org/fluent/mug%201"},
            "b": {"type": "literal", "value": "-INF", "datatype": xsd + "double"},
            "c": {"type": "literal", "value": "3", "datatype": xsd + "integer"},
            "d": {"type": "literal", "value": "true", "datatype": xsd + "boolean"},
            "e": {"type": "literal", "value": "text"},
        }
        return httpx.Response(
            200,
            json={"head": {"vars": list("abcdef")}, "results": {"bindings": [binding]}},
            headers={"Content-Type": "application/sparql-results+json; charset=utf-8"},
        )

    (row,) = a_client(board).select("SELECT * {}")
    subject = row["a"]
    assert isinstance(subject, Iri)
    assert subject.name == "mug 1"
    assert [row[name] for name in "bcdef"] == [-math.inf, 3, True, "text", None]


def test_ask_gives_a_truth_value() -> None:
    reply = httpx.Response(
        200,
        json={"head": {}, "boolean": True},
        headers={"Content-Type": "application/sparql-results+json"},
    )
    assert a_client(lambda _: reply).ask("ASK {}") is True


def test_construct_gives_triples_as_text() -> None:
    text = "<a:s> <a:p> <a:o> .\n"
    reply = httpx.Response(200, text=text, headers={"Content-Type": "application/n-triples"})
    assert a_client(lambda _: reply).construct("CONSTRUCT {} {}") == text
    with pytest.raises(InvalidInput, match="not a SELECT"):
        a_client(lambda _: reply).select("CONSTRUCT {} {}")


@pytest.mark.parametrize(
    ("code", "status", "error"),
    [
        ("unknown-fluent", 404, UnknownFluent),
        ("version-mismatch", 412, VersionMismatch),
        ("invalid-query", 400, InvalidQuery),
    ],
)
def test_problem_becomes_the_error_of_its_code(
    code: str, status: int, error: type[FluentboardError]
) -> None:
    client = a_client(lambda _: problem(code, status, name="mug1", version=8))
    with pytest.raises(error, match="what happened") as raised:
        client.fluent("mug1")
    assert raised.value.detail == {"name": "mug1", "version": 8}


def test_unknown_code_is_kept() -> None:
    with pytest.raises(FluentboardError, match=r"^brand-new: what happened$") as raised:
        a_client(lambda _: problem("brand-new", 418)).health()
    assert raised.value.code == "brand-new"
    assert raised.value.http_status == 418


def test_reply_that_is_no_problem_document_names_its_status() -> None:
    with pytest.raises(FluentboardError, match="http-502: http://board answered 502"):
        a_client(lambda _: httpx.Response(502, text="<html>")).health()


def test_board_that_is_not_there_is_unreachable() -> None:
    def nobody(request: httpx.Request) -> httpx.Response:
        raise httpx.ConnectError("Connection refused", request=request)

    with pytest.raises(BoardUnreachable, match=r"board cannot be reached: Connection refused"):
        a_client(nobody).fluent("mug1")
    assert not a_client(nobody).ready()


def test_broken_connection_repeats_the_write_with_the_same_key() -> None:
    keys: list[str] = []

    def board(request: httpx.Request) -> httpx.Response:
        keys.append(request.headers["Idempotency-Key"])
        if len(keys) == 1:
            raise httpx.RemoteProtocolError("Server disconnected", request=request)
        return httpx.Response(201, json={"commit": 1, "fluents": [], "warnings": []})

    assert a_client(board, retries=1).assert_fluents([MUG]).commit == 1
    assert keys[0] == keys[1]


def test_slow_board_is_not_asked_again() -> None:
    calls: list[str] = []

    def board(request: httpx.Request) -> httpx.Response:
        calls.append(request.method)
        raise httpx.ReadTimeout("", request=request)

    with pytest.raises(BoardUnreachable, match="did not answer in time; raise timeout_s"):
        a_client(board, retries=3).query("SELECT * {}")
    assert len(calls) == 1


@pytest.mark.parametrize("address", ["127.0.0.1:8080", "ftp://board", "http://", ""])
def test_address_that_is_no_url_is_refused(address: str) -> None:
    with pytest.raises(InvalidInput, match="is not a URL"):
        Client(address)


def test_import_streams_and_counts_what_it_sent() -> None:
    def board(request: httpx.Request) -> httpx.Response:
        assert request.headers["Content-Type"] == "application/x-ndjson"
        assert request.read() == b"onetwo"
        return httpx.Response(200, json={"imported": 2})

    def pieces() -> Iterator[bytes]:
        yield b"one"
        yield b"two"

    sent: list[int] = []
    account = a_client(board).import_fluents(pieces(), "jsonl", progress=sent.append)
    assert (account, sent) == ({"imported": 2}, [3, 3])


def test_export_raises_the_problem_instead_of_yielding_it() -> None:
    with pytest.raises(InvalidInput, match="what happened"):
        list(a_client(lambda _: problem("invalid-input", 422)).export("yaml"))


def test_author_of_any_script_is_sent_in_utf_8() -> None:
    seen: list[httpx.Request] = []

    def board(request: httpx.Request) -> httpx.Response:
        seen.append(request)
        return httpx.Response(200, json=fluent_to_json(MUG))

    transport = httpx.MockTransport(board)
    Client("http://board", author="Jürgen 机器人", transport=transport).fluent("mug1")
    assert dict(seen[0].headers.raw)[b"X-Author"].decode() == "Jürgen 机器人"


@pytest.mark.parametrize(("author", "token"), [("ann\r\nX-Evil: 1", None), ("ann", "secret\n")])
def test_line_break_in_a_header_is_refused_before_anything_is_sent(
    author: str, token: str | None
) -> None:
    with pytest.raises(InvalidInput, match="control characters"):
        Client("http://board", author=author, token=token)


@pytest.mark.parametrize("name", ["", ".", "..", "a/b"])
def test_name_that_would_lead_to_another_path_is_refused(name: str) -> None:
    client = a_client(lambda request: httpx.Response(200, json={}))
    for read in (client.fluent, client.history, client.trajectory, client.subscriptions.read):
        with pytest.raises(InvalidName, match="nothing on a board"):
            read(name)
