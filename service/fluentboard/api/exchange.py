"""Call and Reply: one HTTP request and its answer, thin enough for the hot routes.

A route is an async function from a `Call` to a `Reply`. It raises FluentboardErrors; the edge turns
them into problem documents.
"""

from __future__ import annotations

from binascii import a2b_qp
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping, MutableMapping
from typing import Any, NamedTuple
from urllib.parse import parse_qsl, unquote_plus

import orjson

from fluentboard.api.security import ANYONE, Principal
from fluentboard.errors import InvalidInput, TooLarge, UnsupportedMediaType

Scope = MutableMapping[str, Any]
Message = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Message]]
Send = Callable[[Message], Awaitable[None]]
HeaderList = list[tuple[bytes, bytes]]

JSON = b"application/json"

_SHORT_BODY_BYTES = 64 * 1024


class Disconnected(Exception):
    """The client went away before its request was read; there is nobody to answer."""


FORESEEN = "fluentboard.foreseen"
"""Where a scope keeps what is foreseen."""


class Foreseen(NamedTuple):
    """What was found out about a request before it took the usual way.

    Attributes:
        parameters: of its query string.
        is_costly: it asks what cannot be answered without waiting, neither then nor later.
    """

    parameters: dict[str, list[str]]
    is_costly: bool


class Call:
    """One request.

    Attributes:
        method: `GET`, `POST` and so on; `HEAD` is seen as `GET`.
        path: decoded, without the root path.
        headers: by lower-case name; of a repeated header the last.
        arguments: values of the `{name}` parts of the route's path.
        principal: who calls.
    """

    __slots__ = (
        "_is_read",
        "_receive",
        "_scope",
        "arguments",
        "headers",
        "method",
        "path",
        "principal",
    )

    def __init__(self, scope: Scope, receive: Receive, path: str | None = None) -> None:
        self._scope = scope
        self._receive = receive
        self._is_read = False
        self.method: str = scope.get("method", "GET")
        self.path: str = scope["path"] if path is None else path
        self.headers: dict[bytes, bytes] = dict(scope["headers"])
        self.arguments: Mapping[str, str] = {}
        self.principal: Principal = ANYONE

    def header(self, name: bytes) -> str | None:
        """The value of a header, or None."""
        value = self.headers.get(name)
        return None if value is None else value.decode("latin-1")

    @property
    def author(self) -> str:
        """Whom the commits of this request are attributed to."""
        named = self.principal.name
        if named is not None:
            return named
        value = self.headers.get(b"x-author")
        if not value:
            return "anonymous"
        # Header bytes are latin-1 by tradition, but clients send UTF-8.
        author = value.decode("utf-8", "replace").strip()
        if len(author) > 200 or not author.isprintable():
            raise InvalidInput(
                "the header X-Author is longer than 200 characters or has control characters; "
                "give a short name"
            )
        return author or "anonymous"

    @property
    def query_string(self) -> bytes:
        """What follows the `?`, still encoded."""
        return self._scope["query_string"]

    @property
    def scheme(self) -> str:
        """`http` or `https`."""
        return self._scope.get("scheme", "http")

    @property
    def root_path(self) -> str:
        """Path under which a proxy serves the board; mostly empty."""
        return self._scope.get("root_path", "")

    @property
    def foreseen(self) -> Foreseen | None:
        """What the server found out when it tried to answer without waiting; None if it did not."""
        return self._scope.get(FORESEEN)

    def parameters(self) -> dict[str, list[str]]:
        """The parameters of the query string, each with all its values.

        Raises:
            InvalidInput: a value is not UTF-8.
        """
        foreseen = self.foreseen
        if foreseen is not None:
            return foreseen.parameters
        return form_values(self._scope["query_string"], "the query string")

    @property
    def media_type(self) -> str:
        """Media type of the body in lower case, without parameters; empty if none is given."""
        value = self.headers.get(b"content-type")
        return "" if value is None else value.partition(b";")[0].strip().lower().decode("latin-1")

    async def body(self, limit_bytes: int) -> bytes:
        """The whole body.

        Raises:
            TooLarge: it is longer than the limit; no more than the limit was kept.
            UnsupportedMediaType: it is compressed.
        """
        self._check_announced(limit_bytes)
        message = await self._receive()
        if message["type"] == "http.request" and not message.get("more_body"):
            self._is_read = True
            return _within(message.get("body", b""), limit_bytes)
        parts: list[bytes] = []
        size = 0
        while message["type"] == "http.request":
            part: bytes = message.get("body", b"")
            size += len(part)
            if size > limit_bytes:
                raise body_too_large(limit_bytes)
            parts.append(part)
            if not message.get("more_body"):
                self._is_read = True
                return b"".join(parts)
            message = await self._receive()
        raise Disconnected

    async def chunks(self, limit_bytes: int) -> AsyncIterator[bytes]:
        """The body in the pieces in which it arrives.

        Raises:
            TooLarge: it is longer than the limit.
            UnsupportedMediaType: it is compressed.
        """
        self._check_announced(limit_bytes)
        size = 0
        while True:
            message = await self._receive()
            if message["type"] != "http.request":
                raise Disconnected
            part: bytes = message.get("body", b"")
            size += len(part)
            if size > limit_bytes:
                raise body_too_large(limit_bytes)
            self._is_read = not message.get("more_body")
            if part:
                yield part
            if self._is_read:
                return

    async def gone(self) -> None:
        """Returns when the client has closed the connection; only after the body was read."""
        while (await self._receive())["type"] == "http.request":
            pass

    @property
    def has_long_unread_body(self) -> bool:
        """So much of the body is still to come that refusing it should close the connection."""
        if self._is_read:
            return False
        announced = self.headers.get(b"content-length", b"")
        if announced.isdigit():
            return int(announced) > _SHORT_BODY_BYTES
        return b"transfer-encoding" in self.headers

    async def drain(self, limit_bytes: int) -> None:
        """Reads and forgets what is left of the body, up to a limit."""
        left = limit_bytes
        while left > 0:
            message = await self._receive()
            if message["type"] != "http.request" or not message.get("more_body"):
                return
            left -= len(message.get("body", b"")) + 1

    def _check_announced(self, limit_bytes: int) -> None:
        announced = self.headers.get(b"content-length")
        if announced is not None and announced.isdigit() and int(announced) > limit_bytes:
            raise body_too_large(limit_bytes, int(announced))
        encoding = self.headers.get(b"content-encoding", b"identity").strip().lower()
        if encoding not in (b"", b"identity"):
            raise UnsupportedMediaType(
                f"the body is encoded as {encoding.decode('latin-1')}; send it uncompressed",
                accepted=["identity"],
            )


