"""SPARQL 1.1 Protocol: queries by GET, by form and by direct POST, and the service description."""

from __future__ import annotations

import re
from collections.abc import Mapping
from urllib.parse import quote

import pyoxigraph as ox

from fluentboard.api import parameters
from fluentboard.api.answering import (
    GRAPH_OFFERS,
    SOLUTION_OFFERS,
    Question,
    Result,
    result_content,
)
from fluentboard.api.evaluation import Costly, Evaluator
from fluentboard.api.exchange import (
    Call,
    Foreseen,
    HeaderList,
    Reply,
    StreamedReply,
    form_values,
    json_reply,
    utf8_text,
)
from fluentboard.api.mistakes import located
from fluentboard.api.negotiation import content_type, negotiated
from fluentboard.api.operations import Answer, Content, Operation, Parameter
from fluentboard.api.results import file_chunks
from fluentboard.api.service_description import DESCRIPTION_PREFIXES, service_description
from fluentboard.api.updating import Updater
from fluentboard.api.writing import commit_header
from fluentboard.board.blackboard import Blackboard
from fluentboard.board.events import Commit
from fluentboard.board.statement_rules import ClassInUse, ProtectedStatement
from fluentboard.config import LimitSettings
from fluentboard.errors import (
    FluentsAreReadOnly,
    InvalidInput,
    InvalidQuery,
    NotAcceptable,
    NotAllowed,
    QueryTimeout,
    StorageFailed,
    TooLarge,
    UnknownResource,
    UnsupportedMediaType,
)
from fluentboard_ontology import PREFIXES

_FORM = "application/x-www-form-urlencoded"
_DIRECT = "application/sparql-query"
_UPDATE = "application/sparql-update"

_CHARSET = re.compile(r";\s*charset=\"?([^\s\";]+)", re.IGNORECASE)

_RELATIVE_IRI = re.compile(r"<(?![A-Za-z][A-Za-z0-9+.-]*:)[^<>\"{}|^`\\\x00-\x20]*>")


