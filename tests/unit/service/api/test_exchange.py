from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Iterable
from typing import Any
from urllib.parse import quote

import pytest

from fluentboard.api.exchange import (
    Call,
    Disconnected,
    Message,
    StreamedReply,
    form_values,
    parsed_json,
)
from fluentboard.errors import InvalidInput, TooLarge, UnsupportedMediaType


def call_with(
    parts: Iterable[bytes], headers: dict[bytes, bytes] | None = None, *, ends: bool = True
) -> tuple[Call, list[int]]:
    """A call whose body arrives in parts, and a list that grows with every part taken."""
    waiting = list(parts)
    taken: list[int] = []

    async def receive() -> Message:
        if not waiting:
            return {"type": "http.disconnect"}
        part = waiting.pop(0)
        taken.append(len(part))
        return {"type": "http.request", "body": part, "more_body": bool(waiting) or not ends}

    scope: dict[str, Any] = {
        "type": "http",
        "method": "POST",
        "path": "/",
        "query_string": b"",
        "headers": list((headers or {}).items()),
    }
    return Call(scope, receive), taken


def test_a_body_in_parts_is_put_together() -> None:
    call, _ = call_with([b"ab", b"c", b"", b"d"])
    assert asyncio.run(call.body(4)) == b"abcd"


def test_a_body_announced_too_long_is_refused_unread() -> None:
    call, taken = call_with([b"x"], {b"content-length": b"1000000000"})
    with pytest.raises(TooLarge, match="1,000,000,000 bytes"):
        asyncio.run(call.body(100))
    assert taken == []


def test_a_body_is_refused_as_soon_as_it_is_too_long() -> None:
    call, taken = call_with([b"x" * 40] * 1_000)
    with pytest.raises(TooLarge):
        asyncio.run(call.body(100))
    assert len(taken) == 3


def test_a_compressed_body_is_refused() -> None:
    call, _ = call_with([b"x"], {b"content-encoding": b"gzip"})
    with pytest.raises(UnsupportedMediaType, match="gzip"):
        asyncio.run(call.body(100))


def test_a_body_that_breaks_off_is_nobodys() -> None:
    call, _ = call_with([b"half"], ends=False)
    with pytest.raises(Disconnected):
        asyncio.run(call.body(100))


@pytest.mark.parametrize(
    ("headers", "is_long"),
    [
        ({}, False),
        ({b"content-length": b"10"}, False),
        ({b"content-length": b"1000000"}, True),
        ({b"transfer-encoding": b"chunked"}, True),
    ],
)
def test_refusing_a_long_unread_body_is_known_to_be_expensive(
    headers: dict[bytes, bytes], is_long: bool
) -> None:
    call, _ = call_with([b"x"], headers)
    assert call.has_long_unread_body is is_long


def test_a_body_that_was_read_is_not_unread() -> None:
    call, _ = call_with([b"x"], {b"transfer-encoding": b"chunked"})
    asyncio.run(call.body(10))
    assert not call.has_long_unread_body


@pytest.mark.parametrize(
    ("body", "message"),
    [
        (b"", "is empty"),
        (b"  ", "is empty"),
        (b"{", r"line 1, column 2"),
        (b'{"a": 1,\n "b" 2}', r"line 2, column \d"),
        (b'{"a": "\xff"}', r"byte 0xff at offset 7"),
        (b'{"a": NaN}', "line 1"),
    ],
)
def test_json_that_is_none_is_refused_with_its_place(body: bytes, message: str) -> None:
    with pytest.raises(InvalidInput, match=message):
        parsed_json(body)


@pytest.mark.parametrize(
    "value", ["", "a b", "1+1=2", "50 %", "ä ö ü €", "a&b=c", "line\nbreak\r\n", "\t=", "%zz"]
)
def test_form_values_come_back_as_they_were(value: str) -> None:
    encoded = f"query={quote(value)}"
    assert form_values(encoded.encode(), "the form") == {"query": [value]}
    assert form_values(f"{encoded}&other=1".encode(), "the form")["query"] == [value]


@pytest.mark.parametrize("encoded", [b"query=a+b%20c", b"query=a%", b"query=%zz%41", b"query=a=b"])
def test_odd_escapes_are_read_as_the_standard_library_does(encoded: bytes) -> None:
    alone = form_values(encoded, "the form")
    with_another = form_values(encoded + b"&other=1", "the form")
    assert alone["query"] == with_another["query"]


def test_form_values_that_are_not_utf8_are_refused() -> None:
    with pytest.raises(InvalidInput, match="the query string"):
        form_values(b"query=%ff", "the query string")


def test_a_long_reply_ends_when_the_client_is_gone() -> None:
    made: list[int] = []

    async def chunks() -> AsyncIterator[bytes]:
        for number in range(100):
            made.append(number)
            yield b"x"

    async def send(message: Message) -> None:
        return

    async def run() -> None:
        reply = await StreamedReply(chunks(), b"text/plain").begun()
        await reply.send(send, lambda: len(made) > 3)

    asyncio.run(run())
    assert len(made) == 4


def test_what_a_long_reply_comes_from_is_let_go_of_with_the_client() -> None:
    let_go: list[str] = []

    async def chunks() -> AsyncIterator[bytes]:
        try:
            while True:
                yield b"more"
        finally:
            let_go.append("file")

    async def exchange() -> None:
        async def send(_: Message) -> None:
            return

        reply = StreamedReply(chunks(), b"text/plain")
        await reply.send(send, lambda: True)
        assert let_go == ["file"], reply

    asyncio.run(exchange())


def test_an_error_before_the_first_piece_is_still_an_error() -> None:
    async def chunks() -> AsyncIterator[bytes]:
        raise InvalidInput("not today")
        yield b"x"

    async def run() -> None:
        await StreamedReply(chunks(), b"text/plain").begun()

    with pytest.raises(InvalidInput):
        asyncio.run(run())
