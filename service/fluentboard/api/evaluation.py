"""Evaluation: one query in, its serialised result out, within the limits of the service.

Everything that answers SPARQL calls `Evaluator.evaluate`. It is the seam at which queries can move
to processes of their own, which can be killed: today a query that runs over its time is abandoned,
and stops by itself when it next produces a result, but one that produces none occupies its thread
until it is done.
"""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Collection, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from functools import partial
from typing import IO, Literal, cast

import pyoxigraph as ox

from fluentboard.api.federation import check_services
from fluentboard.api.negotiation import Offer, negotiated
from fluentboard.api.point_queries import is_point_query
from fluentboard.api.query_threads import QueryThreads
from fluentboard.api.result_cache import Cached, Key, ResultCache
from fluentboard.api.results import ResultSink
from fluentboard.board.blackboard import Blackboard
from fluentboard.board.events import Commit
from fluentboard.board.store import GraphName, QueryResults
from fluentboard.board.time_functions import mentions_functions
from fluentboard.config import LimitSettings
from fluentboard.errors import InvalidQuery, QueryTimeout, TooLarge
from fluentboard.model.interval import Certainty

_XML = "application/sparql-results+xml"
_JSON = "application/sparql-results+json"

SOLUTION_OFFERS = (
    Offer(_JSON, ox.QueryResultsFormat.JSON),
    Offer(_XML, ox.QueryResultsFormat.XML),
    Offer("text/csv", ox.QueryResultsFormat.CSV),
    Offer("text/tab-separated-values", ox.QueryResultsFormat.TSV),
    # What clients ask for that do not know the proper names.
    Offer("application/json", ox.QueryResultsFormat.JSON),
    Offer("application/xml", ox.QueryResultsFormat.XML),
    Offer("text/xml", ox.QueryResultsFormat.XML),
)
"""What the result of a SELECT or ASK can be written as, the preferred first."""

GRAPH_OFFERS = (
    Offer("text/turtle", ox.RdfFormat.TURTLE),
    Offer("application/n-triples", ox.RdfFormat.N_TRIPLES),
    Offer("application/ld+json", ox.RdfFormat.JSON_LD),
    Offer("application/rdf+xml", ox.RdfFormat.RDF_XML),
    Offer("application/trig", ox.RdfFormat.TRIG),
    Offer("application/n-quads", ox.RdfFormat.N_QUADS),
    Offer("text/n3", ox.RdfFormat.N3),
    Offer("application/json", ox.RdfFormat.JSON_LD),
    Offer("application/xml", ox.RdfFormat.RDF_XML),
)
"""What the result of a CONSTRUCT or DESCRIBE can be written as, the preferred first."""

DEFAULT_GRAPH = "urn:x-arq:DefaultGraph"
"""Stands for the default graph where the IRI of a graph is asked for, as in Apache Jena."""

UNION_GRAPH = "urn:x-arq:UnionGraph"
"""Stands for all named graphs together, likewise."""

# A result longer than this is not one that the event loop should wait for.
_INLINE_BYTES_MAX = 32 * 1024


@dataclass(frozen=True, slots=True)
class Question:
    """A query as the SPARQL protocol has it.

    Attributes:
        text: SPARQL 1.1.
        accept: the media types that the client takes, as in the header; None for any.
        default_graphs: IRIs that make up the default graph; none for the board's own.
        named_graphs: IRIs that `GRAPH` sees; none for all.
        at: sees only what holds at this time in seconds, or now; None for all of history.
        as_of: sees what was believed after this commit; None for the present belief.
        certainty: whether `at` shows what may hold, or only what surely does.
    """

    text: str
    accept: str | None = None
    default_graphs: tuple[str, ...] = ()
    named_graphs: tuple[str, ...] = ()
    at: float | Literal["now"] | None = None
    as_of: int | None = None
    certainty: Certainty = Certainty.POSSIBLE

    @property
    def is_timeless(self) -> bool:
        """It asks about all of history, and its answer changes with commits alone."""
        return self.at is None and self.as_of is None and not mentions_functions(self.text)


@dataclass(frozen=True, slots=True)
class Result:
    """A whole result.

    Attributes:
        media_type: of the text.
        text: the serialised result, or None if it is so long that it waits in the sink's file.
        sink: where it was written; None if it was known already.
        commit: the commit it is exact at, or that it has at least.
        at_s: the time it is exact at, in seconds; None for all times.
        is_exact: no later commit is in it.
    """

    media_type: str
    text: bytes | None
    sink: ResultSink | None
    commit: int
    at_s: float | None = None
    is_exact: bool = True