class SparqlRoutes:
    """`/sparql`.

    Args:
        board: what is asked.
        evaluator: answers queries.
        updater: carries out updates.
        limits: on the length of a request.
    """

    def __init__(
        self, board: Blackboard, evaluator: Evaluator, updater: Updater, limits: LimitSettings
    ) -> None:
        self._board = board
        self._evaluator = evaluator
        self._updater = updater
        self._limits = limits

    async def get(self, call: Call) -> Reply | StreamedReply:
        """`GET /sparql`: a query, or without one the service description."""
        values = call.parameters()
        if "update" in values:
            raise InvalidQuery("an update is sent by POST, so that no link or cache repeats it")
        if "query" not in values:
            return self._description(call)
        return await self._answer(call, values)

    def at_once(
        self, query_string: bytes, headers: Mapping[bytes, bytes]
    ) -> Reply | Foreseen | None:
        """The reply to `GET /sparql`, if it takes no waiting; None also if something is wrong.

        Args:
            query_string: of the request, still encoded.
            headers: by lower-case name.
        """
        try:
            values = form_values(query_string, "the query string")
        except InvalidInput:
            return None
        texts = values.get("query", ())
        if len(values) != 1 or len(texts) != 1:
            return None
        accept = headers.get(b"accept")
        # A text with a relative IRI is no point query, and is kept with its base: it is not found.
        question = Question(texts[0], None if accept is None else accept.decode("latin-1"))
        result = self._evaluator.at_once(question)
        if isinstance(result, Result):
            reply = result_reply(result)
            return reply if isinstance(reply, Reply) else None
        return Foreseen(values, is_costly=result is Costly.QUERY)

    async def post(self, call: Call) -> Reply | StreamedReply:
        """`POST /sparql`: a query or an update, as a form or as the body itself."""
        values = await posted_values(call, self._limits.body_max_bytes)
        if "update" in values:
            return await self._update(call, values)
        return await self._answer(call, values)

    async def _update(self, call: Call, values: parameters.Values) -> Reply:
        self._updater.admit(call)
        texts = values["update"]
        if len(texts) != 1 or "query" in values:
            raise InvalidQuery(
                f"the request has {len(texts)} updates and {len(values.get('query', ()))} queries; "
                "send one update, as the form field `update` or as the body"
            )
        try:
            commit = await self._updater.update(
                call,
                texts[0],
                own_address(call),
                values.get("using-graph-uri", ()),
                values.get("using-named-graph-uri", ()),
            )
        except InvalidQuery as problem:
            raise located(problem, texts[0]) from None
        return json_reply(update_receipt(commit), 200, [commit_header(commit.number)])

    def _description(self, call: Call) -> Reply:
        media_type, form = negotiated(call.header(b"accept"), GRAPH_OFFERS)
        triples = service_description(self._board, own_address(call))
        text = ox.serialize(triples, format=form, prefixes=DESCRIPTION_PREFIXES)
        assert text is not None
        return Reply(text, content_type(media_type), 200, [_VARY])

    async def _answer(self, call: Call, values: parameters.Values) -> Reply | StreamedReply:
        queries = values.get("query", ())
        if len(queries) != 1:
            raise InvalidQuery(
                f"the request has {len(queries)} queries; send one, as the parameter `query` or as "
                "the body"
            )
        (text,) = queries
        base = f"BASE <{own_address(call)}> " if _RELATIVE_IRI.search(text) else ""
        accept = call.header(b"accept")
        if len(values) == 1:
            question = Question(base + text, accept)
        else:
            question = Question(
                base + text,
                accept,
                tuple(values.get("default-graph-uri", ())),
                tuple(values.get("named-graph-uri", ())),
                parameters.time_or_now(values, "at"),
                parameters.as_of(values, self._board),
                parameters.certainty(values),
            )
        try:
            foreseen = call.foreseen
            is_costly = foreseen is not None and foreseen.is_costly and not base
            result = await self._evaluator.evaluate(question, call, is_costly=is_costly)
        except InvalidQuery as problem:
            raise located(problem, text, len(base)) from None
        return result_reply(result)

    def operations(self) -> list[Operation]:
        """The routes, documented."""
        example = "SELECT ?mug WHERE { ?mug a race:Mug }"
        query = Parameter(
            "query", "The query. Without it, GET returns the service description.", example=example
        )
        description = (
            "SPARQL 1.1 over the whole history: ended fluents are there, with their endpoints "
            "(`upper:hasStartEarliest`, `upper:hasStartLatest`, `upper:hasFinishEarliest`, "
            "`upper:hasFinishLatest`), unless `at` and `asof` narrow it. The prefixes "
            + ", ".join(f"`{prefix}`" for prefix in PREFIXES)
            + " need no declaration. The result is complete before its first byte is sent, so a "
            "reply is either whole or a problem."
        )
        answer = Answer(
            "The result, in the format that Accept asks for.",
            _result_contents(),
            {
                "X-Commit": "The commit that it is exact at.",
                "X-At": "The time in seconds that it is exact at, where `at` was given.",
            },
        )
        errors = (
            InvalidQuery,
            InvalidInput,
            NotAcceptable,
            TooLarge,
            QueryTimeout,
            StorageFailed,
        )
        update_errors = (
            UnsupportedMediaType,
            FluentsAreReadOnly,
            ProtectedStatement,
            ClassInUse,
            UnknownResource,
            NotAllowed,
        )
        text = {"type": "string"}
        form = {
            "type": "object",
            "properties": {
                "query": text,
                "default-graph-uri": {"type": "array", "items": text},
                "named-graph-uri": {"type": "array", "items": text},
                "update": text,
                "using-graph-uri": {"type": "array", "items": text},
                "using-named-graph-uri": {"type": "array", "items": text},
            },
        }
        receipt = {"commit": 12, "added": 1, "removed": 0}
        return [
            Operation(
                "GET",
                "/sparql",
                self.get,
                "query",
                "Ask a SPARQL query",
                description,
                tag="sparql",
                parameters=(query, *_DATASET, *_TIMES),
                answers={200: answer},
                errors=errors,
                is_strict=False,
            ),
            Operation(
                "POST",
                "/sparql",
                self.post,
                "queryByPost",
                "Ask a SPARQL query, or carry out a SPARQL update",
                _UPDATES + description,
                tag="sparql",
                parameters=(*_DATASET, *_USING, *_TIMES),
                body={
                    _FORM: Content(form, {"query": example}),
                    _DIRECT: Content(text, example),
                    _UPDATE: Content(
                        text, "INSERT DATA { GRAPH <urn:notes> { <urn:a> a <urn:b> } }"
                    ),
                },
                body_description="The query or update, as a form field or as the body itself.",
                answers={
                    200: Answer(
                        "The result, in the format that Accept asks for; of an update, how many "
                        "statements came and went.",
                        {
                            **answer.content,
                            "application/json": Content({"type": "object"}, receipt),
                        },
                        answer.headers,
                    )
                },
                errors=(*errors, *update_errors),
                is_strict=False,
            ),
        ]


