"""Queries: to ask a board in SPARQL, and to take all of what it knows with one."""

from __future__ import annotations

from typing import Any

from fluentboard_client import exchange, replies
from fluentboard_client.calls import Ask, Pages, call, pages, pieces
from fluentboard_client.exchange import (
    ChangesFormat,
    ExportFormat,
    RdfVocabulary,
    Request,
    Time,
)
from fluentboard_client.results import Row


class QueryCalls:
    """What `Client` and `AsyncClient` have for queries and for copies of the board."""

    @call
    def query(
        self,
        sparql: str,
        *,
        at: Time | None = None,
        certainly: bool = False,
        as_of: int | None = None,
    ) -> Ask[list[Row] | bool | str]:
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
        request = exchange.sparql(sparql, at=at, certainly=certainly, as_of=as_of)
        return Ask(request, replies.result_of)

    @call
    def select(
        self,
        sparql: str,
        *,
        at: Time | None = None,
        certainly: bool = False,
        as_of: int | None = None,
    ) -> Ask[list[Row]]:
        """The rows of a SELECT; see `query`."""
        request = exchange.sparql(sparql, at=at, certainly=certainly, as_of=as_of)
        return Ask(request, replies.rows_of)

    @call
    def ask(
        self,
        sparql: str,
        *,
        at: Time | None = None,
        certainly: bool = False,
        as_of: int | None = None,
    ) -> Ask[bool]:
        """The truth of an ASK; see `query`."""
        request = exchange.sparql(sparql, at=at, certainly=certainly, as_of=as_of)
        return Ask(request, replies.truth_of)

    @call
    def construct(
        self,
        sparql: str,
        *,
        at: Time | None = None,
        certainly: bool = False,
        as_of: int | None = None,
    ) -> Ask[str]:
        """The N-Triples text of a CONSTRUCT or DESCRIBE; see `query`."""
        request = exchange.sparql(sparql, at=at, certainly=certainly, as_of=as_of)
        return Ask(request, replies.triples_of)

    @call
    def query_document(
        self,
        sparql: str,
        media_types: str,
        *,
        at: Time | None = None,
        certainly: bool = False,
        as_of: int | None = None,
    ) -> Ask[bytes]:
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
        request = exchange.sparql(
            sparql, at=at, certainly=certainly, as_of=as_of, media_types=media_types
        )
        return Ask(request, replies.bytes_of)

    @pieces
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
    ) -> Request:
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
        return exchange.export(
            format,
            at,
            class_name=class_name,
            during=during,
            certainly=certainly,
            as_of=as_of,
            vocabulary=vocabulary,
            relations=relations,
        )

    @pieces
    def changes(
        self,
        since: int = 0,
        *,
        until: int | None = None,
        follow: bool = False,
        format: ChangesFormat = "rdf-patch",
    ) -> Request:
        """What the commits after one changed, in pieces as they arrive.

        Args:
            since: the last commit that is known; 0 for all.
            until: the last commit to tell of.
            follow: go on with commits as they are made, for ever.
            format: RDF Patch, or JSON Lines.
        """
        return exchange.changes(since, until, follow, format)

    @pieces
    def backup(self, up_to: str | None = None) -> Request:
        """A copy of the board's journal, in pieces as they arrive; `restore` reads it.

        Args:
            up_to: number of its last commit, or a time; None for all.
        """
        return exchange.backup(up_to)

    @pages
    def audit(
        self,
        *,
        author: str | None = None,
        name: str | None = None,
        after: str | None = None,
        up_to: str | None = None,
        forced: bool = False,
    ) -> Pages[dict[str, Any]]:
        """Who changed what and when: the commits that pass a filter, in order.

        Args:
            author: only commits of this author.
            name: only commits that changed this fluent.
            after: only commits after this one, or after a time.
            up_to: only commits up to this one, or to a time.
            forced: only corrections that an admin forced.
        """

        def page(cursor: str | None) -> Request:
            return exchange.audit(author, name, cursor or after, up_to, forced)

        return Pages(page, replies.commits_of)

    @call
    def health(self) -> Ask[dict[str, Any]]:
        """What the service says of itself.

        Raises:
            BoardUnreachable: nothing answers.
        """
        return Ask(Request("GET", "/health"), replies.json_of)
