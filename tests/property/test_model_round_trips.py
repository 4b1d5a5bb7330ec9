"""Fluent to YAML or JSON and back is the same fluent, and any YAML reader reads what we mean."""

from __future__ import annotations

import io
import json
from typing import Any

import yaml
from hypothesis import example, given, settings
from hypothesis import strategies as st

from fluentboard.errors import FluentboardError
from fluentboard.model import yaml_format
from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.interval import Interval
from fluentboard.model.json_format import fluent_from_json, fluent_to_json
from fluentboard.model.yaml_format import fluent_to_yaml, read_fluents, write_fluents

TIMES = st.none() | st.floats(allow_nan=False, allow_infinity=False).filter(bool)
# fmt: off
WORDS = st.sampled_from([
    "On", "on4", "no", "Yes", "TRUE", "null", "y", "12", "1e3", "0x1", "1_0", "1:30", "-5", "+3",
    ".5", "2015-02-06", "a:b", "xsd:float", "a-", "a+b", "hasX", "mug1", "_", "__", "größe", "茶碗",
    "a@b", "a~",
])
ODD_SCALARS = st.sampled_from([
    "1.0", "-1.40", "0.0", "1e400", "1e-400", "nan", ".inf", "a b", "a: b", "a #b", "'x'", "a:",
    '"x y"', '""', '"a\\n"', "", "[", "]", "&a", "*a", "!x", "~", "--", "a#b", "a:#b", "-a", "-",
    "-1:2", "1,0", "?x", "%x", "|", "=", "<<", "a/b", "http://x/y#z",
])
# fmt: on
NAMES = st.text(
    st.characters(categories=["L", "N"], include_characters="_.:@+~-"), min_size=1, max_size=12
).filter(lambda name: name not in (".", ".."))
TERMS = (
    st.text(
        st.characters(exclude_categories=["C", "Z"], exclude_characters='<>"{}|\\^`'),
        min_size=1,
        max_size=12,
    )
    | NAMES
    | WORDS
    | st.just("http://example.org/terms#has-x")
)
TEXTS = WORDS | st.text(
    st.characters(exclude_categories=["Cs"], exclude_characters="\ufffe\uffff").filter(
        lambda letter: letter >= " " or letter in "\t\n\r"
    )
)


@st.composite
def intervals(draw: st.DrawFn) -> Interval:
    earliest, latest = draw(TIMES), draw(TIMES)
    if earliest is not None and latest is not None and earliest > latest:
        earliest, latest = latest, earliest
    return Interval(earliest, latest)


def properties() -> st.SearchStrategy[Property]:
    literals = st.one_of(
        st.tuples(st.just("xsd:string"), TEXTS),
        st.tuples(st.just("xsd:double"), st.floats(allow_nan=False, allow_infinity=False)),
        st.tuples(st.just("xsd:float"), st.floats(width=32, allow_nan=False, allow_infinity=False)),
        st.tuples(st.just("xsd:integer"), st.integers(-(2**63), 2**63 - 1)),
        st.tuples(st.just("xsd:boolean"), st.booleans()),
        st.tuples(st.just("xsd:decimal"), st.from_regex(r"[+-]?[0-9]+(\.[0-9]*)?", fullmatch=True)),
        st.tuples(st.just("xsd:dateTime"), st.just("2015-02-06T12:42:37.28Z")),
        st.tuples(
            TERMS.filter(lambda term: not term.startswith("xsd:")),
            NAMES | WORDS,
        ),
    )
    return st.tuples(TERMS, literals).map(lambda parts: Property(parts[0], *parts[1]))


@st.composite
def fluents(draw: st.DrawFn) -> Fluent:
    start, finish = draw(intervals()), draw(intervals())
    if None not in (start.earliest, finish.latest) and start.earliest > finish.latest:  # type: ignore[operator]
        start, finish = finish, start
    name, class_name = draw(NAMES | WORDS), draw(TERMS)
    statements = tuple(draw(st.lists(properties(), max_size=5)))
    try:
        return Fluent(name, class_name, start, finish, statements)
    except FluentboardError:  # the two intervals cannot be ordered
        return Fluent(name, class_name, start, Interval(), statements)


class PlainReader(yaml.SafeLoader):
    """What any other YAML program does with a document of ours."""


def _mapping(loader: Any, node: Any) -> Any:
    return loader.construct_mapping(node, deep=True)


