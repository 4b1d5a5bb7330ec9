"""Replies with statements, in a format with or without graphs as the client wants."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable, Iterator
from typing import IO, cast

import pyoxigraph as ox

from fluentboard.api.answering import GRAPH_OFFERS
from fluentboard.api.exchange import Call, Reply, StreamedReply
from fluentboard.api.negotiation import Offer, content_type, negotiated
from fluentboard.api.results import ResultSink, Stopped
from fluentboard.config import LimitSettings
from fluentboard.errors import QueryTimeout

_WITH_GRAPHS = ("application/n-quads", "application/trig", "application/ld+json")

# Where the client does not care, nothing is to be lost.
STATEMENT_OFFERS: tuple[Offer, ...] = (
    *sorted(
        (offer for offer in GRAPH_OFFERS if offer.media_type in _WITH_GRAPHS),
        key=lambda offer: _WITH_GRAPHS.index(offer.media_type),
    ),
    *(offer for offer in GRAPH_OFFERS if offer.media_type not in _WITH_GRAPHS),
)
"""What statements can be written as, the preferred first."""


async def statements_reply(
    call: Call, find: Callable[[], Iterator[ox.Quad]], limits: LimitSettings
) -> Reply | StreamedReply:
    """The reply with statements; in a format without graphs, they are left out.

    Args:
        call: the request.
        find: gives the statements; called in another thread.
        limits: on time and length.

    Raises:
        NotAcceptable: the client accepts no format of RDF.
        TooLarge: they are too many.
        QueryTimeout: they took too long.
    """
    media_type, form = negotiated(call.header(b"accept"), STATEMENT_OFFERS)
    stop = threading.Event()

    def written() -> ResultSink:
        sink = ResultSink(form, limits, stop)
        quads = _looked_at(find(), stop)
        statements = quads if media_type in _WITH_GRAPHS else (quad.triple for quad in quads)
        try:
            ox.serialize(statements, cast("IO[bytes]", sink), form)
        except BaseException:
            sink.close()
            raise
        return sink

    try:
        sink = await asyncio.wait_for(asyncio.to_thread(written), limits.query_timeout_s)
    except TimeoutError:
        raise QueryTimeout(
            f"the statements were not found within {limits.query_timeout_s:g} s; ask for less, or "
            "raise limits.query_timeout_s",
            timeout_s=limits.query_timeout_s,
        ) from None
    finally:
        stop.set()
    headers = [(b"vary", b"Accept")]
    if sink.text is not None:
        return Reply(sink.text, content_type(media_type), 200, headers)
    return StreamedReply(sink.chunks(), content_type(media_type), sink.size, headers)


def _looked_at(quads: Iterator[ox.Quad], stop: threading.Event) -> Iterator[ox.Quad]:
    for quad in quads:
        if stop.is_set():
            raise Stopped
        yield quad
