"""The routes of the RDF4J protocol as the OpenAPI document tells of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from fluentboard.api.answering import SOLUTION_OFFERS, result_content
from fluentboard.api.exchange import Handler
from fluentboard.api.operations import Answer, Content, Operation, Parameter
from fluentboard.api.rdf_bodies import PROPER_FORMATS, InvalidRdf
from fluentboard.api.statement_replies import STATEMENT_OFFERS
from fluentboard.board.statement_rules import ClassInUse, ProtectedStatement
from fluentboard.errors import (
    FluentboardError,
    FluentsAreReadOnly,
    IdempotencyConflict,
    InvalidInput,
    InvalidName,
    InvalidQuery,
    NotAcceptable,
    NotAllowed,
    QueryTimeout,
    StorageFailed,
    TooLarge,
    UnknownResource,
    UnsupportedMediaType,
)

if TYPE_CHECKING:
    from fluentboard.api.rdf4j import Rdf4jRoutes

_TEXT = {"type": "string"}
_FORM = "application/x-www-form-urlencoded"
_QUERY = "application/sparql-query"
_UPDATE = "application/sparql-update"

_READ_ERRORS: tuple[type[FluentboardError], ...] = (
    UnknownResource,
    InvalidInput,
    NotAcceptable,
    TooLarge,
    QueryTimeout,
)
_WRITE_ERRORS: tuple[type[FluentboardError], ...] = (
    UnknownResource,
    InvalidInput,
    InvalidRdf,
    InvalidQuery,
    InvalidName,
    NotAllowed,
    FluentsAreReadOnly,
    ProtectedStatement,
    ClassInUse,
    IdempotencyConflict,
    TooLarge,
    UnsupportedMediaType,
    QueryTimeout,
    StorageFailed,
)

_SUBJECT = Parameter("subj", "Subject, in Turtle syntax.", _TEXT, "<urn:a>")
_PREDICATE = Parameter("pred", "Predicate, likewise.", _TEXT, "<urn:p>")
_OBJECT = Parameter("obj", "Object, likewise.", _TEXT, '"text"@en')
_CONTEXT = Parameter(
    "context", "Graphs: IRIs in angle brackets, or `null` for the default graph.", _TEXT, "null"
)
_INFER = Parameter("infer", "`false`: without the class hierarchy.", {"type": "boolean"}, False)
_BASE = Parameter("baseURI", "What relative IRIs are relative to.", _TEXT, "<http://example.org/>")


_TABLES = {offer.media_type: result_content(offer.media_type) for offer in SOLUTION_OFFERS}
_STATEMENTS = {offer.media_type: result_content(offer.media_type) for offer in STATEMENT_OFFERS}
_PLAIN = {"text/plain": Content(_TEXT)}
_QUERIES = {_FORM: Content({"type": "object"}), _QUERY: Content(_TEXT, "ASK {}")}
_DOCUMENTS = {media_type: Content(_TEXT) for media_type in PROPER_FORMATS}
_DOCUMENTS_OR_UPDATES = {
    **_DOCUMENTS,
    _FORM: Content({"type": "object"}),
    _UPDATE: Content(_TEXT, "CLEAR ALL"),
}

_PATTERN = (_SUBJECT, _PREDICATE, _OBJECT, _CONTEXT)
_CONTEXTS = (_CONTEXT,)
_INFERENCE = (_INFER,)
_INTO = (_CONTEXT, _BASE)
_ACTIONS = (
    Parameter("action", "ADD, DELETE, GET, SIZE, QUERY, UPDATE, PING or COMMIT.", _TEXT, "COMMIT"),
    Parameter("query", "With QUERY: the query.", _TEXT),
    Parameter("update", "With UPDATE: the update.", _TEXT),
    *_PATTERN,
    _INFER,
    _BASE,
)


def _reading(
    path: str,
    handler: Handler,
    identifier: str,
    summary: str,
    contents: Mapping[str, Content],
    parameters: tuple[Parameter, ...] = (),
    *,
    method: str = "GET",
    body: Mapping[str, Content] | None = None,
    is_strict: bool = True,
) -> Operation:
    """A route of the protocol that changes nothing."""
    return Operation(
        method,
        path,
        handler,
        identifier,
        summary,
        tag="rdf4j",
        parameters=parameters,
        body=body or {},
        answers={200: Answer("What was asked for.", contents)},
        errors=_READ_ERRORS,
        is_strict=is_strict,
    )


def _writing(
    method: str,
    path: str,
    handler: Handler,
    identifier: str,
    summary: str,
    parameters: tuple[Parameter, ...] = (),
    *,
    body: Mapping[str, Content] | None = None,
    answers: Mapping[int, Answer] | None = None,
    is_strict: bool = True,
) -> Operation:
    """A route of the protocol that changes something."""
    done = {204: Answer("Done.", headers={"X-Commit": "Number of the commit."})}
    return Operation(
        method,
        path,
        handler,
        identifier,
        summary,
        tag="rdf4j",
        role="write",
        parameters=parameters,
        body=body or {},
        answers=answers or done,
        errors=_WRITE_ERRORS,
        is_strict=is_strict,
    )


def rdf4j_operations(routes: Rdf4jRoutes) -> list[Operation]:
    """All routes of the protocol."""
    here = "/repositories/{repository}"
    prefix, transaction = (
        f"{here}/namespaces/{{prefix}}",
        f"{here}/transactions/{{transaction}}",
    )
    begun = Answer("It has begun.", headers={"Location": "Address of the transaction."})
    acted = Answer("Done; of GET, SIZE and QUERY what was asked for.", _STATEMENTS)
    return [
        _reading("/protocol", routes.protocol, "rdf4jProtocol", "Version of the protocol", _PLAIN),
        _reading(
            "/repositories", routes.repositories, "rdf4jRepositories", "The repository", _TABLES
        ),
        _writing("PUT", here, routes.make_repository, "rdf4jMakeRepository", "Refused"),
        _writing("DELETE", here, routes.make_repository, "rdf4jDeleteRepository", "Refused"),
        _reading(here, routes.query, "rdf4jQuery", "Ask a query", _TABLES, is_strict=False),
        _reading(
            here,
            routes.query_by_post,
            "rdf4jQueryByPost",
            "Ask a query",
            _TABLES,
            method="POST",
            body=_QUERIES,
            is_strict=False,
        ),
        _reading(
            f"{here}/size", routes.size, "rdf4jSize", "Number of statements", _PLAIN, _CONTEXTS
        ),
        _reading(f"{here}/contexts", routes.contexts, "rdf4jContexts", "Named graphs", _TABLES),
        _reading(f"{here}/namespaces", routes.namespaces, "rdf4jNamespaces", "Prefixes", _TABLES),
        _writing(
            "DELETE",
            f"{here}/namespaces",
            routes.forget_namespaces,
            "rdf4jForgetNamespaces",
            "Forget prefixes",
        ),
        _reading(prefix, routes.namespace, "rdf4jNamespace", "What a prefix stands for", _PLAIN),
        _writing(
            "PUT",
            prefix,
            routes.set_namespace,
            "rdf4jSetNamespace",
            "Set a prefix",
            body=_PLAIN,
        ),
        _writing(
            "DELETE", prefix, routes.forget_namespace, "rdf4jForgetNamespace", "Forget a prefix"
        ),
        _reading(
            f"{here}/statements",
            routes.statements,
            "rdf4jStatements",
            "Statements that match",
            _STATEMENTS,
            (*_PATTERN, *_INFERENCE),
        ),
        _writing(
            "POST",
            f"{here}/statements",
            routes.add_statements,
            "rdf4jAddStatements",
            "Add statements, or carry out an update",
            _INTO,
            body=_DOCUMENTS_OR_UPDATES,
            is_strict=False,
        ),
        _writing(
            "PUT",
            f"{here}/statements",
            routes.replace_statements,
            "rdf4jReplaceStatements",
            "Replace statements",
            _INTO,
            body=_DOCUMENTS,
        ),
        _writing(
            "DELETE",
            f"{here}/statements",
            routes.delete_statements,
            "rdf4jDeleteStatements",
            "Remove statements that match",
            _PATTERN,
        ),
        _writing(
            "POST",
            f"{here}/transactions",
            routes.transactions.begin,
            "rdf4jBegin",
            "Begin a transaction",
            answers={201: begun},
            is_strict=False,
        ),
        _writing(
            "PUT",
            transaction,
            routes.transactions.act,
            "rdf4jAct",
            "Do something in a transaction",
            _ACTIONS,
            body=_DOCUMENTS,
            answers={200: acted},
            is_strict=False,
        ),
        _writing(
            "DELETE",
            transaction,
            routes.transactions.roll_back,
            "rdf4jRollBack",
            "Roll a transaction back",
        ),
        *routes.graph_store.routes(
            f"{here}/rdf-graphs/service", "OfRepository", with_parameters=True, tag="rdf4j"
        ),
        *routes.graph_store.routes(
            f"{here}/rdf-graphs/{{graph}}",
            "OfRepositoryByAddress",
            with_parameters=False,
            tag="rdf4j",
        ),
    ]
