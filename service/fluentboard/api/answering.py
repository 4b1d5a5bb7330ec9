"""Answering: a question in, its serialised result out, in whichever process evaluates it."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from pathlib import Path
from typing import IO, Literal, NamedTuple, Protocol, cast

import pyoxigraph as ox

from fluentboard.api.negotiation import Offer, negotiated
from fluentboard.api.operations import Content
from fluentboard.api.results import ResultSink, ShortSink, Stopped
from fluentboard.board.store import GraphName, QueryResults
from fluentboard.board.time_functions import mentions_functions
from fluentboard.board.time_views import TimedResults
from fluentboard.config import LimitSettings
from fluentboard.errors import InvalidQuery, NotAcceptable
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


def result_content(media_type: str) -> Content:
    """How a result in a media type is described; `application/json` is a table or JSON-LD."""
    if media_type == _JSON:
        return Content({"type": "object"})
    if media_type.endswith("json"):
        return Content({"type": ["object", "array"]})
    return Content({"type": "string"})


DEFAULT_GRAPH = "urn:x-arq:DefaultGraph"
"""Stands for the default graph where the IRI of a graph is asked for, as in Apache Jena."""

UNION_GRAPH = "urn:x-arq:UnionGraph"
"""Stands for all named graphs together, likewise."""


class Question(NamedTuple):
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


class Result(NamedTuple):
    """A whole result.

    Attributes:
        media_type: of the text.
        text: the serialised result, or None if it is so long that it waits in a file.
        file: where it waits; whoever sends it closes the file.
        size_bytes: how long it is.
        commit: the commit it is exact at, or that it has at least.
        at_s: the time it is exact at, in seconds; None for all times.
        is_exact: no later commit is in it.
    """

    media_type: str
    text: bytes | None
    file: IO[bytes] | None
    size_bytes: int
    commit: int
    at_s: float | None = None
    is_exact: bool = True


class Readable(Protocol):
    """What can be asked: a board, or a follower of one."""

    def timed_query(
        self,
        sparql: str,
        *,
        at: float | Literal["now"] | None = None,
        as_of: int | None = None,
        certainty: Certainty = Certainty.POSSIBLE,
        default_graphs: Sequence[GraphName] | None = None,
        named_graphs: Sequence[ox.NamedNode | ox.BlankNode] | None = None,
    ) -> TimedResults:
        """The results of a query."""
        ...

    def named_graphs(self) -> list[ox.NamedNode]:
        """Names of all named graphs."""
        ...


def answer(
    board: Readable,
    question: Question,
    limits: LimitSettings,
    stop: threading.Event,
    folder: Path | None = None,
) -> Result:
    """The result of a question.

    Args:
        board: what is asked.
        question: the query.
        limits: on rows and bytes.
        stop: once set, nobody waits for the result any more.
        folder: where a long result is put, as a file with a name; None for one without.

    Raises:
        InvalidQuery: it does not parse, or cannot be evaluated.
        NotAcceptable: the client accepts no format that fits its form.
        TooLarge: its result is too long.
    """
    # A protocol request that names any graph names the whole dataset.
    has_dataset = bool(question.default_graphs or question.named_graphs)
    timed = board.timed_query(
        question.text,
        at=question.at,
        as_of=question.as_of,
        certainty=question.certainty,
        default_graphs=_graphs(board, question.default_graphs) if has_dataset else None,
        named_graphs=_named_graphs(board, question.named_graphs) if has_dataset else None,
    )
    commit, at_s, is_exact = timed.commit, timed.at_s, timed.is_exact
    results: QueryResults | None = timed.results
    del timed
    try:
        media_type, sink = written(results, question.accept, limits, stop, folder)
    finally:
        # Oxigraph's iterators must die in the thread that made them, but the traceback of an
        # error would take this one along to the event loop.
        results = None
    return Result(media_type, sink.text, sink.file, sink.size, commit, at_s, is_exact)


def _graphs(board: Readable, iris: Sequence[str]) -> list[GraphName]:
    graphs: list[GraphName] = []
    for iri in iris:
        graphs += [ox.DefaultGraph()] if iri == DEFAULT_GRAPH else _named_graphs(board, [iri])
    return graphs


def _named_graphs(board: Readable, iris: Sequence[str]) -> list[ox.NamedNode | ox.BlankNode]:
    graphs: list[ox.NamedNode | ox.BlankNode] = []
    try:
        for iri in iris:
            if iri == UNION_GRAPH:
                graphs += board.named_graphs()
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
    folder: Path | None = None,
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
        sink = ResultSink(form, limits, stop, folder)
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


def written_short(
    results: QueryResults, accept: str | None, size_max_bytes: int
) -> tuple[str, bytes] | None:
    """Media type and text of the results of a SELECT or ASK; None if that fails in any way.

    Args:
        results: of the query.
        accept: the media types that the client takes.
        size_max_bytes: how long the text may be.
    """
    sink = ShortSink(size_max_bytes)
    try:
        media_type, form = negotiated(accept, SOLUTION_OFFERS)
        results.serialize(cast("IO[bytes]", sink), form)
    except (Stopped, NotAcceptable, OSError, ValueError, RuntimeError):
        return None
    return media_type, sink.text


def _close(sink: ResultSink | None) -> None:
    if sink is not None:
        sink.close()
