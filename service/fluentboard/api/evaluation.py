"""Evaluation: one query in, its serialised result out, within the limits of the service.

Everything that answers SPARQL calls `Evaluator.evaluate`. A query that surely takes no longer than
its result is long, or that was asked before, is answered at once; every other one in a reader, a
process of its own that is killed when the time is over. A board in memory has no readers: there a
query that runs over its time is abandoned, and occupies its thread until it next produces a result.
"""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Collection, Sequence
from concurrent.futures import Future
from enum import Enum
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from fluentboard.api.answering import Question, Result, answer, written_short
from fluentboard.api.exchange import Call, Disconnected
from fluentboard.api.federation import check_services
from fluentboard.api.point_queries import PointQuery, point_query
from fluentboard.api.query_threads import QueryThreads
from fluentboard.api.readers.pool import ReaderPool
from fluentboard.api.readers.rehearsal import Rehearsal
from fluentboard.api.result_cache import Cached, Key, ResultCache
from fluentboard.board.blackboard import Blackboard
from fluentboard.board.events import Commit
from fluentboard.config import LimitSettings
from fluentboard.errors import QueryTimeout

_Outcome = TypeVar("_Outcome")

# How long a reader may take to come up, on a large board and a slow machine.
_START_PATIENCE_S = 30.0
_LONG_S = 0.1

# A result longer than this is not one that the event loop should wait for.
_INLINE_BYTES_MAX = 32 * 1024


class Costly(Enum):
    """What no look at the query can change: it is not to be answered at once."""

    QUERY = "query"