class Reply:
    """A whole answer."""

    __slots__ = ("body", "headers", "status")

    def __init__(
        self,
        body: bytes = b"",
        media_type: bytes = JSON,
        status: int = 200,
        headers: HeaderList | None = None,
    ) -> None:
        self.status = status
        self.body = body
        length = (b"content-length", b"%d" % len(body))
        if status == 204 or status == 304:
            self.headers = headers or []
        elif headers:
            self.headers = [(b"content-type", media_type), length, *headers]
        else:
            self.headers = [(b"content-type", media_type), length]

    async def send(self, send: Send) -> None:
        """Sends status, headers and body."""
        await send({"type": "http.response.start", "status": self.status, "headers": self.headers})
        await send({"type": "http.response.body", "body": self.body})


class StreamedReply:
    """An answer sent piece by piece.

    Args:
        chunks: the pieces; if one fails, the connection is cut, so that the client cannot take a
            part for the whole.
        media_type: of the whole.
        length: in bytes, where known.
        headers: further headers.
    """

    __slots__ = ("_chunks", "_first", "headers", "status")

    is_endless = False
    """It lasts until the client goes; then its sending is cancelled, whatever it waits for."""

    def __init__(
        self,
        chunks: AsyncIterator[bytes],
        media_type: bytes,
        length: int | None = None,
        headers: HeaderList | None = None,
    ) -> None:
        self.status = 200
        self._chunks = chunks
        self._first = b""
        self.headers: HeaderList = [(b"content-type", media_type), *(headers or [])]
        if length is not None:
            self.headers.append((b"content-length", b"%d" % length))

    async def begun(self) -> StreamedReply:
        """The reply with its first piece made: an error in it can still become a problem."""
        self._first = await anext(self._chunks, b"")
        return self

    async def drop(self) -> None:
        """Lets go of the pieces, where only the headers are wanted."""

    def start(self) -> Message:
        """Status and headers."""
        return {"type": "http.response.start", "status": self.status, "headers": self.headers}

    async def send(self, send: Send, is_gone: Callable[[], bool] = lambda: False) -> None:
        """Sends status and headers, then every piece, until the client is gone."""
        await send(self.start())
        await send({"type": "http.response.body", "body": self._first, "more_body": True})
        try:
            async for chunk in self._chunks:
                if is_gone():
                    return
                await send({"type": "http.response.body", "body": chunk, "more_body": True})
        finally:
            # What the pieces come from is let go of now, and not when somebody collects garbage.
            close = getattr(self._chunks, "aclose", None)
            if close is not None:
                await close()
        await send({"type": "http.response.body", "body": b"", "more_body": False})


