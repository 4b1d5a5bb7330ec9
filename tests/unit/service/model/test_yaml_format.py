from __future__ import annotations

import io
import tempfile
from collections.abc import Iterator
from typing import Any

import pytest
import yaml

from fluentboard.errors import (
    FluentboardError,
    IntervalReversed,
    InvalidName,
    InvalidTime,
    InvalidValue,
    InvalidYaml,
)
from fluentboard.model import yaml_format, yaml_tree
from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.interval import UNKNOWN, Interval
from fluentboard.model.yaml_format import fluent_to_yaml, read_fluents, write_fluents

MUG1 = Fluent("mug1", "Mug", Interval(1.0, 2.0))
TWO_LINES = Fluent("note1", "Note", properties=(Property("hasText", "xsd:string", "a\n---\n!b"),))


def document(**changes: str | None) -> str:
    """The fluent mug1, with keys added, replaced or (None) left out."""
    keys: dict[str, str | None] = {
        "Class_Instance": "[Mug, mug1]",
        "StartTime": "[1.0, 2.0]",
        "FinishTime": "[0.0, 0.0]",
        "Properties": "[]",
    }
    lines = [f"{key}: {text}\n" for key, text in (keys | changes).items() if text is not None]
    return "!Fluent\n" + "".join(lines)


def entry(text: str) -> str:
    return document(Properties=f"\n  - {text}")


def as_text(data: bytes) -> io.TextIOWrapper:
    return io.TextIOWrapper(io.BytesIO(data), "utf-8")


# Reading


@pytest.mark.parametrize(
    "text",
    [
        document(),
        document()[:-1],
        document().replace("\n", "\r\n"),
        document().replace("\n", " # why\n"),
        document(Properties=""),
        "--- " + document() + "...\n",
        "%YAML 1.2\n---\n# mug\n" + document() + "---\n\n---\n# the end\n",
        "\ufeff" + document(),
        "\ufeff---\n" + document(),
        "!Fluent {Class_Instance: [Mug, mug1], StartTime: [1, 2.00], FinishTime: [0, 0],"
        " Properties: []}",
        "!Fluent\nProperties: []\nFinishTime: [0.0, 0.0]\nStartTime:\n- 1.0\n- 2e0\n"
        "Class_Instance: ['Mug', \"mug1\"]\n",
    ],
)
def test_a_fluent_may_be_laid_out_in_many_ways(text: str):
    assert list(read_fluents(text)) == [MUG1]


@pytest.mark.parametrize(
    "lines",
    [
        document().splitlines(),
        document().splitlines(keepends=True),
        document().encode(),
        document().encode().splitlines(keepends=True),
        io.StringIO(document()),
        io.BytesIO(document().encode()),
        iter(document().splitlines()),
    ],
)
def test_fluents_are_read_from_text_bytes_files_and_lines(lines: Any):
    assert list(read_fluents(lines)) == [MUG1]


def test_fluents_are_read_from_an_upload():
    # Uploads arrive as this kind of file, which is neither a text nor a binary one to Python.
    with tempfile.SpooledTemporaryFile() as upload:
        upload.write(document().encode())
        upload.seek(0)
        assert list(read_fluents(upload)) == [MUG1]


@pytest.mark.parametrize("text", ["", "\n\n", "---\n", "# nothing\n---\n...\n"])
def test_a_stream_without_documents_holds_no_fluents(text: str):
    assert list(read_fluents(text)) == []


def test_a_tag_begins_a_document_without_a_separator():
    assert len(list(read_fluents(document() + "\n" + document() + document()))) == 3


def test_fluents_are_given_out_before_the_stream_ends():
    def lines() -> Iterator[str]:
        yield from document().splitlines()
        yield "---"
        raise ConnectionResetError

    stream = read_fluents(lines())
    assert next(stream) == MUG1
    with pytest.raises(ConnectionResetError):
        next(stream)


@pytest.mark.parametrize("zero", ["0.0", "0", "0.00", "-0.0", "+0e7", ".0"])
@pytest.mark.parametrize(
    ("template", "interval"),
    [
        ("[{}, {}]", UNKNOWN),
        ("[{}, 5.0]", Interval(None, 5.0)),
        ("[5.0, {}]", Interval(5.0, None)),
    ],
)
def test_a_time_of_zero_is_unknown(zero: str, template: str, interval: Interval):
    (fluent,) = read_fluents(document(StartTime=template.format(zero, zero)))
    assert fluent.start == interval


