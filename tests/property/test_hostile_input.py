"""Whatever is sent as YAML or SPARQL, the answer is a result or an error with a code."""

from __future__ import annotations

import io
from collections.abc import Iterator

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from fluentboard.board.blackboard import Blackboard
from fluentboard.errors import FluentboardError
from fluentboard.model.yaml_format import read_fluents

LISTING = """!Fluent
Class_Instance: [On, on4]
StartTime: [0.0, 0.0]
FinishTime: [119.621, 161.817]
Properties:
- [hasPhysicalEntity, PhysicalEntity, mug1]
- [hasX, xsd:float, 1.5]
"""
BOMB = "a: &a [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{new}: &{new} [*{old}, *{old}, *{old}, *{old}, *{old}, *{old}, *{old}, *{old}, *{old}]\n"
    for old, new in zip("abcdefgh", "bcdefghi", strict=True)
)
PIECES = st.sampled_from(
    [
        *(
            "!Fluent",
            "!!python/object/apply:os.system",
            "---",
            "...",
            "- ",
            ": ",
            "[",
            "]",
            "{",
            "}",
        ),
        *(
            "&a",
            "*a",
            "<<: *a",
            "|",
            ">",
            "'",
            '"',
            "#",
            "%YAML 1.2",
            "\n",
            "\n  ",
            "\t",
            "\0",
            "\ufeff",
        ),
        *("Class_Instance", "StartTime", "FinishTime", "Properties", "On", "on4", "xsd:float"),
        *(
            "0.0",
            ".nan",
            ".inf",
            "-1e999",
            "1_000",
            "0x10",
            "2001-01-01",
            "null",
            "~",
            "yes",
            "1:30",
        ),
    ]
)
WORDS = st.sampled_from(
    [
        *(
            "SELECT",
            "ASK",
            "CONSTRUCT",
            "DESCRIBE",
            "WHERE",
            "FILTER",
            "OPTIONAL",
            "MINUS",
            "UNION",
        ),
        *(
            "GRAPH",
            "SERVICE",
            "SILENT",
            "BIND",
            "VALUES",
            "UNDEF",
            "GROUP BY",
            "HAVING",
            "ORDER BY",
        ),
        *("LIMIT", "OFFSET", "DISTINCT", "EXISTS", "NOT", "IN", "AS", "FROM", "NAMED", "BASE"),
        *("INSERT", "DELETE", "DATA", "WITH", "USING", "CLEAR", "DROP", "CREATE", "COPY", "ALL"),
        *("PREFIX", "COUNT(*)", "GROUP_CONCAT(?a)", "fb:holdsAt(?a, 1.0)", "fb:now()", "NOW()"),
        *(
            "{",
            "}",
            "(",
            ")",
            "[",
            "]",
            "[]",
            ".",
            ";",
            ",",
            "/",
            "*",
            "+",
            "?",
            "|",
            "^",
            "!",
            "a",
        ),
        *(
            "?a",
            "?b",
            "$c",
            "race:Mug",
            "rdf:type",
            "rdfs:subClassOf",
            "fluent:mug1",
            "<urn:x>",
            "<x>",
        ),
        *(
            "1",
            "1.5e3",
            '"a"',
            '"a"@en',
            "'''b'''",
            '"1"^^xsd:double',
            "true",
            "_:b",
            "<<",
            ">>",
            "\\u0041",
        ),
        *("#", "\n", "\0", "\ud800".encode("utf-8", "replace").decode(), "é", "🙂"),
    ]
)
QUERIES = (
    "SELECT ?s { ?s a race:Mug ; rdf:type/rdfs:subClassOf* ?c FILTER(fb:holdsAt(?s, 1.0)) }",
    "SELECT (GROUP_CONCAT(?o) AS ?x) { GRAPH ?g { SELECT ?s ?o { ?s ?p ?o } } } GROUP BY ?s",
    "INSERT { GRAPH <urn:g> { ?s <urn:p> ?o } } WHERE { ?s ?p ?o FILTER(?o > 1) } ; CLEAR ALL",
)


def fluents_in(data: bytes) -> None:
    try:
        for fluent in read_fluents(io.BytesIO(data), "the test"):
            assert fluent.name
    except FluentboardError:
        return


@settings(max_examples=150, suppress_health_check=[HealthCheck.too_slow])
@example(BOMB.encode())
@example(b"!Fluent\n" + b"[" * 5_000)
@example(b"a: " * 3_000)
@given(
    st.binary(max_size=200)
    | st.text(max_size=100).map(lambda text: text.encode("utf-8", "replace"))
)
def test_any_bytes_as_yaml(data: bytes) -> None:
    fluents_in(data)


@settings(max_examples=200, suppress_health_check=[HealthCheck.too_slow])
@given(st.lists(PIECES, max_size=30), st.integers(0, len(LISTING)), st.integers(0, len(LISTING)))
def test_mangled_fluents_as_yaml(pieces: list[str], start: int, end: int) -> None:
    text = LISTING[:start] + " ".join(pieces) + LISTING[max(start, end) :]
    fluents_in(text.encode("utf-8", "replace"))


@pytest.fixture(scope="module")
def board() -> Iterator[Blackboard]:
    with Blackboard.open(None, builtin_ontologies=False) as opened:
        yield opened


def ask(board: Blackboard, text: str) -> None:
    for at in (None, "now"):
        try:
            results = board.query(text, at=at)
            assert results is not None
        except FluentboardError:
            continue
    try:
        assert board.graphs.update(text, "test").result().number <= board.commit
    except FluentboardError:
        return


@settings(max_examples=200, suppress_health_check=[HealthCheck.too_slow])
@example(["#"])
@example(["SELECT *", *["{"] * 20_000])
@example(["SELECT * { ?a ?b ?c FILTER(", *["("] * 20_000])
@example(["SELECT * { ?a ?b ?c FILTER(", *["?a ||"] * 20_000, "?a ) }"])
@example(["INSERT { } WHERE", *["{"] * 20_000])
@given(st.lists(WORDS, max_size=25))
def test_any_words_as_sparql(board: Blackboard, words: list[str]) -> None:
    ask(board, " ".join(words))


@settings(max_examples=200, suppress_health_check=[HealthCheck.too_slow])
@given(
    st.sampled_from(QUERIES),
    st.lists(
        st.tuples(st.integers(0, 90), st.integers(0, 12), WORDS | st.text(max_size=3)), max_size=3
    ),
)
def test_mangled_queries_as_sparql(
    board: Blackboard, text: str, edits: list[tuple[int, int, str]]
) -> None:
    for place, length, word in edits:
        text = text[:place] + word + text[place + length :]
    ask(board, text.encode("utf-8", "replace").decode())