PlainReader.add_constructor("!Fluent", _mapping)


@settings(max_examples=50)
@given(st.lists(fluents(), max_size=3))
def test_fluents_survive_yaml(written: list[Fluent]):
    stream = io.StringIO()
    write_fluents(written, stream)
    text = stream.getvalue()
    assert list(read_fluents(text)) == written
    assert repr(list(read_fluents(text))) == repr(written)  # -0.0 equals 0.0
    assert list(read_fluents(text.encode())) == written
    assert list(read_fluents(text.split("\n"))) == written


@settings(max_examples=50)
@given(fluents(), st.integers(0, 2**40), st.text(max_size=8), st.integers(0, 2**40))
def test_a_fluent_survives_json(fluent: Fluent, version: int, author: str, created: int):
    board = Fluent(
        fluent.name, fluent.class_name, fluent.start, fluent.finish, fluent.properties,
        version, author, created,
    )  # fmt: skip
    assert fluent_from_json(json.loads(json.dumps(fluent_to_json(board)))) == board


@settings(max_examples=60)
@given(fluents())
def test_any_yaml_reader_finds_the_same_words_and_numbers(fluent: Fluent):
    read = yaml.load(fluent_to_yaml(fluent), Loader=PlainReader)  # a SafeLoader
    assert read["Class_Instance"] == [fluent.class_name, fluent.name]
    for key, interval in (("StartTime", fluent.start), ("FinishTime", fluent.finish)):
        assert read[key] == [interval.earliest or 0.0, interval.latest or 0.0]
    assert read["Properties"] == [[p.name, p.type, p.value] for p in fluent.properties]
    assert [type(entry[2]) for entry in read["Properties"]] == [
        type(p.value) for p in fluent.properties
    ]


# Texts near the canonical layout, most of them wrong somewhere.
SCALARS = WORDS | ODD_SCALARS | NAMES | TEXTS


@st.composite
def near_documents(draw: st.DrawFn) -> str:
    class_name, name = draw(st.just("Mug") | WORDS | SCALARS), draw(st.just("mug1") | SCALARS)
    good_times = st.sampled_from(["0.0", "1.0", "2.5", "7", "1e3"])
    times = sorted(draw(st.tuples(*[good_times] * 4)), key=float)
    if draw(st.integers(0, 4)) == 0:
        times[draw(st.integers(0, 3))] = draw(SCALARS)
    types = st.sampled_from(["xsd:float", "xsd:string", "xsd:integer", "xsd:boolean", "Mug", "On"])
    entries = [
        f"  - [{draw(WORDS | SCALARS)}, {draw(types | SCALARS)}, {draw(SCALARS)}]\n"
        for _ in range(draw(st.integers(0, 2)))
    ]
    empty = draw(st.sampled_from(["", "", " []", " # x"]))
    return (
        f"!Fluent\nClass_Instance: [{class_name}, {name}]\nStartTime: [{times[0]}, {times[1]}]\n"
        f"FinishTime: [{times[2]}, {times[3]}]\nProperties:{empty}\n" + "".join(entries)
    )


ENTRY = (
    "!Fluent\nClass_Instance: [A, a]\nStartTime: [1, 2]\nFinishTime: [0, 0]\nProperties:\n"
    "  - [p, xsd:float, 1.0]\n"
)


def outcome(text: str) -> Any:
    """The fluents, or the error's class and place."""
    try:
        return [fluent_to_json(fluent) for fluent in read_fluents(text)]
    except FluentboardError as problem:
        return type(problem), problem.detail["line"], problem.detail["document"]


@settings(max_examples=200)
@given(near_documents() | fluents().map(fluent_to_yaml))
@example(ENTRY.replace("Properties:", "Properties: []"))
@example(ENTRY.replace("[p, xsd:float, 1.0]", "[a#b, a:#b, -a]"))
def test_the_fast_path_reads_what_the_yaml_parser_reads(text: str):
    fast = outcome(text)
    canonical = yaml_format.read_canonical
    yaml_format.read_canonical = lambda _: None
    try:
        assert fast == outcome(text)
    finally:
        yaml_format.read_canonical = canonical


@given(near_documents())
def test_reading_gives_fluents_or_an_error_of_ours(text: str):
    outcome(text)


@given(st.text() | st.binary())
def test_reading_anything_gives_fluents_or_an_error_of_ours(text: Any):
    outcome(text)
