"""Events: what happened on the board. Frozen, and named in the past tense."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from fluentboard.model.fluent import Fluent

GraphEvent = Literal["", "created", "dropped"]

# One of these stands in every statement that declares a class or property, or relates classes.
_SCHEMA = ("#subClassOf>", "Class>", "Property>")


@dataclass(frozen=True, slots=True)
class FluentAdded:
    """A fluent was asserted that was not there before."""

    after: Fluent

    kind = "added"

    @property
    def before(self) -> None:
        """There was none."""
        return None


@dataclass(frozen=True, slots=True)
class FluentRefined:
    """An interval became narrower, or a property value was added."""

    before: Fluent
    after: Fluent

    kind = "refined"


@dataclass(frozen=True, slots=True)
class FluentEnded:
    """A finish became known (properties may have been added in the same breath)."""

    before: Fluent
    after: Fluent

    kind = "ended"


@dataclass(frozen=True, slots=True)
class FluentCorrected:
    """An admin replaced what was said, with a reason that the commit keeps."""

    before: Fluent
    after: Fluent

    kind = "corrected"


@dataclass(frozen=True, slots=True)
class StatementsChanged:
    """Statements outside fluents changed: an ontology was loaded or a graph was updated.

    Attributes:
        graph: IRI of the named graph, or "" for the default graph.
        added: N-Triples text.
        removed: N-Triples text.
        ontology: name of the ontology that this loads or replaces, or "".
        digest: fingerprint of the ontology's source text, or "".
        graph_event: `created` if the named graph was not there before, `dropped` if it is not there
            any more.
    """

    graph: str
    added: str
    removed: str
    ontology: str = ""
    digest: str = ""
    graph_event: GraphEvent = ""

    kind = "statements"

    @property
    def may_declare(self) -> bool:
        """It may change which classes and properties there are, and how classes are related."""
        return bool(self.ontology) or (
            not self.graph and any(mark in self.added or mark in self.removed for mark in _SCHEMA)
        )


FluentEvent = FluentAdded | FluentRefined | FluentEnded | FluentCorrected
Event = FluentEvent


@dataclass(frozen=True, slots=True)
class Commit:
    """What one accepted batch changed, all of it or nothing.

    Attributes:
        number: one more than the commit before; 1 is the first.
        wall_s: transaction time, in seconds since the Unix epoch.
        author: who asked for it.
        events: what happened to fluents, in the order of the commands.
        statements: what happened outside fluents.
        reason: why, where an admin forced it.
    """

    number: int
    wall_s: float
    author: str
    events: tuple[FluentEvent, ...] = ()
    statements: tuple[StatementsChanged, ...] = ()
    reason: str = ""
