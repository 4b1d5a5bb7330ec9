from __future__ import annotations

import json
import socket
import threading
from collections.abc import Generator, Iterator
from contextlib import contextmanager

import pytest

from fluentboard.api.answering import Question, Result
from fluentboard.api.app import create_app
from fluentboard.api.evaluation import Costly, Evaluator
from fluentboard.api.server import Server, listening_socket
from fluentboard.board.blackboard import Blackboard
from fluentboard.board.commands import AssertFluent
from fluentboard.config import Settings
from fluentboard.model.fluent import Fluent
from fluentboard.model.interval import UNKNOWN, Interval

MUGS = 30


def query(mug: int) -> str:
    return f"/sparql?query=SELECT%20?p%20?o%20%7B%20fluent:mug{mug}%20?p%20?o%20%7D"


@contextmanager
def served(**settings: object) -> Generator[tuple[str, int]]:
    """A board in memory with some mugs, on a real socket."""
    configured = Settings.model_validate({"server": {"port": 0}, **settings})
    with Blackboard.open(None) as board, listening_socket(configured.server) as listener:
        interval = Interval.at(1.0)
        mugs = [Fluent(f"mug{n}", "Mug", interval, UNKNOWN) for n in range(MUGS)]
        board.execute([AssertFluent(mug) for mug in mugs], author="test")
        board.query("ASK {}")
        ready = threading.Event()
        server = Server(create_app(board, configured), configured, ready.set)
        thread = threading.Thread(target=lambda: server.run(sockets=[listener]))
        thread.start()
        try:
            assert ready.wait(20)
            yield listener.getsockname()
        finally:
            server.should_exit = True
            thread.join()


@pytest.fixture(scope="module")
def address() -> Iterator[tuple[str, int]]:
    with served() as where:
        yield where


class Line:
    """One connection, down to the bytes."""

    def __init__(self, address: tuple[str, int]) -> None:
        self._socket = socket.create_connection(address, timeout=20)
        self._file = self._socket.makefile("rb")

    def __enter__(self) -> Line:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()
        self._socket.close()

    def send(self, *targets: str, method: str = "GET", version: str = "1.1", **more: str) -> None:
        named = {"host": "localhost", **{name.replace("_", "-"): more[name] for name in more}}
        headers = "".join(f"{name}: {value}\r\n" for name, value in named.items())
        requests = (f"{method} {target} HTTP/{version}\r\n{headers}\r\n" for target in targets)
        self._socket.sendall("".join(requests).encode())

    def send_bytes(self, sent: bytes) -> None:
        self._socket.sendall(sent)

    def send_slowly(self, target: str) -> None:
        for byte in f"GET {target} HTTP/1.1\r\nhost: localhost\r\n\r\n".encode():
            self._socket.sendall(bytes([byte]))

    def reply(self, *, has_body: bool = True) -> tuple[int, dict[str, str], bytes]:
        status = int(self._file.readline().split()[1])
        headers: dict[str, str] = {}
        while line := self._file.readline().strip().decode():
            name, _, value = line.partition(": ")
            headers[name] = value
        body = self._file.read(int(headers["content-length"])) if has_body else b""
        return status, headers, body

    def is_over(self) -> bool:
        return self._file.read(1) == b""


def test_the_short_way_gives_the_reply_of_the_usual_way(address: tuple[str, int]) -> None:
    with Line(address) as line:
        line.send(query(3))
        short_status, short_headers, short_body = line.reply()
        line.send(query(4), origin="http://localhost")
        line.reply()
        line.send(query(3), origin="http://localhost")  # pages take the usual way
        status, headers, body = line.reply()

    assert (short_status, short_body) == (status, body) == (200, short_body)
    rows = json.loads(body)["results"]["bindings"]
    assert any(row["o"]["value"].endswith("#Mug") for row in rows)
    headers["vary"] = "Accept"
    assert short_headers.keys() == headers.keys() - {"access-control-allow-origin"}
    assert {name: short_headers[name] for name in ("content-type", "x-commit", "vary")} == {
        name: headers[name] for name in ("content-type", "x-commit", "vary")
    }


def test_requests_in_one_packet_are_answered_in_their_order(address: tuple[str, int]) -> None:
    targets = [query(n) if n % 7 else f"/fluents/mug{n}" for n in range(MUGS)]
    with Line(address) as line:
        line.send(*targets)
        replies = [line.reply() for _ in targets]

    assert [status for status, _, _ in replies] == [200] * MUGS
    for number, (_, headers, body) in enumerate(replies):
        if number % 7 == 0:
            assert json.loads(body)["name"] == f"mug{number}"
        else:
            assert headers["content-type"] == "application/sparql-results+json"


