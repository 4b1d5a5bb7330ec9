"""Writing: how a route hands commands to the board and what it tells the writer."""

from __future__ import annotations

import asyncio
import re
from collections.abc import Iterable, Sequence
from concurrent.futures import Future
from typing import Any
from urllib.parse import quote

from fluentboard.api.exchange import Call, HeaderList
from fluentboard.board.blackboard import Blackboard
from fluentboard.board.commands import Command
from fluentboard.board.events import Commit, FluentEvent
from fluentboard.errors import InvalidInput, VersionMismatch
from fluentboard.model.json_format import fluent_to_json

_KEY_MAX_CHARACTERS = 200
_LONG_BATCH = 200
_ETAG = re.compile(r'(?:W/)?"(\d{1,18})"')


async def committed(board: Blackboard, call: Call, commands: Sequence[Command]) -> Commit:
    """The commit that the commands lead to, once it is durable and visible.

    Raises:
        FluentboardError: why none of them was accepted.
    """
    author, key = call.author, idempotency_key(call)
    if len(commands) < _LONG_BATCH:
        return await outcome(board.submit(commands, author, idempotency_key=key))
    future = await asyncio.to_thread(board.submit, commands, author, idempotency_key=key)
    return await outcome(future)


async def outcome(future: Future[Commit]) -> Commit:
    """Waits for another thread's future; half the price of `asyncio.wrap_future`."""
    if future.done():
        return future.result()
    loop = asyncio.get_running_loop()
    waiter: asyncio.Future[None] = loop.create_future()

    def wake() -> None:
        if not waiter.done():
            waiter.set_result(None)

    def finished(_: Future[Commit]) -> None:
        try:
            loop.call_soon_threadsafe(wake)
        except RuntimeError:
            # The loop is closed: the service stopped while the commit was on its way to the disk.
            return

    future.add_done_callback(finished)
    await waiter
    return future.result()


def remarks(board: Blackboard, commands: Sequence[Command]) -> list[str]:
    """The warnings of an accepted write."""
    return board.remarks(commands)


def commit_header(number: int) -> tuple[bytes, bytes]:
    """The header that every reply to a write has."""
    return (b"x-commit", b"%d" % number)


def fluent_headers(call: Call, name: str, version: int, commit: int) -> HeaderList:
    """Commit, address and version of the one fluent that a write was about."""
    path = f"{call.root_path}/fluents/{quote(name, safe=':@+~')}"
    return [commit_header(commit), (b"location", path.encode()), etag(version)]


def etag(version: int) -> tuple[bytes, bytes]:
    """The header that tells a fluent's version."""
    return (b"etag", b'"%d"' % version)


def expected_version(call: Call, name: str) -> int | None:
    """The version that the writer read (If-Match), or None if it does not say.

    Raises:
        VersionMismatch: the header holds no version of a fluent.
    """
    value = call.header(b"if-match")
    if value is None or value.strip() == "*":
        return None
    match = _ETAG.fullmatch(value.strip())
    if match is None:
        raise VersionMismatch(
            f"If-Match {value!r} is no version of {name!r}; send the ETag of the reply in which "
            'you read it, such as "12"',
            name=name,
        )
    return int(match[1])


def has_version(call: Call, version: int) -> bool:
    """The reader holds that version already (If-None-Match)."""
    value = call.header(b"if-none-match")
    if value is None:
        return False
    return value.strip() == "*" or str(version) in _ETAG.findall(value)


def event_json(event: FluentEvent) -> dict[str, Any]:
    """What happened to a fluent."""
    return {"event": event.kind, "fluent": fluent_to_json(event.after)}


def commit_json(commit: Commit) -> Iterable[dict[str, Any]]:
    """What happened to fluents in a commit, each with who did it and when."""
    for event in commit.events:
        yield {
            **event_json(event),
            "commit": commit.number,
            "author": commit.author,
            "wall_s": commit.wall_s,
            "reason": commit.reason,
        }


def idempotency_key(call: Call) -> str | None:
    """The key by which the same write is recognised when it is repeated.

    Raises:
        InvalidInput: it is no key.
    """
    key = call.header(b"idempotency-key")
    if key is None:
        return None
    if not key or len(key) > _KEY_MAX_CHARACTERS or not key.isprintable():
        raise InvalidInput(
            f"the Idempotency-Key is empty, longer than {_KEY_MAX_CHARACTERS} characters or has "
            "control characters; a UUID is a good key"
        )
    return key
