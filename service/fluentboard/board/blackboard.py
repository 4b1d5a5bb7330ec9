"""The one entry point: a command goes in, it is journalled and projected, events come out."""

from __future__ import annotations

import hashlib
import logging
import math
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from contextlib import suppress
from pathlib import Path
from typing import Literal

import pyoxigraph as ox

from fluentboard.board.audit import AuditEntry, AuditFilter
from fluentboard.board.coming import next_changes
from fluentboard.board.commands import (
    Command,
)
from fluentboard.board.endpoint import Endpoint
from fluentboard.board.events import Commit, StatementsChanged
from fluentboard.board.graphs import Graphs
from fluentboard.board.intervals import FluentFilter, IntervalIndex
from fluentboard.board.journal import CommitLog, Durability, Journal
from fluentboard.board.listing import Listing, Page
from fluentboard.board.mirrored_journal import MirroredJournal
from fluentboard.board.projections import Projections
from fluentboard.board.projector import Listener, Projector
from fluentboard.board.rdf_store import RdfStore
from fluentboard.board.remote_store import RemoteStore
from fluentboard.board.shapes import LookUp, ShapesGuard
from fluentboard.board.short_names import in_short_names, remarks_on
from fluentboard.board.sqlite_journal import SqliteJournal
from fluentboard.board.store import EmbeddedStore, GraphName, QueryResults
from fluentboard.board.time_functions import functions_for, mentions_functions
from fluentboard.board.time_view import Perspective, TimeView
from fluentboard.board.time_views import TimedResults, TimeViews
from fluentboard.board.trajectory import Trajectory, pose_names, trajectory_of
from fluentboard.board.vocabulary import (
    Vocabulary,
)
from fluentboard.board.writer import Request, Whole, Writer
from fluentboard.clock import Clock, SystemClock
from fluentboard.errors import (
    FluentboardError,
    InvalidInput,
    StorageFailed,
    TooLarge,
    UnknownFluent,
)
from fluentboard.model.fluent import Fluent
from fluentboard.model.interval import Certainty
from fluentboard_ontology import PREFIXES

logger = logging.getLogger(__name__)


