"""SPARQL 1.1 Protocol: queries by GET, by form and by direct POST, and the service description."""

from __future__ import annotations

import re
from urllib.parse import quote

import pyoxigraph as ox

from fluentboard.api import parameters
from fluentboard.api.evaluation import (
    GRAPH_OFFERS,
    SOLUTION_OFFERS,
    Evaluator,
    Question,
)
from fluentboard.api.exchange import Call, HeaderList, Reply, StreamedReply, form_values, utf8_text
from fluentboard.api.negotiation import negotiated
from fluentboard.api.operations import Answer, Content, Operation, Parameter
from fluentboard.api.writing import commit_header
from fluentboard.board.blackboard import Blackboard
from fluentboard.board.time_functions import FUNCTIONS
from fluentboard.config import LimitSettings
from fluentboard.errors import (
    FluentsAreReadOnly,
    InvalidInput,
    InvalidQuery,
    NotAcceptable,
    QueryTimeout,
    StorageFailed,
    TooLarge,
    UnsupportedMediaType,
)
from fluentboard_ontology import FB, PREFIXES

_FORM = "application/x-www-form-urlencoded"
_DIRECT = "application/sparql-query"
_UPDATE = "application/sparql-update"

# How much of a query is shown on either side of a mistake, and how many alternatives.
_CONTEXT = 30
_EXPECTED_MAX = 8

_POSITION = re.compile(r"error at (\d+):(\d+)")

_SD = "http://www.w3.org/ns/sparql-service-description#"
_FORMATS = "http://www.w3.org/ns/formats/"
_DESCRIBED_FORMATS = (
    "SPARQL_Results_JSON",
    "SPARQL_Results_XML",
    "SPARQL_Results_CSV",
    "SPARQL_Results_TSV",
    "Turtle",
    "N-Triples",
    "JSON-LD",
    "RDF_XML",
    "TriG",
    "N-Quads",
    "N3",
)


class SparqlRoutes:
    """`/sparql`.

    Args:
        board: what is asked.
        evaluator: answers queries.
        limits: on the length of a request.
    """

    def __init__(self, board: Blackboard, evaluator: Evaluator, limits: LimitSettings) -> None:
        self._board = board
        self._evaluator = evaluator
        self._limits = limits

    async def get(self, call: Call) -> Reply | StreamedReply:
        """`GET /sparql`: a query, or without one the service description."""
        values = call.parameters()
        if "update" in values:
            raise _read_only()
        if "query" not in values:
            return _description(call)
        return await self._answer(self._question(values, call.header(b"accept")))

    async def post(self, call: Call) -> Reply | StreamedReply:
        """`POST /sparql`: a query as a form, or as the body itself."""
        media_type = call.media_type
        values = call.parameters()
        if media_type == _FORM:
            body = await call.body(self._limits.body_max_bytes)
            for name, found in form_values(body, "the form").items():
                values.setdefault(name, []).extend(found)
        elif media_type == _DIRECT:
            body = await call.body(self._limits.body_max_bytes)
            values["query"] = [utf8_text(body, "the query")]
        elif media_type == _UPDATE:
            raise _read_only()
        else:
            raise UnsupportedMediaType(
                f"a query is sent as {_FORM} or {_DIRECT}, not as {media_type or 'untyped bytes'}",
                accepted=[_FORM, _DIRECT],
            )
        if "update" in values:
            raise _read_only()
        return await self._answer(self._question(values, call.header(b"accept")))

    def _question(self, values: parameters.Values, accept: str | None) -> Question:
        queries = values.get("query", ())
        if len(queries) != 1:
            raise InvalidQuery(
                f"the request has {len(queries)} queries; send one, as the parameter `query` or as "
                "the body"
            )
        return Question(
            queries[0],
            accept,
            tuple(values.get("default-graph-uri", ())),
            tuple(values.get("named-graph-uri", ())),
            parameters.time_or_now(values, "at"),
            parameters.as_of(values, self._board),
            parameters.certainty(values),
        )

    async def _answer(self, question: Question) -> Reply | StreamedReply:
        try:
            result = await self._evaluator.evaluate(question)
        except InvalidQuery as problem:
            raise _located(problem, question.text) from None
        headers: HeaderList = [_VARY, commit_header(result.commit)]
        if result.at_s is not None:
            headers.append((b"x-at", repr(result.at_s).encode()))
        if result.text is not None:
            return Reply(result.text, result.media_type.encode(), 200, headers)
        sink = result.sink
        assert sink is not None, "a result that is not in memory is in a file"
        return StreamedReply(sink.chunks(), result.media_type.encode(), sink.size, headers)

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
            FluentsAreReadOnly,
            TooLarge,
            QueryTimeout,
            StorageFailed,
        )
        text = {"type": "string"}
        form = {
            "type": "object",
            "properties": {
                "query": text,
                "default-graph-uri": {"type": "array", "items": text},
                "named-graph-uri": {"type": "array", "items": text},
            },
            "required": ["query"],
        }
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
                "Ask a SPARQL query that is too long for an address",
                description,
                tag="sparql",
                parameters=(*_DATASET, *_TIMES),
                body={
                    _FORM: Content(form, {"query": example}),
                    _DIRECT: Content(text, example),
                },
                body_description="The query, as a form field or as the body itself.",
                answers={200: answer},
                errors=(*errors, UnsupportedMediaType),
                is_strict=False,
            ),
        ]