def test_a_zero_that_is_not_a_time_stays_zero():
    (fluent,) = read_fluents(entry("[hasYaw, xsd:float, 0.0]"))
    assert fluent.values("hasYaw") == (0.0,)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("[p, xsd:string, yes]", "yes"),
        ("[p, xsd:string, 0x1]", "0x1"),
        ("[p, xsd:string, 1e3]", "1e3"),
        ("[p, xsd:string, 2015-02-06]", "2015-02-06"),
        ("[p, xsd:string, null]", "null"),
        ("[p, xsd:string, ~]", "~"),
        ("[p, xsd:string, two words]", "two words"),
        ("[p, xsd:string, 'it''s, so']", "it's, so"),
        ('[p, xsd:string, "a\\n\\u00e4"]', "a\nä"),
        ("[p, xsd:string, '']", ""),
        ("[p, xsd:float, 1e3]", 1000.0),
        ("[p, xsd:double, -1.40]", -1.4),
        ("[p, xsd:integer, -7]", -7),
        ("[p, xsd:boolean, True]", True),
        ("[p, xsd:boolean, 0]", False),
        ("[p, xsd:decimal, 10.30]", "10.30"),
        ("[p, On, yes]", "yes"),
        ("[p, On, 12]", "12"),
    ],
)
def test_a_value_is_read_by_its_declared_type_and_never_guessed(text: str, value: object):
    (fluent,) = read_fluents(entry(text))
    assert fluent.values("p") == (value,)
    assert type(fluent.values("p")[0]) is type(value)


def test_a_comment_after_properties_is_allowed():
    text = document(Properties="# unchanged\n  - [hasX, xsd:float, 1.0] # metres")
    (fluent,) = read_fluents(text)
    assert fluent.values("hasX") == (1.0,)


# What is refused