class Blackboard:
    """Facts with uncertain intervals, never removed, only ended. Safe to use from any thread.

    Use `Blackboard.open`. A write returns when it is durable and visible to every reader.

    Attributes:
        clock: where transaction times and `now` come from.
        graphs: what is said outside fluents, read and changed by statements.

    Example:
        >>> board = Blackboard.open(None)
        >>> commit = board.execute([AssertFluent(Fluent("mug1", "Mug"))], author="example")
        >>> board.fluent("mug1").version == commit.number
        True
        >>> board.close()
    """

    def __init__(self, projections: Projections, clock: Clock, shapes: Sequence[Path] = ()) -> None:
        self._projections = projections
        self._journal = projections.journal
        self.clock = clock
        # One for the writer and one for imports, which must not hold the writer up.
        guard, self._guard_of_imports = (
            (ShapesGuard(shapes), ShapesGuard(shapes)) if shapes else (None, None)
        )
        self._projector = Projector(projections)
        self._views = TimeViews(projections, self._projector, clock)
        self._listing = Listing(projections, self._projector)
        self._writer = Writer(
            projections,
            self._projector,
            clock,
            waits_for_disk=self._journal.waits_for_disk,
            guard=guard,
        )
        self.graphs = Graphs(projections, self._projector, self._writer)

    @classmethod
    def open(
        cls,
        data: Path | None,
        *,
        durability: Durability = "disk",
        ontologies: Sequence[Path] = (),
        clock: Clock | None = None,
        builtin_ontologies: bool = True,
        log: CommitLog | None = None,
        endpoint: Endpoint | None = None,
        shapes: Sequence[Path] = (),
    ) -> Blackboard:
        """Opens a board, recovers it if need be, and loads its ontologies.

        Args:
            data: folder of the journal and the RDF store, created if missing; None keeps nothing.
            durability: "disk" fsyncs before a write returns, "process" does not.
            ontologies: Turtle or RDF/XML files to load on top.
            clock: where transaction times and `now` come from; the system by default.
            builtin_ontologies: load `upper`, `race` and `furniture`.
            endpoint: holds the RDF store, which is then not in `data`; it must be empty or this
                board's.
            shapes: SHACL files; a batch that violates one of their shapes is refused.
            log: where commits are kept, such as a replicated log; the journal in `data` is then a
                mirror of it. None makes that journal the truth itself.

        Raises:
            StorageFailed: the folder is in use, damaged or not writable.
            InvalidOntology: an ontology file is missing or does not parse.
        """
        clock = clock or SystemClock()
        if data is not None:
            _make_folder(data)
        own = SqliteJournal(data and data / "journal.sqlite", durability)
        journal: Journal = own
        try:
            if log is not None:
                journal = MirroredJournal(log, own)
            store: RdfStore = (
                EmbeddedStore(data and data / "store")
                if endpoint is None
                else RemoteStore(endpoint, lambda: _identity(journal))
            )
            projections = Projections(journal, store, IntervalIndex(), durability)
            projections.recover()
        except BaseException:
            journal.close()
            if endpoint is not None:
                endpoint.close()
            raise
        board = cls(projections, clock, shapes)
        try:
            board.load_ontologies(ontologies, builtin=builtin_ontologies)
        except BaseException:
            board.close()
            raise
        return board

    def load_ontologies(self, files: Sequence[Path], *, builtin: bool = False) -> None:
        """Loads ontologies; one that is loaded already and has not changed costs nothing.

        Raises:
            InvalidOntology: a file is missing or does not parse; none of them is loaded.
        """
        changes = self._projections.ontology_changes(files, builtin=builtin)
        if changes:
            commit = self._writer.submit(Request((), "fluentboard", statements=changes)).result()
            self._projector.wait_for(commit.number)

    def submit(
        self,
        commands: Sequence[Command],
        author: str,
        *,
        idempotency_key: str | None = None,
        whole: Whole | None = None,
    ) -> Future[Commit]:
        """Asks for a batch, all or nothing; the future is done when it is durable and visible.

        A batch that changes nothing gives the present commit number and no events. The same
        idempotency key gives the first answer again.

        Args:
            commands: the batch.
            author: whom its commit is attributed to.
            idempotency_key: tells a repetition from another request.
            whole: the import that the batch is a part of, if it is.
        """
        vocabulary = self.vocabulary
        try:
            request = Request(
                tuple(in_short_names(command, vocabulary) for command in commands),
                author,
                idempotency_key,
                _digest(commands, author) if idempotency_key else None,
                whole=whole,
            )
        except FluentboardError as problem:
            refused: Future[Commit] = Future()
            refused.set_exception(problem)
            return refused
        return self._writer.submit(request)

    def execute(
        self, commands: Sequence[Command], author: str, *, idempotency_key: str | None = None
    ) -> Commit:
        """Like `submit`, but waits.

        Raises:
            FluentboardError: the first command that was refused says why; nothing was stored.
        """
        return self.submit(commands, author, idempotency_key=idempotency_key).result()

    def check_shapes(self, fluents: Sequence[Fluent], look_up: LookUp) -> None:
        """Lets a part of an import pass, or not, while writes go on.

        Args:
            fluents: as they would be on the board, in the short names of its vocabulary.
            look_up: gives a fluent as it would be with all of the import.

        Raises:
            ShapeViolation: with what pySHACL reports.
        """
        if self._guard_of_imports is not None:
            self._guard_of_imports.check(fluents, self.vocabulary, look_up)

    @property
    def has_shapes(self) -> bool:
        """Writes have to meet SHACL shapes."""
        return self._guard_of_imports is not None

    @property
    def commit(self) -> int:
        """Number of the last commit; every read that starts now sees it."""
        return self._projections.remembered

    @property
    def vocabulary(self) -> Vocabulary:
        """What the loaded ontologies declare."""
        return self._projections.vocabulary

    @property
    def failure(self) -> str | None:
        """Why the board accepts no writes, or None while it does."""
        return self._projector.failure

    def __len__(self) -> int:
        return len(self._projections.index)

    def __contains__(self, name: str) -> bool:
        return name in self._projections.index

    def fluent(self, name: str, as_of: int | None = None) -> Fluent:
        """A fluent as it stands, or as it stood after a commit.

        Raises:
            UnknownFluent: it was not asserted (by then).
        """
        return self._projections.fluent(name, as_of)

    def history(self, name: str) -> list[Commit]:
        """The commits that changed a fluent, each with the events about it alone.

        Raises:
            UnknownFluent: it was never asserted.
        """
        return self._journal.history(name)

    def commits(self, after: int, up_to: int | None = None) -> Iterator[Commit]:
        """Commits with numbers in (after, up_to], in order."""
        return self._journal.commits(after, up_to)

    def audit(self, wanted: AuditFilter, limit: int = 1_000) -> list[AuditEntry]:
        """Who changed what and when, at most `limit` commits of it, in order."""
        return self._journal.audit(wanted, limit)

    def statements(self, up_to: int | None = None) -> Iterator[StatementsChanged]:
        """What ontologies and graph updates have changed so far, or up to a commit, in order."""
        return (change for _, change in self._journal.statements(0, up_to))

    def commit_at(self, wall_s: float) -> int:
        """Number of the last commit made at or before a wall-clock time."""
        return self._journal.commit_at(wall_s)

    def list(self, wanted: FluentFilter, *, after: int = 0, limit: int = 100) -> Page:
        """Fluents that pass a filter, in the order of their first assertion.

        Args:
            wanted: the filter.
            after: where to go on: 0, or `next` of the page before.
            limit: how many at most.

        Raises:
            UnknownClass: the filter names a class that no ontology declares.
            UnknownFluent: it relates to a fluent that was not asserted (by then).
        """
        return self._listing.page(wanted, after, limit)

    def trajectory(
        self,
        name: str,
        from_s: float | None = None,
        to_s: float | None = None,
        *,
        as_of: int | None = None,
    ) -> Trajectory:
        """Where an object was at some moment of [from_s, to_s), as believed after a commit.

        Raises:
            UnknownFluent: it was not asserted (by then).
            InvalidTime, IntervalReversed: from_s and to_s are no window of time.
        """
        fluent, poses = self.fluent(name, as_of), dict[str, Fluent]()
        for pose in pose_names(fluent):
            with suppress(UnknownFluent):  # a reference may be to what is not on the board yet
                poses[pose] = self.fluent(pose, as_of)
        return trajectory_of(
            fluent,
            poses,
            -math.inf if from_s is None else from_s,
            math.inf if to_s is None else to_s,
        )

    def query(
        self,
        sparql: str,
        *,
        at: float | Literal["now"] | None = None,
        as_of: int | None = None,
        certainty: Certainty = Certainty.POSSIBLE,
        default_graphs: Sequence[GraphName] | None = None,
        named_graphs: Sequence[ox.NamedNode | ox.BlankNode] | None = None,
    ) -> QueryResults:
        """The results of a SPARQL query, by default over the whole history of facts.

        Args:
            sparql: the query; it may call the functions of `time_functions`.
            at: sees only the fluents that hold at this time in seconds, or at the clock's.
            as_of: sees what was believed after this commit.
            certainty: whether `at` shows what may hold or only what surely does.
            default_graphs: merged into the default graph; by default the board's own.
            named_graphs: what `GRAPH` sees; by default all.

        Raises:
            InvalidQuery: it does not parse, or cannot be evaluated.
            InvalidTime: `at` is NaN.
        """
        if at is not None or as_of is not None or mentions_functions(sparql):
            return self.timed_query(
                sparql,
                at=at,
                as_of=as_of,
                certainty=certainty,
                default_graphs=default_graphs,
                named_graphs=named_graphs,
            ).results
        if default_graphs is None:
            sparql = self._rewritten(sparql)
        self._projector.wait_for(self.commit)
        return self._projections.store.query(sparql, default_graphs, named_graphs)

    def timed_query(
        self,
        sparql: str,
        *,
        at: float | Literal["now"] | None = None,
        as_of: int | None = None,
        certainty: Certainty = Certainty.POSSIBLE,
        default_graphs: Sequence[GraphName] | None = None,
        named_graphs: Sequence[ox.NamedNode | ox.BlankNode] | None = None,
    ) -> TimedResults:
        """Like `query`, with the commit and the time that the results are exact at."""
        if at is not None or as_of is not None:
            perspective = Perspective(at, as_of, certainty)
            return self._views.query(sparql, perspective, default_graphs, named_graphs)
        if self._needs_view(sparql):
            return self._views.query(sparql, Perspective(), default_graphs, named_graphs)
        self._projector.wait_for(self.commit)
        commit, is_exact, results = self._projections.store.marked_query(
            self._rewritten(sparql) if default_graphs is None else sparql,
            functions_at=functions_for(sparql, self._projections.index, self.clock),
            default_graphs=default_graphs,
            named_graphs=named_graphs,
        )
        return TimedResults(results, commit, is_exact=is_exact)

    def point_query(self, sparql: str, *, has_prefixes: bool) -> tuple[int, QueryResults] | None:
        """The results of a query that is surely cheap, with the commit that they are exact at.

        It does not wait for commits. None if the query is not answered so: `query` it.

        Args:
            sparql: patterns about one constant subject, and nothing else.
            has_prefixes: it may use well-known prefixes.
        """
        store = self._projections.store
        if not isinstance(store, EmbeddedStore):
            return None
        return store.point_query(sparql, PREFIXES if has_prefixes else {})

    def snapshot_query(self, sparql: str) -> tuple[int, QueryResults]:
        """The results of a query, with the number of the commit that they are exact at.

        It does not wait: the commit may be one that is not the last any more.
        """
        if self._needs_view(sparql):
            timed = self._views.query(sparql, Perspective())
            return timed.commit, timed.results
        # The rewritten query is right only where the class hierarchy of this vocabulary is stored.
        self._projector.wait_for(self._projections.vocabulary_commit)
        return self._projections.store.snapshot_query(
            self._rewritten(sparql),
            functions_at=functions_for(sparql, self._projections.index, self.clock),
        )

    def past_query(
        self, sparql: str, commit: int, at_s: float | None, certainty: Certainty | None
    ) -> QueryResults:
        """The results of a query as they were after a commit and, for one at now, at a time.

        Raises:
            TooLarge: the board has too many fluents to look back in between.
        """
        if len(self) > _LOOK_BACK_MAX:
            raise TooLarge(
                f"a board of {len(self)} fluents is too large to look back", limit=_LOOK_BACK_MAX
            )
        certainty = certainty or Certainty.POSSIBLE
        return self.query(sparql, at=at_s, as_of=commit, certainty=certainty)

    def own_view(self, perspective: Perspective) -> TimeView:
        """A view that nobody else uses; whoever asked for it brings it up and closes it."""
        return self._views.own_view(perspective)

    def bring_up(self, view: TimeView, commit: int, now_s: float) -> None:
        """Makes such a view exact at a commit and, if it follows a clock, at a time."""
        self._projector.wait_for(commit)
        with view.lock:
            view.bring_up(commit, now_s)

    def next_change_s(self, certainty: Certainty = Certainty.POSSIBLE) -> float:
        """When the clock alone changes next what holds now, in seconds; infinite if it does not.

        A commit may bring it forward or put it off.
        """
        return self._views.next_change_s(certainty)

    def coming(self, certainty: Certainty, at_s: float, as_of: int) -> Iterator[tuple[float, str]]:
        """When the clock alone changes what holds after a time, in seconds, and the fluent's name.

        Args:
            certainty: with which a fluent must hold.
            at_s: the time, in seconds.
            as_of: what was believed after this commit.
        """
        index = self._projections.index
        for time_s, row in next_changes(index.outline(as_of), certainty, at_s):
            yield time_s, index.name(row)

    def listen(self, callback: Listener) -> Callable[[], None]:
        """Has every group of commits passed on as soon as it is applied.

        Args:
            callback: called in the projector's thread, so it must return at once. What it queries
                shows at least these commits.

        Returns:
            Call it to stop listening.
        """
        return self._projector.listen(callback)

    def named_graphs(self) -> list[ox.NamedNode]:
        """Names of all named graphs, the empty ones included."""
        return self.graphs.named_graphs()

    @property
    def can_be_followed(self) -> bool:
        """A `Follower` in another process can answer for it."""
        is_embedded = isinstance(self._projections.store, EmbeddedStore)
        return is_embedded and self.journal_file is not None

    @property
    def journal_file(self) -> Path | None:
        """Where another process can follow the journal; None if it is in memory."""
        return self._journal.file

    def checkpoint(self, folder: Path) -> int:
        """Makes a copy of the RDF store in a folder, for a `Follower`.

        Returns:
            Number of a commit that the copy surely has.

        Raises:
            StorageFailed: it cannot be made.
        """
        applied = self._projections.store.checkpoint(folder)
        if applied is None:
            raise StorageFailed("a store at an endpoint cannot be copied into a folder")
        return applied

    def remarks(self, commands: Sequence[Command]) -> list[str]:
        """What is allowed but perhaps not meant: undeclared properties, dangling references."""
        return remarks_on(commands, self.vocabulary, self.__contains__)

    def close(self) -> None:
        """Finishes what was asked for, then lets go of all files. Closing twice is harmless."""
        if self._writer.close():
            self._views.close()
            self._projector.close()
            self._projections.close()

    def __enter__(self) -> Blackboard:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _needs_view(self, sparql: str) -> bool:
        """It calls functions that the store does not have; a view in this process has them."""
        return not self._projections.store.has_functions and mentions_functions(sparql)

    def _rewritten(self, sparql: str) -> str:
        return self._projections.prepared.rewritten(sparql, self.vocabulary)


_LOOK_BACK_MAX = 200_000
"""Fluents; to build a view of the past takes about a second per 100,000."""


def _digest(commands: Sequence[Command], author: str) -> str:
    return hashlib.sha256(repr((author, *commands)).encode()).hexdigest()


def _identity(journal: Journal) -> str | None:
    """What a journal is recognised by: its first commit; None while it has none."""
    first = journal.audit(AuditFilter(), 1)
    return f"{first[0].wall_s!r} {len(first[0].fluents)}" if first else None


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as problem:
        raise InvalidInput(
            f"cannot make the data folder {folder}: {problem}; give a writable folder with --data"
        ) from None