_VARY = (b"vary", b"Accept")
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


def _located(problem: InvalidQuery, query: str) -> InvalidQuery:
    """The problem with the place in the query, instead of all that could have stood there."""
    position = _POSITION.search(problem.message)
    if position is None:
        return problem
    line, column = int(position[1]), int(position[2])
    text = (query.splitlines() or [""])[min(line, query.count("\n") + 1) - 1]
    before, _, expected = problem.message.partition("expected one of")
    few = expected.count(",") < _EXPECTED_MAX
    begin = max(0, column - 1 - _CONTEXT)
    near = text[begin : column - 1 + _CONTEXT]
    message = problem.message if few else before.rstrip(": ")
    return InvalidQuery(
        f"{message} (line {line}, column {column}, near {near!r})",
        **{**problem.detail, "line": line, "column": column},
    )


def _read_only() -> FluentsAreReadOnly:
    return FluentsAreReadOnly(
        "fluents are not changed by SPARQL Update, so that their intervals stay consistent and "
        "nothing is lost; assert with POST /fluents, refine with PATCH /fluents/{name}, end with "
        "POST /fluents/{name}/end, several at once with POST /commands"
    )


def _description(call: Call) -> Reply:
    """The service description (SPARQL 1.1 Service Description)."""
    media_type, form = negotiated(call.header(b"accept"), GRAPH_OFFERS)
    service, dataset, graph = (ox.BlankNode(name) for name in ("service", "dataset", "graph"))

    def sd(name: str) -> ox.NamedNode:
        return ox.NamedNode(_SD + name)

    a = ox.NamedNode(PREFIXES["rdf"] + "type")
    triples = [
        ox.Triple(service, a, sd("Service")),
        ox.Triple(service, sd("endpoint"), ox.NamedNode(_own_address(call))),
        ox.Triple(service, sd("supportedLanguage"), sd("SPARQL11Query")),
        ox.Triple(service, sd("defaultDataset"), dataset),
        ox.Triple(dataset, a, sd("Dataset")),
        ox.Triple(dataset, sd("defaultGraph"), graph),
        ox.Triple(graph, a, sd("Graph")),
    ]
    triples += [
        ox.Triple(service, sd("resultFormat"), ox.NamedNode(_FORMATS + name))
        for name in _DESCRIBED_FORMATS
    ]
    for name, what in FUNCTIONS.items():
        function = ox.NamedNode(FB + name)
        triples += [
            ox.Triple(service, sd("extensionFunction"), function),
            ox.Triple(function, a, sd("Function")),
            ox.Triple(function, ox.NamedNode(PREFIXES["rdfs"] + "comment"), ox.Literal(what)),
        ]
    prefixes = {"sd": _SD, "formats": _FORMATS, "fb": FB, "rdfs": PREFIXES["rdfs"]}
    text = ox.serialize(triples, format=form, prefixes=prefixes)
    assert text is not None
    return Reply(text, media_type.encode(), 200, [_VARY])


def _own_address(call: Call) -> str:
    host = quote(call.header(b"host") or "localhost", safe=":[]")
    return f"{call.scheme}://{host}{call.root_path}/sparql"


def _result_contents() -> dict[str, Content]:
    rows = {
        "head": {"vars": ["mug"]},
        "results": {"bindings": [{"mug": {"type": "uri", "value": PREFIXES["fluent"] + "mug1"}}]},
    }
    contents = {
        offer.media_type: Content({"type": "string"}) for offer in (*SOLUTION_OFFERS, *GRAPH_OFFERS)
    }
    contents["application/sparql-results+json"] = Content({"type": "object"}, rows)
    contents["application/json"] = Content({"type": "object"})
    return contents
