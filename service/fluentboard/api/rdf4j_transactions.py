"""Transactions of the RDF4J protocol: operations collected until they are committed as one."""

from __future__ import annotations

import asyncio
import threading
import time
import uuid
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import pyoxigraph as ox

from fluentboard.api import parameters, rdf4j_parameters
from fluentboard.api.answering import written
from fluentboard.api.exchange import Call, Reply, StreamedReply, utf8_text
from fluentboard.api.negotiation import content_type
from fluentboard.api.rdf4j_parameters import check_repository
from fluentboard.api.rdf_bodies import quads_in
from fluentboard.api.sparql import own_address
from fluentboard.api.statement_replies import statements_reply
from fluentboard.api.updating import Updater
from fluentboard.api.writing import commit_header
from fluentboard.board.blackboard import Blackboard
from fluentboard.board.graphs import CHANGES_MAX
from fluentboard.board.oxigraph_query import ask
from fluentboard.board.update_operations import (
    DeleteStatements,
    Graph,
    InsertStatements,
    Operation,
    Term,
)
from fluentboard.board.update_syntax import parse_update
from fluentboard.board.updates import loads_resolved
from fluentboard.config import LimitSettings
from fluentboard.errors import InvalidInput, TooLarge, UnknownResource

_OPEN_MAX = 100
_IDLE_MAX_S = 60.0
_TEXT = b"text/plain; charset=utf-8"


@dataclass
class _Transaction:
    used_s: float
    operations: list[Operation] = field(default_factory=list[Operation])
    size: int = 0


