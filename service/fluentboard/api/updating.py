"""Updating: how routes change what is said outside fluents."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Awaitable, Callable, Sequence
from concurrent.futures import Future
from functools import partial

import pyoxigraph as ox

from fluentboard.api.answering import DEFAULT_GRAPH, Question
from fluentboard.api.exchange import Call
from fluentboard.api.query_threads import QueryThreads
from fluentboard.api.readers.rehearsal import Rehearsal, needs_rehearsal
from fluentboard.api.security import Guard
from fluentboard.api.writing import idempotency_key, outcome
from fluentboard.board.blackboard import Blackboard
from fluentboard.board.events import Commit
from fluentboard.board.graphs import Reader
from fluentboard.board.update_operations import Modify, Operation
from fluentboard.board.update_syntax import parse_update
from fluentboard.config import LimitSettings
from fluentboard.errors import QueryTimeout

# Updates are committed one after the other anyway; the second thread is for the one that hangs.
_THREADS = 2


TryOut = Callable[[Question | Rehearsal], Awaitable[None]]


class Updater:
    """Carries out updates in threads, so that none of them holds up the event loop.

    Args:
        board: what is changed.
        limits: on time.
        guard: admits callers.
        read: gets documents for LOAD; None to refuse it.
        try_out: evaluates a query or update where it can be stopped, and does nothing with its
            result; None to carry out every update right away.
    """

    def __init__(
        self,
        board: Blackboard,
        limits: LimitSettings,
        guard: Guard,
        read: Reader | None = None,
        try_out: TryOut | None = None,
    ) -> None:
        self._try_out = try_out
        self._board = board
        self._limits = limits
        self._guard = guard
        self._read = read
        self._threads = QueryThreads(_THREADS)

    def admit(self, call: Call) -> None:
        """Refuses a caller who may ask but not write; for routes that do both.

        Raises:
            NotAllowed: the caller's role, or the page that sends the request, may not write.
        """
        call.principal = self._guard.admit(call.headers, "write", changes=True)

    async def update(
        self,
        call: Call,
        text: str,
        base_iri: str,
        using_graphs: Sequence[str] = (),
        using_named_graphs: Sequence[str] = (),
    ) -> Commit:
        """Carries out a SPARQL 1.1 Update request.

        Raises:
            FluentboardError: why nothing was changed.
            QueryTimeout: it took too long to find out what is to be changed.
        """
        if self._try_out is not None and "WHERE" in text.upper():
            parsed = await asyncio.to_thread(
                parse_update,
                text,
                base_iri=base_iri,
                using_graphs=using_graphs,
                using_named_graphs=using_named_graphs,
            )
            await self.try_out(parsed)
        return await self._done(
            partial(
                self._board.graphs.update,
                text,
                call.author,
                base_iri=base_iri,
                using_graphs=using_graphs,
                using_named_graphs=using_named_graphs,
                idempotency_key=idempotency_key(call),
                read=self._read,
            )
        )

    async def try_out(self, operations: Sequence[Operation]) -> None:
        """Finds out what operations would change, where that can be stopped.

        Raises:
            FluentboardError: why nothing would be changed.
            QueryTimeout: it takes too long.
        """
        if self._try_out is None:
            return
        if needs_rehearsal(operations):
            await self._try_out(Rehearsal.of(operations))
        elif operations and isinstance(operations[0], Modify):
            await self._try_out(_question(operations[0]))

    async def try_query(self, operations: Sequence[Operation], query: str) -> None:
        """The same for a query on what the operations lead to."""
        if self._try_out is not None:
            await self._try_out(Rehearsal.of(operations, query))

    async def change(
        self, call: Call, operations: Callable[[], Sequence[Operation]], fingerprint: str = ""
    ) -> Commit:
        """Carries out operations.

        Args:
            call: the request.
            operations: called in another thread, because reading a long body takes a while.
            fingerprint: what another request with the same idempotency key is recognised by.

        Raises:
            FluentboardError: why nothing was changed.
            QueryTimeout: it took too long to find out what is to be changed.
        """
        author, key = call.author, idempotency_key(call)

        def submit(*, stop: threading.Event, patience_s: float) -> Future[Commit]:
            return self._board.graphs.change(
                operations(),
                author,
                idempotency_key=key,
                fingerprint=fingerprint,
                stop=stop,
                patience_s=patience_s,
            )

        return await self._done(submit)

    def close(self) -> None:
        """Lets go of the threads."""
        self._threads.close()

    async def _done(self, submit: Callable[..., Future[Commit]]) -> Commit:
        stop = threading.Event()
        timeout_s = self._limits.query_timeout_s
        future = self._threads.submit(partial(submit, stop=stop, patience_s=timeout_s))
        try:
            committed = await asyncio.wait_for(asyncio.wrap_future(future), timeout_s)
            # From here on it is in the writer's hands, and will be done.
            return await outcome(committed)
        except TimeoutError:
            raise QueryTimeout(
                f"what the update is to change was not found within {timeout_s:g} s, and nothing "
                "was changed; narrow its WHERE, split it, or raise limits.query_timeout_s",
                timeout_s=timeout_s,
            ) from None
        finally:
            if not future.done():
                stop.set()


def _question(operation: Modify) -> Question:
    """The WHERE of an operation as a query of its own, on the statements as they are now."""
    base = "" if operation.base_iri is None else f"BASE <{operation.base_iri}> "
    graphs = operation.default_graphs or ()
    return Question(
        base + operation.query,
        "text/csv",
        tuple(DEFAULT_GRAPH if isinstance(g, ox.DefaultGraph) else g.value for g in graphs),
        tuple(graph.value for graph in operation.named_graphs or ()),
    )
