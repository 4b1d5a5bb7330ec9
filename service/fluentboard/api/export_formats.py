"""The formats of an export, each as something that writes page after page of fluents."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Protocol

import orjson
import pyoxigraph as ox

from fluentboard.api.bodies import NDJSON, YAML
from fluentboard.board.owl_time import TIME
from fluentboard.model.fluent import Fluent
from fluentboard.model.json_format import fluent_to_json
from fluentboard.model.yaml_format import fluent_to_yaml
from fluentboard_ontology import PREFIXES

TURTLE, N_TRIPLES = "text/turtle", "application/n-triples"
TRIG, N_QUADS = "application/trig", "application/n-quads"
JSON_LD = "application/ld+json"

MEDIA_TYPES = {
    "yaml": YAML,
    "jsonl": NDJSON,
    "turtle": TURTLE,
    "ntriples": N_TRIPLES,
    "trig": TRIG,
    "nquads": N_QUADS,
    "jsonld": JSON_LD,
}
"""By the name of the format."""

OF_DATASETS = frozenset({TRIG, N_QUADS, JSON_LD})
"""Formats that have named graphs, so that all that the board says fits into one document."""

Lines = Callable[[Fluent], list[str]]
"""The N-Triples lines of a fluent, each with its line end."""


class Writer(Protocol):
    """Writes a document from its beginning to its end."""

    def begin(self) -> bytes:
        """What stands before everything else."""
        ...

    def fluents(self, page: Sequence[Fluent]) -> bytes:
        """A page of fluents."""
        ...

    def statements(self, quads: Iterable[ox.Quad]) -> bytes:
        """Statements outside fluents."""
        ...

    def end(self) -> bytes:
        """What stands after everything else."""
        ...


def writer_for(media_type: str, lines: Lines) -> Writer:
    """A writer of one document.

    Args:
        media_type: one of `MEDIA_TYPES`.
        lines: how a fluent is said in RDF.
    """
    if media_type == YAML:
        return _Yaml()
    if media_type == NDJSON:
        return _JsonLines()
    if media_type == JSON_LD:
        return _JsonLd(lines)
    return _Lines(media_type, lines)


class _Yaml:
    def __init__(self) -> None:
        self._separator = ""

    def begin(self) -> bytes:
        return b""

    def fluents(self, page: Sequence[Fluent]) -> bytes:
        found: list[str] = []
        for fluent in page:
            found += [self._separator, fluent_to_yaml(fluent)]
            self._separator = "---\n"
        return "".join(found).encode()

    def statements(self, quads: Iterable[ox.Quad]) -> bytes:
        return b""

    def end(self) -> bytes:
        return b""


class _JsonLines:
    def begin(self) -> bytes:
        return b""

    def fluents(self, page: Sequence[Fluent]) -> bytes:
        return b"".join(
            orjson.dumps(fluent_to_json(fluent), option=orjson.OPT_APPEND_NEWLINE)
            for fluent in page
        )

    def statements(self, quads: Iterable[ox.Quad]) -> bytes:
        return b""

    def end(self) -> bytes:
        return b""


class _Lines:
    """Turtle, N-Triples, TriG and N-Quads: the lines of N-Triples are all of these."""

    def __init__(self, media_type: str, lines: Lines) -> None:
        self._media_type = media_type
        self._lines = lines

    def begin(self) -> bytes:
        if self._media_type not in (TURTLE, TRIG):
            return b""
        prefixes = {**PREFIXES, "time": TIME}
        return "".join(f"@prefix {name}: <{iri}> .\n" for name, iri in prefixes.items()).encode()

    def fluents(self, page: Sequence[Fluent]) -> bytes:
        return "".join(line for fluent in page for line in self._lines(fluent)).encode()

    def statements(self, quads: Iterable[ox.Quad]) -> bytes:
        form = ox.RdfFormat.TRIG if self._media_type == TRIG else ox.RdfFormat.N_QUADS
        return ox.serialize(quads, format=form) or b""

    def end(self) -> bytes:
        return b""


class _JsonLd:
    """Expanded JSON-LD: one list of nodes and graphs."""

    def __init__(self, lines: Lines) -> None:
        self._lines = lines
        self._is_first = True

    def begin(self) -> bytes:
        return b"[\n"

    def fluents(self, page: Sequence[Fluent]) -> bytes:
        text = "".join(line for fluent in page for line in self._lines(fluent))
        return self.statements(ox.parse(text, format=ox.RdfFormat.N_TRIPLES))

    def statements(self, quads: Iterable[ox.Quad]) -> bytes:
        written = (ox.serialize(quads, format=ox.RdfFormat.JSON_LD) or b"[]").strip()
        members = written[1:-1]
        if not members:
            return b""
        separator = b"" if self._is_first else b",\n"
        self._is_first = False
        return separator + members

    def end(self) -> bytes:
        return b"\n]\n"
