"""Prepared queries: what a query text asks for is worked out once, however often it is sent.

Robots and dashboards send the same few texts over and over. What follows from the text alone is
kept by text; how its class paths are rewritten follows from the text and the class hierarchy, and
is kept with the vocabulary that it was worked out for. A vocabulary never changes - a new ontology
makes a new one - so what is kept cannot become wrong, and goes with the vocabulary.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from threading import Lock
from weakref import WeakKeyDictionary

from fluentboard.board.class_closure import use_class_closure
from fluentboard.board.engine_repairs import needs_repair
from fluentboard.board.query_size import check_size
from fluentboard.board.sparql_tokens import has_word, tokens_of
from fluentboard.board.vocabulary import Vocabulary
from fluentboard_ontology import PREFIXES

_KEPT_MAX = 512
_LONGEST_CHARACTERS = 8_000
"""A longer text is worked out anew each time, so that what is kept stays within 4 MB."""


@dataclass(frozen=True, slots=True)
class Reading:
    """What a query text says before it is parsed.

    Attributes:
        prefixes: the well-known ones that it may use without a declaration.
        sees_all_graphs: it has `GRAPH`, and does not name its dataset itself.
        needs_repair: the engine may depart from SPARQL 1.1 on it.
    """

    prefixes: Mapping[str, str]
    sees_all_graphs: bool
    needs_repair: bool


def reading(sparql: str) -> Reading:
    """What a query text says; known from the last time if it was sent before.

    Raises:
        InvalidQuery: it is nested too deeply, or too long to be evaluated.

    Example:
        >>> reading("SELECT ?p ?o { <urn:mug1> ?p ?o }").prefixes
        {}
        >>> sorted(reading("SELECT ?m { ?m a race:Mug }").prefixes)
        ['race']
    """
    return _read(sparql) if len(sparql) > _LONGEST_CHARACTERS else _known_reading(sparql)


def _read(sparql: str) -> Reading:
    check_size(sparql)
    prefixes = dict(PREFIXES)
    if "\\" not in sparql:  # an escape may spell a prefix
        # One that occurs in a string only does no harm.
        prefixes = {name: iri for name, iri in PREFIXES.items() if f"{name}:" in sparql}
    upper = sparql.upper()
    names_dataset = "FROM" in upper and has_word(tokens_of(sparql), "FROM")
    return Reading(prefixes, "GRAPH" in upper and not names_dataset, needs_repair(sparql))


_known_reading = lru_cache(_KEPT_MAX)(_read)


class PreparedQueries:
    """Query texts with their class paths rewritten. Safe to use from any thread.

    Args:
        kept_max: how many texts per vocabulary are kept; the one unused for longest goes first.
    """

    def __init__(self, kept_max: int = _KEPT_MAX) -> None:
        self._kept_max = kept_max
        self._guard = Lock()
        self._known: WeakKeyDictionary[Vocabulary, dict[str, str]] = WeakKeyDictionary()

    def rewritten(self, sparql: str, vocabulary: Vocabulary) -> str:
        """The query over the materialised class hierarchy.

        Args:
            sparql: the query.
            vocabulary: whose hierarchy the statements hold that the query is evaluated on.
        """
        if "subClassOf" not in sparql:
            return sparql
        if len(sparql) > _LONGEST_CHARACTERS:
            return use_class_closure(sparql, PREFIXES, vocabulary.is_node)
        with self._guard:
            known = self._known.setdefault(vocabulary, {})
            text = known.pop(sparql, None)
            if text is None:
                text = use_class_closure(sparql, PREFIXES, vocabulary.is_node)
                while len(known) >= self._kept_max:
                    del known[next(iter(known))]
            known[sparql] = text  # used last, so the last to go
        return text