class Evaluator:
    """Evaluates queries in threads, so that none of them holds up the event loop.

    Args:
        board: what is asked.
        limits: on time, rows and bytes.
        service_endpoints: which other endpoints queries may ask.
    """

    def __init__(
        self, board: Blackboard, limits: LimitSettings, service_endpoints: Collection[str] = ()
    ) -> None:
        self._board = board
        self._service_endpoints = frozenset(service_endpoints)
        self._limits = limits
        self._inline_limits = limits.model_copy(
            update={"result_max_bytes": min(_INLINE_BYTES_MAX, limits.result_max_bytes)}
        )
        self._threads = QueryThreads(limits.queries_at_once)
        self._never = threading.Event()
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
        """Queries in the threads, the abandoned ones included."""
        return len(self._running)

    async def evaluate(self, question: Question) -> Result:
        """The result of a query.

        Raises:
            InvalidQuery: it does not parse, or cannot be evaluated.
            NotAllowed: it asks an endpoint that it may not.
            NotAcceptable: the client accepts no format that fits its form.
            QueryTimeout: it took too long.
            TooLarge: its result is too long.
        """
        commit = self._board.commit
        key = Key(question.text, question.accept, question.default_graphs, question.named_graphs)
        is_plain = question.at is None and question.as_of is None
        known = self._cache.get(commit, key) if is_plain else None
        if known is not None:
            return Result(known.media_type, known.text, None, commit)
        # A query waits until the RDF store has all that was committed; the event loop must not.
        is_current = is_plain and self._applied >= commit
        result = await self._evaluated(question, is_current=is_current)
        if is_plain and result.text is not None and result.is_exact and question.is_timeless:
            self._cache.put(result.commit, key, Cached(result.media_type, result.text))
        return result

    async def _evaluated(self, question: Question, *, is_current: bool) -> Result:
        if is_current and is_point_query(question.text):
            try:
                return self._answer(question, self._inline_limits, self._never)
            except TooLarge:
                pass  # more than a few kilobytes after all: the usual way decides
        check_services(question.text, self._service_endpoints)
        stop = threading.Event()
        future = self._threads.submit(partial(self._answer, question, self._limits, stop))
        self._running.add(future)
        future.add_done_callback(self._running.discard)
        timeout_s = self._limits.query_timeout_s
        try:
            return await asyncio.wait_for(asyncio.wrap_future(future), timeout_s)
        except TimeoutError:
            self.timeouts += 1
            raise QueryTimeout(
                f"the query did not finish within {timeout_s:g} s; narrow it, add LIMIT, or raise "
                "limits.query_timeout_s",
                timeout_s=timeout_s,
            ) from None
        finally:
            stop.set()

    def close(self) -> None:
        """Lets go of the threads."""
        self._stop_listening()
        self._threads.close()

    def _on_commits(self, commits: Sequence[Commit]) -> None:
        """Called in another thread when the RDF store has applied commits."""
        self._applied = commits[-1].number

    def _answer(self, question: Question, limits: LimitSettings, stop: threading.Event) -> Result:
        # A protocol request that names any graph names the whole dataset.
        has_dataset = bool(question.default_graphs or question.named_graphs)
        timed = self._board.timed_query(
            question.text,
            at=question.at,
            as_of=question.as_of,
            certainty=question.certainty,
            default_graphs=self._graphs(question.default_graphs) if has_dataset else None,
            named_graphs=self._named_graphs(question.named_graphs) if has_dataset else None,
        )
        commit, at_s, is_exact = timed.commit, timed.at_s, timed.is_exact
        results: QueryResults | None = timed.results
        del timed
        try:
            media_type, sink = written(results, question.accept, limits, stop)
        finally:
            # Oxigraph's iterators must die in the thread that made them, but the traceback of an
            # error would take this one along to the event loop.
            results = None
        return Result(media_type, sink.text, sink, commit, at_s, is_exact)

    def _graphs(self, iris: Sequence[str]) -> list[GraphName]:
        graphs: list[GraphName] = []
        for iri in iris:
            graphs += [ox.DefaultGraph()] if iri == DEFAULT_GRAPH else self._named_graphs([iri])
        return graphs

    def _named_graphs(self, iris: Sequence[str]) -> list[ox.NamedNode | ox.BlankNode]:
        graphs: list[ox.NamedNode | ox.BlankNode] = []
        try:
            for iri in iris:
                if iri == UNION_GRAPH:
                    graphs += self._board.graphs.named_graphs()
                else:
                    graphs.append(ox.NamedNode(iri))
        except ValueError as problem:
            raise InvalidQuery(f"a graph of the dataset is no IRI: {problem}") from None
        return graphs


def written(
    results: QueryResults,
    accept: str | None,
    limits: LimitSettings,
    stop: threading.Event,
) -> tuple[str, ResultSink]:
    """Media type and text of the results, in the format that the client wants most.

    Raises:
        NotAcceptable: it wants none that fits.
        InvalidQuery: the evaluation failed on the way.
        TooLarge: there is more than the limits allow.
        Stopped: nobody waits for them any more.
    """
    sink: ResultSink | None = None
    try:
        is_graph = isinstance(results, ox.QueryTriples)
        media_type, form = negotiated(accept, GRAPH_OFFERS if is_graph else SOLUTION_OFFERS)
        sink = ResultSink(form, limits, stop)
        results.serialize(cast("IO[bytes]", sink), form)
    except (OSError, ValueError, RuntimeError) as problem:
        _close(sink)
        raise InvalidQuery(f"the query cannot be evaluated: {problem}") from None
    except BaseException:
        _close(sink)
        raise
    finally:
        del results
    return media_type, sink


def _close(sink: ResultSink | None) -> None:
    if sink is not None:
        sink.close()
