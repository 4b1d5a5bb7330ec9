"""The writer: one thread that turns requests into commits, many of them per fsync."""

from __future__ import annotations

import logging
import queue
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, field, replace

from fluentboard.board.commands import Command, CorrectFluent, decide, name_of
from fluentboard.board.events import Commit, FluentEvent, StatementsChanged
from fluentboard.board.journal import KeyedCommit
from fluentboard.board.projections import Projections
from fluentboard.board.projector import Projector
from fluentboard.board.shapes import LookUp, ShapesGuard
from fluentboard.clock import Clock
from fluentboard.errors import (
    FluentboardError,
    IdempotencyConflict,
    StorageFailed,
)
from fluentboard.model.fluent import Fluent

logger = logging.getLogger(__name__)

_GROUP_REQUESTS_MAX = 256
_GROUP_COMMANDS_MAX = 20_000
_AT_ONCE_COMMANDS_MAX = 16


@dataclass(frozen=True, slots=True)
class Whole:
    """What a batch is a part of: an import, which has to meet the shapes as a whole.

    Attributes:
        look_up: gives a fluent as it will be when all of the import is on the board.
        met_at: the commit after which all of it was found to meet the shapes; None if that was not
            looked at, or somebody else has written since.
    """

    look_up: LookUp
    met_at: int | None


@dataclass(frozen=True, slots=True)
class Request:
    """A batch that somebody waits for.

    Attributes:
        commands: about fluents.
        author: whom the commit is attributed to.
        key: the idempotency key, or None.
        digest: fingerprint of the request, with a key.
        statements: what changes outside fluents.
        derive: works out instead what changes outside fluents; called by the writer when the RDF
            store has all commits before, and nothing can come in between.
        whole: what the batch is a part of; None if it stands for itself.
        answer: the commit, or why there is none.
    """

    commands: tuple[Command, ...]
    author: str
    key: str | None = None
    digest: str | None = None
    statements: tuple[StatementsChanged, ...] = ()
    derive: Callable[[], tuple[StatementsChanged, ...]] | None = None
    whole: Whole | None = None
    answer: Future[Commit] = field(default_factory=lambda: Future[Commit]())


