"""Client: read, write, end and query fluents over HTTP, one blocking call each."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Literal, Self, cast

import httpx

from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.interval import Interval
from fluentboard_client import exchange, trajectories
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
from fluentboard_client.streams import counted, file_pieces
from fluentboard_client.subscriptions import DurableSubscriptions
from fluentboard_client.subscriptions import options as live_options
from fluentboard_client.trajectories import Trajectory

if TYPE_CHECKING:
    from fluentboard_client.conversation import Mode
    from fluentboard_client.live import Subscription

DEFAULT_BOARD = "http://127.0.0.1:8080"


class Client:
    """A board, reached over HTTP.

    Every write carries an idempotency key, so a write that is repeated after a broken connection
    takes effect once. Methods raise the errors that the board raised (`UnknownFluent`,
    `FluentExists` and so on), and `BoardUnreachable` when there is no board.

    One client may be used from several threads. As a context manager it closes its connections.

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
        transport: httpx.BaseTransport | None = None,
    ) -> None:
        self.board = exchange.board_address(board)
        self._headers = exchange.headers(author, token)
        self._retries = retries
        self._timeout_s = timeout_s
        self._http = httpx.Client(
            base_url=self.board,
            headers=self._headers,
            timeout=timeout_s,
            transport=transport,
            trust_env=not exchange.is_loopback(self.board),
        )

    def assert_fluents(
        self, fluents: Fluent | Iterable[Fluent], *, merge: bool = False, key: str | None = None
    ) -> Receipt:
        """Puts fluents on the board, all of them or none.

        Args:
            fluents: one or several.
            merge: refine those that are there already, instead of refusing.
            key: idempotency key; by default a new one.

        Raises:
            FluentExists: one is on the board already and says something else.
            UnknownClass: no loaded ontology has its class.
        """
        several = [fluents] if isinstance(fluents, Fluent) else list(fluents)
        return exchange.receipt(self._send(exchange.assertion(several, merge, key)))

    def refine(
        self,
        name: str,
        *,
        start: Interval | None = None,
        finish: Interval | None = None,
        properties: Sequence[Property] = (),
        version: int | None = None,
        key: str | None = None,
    ) -> Receipt:
        """Narrows the intervals of a fluent or adds property values to it.

        Args:
            name: of the fluent.
            start: the narrower start; None leaves it.
            finish: the narrower finish; None leaves it.
            properties: statements to add.
            version: refuse unless the fluent is at this version.
            key: idempotency key; by default a new one.

        Raises:
            UnknownFluent, NotARefinement, VersionMismatch: as their classes say.
        """
        command = RefineFluent(name, start, finish, tuple(properties), version)
        return exchange.receipt(self._send(exchange.refinement(command, key)))

    def end(
        self,
        name: str,
        at: float | Interval | None = None,
        *,
        version: int | None = None,
        key: str | None = None,
    ) -> Receipt:
        """Says when a fluent ceased to hold.

        Args:
            name: of the fluent.
            at: seconds, or the interval the end lies in; None is the board's present.
            version: refuse unless the fluent is at this version.
            key: idempotency key; by default a new one.

        Raises:
            UnknownFluent, NotARefinement, VersionMismatch: as their classes say.
        """
        return exchange.receipt(self._send(exchange.ending(name, at, version, key)))

    def batch(self, commands: Iterable[Command], *, key: str | None = None) -> Receipt:
        """Carries out several commands, all of them or none."""
        return exchange.receipt(self._send(exchange.batch(commands, key)))

    def import_fluents(
        self,
        source: Path | Iterable[bytes],
        format: ImportFormat = "yaml",
        *,
        graph: str | None = None,
        progress: Callable[[int], None] | None = None,
    ) -> dict[str, Any]:
        """Streams a file of fluents, or of other people's knowledge, to the board.

        Args:
            source: a file, or pieces of one.
            format: `yaml`, `jsonl`, or a format of RDF.
            graph: IRI of the graph for what RDF says that is not about fluents, or `"default"`.
            progress: called with the number of bytes sent since the last call.

        Returns:
            The board's account of what was imported.

        Raises:
            InvalidYaml: or whatever the board finds wrong with the contents.
            InvalidInput: the file cannot be read.
        """
        pieces = file_pieces(source) if isinstance(source, Path) else source
        try:
            reply = self._http.post(
                "/import",
                params=exchange.import_params(graph),
                content=counted(pieces, progress),
                headers={"Content-Type": exchange.MEDIA_TYPES[format]},
                timeout=httpx.Timeout(self._timeout_s, read=None),  # takes as long as it takes
            )
        except httpx.TransportError as failure:
            raise exchange.unreachable(self.board, failure, 1) from failure
        exchange.check(reply, self.board)
        return cast("dict[str, Any]", reply.json())

    def fluent(self, name: str, *, as_of: int | None = None) -> Fluent:
        """The fluent of that name, as it stands or as it stood after commit `as_of`.

        Raises:
            UnknownFluent: there is none.
        """
        return exchange.fluent_of(self._send(exchange.fluent(name, as_of)))

    def history(self, name: str) -> list[FluentChange]:
        """Every change of a fluent, oldest first.

        Raises:
            UnknownFluent: there is none.
        """
        return exchange.changes_of(self._send(exchange.history(name)))

    def fluents(
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
    ) -> Iterator[Fluent]:
        """The fluents that pass a filter; pages are fetched as the iteration goes.

        Args:
            class_name: of that class or a subclass of it.
            at: holding at that time, in seconds or `"now"`.
            during: holding at some time within the window.
            certainly: certainly and not only possibly so.
            property_name: having a value of that property.
            value: the value, as text.
            is_open: holding until further notice, or not.
            as_of: as the board was after that commit.
            page_size: fluents per request.
        """
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
            page, cursor = exchange.page_of(self._send(request))
            yield from page
            if cursor is None:
                return

    def trajectory(
        self,
        name: str,
        *,
        at: Sequence[Time] = (),
        during: tuple[float, float] | None = None,
        as_of: int | None = None,
    ) -> Trajectory:
        """Where an object was: its poses over time, the way it travelled, what is not known.

        Args:
            name: of the object.
            at: tell its position at these times as well, in seconds or `"now"`.
            during: only poses that it may have had at some moment of this window.
            as_of: as was believed after that commit.

        Raises:
            UnknownFluent: there is no such object.
        """
        request = trajectories.trajectory(name, at, during, as_of)
        return trajectories.trajectory_of(self._send(request))

    def query(
        self,
        sparql: str,
        *,
        at: Time | None = None,
        certainly: bool = False,
        as_of: int | None = None,
    ) -> list[Row] | bool | str:
        """The result of a SPARQL query: rows of a SELECT, truth of an ASK, N-Triples of the rest.

        Unless narrowed it sees the whole history: fluents that have ended are still there.

        Args:
            sparql: the query; the usual prefixes (rdf, rdfs, owl, xsd, upper, race, furniture, fb,
                fluent) need no declaration.
            at: see only what possibly holds at that time, in seconds or `"now"`.
            certainly: with `at`: only what certainly holds then.
            as_of: see what was believed after that commit.

        Raises:
            InvalidQuery, QueryTimeout: as their classes say.
        """
        return exchange.result_of(
            self._send(exchange.sparql(sparql, at=at, certainly=certainly, as_of=as_of))
        )

    def select(
        self,
        sparql: str,
        *,
        at: Time | None = None,
        certainly: bool = False,
        as_of: int | None = None,
    ) -> list[Row]:
        """The rows of a SELECT; see `query`."""
        result = self.query(sparql, at=at, certainly=certainly, as_of=as_of)
        if not isinstance(result, list):
            raise exchange.wrong_form("SELECT")
        return result

    def ask(
        self,
        sparql: str,
        *,
        at: Time | None = None,
        certainly: bool = False,
        as_of: int | None = None,
    ) -> bool:
        """The truth of an ASK; see `query`."""
        result = self.query(sparql, at=at, certainly=certainly, as_of=as_of)
        if not isinstance(result, bool):
            raise exchange.wrong_form("ASK")
        return result

    def construct(
        self,
        sparql: str,
        *,
        at: Time | None = None,
        certainly: bool = False,
        as_of: int | None = None,
    ) -> str:
        """The N-Triples text of a CONSTRUCT or DESCRIBE; see `query`."""
        result = self.query(sparql, at=at, certainly=certainly, as_of=as_of)
        if not isinstance(result, str):
            raise exchange.wrong_form("CONSTRUCT or DESCRIBE")
        return result

    def query_document(
        self,
        sparql: str,
        media_types: str,
        *,
        at: Time | None = None,
        certainly: bool = False,
        as_of: int | None = None,
    ) -> bytes:
        """The result of a SPARQL query as the board writes it.

        Args:
            sparql: the query.
            media_types: an Accept header, such as `text/csv`.
            at: as in `query`.
            certainly: as in `query`.
            as_of: as in `query`.

        Raises:
            NotAcceptable: the result cannot be written in any of these types.
        """
        return (
            self._send(
                exchange.sparql(
                    sparql, at=at, certainly=certainly, as_of=as_of, media_types=media_types
                )
            )
        ).content

    def export(
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
    ) -> Iterator[bytes]:
        """Everything on the board, or what passes a filter, in pieces as they arrive.

        Args:
            format: how to write it; RDF with named graphs has what is said outside fluents, too.
            at: only what holds at that time, in seconds or `"now"`.
            class_name: only fluents of that class.
            during: only what holds at some time within the window.
            certainly: certainly and not only possibly so.
            as_of: as the board was after that commit.
            vocabulary: of RDF: the board's own, or OWL-Time.
            relations: with OWL-Time: also Allen's relations that certainly hold.
        """
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
        with self._streamed(request) as reply:
            yield from reply.iter_bytes()

    def changes(
        self,
        since: int = 0,
        *,
        until: int | None = None,
        follow: bool = False,
        format: ChangesFormat = "rdf-patch",
    ) -> Iterator[bytes]:
        """What the commits after one changed, in pieces as they arrive.

        Args:
            since: the last commit that is known; 0 for all.
            until: the last commit to tell of.
            follow: go on with commits as they are made, for ever.
            format: RDF Patch, or JSON Lines.
        """
        request = exchange.changes(since, until, follow, format)
        with self._streamed(request) as reply:
            yield from reply.iter_bytes()

    def backup(self, up_to: str | None = None) -> Iterator[bytes]:
        """A copy of the board's journal, in pieces as they arrive; `restore` reads it.

        Args:
            up_to: number of its last commit, or a time; None for all.
        """
        with self._streamed(exchange.backup(up_to)) as reply:
            yield from reply.iter_bytes()

    def audit(
        self,
        *,
        author: str | None = None,
        name: str | None = None,
        after: str | None = None,
        up_to: str | None = None,
        forced: bool = False,
    ) -> Iterator[dict[str, Any]]:
        """Who changed what and when: the commits that pass a filter, in order.

        Args:
            author: only commits of this author.
            name: only commits that changed this fluent.
            after: only commits after this one, or after a time.
            up_to: only commits up to this one, or to a time.
            forced: only corrections that an admin forced.
        """
        while True:
            found = self._send(exchange.audit(author, name, after, up_to, forced)).json()
            yield from found["commits"]
            if found["next"] is None:
                return
            after = str(found["next"])

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
    ) -> Subscription:
        """The live result of a query: a Snapshot, then a Delta whenever it changes.

        The iterator reconnects when the board restarts and goes on with what it missed. It ends
        when its `close` is called, from any thread.

        Args:
            sparql: a SELECT, ASK or CONSTRUCT.
            mode: whether deltas carry `bindings`, whole `fluents`, or `both`.
            since: go on after this commit instead of starting with a snapshot.
            at: `now` sees only the fluents that hold, and the clock changes the result, too.
            certainly: with `at`: only what certainly holds.
            since_at: with `at` and `since`: the time heard of last, in seconds.
            from_commit: replay: begin after this commit, and go through the later ones.
            from_time: replay: begin at this time, in seconds.
            speed: of a replay: seconds of the past per second.
            durable: instead of a query: the name of a durable subscription.
        """
        from fluentboard_client.live import Subscription

        return Subscription(
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
    def subscriptions(self) -> DurableSubscriptions:
        """Durable subscriptions, and explanations."""
        return DurableSubscriptions(self._send)

    def health(self) -> dict[str, Any]:
        """What the service says of itself.

        Raises:
            BoardUnreachable: nothing answers.
        """
        return cast("dict[str, Any]", self._send(exchange.Request("GET", "/health")).json())

    def ready(self) -> bool:
        """Whether the board answers and has caught up with its journal; False without a board."""
        try:
            return self._http.get("/ready").is_success
        except httpx.TransportError:
            return False

    def close(self) -> None:
        """Closes the connections."""
        self._http.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def _send(self, request: exchange.Request) -> httpx.Response:
        attempt = 0
        while True:
            attempt += 1
            try:
                reply = self._http.request(
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
                time.sleep(delay_s)
                continue
            exchange.check(reply, self.board)
            return reply

    @contextmanager
    def _streamed(self, request: exchange.Request) -> Generator[httpx.Response, None, None]:
        try:
            with self._http.stream(
                request.method,
                request.path,
                params=dict(request.params),
                headers=dict(request.headers),
            ) as reply:
                if not reply.is_success:
                    reply.read()
                    exchange.check(reply, self.board)
                yield reply
        except httpx.TransportError as failure:
            raise exchange.unreachable(self.board, failure, 1) from failure
