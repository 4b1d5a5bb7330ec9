"""`!Fluent` documents to fluents and back; the only file that knows the sentinel 0.

The layout is that of Listings 2.2, 4.1 and 4.2:

    !Fluent
    Class_Instance: [On, on4]
    StartTime: [0.0, 0.0]
    FinishTime: [119.621, 161.817]
    Properties:
      - [hasPhysicalEntity, Mug, mug1]

Documents are separated by `---`; as the listings leave one separator out, a tag at the beginning
of a line begins a document too. Nothing is guessed: a value is converted by its declared type,
never by what it looks like. A time of 0 on either side of an interval means unknown and becomes
None.
"""

from __future__ import annotations

import io
import json
import math
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import lru_cache, partial
from itertools import takewhile
from typing import IO, Any, TextIO, cast

from fluentboard.errors import FluentboardError, IntervalReversed, InvalidTime, InvalidYaml
from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.interval import UNKNOWN, Interval
from fluentboard.model.literals import Value
from fluentboard.model.yaml_tree import Node, Place, parsed

MAX_DOCUMENT_CHARACTERS = 16 * 1024 * 1024
"""Longest `!Fluent` document that is read; 16 Mi characters are some 300,000 properties."""

_Lines = str | bytes | Iterable[str] | Iterable[bytes] | TextIO | IO[bytes]
_EXAMPLES = {
    "Class_Instance": "[On, on4]",
    "StartTime": "[119.621, 161.817]",
    "FinishTime": "[0.0, 0.0]",
    "Properties": "a list of entries such as [hasPassiveObject, Mug, mug1]",
}
_FLOATS = frozenset({"xsd:float", "xsd:double"})
_BREAKS_DOCUMENT = frozenset("-!.%\ufeff")

# What the fast path reads: the layout that `fluent_to_yaml` writes. The words are those that a YAML
# parser takes as they stand, so that both paths give the same fluent.
_REST = r"[\w.@+~/#-]"
_WORD = rf"\w{_REST}*(?::{_REST}+)*"
_NUMBER = r"-?[0-9]+(?:\.[0-9]+)?(?:[eE][+-]?[0-9]+)?"
_QUOTED = r'"[^"\\\x00-\x1f\x7f-\x9f\u2028\u2029\ud800-\udfff\ufeff\ufffe\uffff]*"'
_HEADER = re.compile(
    rf"!Fluent\nClass_Instance: \[({_WORD}|{_QUOTED}), ({_WORD}|{_QUOTED})\]\n"
    rf"StartTime: \[({_NUMBER}), ({_NUMBER})\]\nFinishTime: \[({_NUMBER}), ({_NUMBER})\]\n"
    r"Properties:( \[\])?\n"
)
_ENTRY = re.compile(
    rf"^  - \[({_WORD}), ({_WORD}|{_QUOTED}), (?:({_NUMBER})|(-?{_WORD}|{_QUOTED}))\]$",
    re.MULTILINE,
)
_TIME = re.compile(r"[+-]?([0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")

# Text that every YAML reader takes for the text it is: no digit or sign first, none of the words
# that YAML 1.1 takes for a boolean or null (the class `On` of Listing 2.2 is one).
_PLAIN = re.compile(
    rf"(?!(?:y|n|yes|no|true|false|on|off|null)\Z)[^\W\d]{_REST}*(?::{_REST}+)*", re.IGNORECASE
)
# JSON leaves these characters as they are; YAML does not allow them, or takes them for line breaks.
_NOT_PRINTABLE = re.compile(r"[\x7f-\x9f\u2028\u2029\ufeff\ufffe\uffff]")


