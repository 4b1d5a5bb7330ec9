"""The one entry point: a command goes in, it is journalled and projected, events come out."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import pyoxigraph as ox

from fluentboard.board.audit import AuditEntry, AuditFilter
from fluentboard.board.commands import Command, EndFluent
from fluentboard.board.endpoint import Endpoint
from fluentboard.board.events import Commit, StatementsChanged
from fluentboard.board.graphs import Graphs
from fluentboard.board.intervals import FluentFilter
from fluentboard.board.journal import CommitLog, Durability
from fluentboard.board.listing import Listing, Page
from fluentboard.board.opening import open_projections
from fluentboard.board.projections import Projections
from fluentboard.board.projector import Listener, Projector
from fluentboard.board.querying import Querying
from fluentboard.board.shapes import LookUp, ShapesGuard
from fluentboard.board.short_names import in_short_names, remarks_on
from fluentboard.board.store import EmbeddedStore
from fluentboard.board.trajectory import Trajectory, pose_names, trajectory_of
from fluentboard.board.writer import Request, Whole, Writer
from fluentboard.clock import Clock, SystemClock
from fluentboard.errors import (
    FluentboardError,
    StorageFailed,
    UnknownFluent,
)
from fluentboard.model.fluent import Fluent
from fluentboard.model.interval import UNKNOWN


class Blackboard(Querying):
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
        # One for the writer and one for imports, which must not hold the writer up.
        guard, self._guard_of_imports = (
            (ShapesGuard(shapes), ShapesGuard(shapes)) if shapes else (None, None)
        )
        super().__init__(projections, Projector(projections), clock)
        self._journal = projections.journal
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
        projections = open_projections(data, durability, log, endpoint)
        try:
            board = cls(projections, clock, shapes)
        except BaseException:
            projections.close()
            raise
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

        It cannot be cancelled: what was asked for is done.

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
    def failure(self) -> str | None:
        """Why the board did not accept the last write, or accepts none; None while it does."""
        return self._projector.failure or self._journal.failure

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


def _digest(commands: Sequence[Command], author: str) -> str:
    # A repetition comes later than the request, and asks for the same.
    same = (
        replace(command, finish=UNKNOWN)
        if isinstance(command, EndFluent) and command.is_now
        else command
        for command in commands
    )
    return hashlib.sha256(repr((author, *same)).encode()).hexdigest()