REFUSED: list[tuple[str, type[FluentboardError], int, str]] = [
    (document(StartTime="[nan, 2.0]"), InvalidTime, 3, "StartTime of 'mug1': 'nan'"),
    (document(StartTime="[.nan, 2.0]"), InvalidTime, 3, "0.0 for unknown"),
    (document(FinishTime="[1.0, .inf]"), InvalidTime, 4, "'.inf'"),
    (document(StartTime="[1e400, 2]"), InvalidTime, 3, "finite"),
    (document(StartTime="[1e-400, 2]"), InvalidTime, 3, "1e-400"),
    (document(StartTime="[0x1, 2]"), InvalidTime, 3, "0x1"),
    (document(StartTime="[1_0, 20]"), InvalidTime, 3, "1_0"),
    (document(StartTime="[~, 2]"), InvalidTime, 3, "'~'"),
    (document(StartTime="[yes, 2]"), InvalidTime, 3, "'yes'"),
    (document(StartTime="[2.0, 1.0]"), IntervalReversed, 3, "swap the two values"),
    (document(FinishTime="[0.0, 0.5]"), IntervalReversed, 4, "before it can have started"),
    (document(Class_Instance="[Mug, mug 1]"), InvalidName, 2, "'mug 1'"),
    (document(Class_Instance="[A Mug, mug1]"), InvalidName, 2, "'A Mug'"),
    (entry("[has x, xsd:float, 1]"), InvalidName, 6, "'has x'"),
    (entry("[p, Mug, mug 1]"), InvalidName, 6, "'mug 1'"),
    (entry("[p, xsd:float, yes]"), InvalidValue, 6, "'yes'"),
    (entry("[p, xsd:float, .nan]"), InvalidValue, 6, "'.nan'"),
    (entry("[p, xsd:boolean, yes]"), InvalidValue, 6, "true or false"),
    (entry("[p, xsd:nonsense, 1]"), InvalidValue, 6, "use one of"),
    (document(StartTime=None), InvalidYaml, 1, "StartTime is missing"),
    (document(Properties=None), InvalidYaml, 1, "Properties is missing"),
    (document(Author="me"), InvalidYaml, 6, "unknown key 'Author'"),
    (document() + "StartTime: [1.0, 2.0]\n", InvalidYaml, 6, "given twice"),
    (document() + "? [a]\n: b\n", InvalidYaml, 6, "unknown key a sequence"),
    (document(StartTime="1.0"), InvalidYaml, 3, "give 2 values"),
    (document(StartTime="[1.0]"), InvalidYaml, 3, "give 2 values"),
    (document(StartTime="[1.0, [2.0]]"), InvalidYaml, 3, "give 2 values"),
    (document(StartTime="[[[[1.0]]]]"), InvalidYaml, 3, "nested too deeply"),
    (document(StartTime="[!!float 1.0, 2.0]"), InvalidYaml, 3, "only a document is tagged"),
    (document(Class_Instance="{Mug: mug1}"), InvalidYaml, 2, "give 2 values"),
    (document(Properties="none"), InvalidYaml, 5, "or []"),
    (entry("[p, xsd:float]"), InvalidYaml, 6, "give 3 values"),
    (entry("{p: 1}"), InvalidYaml, 6, "give 3 values"),
    (document(Properties="[]\n  - [p, Mug, m]"), InvalidYaml, 6, "not YAML"),
    (document(StartTime="&start [1.0, 2.0]"), InvalidYaml, 3, "anchor or alias 'start'"),
    (document(FinishTime="*start"), InvalidYaml, 4, "anchor or alias 'start'"),
    ("!Fluent &all\n" + document()[8:], InvalidYaml, 1, "anchor or alias"),
    (document().replace("!Fluent", "!Fluant"), InvalidYaml, 1, "the tag !Fluant"),
    (document().replace("!Fluent\n", ""), InvalidYaml, 1, "no tag"),
    ("!Fluent\n", InvalidYaml, 1, "followed by Class_Instance"),
    ("!Fluent [Mug, mug1]\n", InvalidYaml, 1, "a sequence of 2"),
    ("just text\n", InvalidYaml, 1, "'just text' with no tag"),
    ("%TAG ! tag:a,2018:\n---\n" + document(), InvalidYaml, 2, "not YAML"),
    (document(Properties="\n\t- [p, Mug, m]"), InvalidYaml, 6, "tab"),
    (document(StartTime="[1.0,\t2.0]"), InvalidYaml, 3, "tab"),
    (document(Class_Instance="[Mug, mug1"), InvalidYaml, 3, "not YAML"),
    (entry('[p, xsd:string, "open]'), InvalidYaml, 7, "not YAML"),
    (entry("[p, xsd:string, \x00]"), InvalidYaml, 6, "U+0000"),
    (entry("[p, xsd:string, \ud800]"), InvalidYaml, 6, "U+D800"),
]


@pytest.mark.parametrize("parser", [yaml_tree.FAST_PARSER, yaml.BaseLoader])
@pytest.mark.parametrize(("text", "error", "line", "part"), REFUSED)
def test_what_is_wrong_is_named_with_file_line_and_document(
    text: str,
    error: type[FluentboardError],
    line: int,
    part: str,
    parser: Any,
    monkeypatch: pytest.MonkeyPatch,
):
    monkeypatch.setattr(yaml_tree, "FAST_PARSER", parser)
    stream = read_fluents(document() + "---\n" + text, "facts.yaml")
    assert next(stream) == MUG1
    with pytest.raises(FluentboardError) as failure:
        next(stream)
    assert type(failure.value) is error
    assert part in failure.value.message
    where = {"source": "facts.yaml", "line": 6 + line, "document": 2}
    assert failure.value.detail.items() >= where.items()
    assert failure.value.message.startswith(f"facts.yaml, line {6 + line}, document 2: ")