def read_fluents(lines: _Lines, source: str = "<stream>") -> Iterator[Fluent]:
    """The fluents of a stream of `!Fluent` documents, one after the other.

    Only one document is in memory at a time, even where a file holds no line breaks. To show
    progress, open the file in binary mode and ask it for `tell()` between fluents.

    Args:
        lines: an open text or binary (UTF-8) file, any iterable of lines, or the whole text.
        source: names the stream in errors, usually the file name.

    Raises:
        InvalidYaml: a document is not a fluent in the layout of the listings.
        InvalidName: a fluent, class or property name cannot be part of an IRI.
        InvalidTime: a time is not a finite number.
        InvalidValue: a property value is not of its declared type.
        IntervalReversed: an interval, or the fluent, ends before it starts.

    The message and the detail of each name source, line and document, both counted from 1.
    """
    for document, (line, text) in enumerate(_documents(lines, source), start=1):
        fluent = read_canonical(text)
        yield _Reader(Place(source, line, document)).fluent(text) if fluent is None else fluent


def write_fluents(fluents: Iterable[Fluent], stream: TextIO) -> int:
    """Writes fluents as YAML documents; returns how many.

    Version and author belong to a board and are not written.
    """
    count = 0
    for count, fluent in enumerate(fluents, start=1):
        text = fluent_to_yaml(fluent)
        stream.write(text if count == 1 else f"---\n{text}")
    return count


def fluent_to_yaml(fluent: Fluent) -> str:
    """The fluent as one `!Fluent` document without separators, in the style of Listing 2.2."""
    entries = [
        f"  - [{_word(p.name)}, {_word(p.type)}, {_scalar(p.value)}]\n" for p in fluent.properties
    ]
    return (
        f"!Fluent\nClass_Instance: [{_word(fluent.class_name)}, {_quoted_if_needed(fluent.name)}]\n"
        f"StartTime: {_times(fluent.start)}\nFinishTime: {_times(fluent.finish)}\n"
        + ("Properties:\n" if entries else "Properties: []\n")
        + "".join(entries)
    )


# Writing


def _times(interval: Interval) -> str:
    earliest, latest = interval.earliest, interval.latest
    return (
        f"[{'0.0' if earliest is None else _decimal(earliest)}, "
        f"{'0.0' if latest is None else _decimal(latest)}]"
    )


def _decimal(number: float) -> str:
    """The shortest text that reads back as the same float, here and in any YAML reader."""
    text = repr(number)
    # YAML 1.1 takes 1e-07 for text; it wants a point before the exponent.
    return text.replace("e", ".0e") if "e" in text and "." not in text else text


def _scalar(value: Value) -> str:
    if type(value) is float:
        return _decimal(value)
    return _quoted_if_needed(value) if isinstance(value, str) else str(value)


def _quoted_if_needed(text: str) -> str:
    if _PLAIN.fullmatch(text):
        return text
    escaped = json.dumps(text, ensure_ascii=False)
    return _NOT_PRINTABLE.sub(lambda found: f"\\u{ord(found[0]):04x}", escaped)


_word = lru_cache(maxsize=4096)(_quoted_if_needed)  # names of classes and properties repeat


# Splitting the stream into documents


def _documents(lines: _Lines, source: str) -> Iterator[tuple[int, str]]:
    """Line number and text of every document that is not empty, without its separators."""
    block: list[str] = []
    begins, size, number, found = 1, 0, 0, 0
    try:
        for number, line in enumerate(_text_lines(lines), start=1):
            if line[:1] in _BREAKS_DOCUMENT and (head := _boundary(line, number)) is not None:
                if text := _joined(block):
                    found += 1
                    yield begins, text
                block, begins, size = [head], number, len(head)
            else:
                block.append(line)
                size += len(line) + 1
            if size > MAX_DOCUMENT_CHARACTERS:
                Place(source, begins, found + 1).fail(
                    InvalidYaml,
                    f"a document is longer than {MAX_DOCUMENT_CHARACTERS} characters; separate "
                    "fluents by lines of ---, or split the fluent",
                )
    except UnicodeDecodeError as problem:
        # A text file decodes ahead of the lines it has given out.
        ahead = problem.object[: problem.start]
        tags = len(re.findall(rb"^(?:--- *)?!", ahead, re.MULTILINE))
        place = Place(
            source, number + 1 + ahead.count(b"\n"), found + max(1, tags + bool(_joined(block)))
        )
        place.fail(
            InvalidYaml,
            f"byte 0x{problem.object[problem.start]:02x} is not UTF-8; save the file as UTF-8",
        )
    if text := _joined(block):
        yield begins, text


