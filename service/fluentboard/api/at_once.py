"""At once: uvicorn's HTTP protocol with a short way for queries that are answered without waiting.

A request takes uvicorn and ASGI a task, an event, two messages and as many checks of the headers:
more time than a point query takes the RDF store. A GET of `/sparql` that can be answered where it
is read, from the bytes that have arrived, is written straight to the connection. Everything else
goes the usual way, and so does everything that is in any way unusual.
"""

from __future__ import annotations

from typing import Any, Protocol, cast

from uvicorn.config import Config
from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol, RequestResponseCycle
from uvicorn.server import ServerState

from fluentboard.api.exchange import Reply, Scope

_TARGET = b"/sparql?query="

# How many requests of one piece of data are answered before other connections have their turn.
_IN_A_ROW_MAX = 8

# What only the usual way knows how to treat.
_UNUSUAL = (b"origin", b"transfer-encoding", b"expect", b"upgrade")


class AnswersAtOnce(Protocol):
    """An application that can answer some requests without waiting."""

    def at_once(
        self, query_string: bytes, headers: dict[bytes, bytes], scope: Scope
    ) -> Reply | None:
        """The reply to a GET of `/sparql`, or None if it takes the usual way with its scope."""
        ...


class AtOnceProtocol(HttpToolsProtocol):
    """HTTP/1.1 on one connection. uvicorn makes one for each."""

    def __init__(
        self, config: Config, server_state: ServerState, app_state: dict[str, Any], **options: Any
    ) -> None:
        super().__init__(config, server_state, app_state, **options)
        self._service = cast("AnswersAtOnce", config.app)
        self._reply: Reply | None = None
        self._left = 0

    def data_received(self, data: bytes) -> None:
        """Takes what has arrived: a part of a request, or several of them."""
        self._left = _IN_A_ROW_MAX
        super().data_received(data)

    def on_headers_complete(self) -> None:
        """Answers, or hands the request on to the application."""
        if self._left > 0 and self.url.startswith(_TARGET):
            self._reply = self._answered()
            if self._reply is not None:
                self._left -= 1
                return
        super().on_headers_complete()

    def on_body(self, body: bytes) -> None:
        """Takes a part of the body; what is answered at once has none."""
        if self._reply is None:
            super().on_body(body)

    def on_message_complete(self) -> None:
        """Sends the reply, if there is one."""
        reply = self._reply
        if reply is None:
            super().on_message_complete()
            return
        self._reply = None
        self.transport.write(self._text(reply))
        self.on_response_complete()

    def _answered(self) -> Reply | None:
        cycle = cast("RequestResponseCycle | None", self.cycle)
        is_busy = cycle is not None and not cycle.response_complete
        if is_busy or self.access_log or self.root_path or self.flow.write_paused:
            return None
        parser = self.parser
        assert parser is not None, "a connection that is lost receives nothing"
        if parser.get_method() != b"GET" or parser.get_http_version() != "1.1":
            return None
        headers = dict(self.headers)
        if headers.get(b"content-length", b"0") != b"0" or not parser.should_keep_alive():
            return None
        if any(name in headers for name in _UNUSUAL):
            return None
        query_string = self.url.partition(b"?")[2]
        if b"#" in query_string:
            return None
        return self._service.at_once(query_string, headers, cast("Scope", self.scope))

    def _text(self, reply: Reply) -> bytes:
        parts = [b"HTTP/1.1 200 OK\r\n"]
        for name, value in (*self.server_state.default_headers, *reply.headers):
            parts += (name, b": ", value, b"\r\n")
        parts += (b"\r\n", reply.body)
        return b"".join(parts)
