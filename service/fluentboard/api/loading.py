"""Loading: documents from the web for SPARQL LOAD, from the hosts that the operator names."""

from __future__ import annotations

from collections.abc import Collection
from urllib.parse import urlsplit

import httpx

from fluentboard.api.rdf_bodies import FORMATS, triples_in
from fluentboard.board.graphs import Reader
from fluentboard.board.update_operations import InsertStatements, Load, in_graph
from fluentboard.errors import FluentboardError, InvalidQuery, NotAllowed

_TIMEOUT_S = 20.0
_STATEMENTS_MAX = 1_000_000
_ACCEPT = (
    "text/turtle, application/n-triples;q=0.9, application/rdf+xml;q=0.8, application/ld+json;q=0.7"
)
_BY_ENDING = {
    ".ttl": "text/turtle",
    ".nt": "application/n-triples",
    ".rdf": "application/rdf+xml",
    ".owl": "application/rdf+xml",
    ".jsonld": "application/ld+json",
    ".n3": "text/n3",
}


def reader_for(hosts: Collection[str], size_max_bytes: int) -> Reader | None:
    """What carries out LOAD; None if there is no host to load from.

    Args:
        hosts: names, or names with a port, from which documents may be fetched.
        size_max_bytes: how long a document may be.
    """
    if not hosts:
        return None
    allowed = frozenset(host.lower() for host in hosts)

    def read(load: Load) -> InsertStatements | None:
        try:
            return _statements(load, allowed, size_max_bytes)
        except FluentboardError:
            if load.is_silent:
                return None
            raise

    return read


def _statements(load: Load, allowed: frozenset[str], size_max_bytes: int) -> InsertStatements:
    parts = urlsplit(load.address)
    host = (parts.hostname or "").lower()
    if parts.scheme not in ("http", "https"):
        raise NotAllowed(
            f"<{load.address}> is not on the web; LOAD reads http and https addresses only",
            address=load.address,
        )
    if not {host, parts.netloc.lower()} & allowed:
        raise NotAllowed(
            f"this board does not load from {host!r}; fetch the document yourself and send it with "
            "INSERT DATA, or name the host in security.load_hosts",
            address=load.address,
        )
    body, media_type = _fetched(load.address, size_max_bytes)
    if media_type not in FORMATS or media_type == "text/plain":
        ending = "." + parts.path.rpartition(".")[2].lower()
        media_type = _BY_ENDING.get(ending, media_type)
    triples = triples_in(body, media_type, load.address, _STATEMENTS_MAX)
    return InsertStatements(tuple(in_graph(triple, load.target) for triple in triples))


def _fetched(address: str, size_max_bytes: int) -> tuple[bytes, str]:
    """The document and its media type. A redirect is not followed: it may lead anywhere."""
    try:
        with httpx.stream(
            "GET", address, headers={"Accept": _ACCEPT}, timeout=_TIMEOUT_S, follow_redirects=False
        ) as reply:
            if not reply.is_success:
                raise InvalidQuery(
                    f"<{address}> cannot be loaded: it answers {reply.status_code}",
                    address=address,
                )
            parts: list[bytes] = []
            size = 0
            for part in reply.iter_bytes():
                size += len(part)
                if size > size_max_bytes:
                    raise InvalidQuery(
                        f"<{address}> is longer than the {size_max_bytes:,} bytes that a document "
                        "may have",
                        address=address,
                    )
                parts.append(part)
            media_type = reply.headers.get("content-type", "").partition(";")[0].strip().lower()
            return b"".join(parts), media_type
    except httpx.HTTPError as problem:
        raise InvalidQuery(
            f"<{address}> cannot be loaded: {problem or type(problem).__name__}", address=address
        ) from None