def _text_lines(lines: _Lines) -> Iterator[str]:
    if isinstance(lines, str):
        lines = io.StringIO(lines)
    elif isinstance(lines, (bytes, bytearray)):
        lines = io.BytesIO(lines)
    if isinstance(lines, io.IOBase):
        # A limit per line keeps memory bounded where a file has no line breaks.
        read = partial(cast("Any", lines).readline, MAX_DOCUMENT_CHARACTERS + 1)
        parts = takewhile(len, iter(read, None))
    else:
        parts = iter(cast("Iterable[str | bytes]", lines))
    for part in parts:
        if isinstance(part, str):
            yield part
        else:
            # A line over the limit may be cut inside a character; it is refused for its length.
            fits = len(part) <= MAX_DOCUMENT_CHARACTERS
            yield part.decode("utf-8" if fits else "latin-1")


def _boundary(line: str, number: int) -> str | None:
    """What of a line belongs to the document it begins, or None if it begins none."""
    if line[0] == "\ufeff":
        if number > 1:
            return None
        rest = _boundary(line[1:], number) if len(line) > 1 else ""
        return line[1:] if rest is None else rest
    if line[0] == "!":
        return line
    if line.startswith(("---", "...")) and (len(line) == 3 or line[3].isspace()):
        rest = line[3:].strip()
        return "" if not rest or rest[0] == "#" else line[3:].lstrip(" ")
    # The version directive is the only one that changes nothing.
    return "" if line.startswith("%YAML ") else None


def _joined(block: list[str]) -> str:
    """The text of a document, or nothing if there are only comments and blank lines."""
    while block and not block[-1].strip():
        block.pop()
    text = "".join(block)
    if text.count("\n") < len(block):  # lines came without their ends
        text = "".join(line if line.endswith("\n") else f"{line}\n" for line in block)
    if "\r" in text:
        text = text.replace("\r\n", "\n")
    if text.startswith("!Fluent\n"):
        return text
    return text if any(line.strip() and line.lstrip()[0] != "#" for line in block) else ""


# Reading one document


def _seconds(text: str) -> float | None:
    """The time, or None where 0 says that it is unknown."""
    lexical = _TIME.fullmatch(text)
    seconds = float(text) if lexical else math.nan
    # 1e-999 is not the sentinel, though a float takes it for 0.
    if lexical and seconds == 0.0 and not re.search("[1-9]", lexical[1]):
        return None
    if not math.isfinite(seconds) or seconds == 0.0:
        raise InvalidTime(
            f"{text!r} is not a time; give a finite number of seconds, or 0.0 for unknown"
        )
    return seconds


def read_canonical(text: str) -> Fluent | None:
    """The fluent of a document in the layout of `fluent_to_yaml`, or None if it is not."""
    header = _HEADER.match(text)
    if header is None:
        return None
    class_name, name, *times, empty = header.groups()
    entries = cast("list[tuple[str, str, str, str]]", _ENTRY.findall(text, header.end()))
    if len(entries) != text.count("\n", header.end()) or (empty and entries):
        return None
    try:
        return Fluent(
            _unquoted(name),
            _unquoted(class_name),
            _interval(times[0], times[1]),
            _interval(times[2], times[3]),
            tuple(
                [
                    Property(
                        statement,
                        _unquoted(type_),
                        (float(number) if type_ in _FLOATS else number)
                        if number
                        else _unquoted(word),
                    )
                    for statement, type_, number, word in entries
                ]
            ),
        )
    except FluentboardError:
        return None  # the parser knows the line


def _unquoted(word: str) -> str:
    return word if word[0] != '"' else word[1:-1]


def _interval(earliest: str, latest: str) -> Interval:
    if earliest != latest:
        return Interval(_seconds(earliest), _seconds(latest))
    time_s = _seconds(earliest) if earliest != "0.0" else None
    return UNKNOWN if time_s is None else Interval(time_s, time_s)