def test_a_request_may_arrive_byte_by_byte(address: tuple[str, int]) -> None:
    with Line(address) as line:
        line.send_slowly(query(5))
        assert line.reply()[0] == 200


def test_the_format_is_negotiated(address: tuple[str, int]) -> None:
    with Line(address) as line:
        line.send(query(6), accept="text/csv")
        _, headers, body = line.reply()
        assert headers["content-type"] == "text/csv; charset=utf-8"
        assert body.startswith(b"p,o\r\n")
        line.send(query(6), accept="image/png")
        assert line.reply()[0] == 406


def test_a_mistake_is_explained_as_everywhere(address: tuple[str, int]) -> None:
    with Line(address) as line:
        line.send("/sparql?query=SELECT%20?p%20%7B%20nobody:mug1%20?p%20?o%20%7D")
        status, headers, body = line.reply()
        assert (status, headers["content-type"]) == (400, "application/problem+json")
        assert "nobody" in json.loads(body)["detail"]
        line.send("/sparql?query=%ff")
        assert line.reply()[0] == 422
        line.send(query(1))
        assert line.reply()[0] == 200


def test_head_has_no_body(address: tuple[str, int]) -> None:
    with Line(address) as line:
        line.send(query(1), method="HEAD")
        assert line.reply(has_body=False)[0] == 200
        line.send(query(1))
        assert line.reply()[0] == 200


@pytest.mark.parametrize("more", [{"version": "1.0"}, {"connection": "close"}])
def test_a_connection_that_should_end_ends(address: tuple[str, int], more: dict[str, str]) -> None:
    with Line(address) as line:
        line.send(query(1), **more)
        assert line.reply()[0] == 200
        assert line.is_over()


def test_what_was_just_written_is_in_the_answer(address: tuple[str, int]) -> None:
    with Line(address) as line, Line(address) as other:
        for number in range(20):
            name = f"cup{number}"
            fluent = {"name": name, "class": "Mug", "start": 1.0}
            target, body = "/fluents", json.dumps([fluent])
            other.send(
                target,
                method="POST",
                content_type="application/json",
                content_length=str(len(body)),
            )
            other.send_bytes(body.encode())
            assert other.reply()[0] in (200, 201)
            line.send(f"/sparql?query=ASK%20%7B%20fluent:{name}%20a%20?class%20%7D")
            assert json.loads(line.reply()[2])["boolean"] is True


def test_a_query_that_takes_longer_is_looked_at_only_once(
    address: tuple[str, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    looks: list[str] = []
    look = Evaluator.at_once

    def counted(evaluator: Evaluator, question: Question) -> Result | Costly | None:
        looks.append(question.text)
        return look(evaluator, question)

    monkeypatch.setattr(Evaluator, "at_once", counted)
    with Line(address) as line:
        line.send("/sparql?query=ASK%20%7B%20?mug%20a%20race:Mug%20%7D")
        status, _, body = line.reply()
    assert (status, json.loads(body)["boolean"]) == (200, True)
    assert looks == ["ASK { ?mug a race:Mug }"]


def test_a_board_with_tokens_asks_for_one() -> None:
    token = "a-token-of-some-length"
    security = {"tokens": [{"name": "ann", "token": token, "role": "read"}]}
    with served(security=security) as address, Line(address) as line:
        line.send(query(1))
        assert line.reply()[0] == 401
        line.send(query(1), authorization=f"Bearer {token}")
        assert line.reply()[0] == 200


def test_a_host_name_that_may_be_another_page_is_refused(address: tuple[str, int]) -> None:
    with Line(address) as line:
        line.send(query(1), host="evil.example")
        assert line.reply()[0] == 403


def test_a_failure_nobody_foresaw_is_told_as_everywhere(
    address: tuple[str, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise RuntimeError("a mistake in the service")

    with Line(address) as line:
        with monkeypatch.context() as broken:
            broken.setattr(Evaluator, "at_once", fail)
            line.send(query(2))
            status, headers, _ = line.reply()
        assert (status, headers["content-type"]) == (500, "application/problem+json")
        line.send(query(2))
        assert line.reply()[0] == 200