Handler = Callable[[Call], Awaitable[Reply | StreamedReply]]


def json_reply(value: Any, status: int = 200, headers: HeaderList | None = None) -> Reply:
    """The value as a JSON document."""
    return Reply(orjson.dumps(value), JSON, status, headers)


def parsed_json(body: bytes) -> Any:
    """The value of a JSON body.

    Raises:
        InvalidInput: it is not UTF-8 or not JSON; the message says at which line and column.
    """
    try:
        return orjson.loads(body)
    except orjson.JSONDecodeError as problem:
        if not body.strip():
            raise InvalidInput("the body is empty; send a JSON document") from None
        utf8_text(body)
        raise InvalidInput(
            f"the body is not JSON: {problem.msg} (line {problem.lineno}, column {problem.colno})",
            line=problem.lineno,
            column=problem.colno,
        ) from None


def utf8_text(body: bytes, what: str = "the body") -> str:
    """The bytes as text.

    Raises:
        InvalidInput: they are not UTF-8; the message says where.
    """
    try:
        return body.decode()
    except UnicodeDecodeError as problem:
        raise InvalidInput(
            f"{what} is not UTF-8: byte 0x{body[problem.start]:02x} at offset {problem.start}; "
            "encode it as UTF-8",
            offset=problem.start,
        ) from None


def form_values(encoded: bytes, what: str) -> dict[str, list[str]]:
    """The values of `application/x-www-form-urlencoded` text.

    Raises:
        InvalidInput: a value is not UTF-8.
    """
    try:
        # One parameter is the common case, and three times faster without parse_qsl.
        if encoded.count(b"=") == 1 and b"&" not in encoded:
            key, _, value = encoded.partition(b"=")
            return {key.decode("ascii"): [_unquoted(value)]}
        values: dict[str, list[str]] = {}
        for key, value in parse_qsl(encoded.decode(), keep_blank_values=True, errors="strict"):
            values.setdefault(key, []).append(value)
        return values
    except ValueError:
        raise InvalidInput(f"{what} is not percent-encoded UTF-8") from None


def _unquoted(value: bytes) -> str:
    """Like `unquote_plus`, in a tenth of the time: quoted-printable is decoded in C."""
    if b"\n" not in value and b"\r" not in value:
        text = a2b_qp(value.replace(b"=", b"%3D").replace(b"+", b" ").replace(b"%", b"="))
        # Every good escape makes the text two bytes shorter, a malformed one does not.
        if len(text) == len(value) - 2 * value.count(b"%"):
            return text.decode()
    return unquote_plus(value.decode("ascii"), errors="strict")


def body_too_large(limit_bytes: int, size_bytes: int | None = None) -> TooLarge:
    """The refusal of a body."""
    size = "longer" if size_bytes is None else f"{size_bytes:,} bytes long, more"
    return TooLarge(
        f"the body is {size} than the {limit_bytes:,} bytes that this request may have; send it "
        "in parts, use POST /import for many fluents, or raise the limit in the settings",
        limit_bytes=limit_bytes,
    )


def _within(body: bytes, limit_bytes: int) -> bytes:
    if len(body) > limit_bytes:
        raise body_too_large(limit_bytes)
    return body