class Transactions:
    """Transactions that are open. One that nobody uses for a minute is rolled back.

    What they ask sees what they did; what others commit meanwhile they see, too.

    Args:
        board: what is asked.
        updater: commits.
        limits: on requests and results.
    """

    def __init__(
        self,
        board: Blackboard,
        updater: Updater,
        limits: LimitSettings,
    ) -> None:
        self._board = board
        self._updater = updater
        self._limits = limits
        self._open: dict[str, _Transaction] = {}

    async def begin(self, call: Call) -> Reply:
        """`POST .../transactions`: begins one; `Location` is its address."""
        check_repository(call)
        now_s = time.monotonic()
        for name in [n for n, t in self._open.items() if now_s - t.used_s > _IDLE_MAX_S]:
            del self._open[name]
        if len(self._open) >= _OPEN_MAX:
            raise TooLarge(f"{_OPEN_MAX} transactions are open, as many as can be", limit=_OPEN_MAX)
        name = str(uuid.uuid4())
        self._open[name] = _Transaction(now_s)
        address = own_address(call, f"{call.path}/{name}")
        return Reply(status=201, headers=[(b"location", address.encode())])

    async def act(self, call: Call) -> Reply | StreamedReply:
        """`PUT .../transactions/{transaction}?action=`: does one thing in it."""
        check_repository(call)
        transaction = self._found(call)
        values = call.parameters()
        action = (parameters.text(values, "action") or "").upper()
        match action:
            case "COMMIT":
                return await self._commit(call, transaction)
            case "PING":
                return Reply(b"%d" % round(_IDLE_MAX_S * 1000), _TEXT)
            case "ADD" | "DELETE":
                return await self._say(call, transaction, values, adds=action == "ADD")
            case "UPDATE":
                return await self._update(call, transaction, values)
            case "GET":
                return await self._statements(call, transaction, values)
            case "SIZE":
                graphs = rdf4j_parameters.contexts(values)
                return Reply(
                    b"%d" % await asyncio.to_thread(self._size, transaction, graphs), _TEXT
                )
            case "QUERY":
                return await self._query(call, transaction, values)
            case _:
                raise InvalidInput(
                    f"the action is {action!r}; give ADD, DELETE, GET, SIZE, QUERY, UPDATE, PING "
                    "or COMMIT",
                    parameter="action",
                )

    async def roll_back(self, call: Call) -> Reply:
        """`DELETE .../transactions/{transaction}`: nothing of it happens."""
        check_repository(call)
        self._found(call)
        del self._open[call.arguments["transaction"]]
        return Reply(status=204)

    def _size(self, transaction: _Transaction, graphs: Sequence[Graph]) -> int:
        view, named = self._board.graphs.preview(transaction.operations)
        return sum(1 for _ in _matching(view, graphs or (ox.DefaultGraph(), *named)))

    def _found(self, call: Call) -> _Transaction:
        name = call.arguments["transaction"]
        transaction = self._open.get(name)
        now_s = time.monotonic()
        if transaction is None or now_s - transaction.used_s > _IDLE_MAX_S:
            raise UnknownResource(
                f"there is no transaction {name!r}; one that is idle for {_IDLE_MAX_S:g} s is "
                "rolled back",
                transaction=name,
            )
        transaction.used_s = now_s
        return transaction

    async def _commit(self, call: Call, transaction: _Transaction) -> Reply:
        name = call.arguments["transaction"]
        # Gone for others: what is committed twice may happen twice.
        del self._open[name]
        try:
            await self._updater.try_out(transaction.operations)
            commit = await self._updater.change(call, lambda: transaction.operations, name)
        except BaseException:
            self._open[name] = transaction
            raise
        return Reply(b"", _TEXT, 200, [commit_header(commit.number)])

    async def _say(
        self, call: Call, transaction: _Transaction, values: parameters.Values, *, adds: bool
    ) -> Reply:
        graphs = rdf4j_parameters.contexts(values)
        base = rdf4j_parameters.base_iri(values, own_address(call, call.path))
        body = await call.body(self._limits.body_max_bytes)
        form = call.header(b"content-type") or ""
        left = CHANGES_MAX - transaction.size

        def read() -> tuple[ox.Quad, ...]:
            return tuple(quads_in(body, form, base, left, graphs))

        quads = await asyncio.to_thread(read)
        transaction.size += len(quads)
        transaction.operations.append(
            InsertStatements(quads, tolerates=True) if adds else DeleteStatements(quads)
        )
        return Reply(b"", _TEXT)

    async def _update(
        self, call: Call, transaction: _Transaction, values: parameters.Values
    ) -> Reply:
        text = parameters.text(values, "update")
        if text is None:
            text = utf8_text(await call.body(self._limits.body_max_bytes))
        address = own_address(call, call.path)
        operations = await asyncio.to_thread(parse_update, text, base_iri=address)
        transaction.size += len(text)
        if transaction.size > CHANGES_MAX:
            raise TooLarge(
                f"the transaction has more than {CHANGES_MAX:,} statements, or characters of "
                "updates; commit it, and begin another",
                limit=CHANGES_MAX,
            )
        transaction.operations += loads_resolved(operations, None)
        return Reply(b"", _TEXT)

    async def _statements(
        self, call: Call, transaction: _Transaction, values: parameters.Values
    ) -> Reply | StreamedReply:
        subject, predicate = rdf4j_parameters.subject(values), rdf4j_parameters.predicate(values)
        target = rdf4j_parameters.term(values, "obj")
        graphs = rdf4j_parameters.contexts(values)

        def found() -> Iterator[ox.Quad]:
            view, named = self._board.graphs.preview(transaction.operations)
            chosen = graphs or (ox.DefaultGraph(), *named)
            return _matching(view, chosen, subject, predicate, target)

        return await statements_reply(call, found, self._limits)

    async def _query(
        self, call: Call, transaction: _Transaction, values: parameters.Values
    ) -> Reply | StreamedReply:
        text = parameters.text(values, "query")
        if text is None:
            text = utf8_text(await call.body(self._limits.body_max_bytes))
        await self._updater.try_query(transaction.operations, text)
        return await asyncio.to_thread(self._answered, call, transaction, text)

    def _answered(self, call: Call, transaction: _Transaction, text: str) -> Reply | StreamedReply:
        view, named = self._board.graphs.preview(transaction.operations, text)
        stop = threading.Event()
        media_type, sink = written(
            ask(view, text, None, None, lambda: named), call.header(b"accept"), self._limits, stop
        )
        headers = [(b"vary", b"Accept")]
        if sink.text is not None:
            return Reply(sink.text, content_type(media_type), 200, headers)
        return StreamedReply(sink.chunks(), content_type(media_type), sink.size, headers)


def _matching(
    view: ox.Store,
    graphs: Sequence[Graph],
    subject: ox.NamedNode | ox.BlankNode | None = None,
    predicate: ox.NamedNode | None = None,
    target: Term | None = None,
) -> Iterator[ox.Quad]:
    for graph in graphs:
        yield from view.quads_for_pattern(subject, predicate, target, graph)
