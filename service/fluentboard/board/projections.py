"""Projections: everything that is derived from the journal, kept in step with it."""

from __future__ import annotations

import hashlib
import logging
import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import pyoxigraph as ox

from fluentboard.board.declarations import Declarations
from fluentboard.board.events import Commit, StatementsChanged
from fluentboard.board.folder_lock import FolderLock
from fluentboard.board.intervals import IntervalIndex
from fluentboard.board.journal import Durability, Journal
from fluentboard.board.prepared_queries import PreparedQueries
from fluentboard.board.rdf_store import RdfStore
from fluentboard.board.statement_layers import StatementLayers, Step
from fluentboard.board.triples import event_lines, fluent_lines
from fluentboard.board.vocabulary import Vocabulary, parse_statements
from fluentboard.errors import InvalidOntology, UnknownFluent
from fluentboard.model.fluent import Fluent
from fluentboard_ontology import ONTOLOGIES, read

logger = logging.getLogger(__name__)

_RECENT_MAX = 50_000
_REBUILD_LINES = 200_000
_MARK_EVERY = 1_000


class Projections:
    """The RDF store, the interval index, the vocabulary and recent fluents.

    The writer's thread changes what is in memory (`remember`), the projector's thread the RDF store
    (`project`); any thread reads.
    """

    def __init__(
        self,
        journal: Journal,
        store: RdfStore,
        index: IntervalIndex,
        durability: Durability,
        lock: FolderLock | None = None,
    ) -> None:
        self._lock = lock
        self.journal = journal
        self._durability = durability
        self.store = store
        self.index = index
        self.vocabulary = Vocabulary()
        self.vocabulary_commit = 0
        self.prepared = PreparedQueries()
        # The writer's thread is ahead of the projector's: each follows what is declared by itself.
        self._declarations = Declarations()
        self._layers = StatementLayers(store.says)
        self._recent: dict[str, Fluent] = {}
        self._marked = 0
        self._projected = 0
        self._stated = 0
        self._held_step: tuple[int, Step] | None = None
        self.remembered = 0

    def fluent(self, name: str, as_of: int | None = None) -> Fluent:
        """A fluent as it stands, or as it stood after a commit.

        Raises:
            UnknownFluent: it was not asserted (by then).
        """
        recent = self._recent.get(name)
        if recent is not None and (as_of is None or recent.version <= as_of):
            return recent
        if as_of is None and name not in self:
            raise UnknownFluent(
                f"no fluent {name!r} on the board; names are case-sensitive, GET /fluents lists "
                "them",
                name=name,
            )
        return self.journal.fluent(name, as_of)

    def __contains__(self, name: str) -> bool:
        return name in self.index

    def is_in_ontology(self, quad: ox.Quad) -> bool:
        """An ontology that the RDF store has says the statement of the default graph."""
        return self._layers.is_in_ontology(quad)

    def remember(self, commits: Sequence[Commit]) -> None:
        """Brings what is in memory to the last of the commits; they are durable by now."""
        for commit in commits:
            if commit.statements and self._declarations.apply(commit.statements):
                self.vocabulary = self._declarations.vocabulary
                self.vocabulary_commit = commit.number
            self.index.put((event.after, commit.number) for event in commit.events)
            for event in commit.events:
                self._recent.pop(event.after.name, None)
                self._recent[event.after.name] = event.after
        while len(self._recent) > _RECENT_MAX:
            self._recent.pop(next(iter(self._recent)))
        self.remembered = commits[-1].number

    def project(self, commits: Sequence[Commit]) -> None:
        """Brings the RDF store to the last of the commits.

        Raises:
            StorageFailed: the store cannot be written. Call it again with the same commits: it
                goes on where it stopped.
        """
        waiting: list[Commit] = []
        for commit in commits:
            if commit.statements and commit.number > self._stated:
                # An ontology may rename classes for the events after it, not for those before.
                self._project_events(waiting)
                waiting = []
                self._project_statements(commit.statements, commit.number)
                self._stated = commit.number
            if commit.number > self._projected:
                waiting.append(commit)
        self._project_events(waiting)
        if commits[-1].number - self._marked >= _MARK_EVERY:
            self.store.mark(state=self._durability)
            self._marked = commits[-1].number

    def recover(self, *, is_trusted: bool = False) -> None:
        """Reads the journal into memory and replays into the store what it has not seen.

        A store that may hold what the journal has lost is rebuilt.

        Args:
            is_trusted: the store is a checkpoint that a running board has just made.
        """
        last = self.journal.last
        seen = self.store.applied
        is_rebuilt = not is_trusted and (
            self.store.may_be_ahead or seen > last or (seen == 0 and last > 0)
        )
        for number, changes in self.journal.statements_by_commit(0, last):
            self._declarations.apply(changes)
            if number <= seen and not is_rebuilt:
                self._layers.skip(changes)
                self.store.note_said(changes)
        self.vocabulary = self._declarations.vocabulary
        for name, class_name, s1, s2, f1, f2, number in self.journal.outlines(0, last):
            self.index.put_outline(
                name, class_name, (*_bounds(s1, s2, -math.inf), *_bounds(f1, f2, math.inf)), number
            )
        if is_rebuilt:
            self._rebuild(last)
        elif seen < last:
            logger.info("replaying commits %s to %s into the RDF store", seen + 1, last)
            group: list[Commit] = []
            for commit in self.journal.commits(seen, last):
                group.append(commit)
                if len(group) == _MARK_EVERY:
                    self.project(group)
                    group = []
            if group:
                self.project(group)
        self.remembered = last
        self._marked = last
        self.store.mark(state=self._durability)

    def ontology_changes(
        self, files: Sequence[Path], *, builtin: bool
    ) -> tuple[StatementsChanged, ...]:
        """What loading these ontologies would change; empty if they are all loaded already.

        Raises:
            InvalidOntology: a file is missing or does not parse.
        """
        sources = [(name, read(name)) for name in ONTOLOGIES] if builtin else []
        for file in files:
            try:
                sources.append((file.stem, file.read_text(encoding="utf-8")))
            except (OSError, UnicodeDecodeError) as problem:
                raise InvalidOntology(f"cannot read the ontology {file}: {problem}") from None
        changes: list[StatementsChanged] = []
        for name, text in sources:
            digest = hashlib.sha256(text.encode()).hexdigest()
            loaded = self._declarations.ontologies.get(name)
            if loaded is not None and loaded.digest == digest:
                continue
            triples = parse_statements(text, f"ontology {name!r}", f"urn:fluentboard:{name}")
            added = _serialised(triples)
            changes.append(
                StatementsChanged("", added, loaded.added if loaded else "", name, digest)
            )
        return tuple(changes)

    def close(self) -> None:
        """Lets go of all files."""
        try:
            self.store.close()
        finally:
            self.journal.close()
            if self._lock is not None:
                self._lock.close()

    def _project_events(self, commits: Sequence[Commit]) -> None:
        if not commits:
            return
        added: dict[str, None] = {}
        removed: dict[str, None] = {}
        for commit in commits:
            for event in commit.events:
                new, old = event_lines(event, self.vocabulary)
                for line in old:
                    # Added by an earlier commit of this group: it never reaches the store.
                    if line in added:
                        del added[line]
                    else:
                        removed[line] = None
                if removed:
                    for line in new:
                        if line in removed:
                            del removed[line]
                        else:
                            added[line] = None
                else:
                    added.update(dict.fromkeys(new))
        self.store.apply("".join(added), "".join(removed), commits[-1].number)
        self._projected = commits[-1].number

    def _project_statements(self, changes: Sequence[StatementsChanged], number: int) -> None:
        # A step moves the layers on: one that the store refused is kept, not taken again.
        held = self._held_step
        step = held[1] if held is not None and held[0] == number else self._layers.step(changes)
        self._held_step = number, step
        # In one transaction, or a reader could see half of it and take it for the whole.
        self.store.apply_statements(
            step.added, step.removed, number, created=step.created, dropped=step.dropped
        )
        self._held_step = None

    def _rebuild(self, last: int) -> None:
        logger.info("rebuilding the RDF store from the journal (%s commits)", last)
        self.store.clear()
        for _, changes in self.journal.statements_by_commit():
            self._project_statements(changes, 0)
        lines: list[str] = []
        for fluent in self.journal.fluents():
            lines += fluent_lines(fluent, self.vocabulary)
            if len(lines) >= _REBUILD_LINES:
                self.store.bulk_load(lines)
                lines = []
        self.store.bulk_load(lines)
        self.store.apply("", "", last)


def _bounds(earliest: Any, latest: Any, unknown: float) -> tuple[float, float]:
    if earliest is None and latest is None:
        return unknown, unknown
    return -math.inf if earliest is None else earliest, math.inf if latest is None else latest


def _serialised(triples: Iterable[ox.Triple]) -> str:
    return "".join(f"{triple} .\n" for triple in triples)