_VARY = (b"vary", b"Accept")


async def posted_values(call: Call, body_max_bytes: int) -> dict[str, list[str]]:
    """The parameters of a SPARQL request by POST; a body that is no form is `query` or `update`.

    Raises:
        UnsupportedMediaType: it is neither a form, a query nor an update, or not UTF-8.
        TooLarge: it is too long.
    """
    media_type = call.media_type
    values = call.parameters()
    if media_type not in (_FORM, _DIRECT, _UPDATE):
        raise UnsupportedMediaType(
            f"a query is sent as {_FORM} or {_DIRECT}, an update as {_FORM} or {_UPDATE}, not as "
            f"{media_type or 'untyped bytes'}",
            accepted=[_FORM, _DIRECT, _UPDATE],
        )
    charset = _CHARSET.search(call.header(b"content-type") or "")
    if charset is not None and charset[1].lower() not in ("utf-8", "utf8", "us-ascii"):
        raise UnsupportedMediaType(f"the body is in {charset[1]}; send it in UTF-8")
    body = await call.body(body_max_bytes)
    if media_type == _FORM:
        for name, found in form_values(body, "the form").items():
            values.setdefault(name, []).extend(found)
    else:
        name = "query" if media_type == _DIRECT else "update"
        values[name] = [*values.get(name, ()), utf8_text(body, f"the {name}")]
    return values


def result_reply(result: Result) -> Reply | StreamedReply:
    """The reply with a query's result."""
    headers: HeaderList = [_VARY, commit_header(result.commit)]
    if result.at_s is not None:
        headers.append((b"x-at", repr(result.at_s).encode()))
    if result.text is not None:
        return Reply(result.text, content_type(result.media_type), 200, headers)
    assert result.file is not None, "a result that is not in memory is in a file"
    chunks = file_chunks(result.file)
    return StreamedReply(chunks, content_type(result.media_type), result.size_bytes, headers)


def update_receipt(commit: Commit) -> dict[str, int]:
    """What is told of an update: how many statements came and went."""
    return {
        "commit": commit.number,
        "added": sum(change.added.count("\n") for change in commit.statements),
        "removed": sum(change.removed.count("\n") for change in commit.statements),
    }


def own_address(call: Call, path: str = "/sparql") -> str:
    """The address at which the caller reaches a path of this board."""
    host = quote(call.header(b"host") or "localhost", safe=":[]")
    return f"{call.scheme}://{host}{call.root_path}{path}"


_UPDATES = (
    "SPARQL 1.1 Update reaches what is said outside fluents: named graphs, and in the default "
    "graph what updates have said. A request is carried out as a whole or not at all, and needs "
    "the role write. One that would change a fluent is refused, and so is one that would change "
    "what an ontology says; `CLEAR` and `DELETE WHERE { ?s ?p ?o }` leave ontologies alone. "
)
_DATASET = tuple(
    Parameter(
        name,
        f"IRI of a graph {use}; may be repeated.",
        {"type": "array", "items": {"type": "string", "format": "iri"}},
    )
    for name, use in (
        ("default-graph-uri", "that becomes part of the default graph"),
        ("named-graph-uri", "that GRAPH sees"),
    )
)
_USING = tuple(
    Parameter(
        name,
        f"Of an update: IRI of a graph {use}; may be repeated.",
        {"type": "array", "items": {"type": "string", "format": "iri"}},
    )
    for name, use in (
        ("using-graph-uri", "that becomes part of WHERE's default graph"),
        ("using-named-graph-uri", "that GRAPH sees in WHERE"),
    )
)


_TIMES = (
    Parameter("at", "See only what holds at this time in seconds, or `now`.", example="now"),
    Parameter("certainly", "With `at`: only what surely holds.", {"type": "boolean"}, True),
    Parameter("possibly", "With `at`: also what may hold; the default.", {"type": "boolean"}, True),
    Parameter(
        "asof",
        "See what was believed after this commit, or at a time: 2026-05-01T12:00:00Z, or seconds "
        "with a decimal point.",
        example="17",
    ),
)


def _result_contents() -> dict[str, Content]:
    rows = {
        "head": {"vars": ["mug"]},
        "results": {"bindings": [{"mug": {"type": "uri", "value": PREFIXES["fluent"] + "mug1"}}]},
    }
    contents = {
        offer.media_type: result_content(offer.media_type)
        for offer in (*SOLUTION_OFFERS, *GRAPH_OFFERS)
    }
    contents["application/sparql-results+json"] = Content({"type": "object"}, rows)
    return contents