class Writer:
    """Group commit: requests that arrive while the disk is busy share the next fsync.

    Each request becomes one commit with its own number, or is refused on its own; a refused request
    does not disturb the others of its group.

    Args:
        projections: what follows the journal.
        projector: brings up the RDF store.
        clock: gives the transaction times.
        waits_for_disk: appending takes as long as the disk does. If not, a short request that finds
            the writer idle is carried out in the caller's thread: two changes of thread would take
            longer than the work.
        guard: refuses what violates a shape.
    """

    def __init__(
        self,
        projections: Projections,
        projector: Projector,
        clock: Clock,
        *,
        waits_for_disk: bool = True,
        guard: ShapesGuard | None = None,
    ) -> None:
        self._guard_of_shapes = guard
        self._waits_for_disk = waits_for_disk
        self._committing = threading.Lock()
        self._outstanding = 0
        self._projections = projections
        self._projector = projector
        self._journal = projections.journal
        self._clock = clock
        self._waiting: queue.SimpleQueue[Request | None] = queue.SimpleQueue()
        self._held: Request | None = None
        self._guard = threading.Condition(threading.Lock())
        self._closed = False
        self._thread = threading.Thread(target=self._run, name="fluentboard-writer", daemon=True)
        self._thread.start()

    def submit(self, request: Request) -> Future[Commit]:
        """Queues a request; its future, which cannot be cancelled, is done with the commit."""
        # What is written cannot be unwritten: nobody may cancel it while the others wait.
        request.answer.set_running_or_notify_cancel()
        with self._guard:
            if self._closed:
                request.answer.set_exception(StorageFailed("the board is closed; open it again"))
                return request.answer
            at_once = self._outstanding == 0 and self._is_short(request)
            self._outstanding += 1
            if not at_once:
                self._waiting.put(request)
        if at_once:
            self._carry_out([request])
        return request.answer

    def _is_short(self, request: Request) -> bool:
        return (
            not self._waits_for_disk
            and request.derive is None
            and not request.statements
            and len(request.commands) <= _AT_ONCE_COMMANDS_MAX
            and not self._projector.is_behind
        )

    def close(self) -> bool:
        """Finishes what was queued and stops; False if it was closed before."""
        with self._guard:
            if self._closed:
                return False
            self._closed = True
            self._waiting.put(None)
        self._thread.join()
        with self._guard:
            self._guard.wait_for(lambda: self._outstanding == 0)
        return True

    def _run(self) -> None:
        while True:
            group, stopping = self._next_group()
            if group:
                self._carry_out(group)
            if stopping:
                return

    def _carry_out(self, group: list[Request]) -> None:
        try:
            with self._committing:
                self._commit(group)
        except BaseException as problem:
            logger.exception("the writer met an unexpected error")
            for request in group:
                if not request.answer.done():
                    request.answer.set_exception(problem)
        finally:
            with self._guard:
                self._outstanding -= len(group)
                if self._closed:
                    self._guard.notify_all()

    def _next_group(self) -> tuple[list[Request], bool]:
        first, self._held = self._held or self._waiting.get(), None
        if first is None:
            return [], True
        group, commands = [first], len(first.commands)
        if first.derive is not None:
            # It looks at the store, which must have everything before it: it goes alone.
            return group, False
        while len(group) < _GROUP_REQUESTS_MAX and commands < _GROUP_COMMANDS_MAX:
            try:
                request = self._waiting.get_nowait()
            except queue.Empty:
                break
            if request is None:
                return group, True
            if request.derive is not None:
                self._held = request
                break
            group.append(request)
            commands += len(request.commands)
        return group, False

    def _commit(self, group: list[Request]) -> None:
        try:
            self._take_over_missed()
        except StorageFailed as problem:
            for request in group:
                request.answer.set_exception(problem)
            return
        accepted: list[tuple[Request, KeyedCommit]] = []
        answered: list[tuple[Request, Commit | FluentboardError]] = []
        pending: dict[str, Fluent] = {}
        for request in group:
            try:
                outcome = self._decide(request, accepted, pending)
            except FluentboardError as problem:
                answered.append((request, problem))
                continue
            if isinstance(outcome, KeyedCommit):
                accepted.append((request, outcome))
            else:
                answered.append((request, outcome))
        commits = [entry.commit for _, entry in accepted]
        try:
            if commits:
                self._journal.append(
                    [entry for _, entry in accepted], expected=commits[0].number - 1
                )
                self._projections.remember(commits)
                self._projector.put(commits)
        except StorageFailed as problem:
            # Nothing of this group can be read. What was answered without a commit may rest on the
            # failed changes, so it fails with them.
            for request in group:
                request.answer.set_exception(problem)
            return
        for request, entry in accepted:
            request.answer.set_result(entry.commit)
        for request, answer in answered:
            if isinstance(answer, Commit):
                request.answer.set_result(answer)
            else:
                request.answer.set_exception(answer)

    def _take_over_missed(self) -> None:
        """Goes on where an append was kept that could not be looked up.

        Raises:
            StorageFailed: that, or the RDF store, is still broken.
        """
        if self._projector.failure is not None:
            raise StorageFailed(self._projector.failure)
        if self._journal.mend():
            missed = list(self._journal.commits(self._projections.remembered))
            self._projections.remember(missed)
            self._projector.put(missed)

    def _decide(
        self,
        request: Request,
        accepted: list[tuple[Request, KeyedCommit]],
        pending: dict[str, Fluent],
    ) -> KeyedCommit | Commit:
        number = self._journal.last + len(accepted) + 1
        earlier = self._earlier_answer(request, accepted)
        if earlier is not None:
            return earlier
        events: list[FluentEvent] = []
        fresh: dict[str, Fluent] = {}
        reason = ""
        for command in request.commands:
            name = name_of(command)
            event = decide(command, self._current(name, fresh, pending))
            if event is None:
                continue
            if isinstance(command, CorrectFluent):
                reason = command.reason
            before = event.before
            after = replace(
                event.after,
                version=number,
                author=request.author,
                created=number if before is None else before.created,
            )
            fresh[name] = after
            events.append(replace(event, after=after))
        statements = request.statements
        if request.derive is not None:
            self._projector.wait_for(self._journal.last)
            statements = request.derive()
        if not events and not statements:
            return Commit(number - 1, self._clock.now_s(), request.author)
        self._check_shapes(request, number, events, fresh, pending)
        pending.update(fresh)
        commit = Commit(
            number, self._clock.now_s(), request.author, tuple(events), statements, reason
        )
        return KeyedCommit(commit, request.key, request.digest)

    def _check_shapes(
        self,
        request: Request,
        number: int,
        events: Sequence[FluentEvent],
        fresh: dict[str, Fluent],
        pending: dict[str, Fluent],
    ) -> None:
        whole = request.whole
        if self._guard_of_shapes is None or not events:
            return
        if whole is not None and whole.met_at == number - 1:
            return

        def look_up(name: str) -> Fluent | None:
            found = fresh.get(name)
            if found is None and whole is not None:
                found = whole.look_up(name)
            return self._current(name, fresh, pending) if found is None else found

        fluents = [event.after for event in events]
        self._guard_of_shapes.check(fluents, self._projections.vocabulary, look_up)

    def _earlier_answer(
        self, request: Request, accepted: list[tuple[Request, KeyedCommit]]
    ) -> Commit | None:
        if request.key is None:
            return None
        for _, entry in accepted:
            if entry.key == request.key:
                found = entry.commit.number, entry.digest
                break
        else:
            found = self._journal.request(request.key)
            if found is None:
                return None
        number, digest = found
        if digest != request.digest:
            raise IdempotencyConflict(
                f"the idempotency key {request.key!r} was used in commit {number} for another "
                "request; choose a new key for each request",
                commit=number,
            )
        in_group = [entry.commit for _, entry in accepted if entry.commit.number == number]
        return in_group[0] if in_group else self._journal.commit(number)

    def _current(
        self, name: str, fresh: dict[str, Fluent], pending: dict[str, Fluent]
    ) -> Fluent | None:
        found = fresh.get(name) or pending.get(name)
        if found is not None:
            return found
        return self._projections.fluent(name) if name in self._projections else None