class Evaluator:
    """Evaluates queries beside the event loop, so that none of them holds it up.

    Args:
        board: what is asked.
        limits: on time, rows and bytes.
        service_endpoints: which other endpoints queries may ask.
        readers_folder: where readers keep their files; None to evaluate in threads.
    """

    def __init__(
        self,
        board: Blackboard,
        limits: LimitSettings,
        service_endpoints: Collection[str] = (),
        readers_folder: Path | None = None,
    ) -> None:
        can_follow = readers_folder is not None and board.can_be_followed
        self._readers = (
            ReaderPool(board, readers_folder, limits) if can_follow and readers_folder else None
        )
        self._board = board
        self._service_endpoints = frozenset(service_endpoints)
        self._limits = limits
        # A row takes at least a byte: a result of fewer bytes than rows allowed needs no counting.
        self._inline_bytes_max = min(
            _INLINE_BYTES_MAX, limits.result_max_bytes, limits.result_rows_max
        )
        self._threads = QueryThreads(limits.queries_at_once)
        self._cache = ResultCache(limits.result_cache_bytes)
        self._applied = 0
        self._stop_listening = board.listen(self._on_commits)
        # Whatever was committed before listening began has been applied when this returns.
        commit = board.commit
        board.query("ASK {}")
        self._applied = max(self._applied, commit)
        self._running: set[Future[Result]] = set()
        self.timeouts = 0

    @property
    def running(self) -> int:
        """Queries being evaluated; in threads, the abandoned ones too."""
        return len(self._running)

    @property
    def processes(self) -> int:
        """How many readers there are; 0 for a board in memory."""
        return 0 if self._readers is None else len(self._readers.process_ids)

    async def evaluate(
        self, question: Question, call: Call | None = None, *, is_costly: bool = False
    ) -> Result:
        """The result of a query.

        Args:
            question: the query.
            call: who asks, with nothing of the body unread; a query that takes long is ended when
                nobody waits for it any more.
            is_costly: `at_once` has just said so.

        Raises:
            Disconnected: nobody does.
            InvalidQuery: it does not parse, or cannot be evaluated.
            NotAllowed: it asks an endpoint that it may not.
            NotAcceptable: the client accepts no format that fits its form.
            QueryTimeout: it took too long.
            TooLarge: its result is too long.
        """
        if question.at is not None or question.as_of is not None:
            return await self._evaluated(question, call)
        known = Costly.QUERY if is_costly else self.at_once(question)
        if isinstance(known, Result):
            return known
        result = await self._evaluated(question, call)
        if result.text is not None and result.is_exact and question.is_timeless:
            answered = Cached(result.media_type, result.text)
            self._cache.put(result.commit, _key(question), answered)
        return result

    def at_once(self, question: Question) -> Result | Costly | None:
        """The result of a query over all of history, if it costs no more than to wait for one.

        That is so if it was asked before and nothing has changed, or if it is a point query with a
        short result. If there is none, `evaluate` the query; `Costly.QUERY` says that there will be
        none when this is called again, either.
        """
        commit, key = self._board.commit, _key(question)
        known = self._cache.get(commit, key)
        if known is not None:
            return Result(known.media_type, known.text, None, len(known.text), commit)
        # A query waits until the RDF store has all that was committed; the event loop must not.
        if question.default_graphs or question.named_graphs:
            return Costly.QUERY
        kind = point_query(question.text)
        if kind is None:
            return Costly.QUERY
        if self._applied < commit:
            return None
        found = self._board.point_query(question.text, has_prefixes=kind is PointQuery.PREFIXED)
        if found is None:
            return None
        commit, results = found
        answered = written_short(results, question.accept, self._inline_bytes_max)
        if answered is None:
            return None
        self._cache.put(commit, key, Cached(*answered), may_change=False)
        media_type, text = answered
        return Result(media_type, text, None, len(text), commit)

    async def _evaluated(self, question: Question, call: Call | None = None) -> Result:
        if self._applied < self._board.commit and point_query(question.text):
            # Handing it to a reader would cost more than it does.
            return await self._in_thread(question, call)
        check_services(question.text, self._service_endpoints)
        if self._readers is None:
            return await self._in_thread(question, call)
        return await self._in_reader(self._readers, question, call)

    async def _in_reader(
        self, readers: ReaderPool, question: Question | Rehearsal, call: Call | None = None
    ) -> Result:
        job = readers.submit(question, self._board.commit, self._board.clock.now_s())
        self._note(job.future)
        timeout_s = self._limits.query_timeout_s
        try:
            # Waiting for a reader, which may have to start first, is not time that the query took.
            begun = asyncio.wrap_future(job.begun)
            await self._in_time(begun, timeout_s + _START_PATIENCE_S, "did not get its turn", call)
            result = asyncio.wrap_future(job.future)
            await asyncio.wait({result}, timeout=min(_LONG_S, timeout_s))
            if not result.done():
                # It may go on for long: the next query is to find a reader that is free.
                readers.prepare_one_more()
            return await self._in_time(result, timeout_s, "did not finish", call)
        finally:
            job.abandon()

    async def _in_thread(self, question: Question, call: Call | None) -> Result:
        stop = threading.Event()
        future = self._threads.submit(partial(answer, self._board, question, self._limits, stop))
        self._note(future)
        try:
            timeout_s = self._limits.query_timeout_s
            result = asyncio.wrap_future(future)
            return await self._in_time(result, timeout_s, "did not finish", call)
        finally:
            stop.set()

    def _note(self, future: Future[Result]) -> None:
        self._running.add(future)
        future.add_done_callback(self._running.discard)

    async def _in_time(
        self, future: asyncio.Future[_Outcome], timeout_s: float, complaint: str, call: Call | None
    ) -> _Outcome:
        """What comes of a future, as long as the client is there."""
        short_s = min(_LONG_S, timeout_s)
        try:
            await asyncio.wait({future}, timeout=short_s)
            is_gone = not future.done() and await _gone_before(future, timeout_s - short_s, call)
            if future.done():
                return future.result()
        finally:
            future.cancel()  # does nothing to one that is done
        if is_gone:
            raise Disconnected
        self.timeouts += 1
        raise QueryTimeout(
            f"the query {complaint} within {timeout_s:g} s and was stopped; narrow it, add "
            "LIMIT, or raise limits.query_timeout_s",
            timeout_s=timeout_s,
        )

    async def try_out(self, question: Question | Rehearsal) -> None:
        """Evaluates a query or update where it can be stopped, before it is where it cannot.

        On a board in memory, which has no such place, it does nothing.

        Raises:
            FluentboardError: as `evaluate`.
        """
        if self._readers is None:
            return
        if isinstance(question, Rehearsal):
            await self._in_reader(self._readers, question)
            return
        result = await self._evaluated(question)
        if result.file is not None:
            result.file.close()

    def warm_up(self) -> None:
        """Starts what the first query would have to wait for."""
        if self._readers is not None:
            self._readers.warm_up()

    def close(self) -> None:
        """Lets go of the threads and ends the readers."""
        self._stop_listening()
        if self._readers is not None:
            self._readers.close()
        self._threads.close()

    def _on_commits(self, commits: Sequence[Commit]) -> None:
        """Called in another thread when the RDF store has applied commits."""
        self._applied = commits[-1].number


async def _gone_before(
    future: asyncio.Future[_Outcome], timeout_s: float, call: Call | None
) -> bool:
    """Waits for a future, for a time at most; whether the client goes before it is done."""
    if call is None:
        await asyncio.wait({future}, timeout=timeout_s)
        return False
    leaving = asyncio.ensure_future(call.gone())
    try:
        either: set[asyncio.Future[Any]] = {future, leaving}
        await asyncio.wait(either, timeout=timeout_s, return_when=asyncio.FIRST_COMPLETED)
        return leaving.done()
    finally:
        leaving.cancel()


def _key(question: Question) -> Key:
    return Key(question.text, question.accept, question.default_graphs, question.named_graphs)