@dataclass(frozen=True, slots=True)
class _Reader:
    """Reads one document of any layout that YAML allows, and says what is wrong with it."""

    begin: Place

    def fluent(self, text: str) -> Fluent:
        """The fluent that the text describes."""
        root = parsed(text, self.begin)
        if root is None or root.kind != "mapping" or root.tag != "!Fluent":
            tag = "no tag" if root is None or root.tag is None else f"the tag {root.tag}"
            place = self.begin if root is None else self.begin.at(root)
            place.fail(
                InvalidYaml,
                f"a document is {root or 'empty'} with {tag}; begin each fluent with a line "
                "!Fluent, followed by " + ", ".join(_EXAMPLES),
            )
        values: dict[str, Node] = {}
        for key, value in zip(root.parts[::2], root.parts[1::2], strict=True):
            if key.kind != "scalar" or key.text not in _EXAMPLES:
                self.begin.at(key).fail(
                    InvalidYaml, f"unknown key {key}; the keys are {', '.join(_EXAMPLES)}"
                )
            if key.text in values:
                self.begin.at(key).fail(
                    InvalidYaml, f"{key.text} is given twice; remove one of the two"
                )
            values[key.text] = value
        for key, example in _EXAMPLES.items():
            if key not in values:
                self.begin.at(root).fail(InvalidYaml, f"{key} is missing; give {example}")
        class_name, name = self._texts("Class_Instance", values["Class_Instance"], 2)
        start = self._times("StartTime", values["StartTime"], name)
        finish = self._times("FinishTime", values["FinishTime"], name)
        properties = tuple(self._properties(values["Properties"], name))
        try:
            return Fluent(name, class_name, start, finish, properties)
        except IntervalReversed as problem:
            place = self.begin.at(values["FinishTime"])
            place.fail(type(problem), problem.message, **problem.detail)
        except FluentboardError as problem:
            place = self.begin.at(values["Class_Instance"])
            place.fail(type(problem), problem.message, **problem.detail)

    def _properties(self, node: Node, fluent: str) -> Iterator[Property]:
        if node.kind == "scalar" and node.text == "" and node.tag is None:
            return  # nothing after the colon
        if node.kind != "sequence" or node.tag is not None:
            self.begin.at(node).fail(
                InvalidYaml, f"Properties is {node}; give {_EXAMPLES['Properties']}, or []"
            )
        for entry in node.parts:
            name, type_, value = self._texts("Properties", entry, 3)
            try:
                yield Property(name, type_, value)
            except FluentboardError as problem:
                self.begin.at(entry).fail(
                    type(problem), f"{fluent!r}: {problem.message}", **problem.detail
                )

    def _times(self, key: str, node: Node, fluent: str) -> Interval:
        earliest, latest = self._texts(key, node, 2)
        try:
            return _interval(earliest, latest)
        except FluentboardError as problem:
            self.begin.at(node).fail(
                type(problem), f"{key} of {fluent!r}: {problem.message}", **problem.detail
            )

    def _texts(self, key: str, node: Node, count: int) -> list[str]:
        """The texts of a sequence of so many scalars."""
        tagged = next((part for part in (node, *node.parts) if part.tag is not None), None)
        if tagged is not None:
            self.begin.at(tagged).fail(
                InvalidYaml,
                f"{key} has the tag {tagged.tag}; only a document is tagged, as !Fluent",
            )
        plain = all(part.kind == "scalar" for part in node.parts)
        if node.kind != "sequence" or len(node.parts) != count or not plain:
            shown = f"[{', '.join(map(str, node.parts[:5]))}]" if node.parts else str(node)
            self.begin.at(node).fail(
                InvalidYaml,
                f"{key} holds {shown}; give {count} values, as in "
                + ("[hasPassiveObject, Mug, mug1]" if count == 3 else _EXAMPLES[key]),
            )
        return [part.text for part in node.parts]
