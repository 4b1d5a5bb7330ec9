"""A SPARQL 1.1 endpoint of somebody else: queries and updates over HTTP."""

from __future__ import annotations

import re
import threading
from collections.abc import Sequence
from urllib.parse import urlsplit

import httpx
import orjson
import pyoxigraph as ox

from fluentboard.board.oxigraph_query import QueryResults
from fluentboard.errors import InvalidConfiguration, InvalidQuery, QueryTimeout, StorageFailed
from fluentboard_ontology import PREFIXES

_ACCEPT = "application/sparql-results+json, application/n-triples;q=0.9"
BLANK = "urn:fluentboard:blank:"
"""Begins the IRIs that stand for blank nodes, for which an endpoint has no lasting names."""
_UPDATE_TIMEOUT_S = 600.0
_BLANK_IRI = re.compile(rf"<{BLANK}([^>\s]+)>")
_PROLOGUE = "".join(f"PREFIX {prefix}: <{iri}> " for prefix, iri in PREFIXES.items())


class Endpoint:
    """Speaks the SPARQL 1.1 protocol. Safe to use from any thread.

    Args:
        address: of the query endpoint; of a server's root, `/query` and `/update` below it are
            used, as Oxigraph has them.
        update_address: where updates go, if that cannot be told from `address`.
        timeout_s: how long a query may take.

    Raises:
        InvalidConfiguration: an address is no http or https URL.
    """

    def __init__(
        self, address: str, update_address: str | None = None, timeout_s: float = 30.0
    ) -> None:
        for given in filter(None, (address, update_address)):
            parts = urlsplit(given)
            if parts.scheme not in ("http", "https") or not parts.hostname:
                raise InvalidConfiguration(
                    f"the store {given!r} is not a URL; give one such as http://127.0.0.1:7878"
                )
        is_root = urlsplit(address).path in ("", "/")
        root = address.rstrip("/")
        self.address = address
        self._query_address = root + "/query" if is_root else address
        self._update_address = update_address or (root + "/update" if is_root else address)
        self._local = threading.local()
        self._timeout_s = timeout_s
        self._clients: list[httpx.Client] = []

    def query(
        self,
        sparql: str,
        *,
        base_iri: str | None = None,
        default_graphs: Sequence[str] = (),
        named_graphs: Sequence[str] = (),
    ) -> QueryResults:
        """The results of a query.

        Raises:
            InvalidQuery: the endpoint refuses it.
            StorageFailed: the endpoint cannot be reached, or fails.
        """
        base = "" if base_iri is None else f"BASE <{base_iri}> "
        fields: dict[str, str | list[str]] = {"query": base + _PROLOGUE + sparql}
        if default_graphs:
            fields["default-graph-uri"] = list(default_graphs)
        if named_graphs:
            fields["named-graph-uri"] = list(named_graphs)
        reply = self._posted(self._query_address, fields, {"Accept": _ACCEPT})
        media_type = reply.headers.get("content-type", "").partition(";")[0].strip()
        if media_type == "application/sparql-results+json":
            body = reply.content
            if BLANK.encode() in body:
                body = orjson.dumps(_with_blank_nodes(orjson.loads(body)))
            return ox.parse_query_results(body, format=ox.QueryResultsFormat.JSON)
        graph = ox.Store()
        graph.load(_BLANK_IRI.sub(r"_:\1", reply.text).encode(), format=ox.RdfFormat.N_TRIPLES)
        results = graph.query("CONSTRUCT { ?s ?p ?o } WHERE { ?s ?p ?o }")
        assert isinstance(results, ox.QueryTriples)
        return results

    def update(self, sparql: str) -> None:
        """Carries out an update, which the endpoint does as a whole or not at all.

        Raises:
            StorageFailed: it cannot be reached, or fails.
        """
        try:
            self._posted(self._update_address, {"update": sparql}, {})
        except (InvalidQuery, QueryTimeout) as problem:
            raise StorageFailed(f"the store refuses an update: {problem.message}") from None

    def close(self) -> None:
        """Closes all connections."""
        for client in self._clients:
            client.close()

    def _posted(
        self, address: str, fields: dict[str, str | list[str]], headers: dict[str, str]
    ) -> httpx.Response:
        client: httpx.Client | None = getattr(self._local, "client", None)
        if client is None:
            # trust_env: a proxy for the web must not come between a board and its store.
            client = self._local.client = httpx.Client(timeout=self._timeout_s, trust_env=False)
            self._clients.append(client)
        try:
            reply = client.post(
                address,
                data=fields,
                headers=headers,
                timeout=self._timeout_s if "query" in fields else _UPDATE_TIMEOUT_S,
            )
        except httpx.ReadTimeout:
            raise QueryTimeout(
                f"the store at {self.address} did not answer in time; narrow the query, add LIMIT, "
                "or raise limits.query_timeout_s"
            ) from None
        except httpx.HTTPError as problem:
            raise StorageFailed(
                f"the store at {self.address} does not answer: {problem or type(problem).__name__}"
            ) from None
        if reply.is_success:
            return reply
        complaint = reply.text.strip()[:500]
        if reply.status_code == 400:
            raise InvalidQuery(f"the query cannot be evaluated: {complaint}")
        raise StorageFailed(f"the store at {self.address} answers {reply.status_code}: {complaint}")


def _with_blank_nodes(results: dict[str, dict[str, list[dict[str, dict[str, str]]]]]) -> object:
    """SPARQL JSON results in which IRIs that stand for blank nodes are blank nodes again."""
    for row in results.get("results", {}).get("bindings", []):
        for term in row.values():
            if term.get("type") == "uri" and term["value"].startswith(BLANK):
                term.update(type="bnode", value=term["value"].removeprefix(BLANK))
    return results
