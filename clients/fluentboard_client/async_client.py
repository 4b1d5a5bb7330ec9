"""AsyncClient: read, write, end and query fluents over HTTP from an event loop."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncGenerator, AsyncIterator, Callable, Iterable, Sequence
from contextlib import asynccontextmanager
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Literal, Self, cast

import httpx

from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.interval import Interval
from fluentboard_client import exchange, trajectories
from fluentboard_client.client import DEFAULT_BOARD
from fluentboard_client.commands import Command, RefineFluent
from fluentboard_client.exchange import (
    ChangesFormat,
    ExportFormat,
    FluentChange,
    ImportFormat,
    RdfVocabulary,
    Receipt,
    Time,
)
from fluentboard_client.results import Row
from fluentboard_client.streams import counted_async, file_pieces
from fluentboard_client.subscriptions import AsyncDurableSubscriptions
from fluentboard_client.subscriptions import options as live_options
from fluentboard_client.trajectories import Trajectory

if TYPE_CHECKING:
    from fluentboard_client.conversation import Mode
    from fluentboard_client.live import AsyncSubscription


class AsyncClient:
    """A board, reached over HTTP.

    Every write carries an idempotency key, so a write that is repeated after a broken connection
    takes effect once. Methods raise the errors that the board raised (`UnknownFluent`,
    `FluentExists` and so on), and `BoardUnreachable` when there is no board.

    Its methods are those of `Client`, to be awaited. As a context manager it closes its
    connections.

    Args:
        board: address of the board.
        author: who writes; the journal keeps it.
        token: bearer token, where the board asks for one.
        timeout_s: how long to wait for a reply.
        retries: how often a request is repeated when the connection fails.
        transport: replaces the network, in tests.
    """

    def __init__(
        self,
        board: str = DEFAULT_BOARD,
        *,
        author: str = "",
        token: str | None = None,
        timeout_s: float = 30.0,
        retries: int = 3,
        transport: httpx.AsyncBaseTransport | None = None,
    ) -> None:
        self.board = exchange.board_address(board)
        self._headers = exchange.headers(author, token)
        self._retries = retries
        self._timeout_s = timeout_s
        self._http = httpx.AsyncClient(
            base_url=self.board,
            headers=self._headers,
            timeout=timeout_s,
            transport=transport,
            trust_env=not exchange.is_loopback(self.board),
        )

    async def assert_fluents(
        self, fluents: Fluent | Iterable[Fluent], *, merge: bool = False, key: str | None = None
    ) -> Receipt:
        """See `Client.assert_fluents`."""
        several = [fluents] if isinstance(fluents, Fluent) else list(fluents)
        return exchange.receipt(await self._send(exchange.assertion(several, merge, key)))

    async def refine(
        self,
        name: str,
        *,
        start: Interval | None = None,
        finish: Interval | None = None,
        properties: Sequence[Property] = (),
        version: int | None = None,
        key: str | None = None,
    ) -> Receipt:
        """See `Client.refine`."""
        command = RefineFluent(name, start, finish, tuple(properties), version)
        return exchange.receipt(await self._send(exchange.refinement(command, key)))

    async def end(
        self,
        name: str,
        at: float | Interval | None = None,
        *,
        version: int | None = None,
        key: str | None = None,
    ) -> Receipt:
        """See `Client.end`."""
        return exchange.receipt(await self._send(exchange.ending(name, at, version, key)))

    async def batch(self, commands: Iterable[Command], *, key: str | None = None) -> Receipt:
        """See `Client.batch`."""
        return exchange.receipt(await self._send(exchange.batch(commands, key)))

    async def import_fluents(
        self,
        source: Path | Iterable[bytes],
        format: ImportFormat = "yaml",
        *,
        graph: str | None = None,
        progress: Callable[[int], None] | None = None,
    ) -> dict[str, Any]:
        """See `Client.import_fluents`."""
        pieces = file_pieces(source) if isinstance(source, Path) else source
        try:
            reply = await self._http.post(
                "/import",
                params=exchange.import_params(graph),
                content=counted_async(pieces, progress),
                headers={"Content-Type": exchange.MEDIA_TYPES[format]},
                timeout=httpx.Timeout(self._timeout_s, read=None),
            )
        except httpx.TransportError as failure:
            raise exchange.unreachable(self.board, failure, 1) from failure
        exchange.check(reply, self.board)
        return cast("dict[str, Any]", reply.json())

    async def fluent(self, name: str, *, as_of: int | None = None) -> Fluent:
        """See `Client.fluent`."""
        return exchange.fluent_of(await self._send(exchange.fluent(name, as_of)))

    async def history(self, name: str) -> list[FluentChange]:
        """See `Client.history`."""
        return exchange.changes_of(await self._send(exchange.history(name)))

    async def fluents(
        self,
        class_name: str | None = None,
        *,
        at: Time | None = None,
        during: tuple[float, float] | None = None,
        certainly: bool = False,
        property_name: str | None = None,
        value: str | None = None,
        is_open: bool | None = None,
        as_of: int | None = None,
        page_size: int = 500,
    ) -> AsyncIterator[Fluent]:
        """See `Client.fluents`."""
        cursor: str | None = None
        while True:
            request = exchange.listing(
                class_name=class_name,
                at=at,
                during=during,
                certainly=certainly,
                property_name=property_name,
                value=value,
                is_open=is_open,
                as_of=as_of,
                page_size=page_size,
                cursor=cursor,
            )
            page, cursor = exchange.page_of(await self._send(request))
            for entry in page:
                yield entry
            if cursor is None:
                return

    async def trajectory(
        self,
        name: str,
        *,
        at: Sequence[Time] = (),
        during: tuple[float, float] | None = None,
        as_of: int | None = None,
    ) -> Trajectory:
        """See `Client.trajectory`."""
        request = trajectories.trajectory(name, at, during, as_of)
        return trajectories.trajectory_of(await self._send(request))

    async def query(
        self,
        sparql: str,
        *,
        at: Time | None = None,
        certainly: bool = False,
        as_of: int | None = None,
    ) -> list[Row] | bool | str:
        """See `Client.query`."""
        return exchange.result_of(
            await self._send(exchange.sparql(sparql, at=at, certainly=certainly, as_of=as_of))
        )

    async def select(
        self,
        sparql: str,
        *,
        at: Time | None = None,
        certainly: bool = False,
        as_of: int | None = None,
    ) -> list[Row]:
        """See `Client.select`."""
        result = await self.query(sparql, at=at, certainly=certainly, as_of=as_of)
        if not isinstance(result, list):
            raise exchange.wrong_form("SELECT")
        return result

    async def ask(
        self,
        sparql: str,
        *,
        at: Time | None = None,
        certainly: bool = False,
        as_of: int | None = None,
    ) -> bool:
        """See `Client.ask`."""
        result = await self.query(sparql, at=at, certainly=certainly, as_of=as_of)
        if not isinstance(result, bool):
            raise exchange.wrong_form("ASK")
        return result

    async def construct(
        self,
        sparql: str,
        *,
        at: Time | None = None,
        certainly: bool = False,
        as_of: int | None = None,
    ) -> str:
        """See `Client.construct`."""
        result = await self.query(sparql, at=at, certainly=certainly, as_of=as_of)
        if not isinstance(result, str):
            raise exchange.wrong_form("CONSTRUCT or DESCRIBE")
        return result

    async def query_document(
        self,
        sparql: str,
        media_types: str,
        *,
        at: Time | None = None,
        certainly: bool = False,
        as_of: int | None = None,
    ) -> bytes:
        """See `Client.query_document`."""
        request = exchange.sparql(
            sparql, at=at, certainly=certainly, as_of=as_of, media_types=media_types
        )
        return (await self._send(request)).content

    async def export(
        self,
        format: ExportFormat = "yaml",
        *,
        at: Time | None = None,
        class_name: str | None = None,
        during: tuple[float, float] | None = None,
        certainly: bool = False,
        as_of: int | None = None,
        vocabulary: RdfVocabulary | None = None,
        relations: bool = False,
    ) -> AsyncIterator[bytes]:
        """See `Client.export`."""
        request = exchange.export(
            format,
            at,
            class_name=class_name,
            during=during,
            certainly=certainly,
            as_of=as_of,
            vocabulary=vocabulary,
            relations=relations,
        )
        async with self._streamed(request) as reply:
            async for piece in reply.aiter_bytes():
                yield piece

    async def changes(
        self,
        since: int = 0,
        *,
        until: int | None = None,
        follow: bool = False,
        format: ChangesFormat = "rdf-patch",
    ) -> AsyncIterator[bytes]:
        """See `Client.changes`."""
        request = exchange.changes(since, until, follow, format)
        async with self._streamed(request) as reply:
            async for piece in reply.aiter_bytes():
                yield piece

    def subscribe(
        self,
        sparql: str = "",
        *,
        mode: Mode = "bindings",
        since: int | None = None,
        at: Literal["now"] | None = None,
        certainly: bool = False,
        since_at: float | None = None,
        from_commit: int | None = None,
        from_time: float | None = None,
        speed: float = 1.0,
        durable: str | None = None,
    ) -> AsyncSubscription:
        """See `Client.subscribe`."""
        from fluentboard_client.live import AsyncSubscription

        return AsyncSubscription(
            self.board,
            sparql,
            mode=mode,
            since=since,
            headers=self._headers,
            timeout_s=self._timeout_s,
            retries=self._retries,
            options=live_options(
                at=at,
                certainly=certainly,
                since_at=since_at,
                from_commit=from_commit,
                from_time=from_time,
                speed=speed,
                durable=durable,
            ),
        )

    @property
    def subscriptions(self) -> AsyncDurableSubscriptions:
        """Durable subscriptions, and explanations."""
        return AsyncDurableSubscriptions(self._send)

    async def health(self) -> dict[str, Any]:
        """See `Client.health`."""
        return cast("dict[str, Any]", (await self._send(exchange.Request("GET", "/health"))).json())

    async def ready(self) -> bool:
        """See `Client.ready`."""
        try:
            return (await self._http.get("/ready")).is_success
        except httpx.TransportError:
            return False

    async def aclose(self) -> None:
        """Closes the connections."""
        await self._http.aclose()

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        await self.aclose()

    async def _send(self, request: exchange.Request) -> httpx.Response:
        attempt = 0
        while True:
            attempt += 1
            try:
                reply = await self._http.request(
                    request.method,
                    request.path,
                    params=dict(request.params) or None,
                    json=request.json,
                    data=request.form,
                    headers=dict(request.headers),
                )
            except httpx.TransportError as failure:
                delay_s = exchange.retry_delay_s(failure, attempt, self._retries)
                if delay_s is None:
                    raise exchange.unreachable(self.board, failure, attempt) from failure
                await asyncio.sleep(delay_s)
                continue
            exchange.check(reply, self.board)
            return reply

    @asynccontextmanager
    async def _streamed(self, request: exchange.Request) -> AsyncGenerator[httpx.Response, None]:
        try:
            async with self._http.stream(
                request.method,
                request.path,
                params=dict(request.params),
                headers=dict(request.headers),
            ) as reply:
                if not reply.is_success:
                    await reply.aread()
                    exchange.check(reply, self.board)
                yield reply
        except httpx.TransportError as failure:
            raise exchange.unreachable(self.board, failure, 1) from failure