@pytest.mark.parametrize("parser", [yaml_tree.FAST_PARSER, yaml.BaseLoader])
def test_half_a_character_is_refused(parser: Any, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(yaml_tree, "FAST_PARSER", parser)
    with pytest.raises((InvalidYaml, InvalidValue), match="line 6, document 1"):
        list(read_fluents(entry('[p, xsd:string, "\\ud800"]')))


@pytest.mark.parametrize("wrap", [io.BytesIO, as_text])
def test_bytes_that_are_not_utf8_are_refused_with_their_line(wrap: Any):
    data = (document() + "---\n" + document()).encode() + b"# caf\xe9\n"
    with pytest.raises(InvalidYaml, match=r"line 12, document 2: byte 0xe9 is not UTF-8"):
        list(read_fluents(wrap(data)))


def test_a_document_over_the_limit_is_refused(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(yaml_format, "MAX_DOCUMENT_CHARACTERS", 1000)
    long = document(Properties="\n" + "  - [hasX, xsd:float, 1.0]\n" * 50)
    with pytest.raises(InvalidYaml, match="line 7, document 2: a document is longer than 1000"):
        list(read_fluents(document() + "---\n" + long))


@pytest.mark.parametrize("kind", [io.BytesIO, as_text])
@pytest.mark.parametrize("letter", ["x", "!", "€"])
def test_a_file_without_line_breaks_is_not_read_to_its_end(
    kind: Any, letter: str, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(yaml_format, "MAX_DOCUMENT_CHARACTERS", 1000)
    file = kind((letter * 200_000).encode())
    with pytest.raises(InvalidYaml, match="longer than 1000"):
        list(read_fluents(file))
    assert len(file.read()) > 100_000


def test_unfolding_aliases_are_refused_at_the_first_anchor():
    bomb = document(Properties="\n  - &a [x, x, x]\n  - &b [*a, *a, *a]")
    with pytest.raises(InvalidYaml, match="line 6, document 1: anchor"):
        list(read_fluents(bomb))


# Writing


def test_a_fluent_is_written_in_the_style_of_the_listings():
    fluent = Fluent(
        "on4",
        "Below",
        UNKNOWN,
        Interval(119.621, 161.817),
        (Property("isInitialKnowledge", "xsd:boolean", True), Property("hasMug", "Mug", "mug1")),
    )
    assert fluent_to_yaml(fluent) == (
        "!Fluent\n"
        "Class_Instance: [Below, on4]\n"
        "StartTime: [0.0, 0.0]\n"
        "FinishTime: [119.621, 161.817]\n"
        "Properties:\n"
        "  - [isInitialKnowledge, xsd:boolean, True]\n"
        "  - [hasMug, Mug, mug1]\n"
    )


def test_a_fluent_without_properties_is_written_with_an_empty_list():
    assert fluent_to_yaml(MUG1) == document()


def test_documents_are_separated_by_three_dashes():
    stream = io.StringIO()
    assert write_fluents([MUG1, MUG1], stream) == 2
    assert stream.getvalue() == document() + "---\n" + document()


def test_nothing_is_written_for_no_fluents():
    stream = io.StringIO()
    assert write_fluents([], stream) == 0
    assert stream.getvalue() == ""


def test_text_with_separators_in_it_stays_in_its_document():
    assert list(read_fluents(fluent_to_yaml(TWO_LINES))) == [TWO_LINES]


@pytest.mark.parametrize(
    ("text", "written"),
    [
        ("succeeded", "succeeded"),
        ("On", '"On"'),
        ("no", '"no"'),
        ("null", '"null"'),
        ("y", '"y"'),
        ("12", '"12"'),
        ("1e3", '"1e3"'),
        ("2015-02-06", '"2015-02-06"'),
        ("", '""'),
        ("two words", '"two words"'),
        ("a, b", '"a, b"'),
        ("a: b", '"a: b"'),
        ("a #b", '"a #b"'),
        ('say "a\\b"', '"say \\"a\\\\b\\""'),
        ("a\nb\tc\r", '"a\\nb\\tc\\r"'),
        ("Tasse größe 茶", '"Tasse größe 茶"'),
        ("größe", "größe"),
        ("\x85\u2028\ufeff\x7f", '"\\u0085\\u2028\\ufeff\\u007f"'),
    ],
)
def test_text_is_quoted_where_a_yaml_reader_would_take_it_for_something_else(
    text: str, written: str
):
    fluent = Fluent("a", "A", properties=(Property("p", "xsd:string", text),))
    assert fluent_to_yaml(fluent).endswith(f"  - [p, xsd:string, {written}]\n")


@pytest.mark.parametrize(
    ("number", "written"),
    [(0.1, "0.1"), (1e22, "1.0e+22"), (1.5e-7, "1.5e-07"), (1e-7, "1.0e-07"), (-0.0, "-0.0")],
)
def test_a_float_is_written_with_a_point_and_all_its_digits(number: float, written: str):
    fluent = Fluent("a", "A", properties=(Property("p", "xsd:double", number),))
    assert fluent_to_yaml(fluent).endswith(f"  - [p, xsd:double, {written}]\n")
