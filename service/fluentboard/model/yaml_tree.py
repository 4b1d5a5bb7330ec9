"""One YAML document as a tree of texts that know their lines; no value is interpreted.

Anchors, aliases and deep nesting are refused while parsing, so a small document cannot unfold into
a large one.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, NoReturn, cast

import yaml

from fluentboard.errors import FluentboardError, InvalidYaml

_MAX_DEPTH = 3  # a mapping of lists of lists
FAST_PARSER: Any = getattr(yaml, "CBaseLoader", yaml.BaseLoader)
"""libyaml where PyYAML was built with it; both parsers read the same."""
_KINDS: dict[object, str] = {
    yaml.ScalarEvent: "scalar",
    yaml.SequenceStartEvent: "sequence",
    yaml.MappingStartEvent: "mapping",
    yaml.SequenceEndEvent: "end",
    yaml.MappingEndEvent: "end",
}
# libyaml takes a tab for a space between values, PyYAML's own parser does not: one rule for both.
_TAB = re.compile(r"^[^\"'#\n]*\t", re.MULTILINE)
_UNREADABLE = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x84\x86-\x9f\ud800-\udfff\ufffe\uffff]")


@dataclass(slots=True)
class Node:
    """A part of a document: `text` of a scalar, or `parts` of a sequence or mapping."""

    kind: str
    line: int
    tag: str | None = None
    text: str = ""
    parts: list[Node] = field(default_factory=list["Node"])

    def __str__(self) -> str:
        if self.kind == "scalar":
            return repr(self.text) if len(self.text) <= 60 else f"{self.text[:57]!r}..."
        return f"a {self.kind} of {len(self.parts) // (2 if self.kind == 'mapping' else 1)}"


@dataclass(frozen=True, slots=True)
class Place:
    """Where a document, or a part of it, begins; for messages."""

    source: str
    line: int
    document: int

    def fail(self, error: type[FluentboardError], message: str, **detail: Any) -> NoReturn:
        """Raises the error with source, line and document in message and detail."""
        where = {"source": self.source, "line": self.line, "document": self.document}
        raise error(
            f"{self.source}, line {self.line}, document {self.document}: {message}",
            **{**detail, **where},
        ) from None

    def lines_on(self, lines: int) -> Place:
        """The place so many lines further on."""
        return Place(self.source, self.line + lines, self.document)

    def at(self, node: Node) -> Place:
        """The place of a part of the document."""
        return Place(self.source, node.line, self.document)


def parsed(text: str, begin: Place) -> Node | None:
    """The tree of a document, or None if it is empty.

    Args:
        text: the document without `---`.
        begin: where it begins.

    Raises:
        InvalidYaml: it is not YAML, has tabs outside quotes, anchors, aliases or characters that
            YAML does not allow, or is nested deeper than a fluent.
    """
    if tab := _TAB.search(text):
        place = begin.lines_on(text.count("\n", 0, tab.start()))
        place.fail(InvalidYaml, "a tab stands outside quotes; use spaces")
    try:
        return _tree(text, begin)
    except yaml.MarkedYAMLError as problem:
        mark = problem.problem_mark or problem.context_mark
        begin.lines_on(0 if mark is None else mark.line).fail(
            InvalidYaml,
            f"{problem.problem or problem.context}; this is not YAML, correct it or put the text "
            "in quotes",
        )
    except (yaml.YAMLError, UnicodeEncodeError) as problem:
        bad = _UNREADABLE.search(text)
        shown = f"the character U+{ord(bad[0]):04X}" if bad else str(problem)
        begin.lines_on(text.count("\n", 0, bad.start()) if bad else 0).fail(
            InvalidYaml, f"{shown} cannot stand in YAML; remove it or write it as an escape"
        )


def _tree(text: str, begin: Place) -> Node | None:
    root: Node | None = None
    open_nodes: list[Node] = []
    events = cast("Any", yaml).parse(text, Loader=FAST_PARSER)
    for event in cast("Iterator[Any]", events):
        if getattr(event, "anchor", None) is not None:
            begin.lines_on(event.start_mark.line).fail(
                InvalidYaml,
                f"anchor or alias {event.anchor!r}; write the value out where it is meant",
            )
        kind = _KINDS.get(cast("object", type(event)))
        if kind is None:
            continue
        if kind == "end":
            open_nodes.pop()
            continue
        node = Node(
            kind, begin.line + event.start_mark.line, event.tag, getattr(event, "value", "")
        )
        if open_nodes:
            open_nodes[-1].parts.append(node)
        elif root is None:
            root = node
        else:
            begin.at(node).fail(InvalidYaml, "a second document begins without a line ---")
        if kind != "scalar":
            open_nodes.append(node)
        if len(open_nodes) > _MAX_DEPTH:
            begin.at(node).fail(InvalidYaml, "brackets are nested too deeply for a fluent")
    return root
