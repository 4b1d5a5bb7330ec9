"""The pool of readers: questions go to whichever reader is free; an overdue one is killed.

Each reader has a thread that starts it, feeds it, keeps it up to date while nobody asks, and
replaces it when it was killed or has fallen too far behind.
"""

from __future__ import annotations

import logging
import queue
import shutil
import threading
from collections.abc import Sequence
from concurrent.futures import Future, InvalidStateError
from contextlib import suppress
from itertools import count
from pathlib import Path

from fluentboard.api.answering import Question, Result
from fluentboard.api.readers.process import ReaderEnded, ReaderProcess
from fluentboard.api.readers.rehearsal import Rehearsal
from fluentboard.board.blackboard import Blackboard
from fluentboard.board.events import Commit
from fluentboard.config import LimitSettings
from fluentboard.errors import FluentboardError, QueryTimeout, TooLarge

logger = logging.getLogger(__name__)

_LOOK_EVERY_S = 0.5
# A reader that was asked within so many looks is kept up to date even while writes pour in.
_ASKED_LOOKS = 10
# Beyond so many changes a new checkpoint is quicker than following the journal.
_BEHIND_MAX = 20_000


class Job:
    """A question, or a rehearsal, that waits for a reader or has one.

    Attributes:
        begun: done once a reader works on it, or when it will not come to that.
        future: the result.
    """

    def __init__(self, question: Question | Rehearsal, commit: int, now_s: float) -> None:
        self.question = question
        self.commit = commit
        self.now_s = now_s
        self.begun: Future[None] = Future()
        self.future: Future[Result] = Future()
        self._guard = threading.Lock()
        self._reader: ReaderProcess | None = None
        self._abandoned = False

    @property
    def is_abandoned(self) -> bool:
        """Nobody waits for the result any more."""
        return self._abandoned

    def abandon(self) -> None:
        """Gives up; a reader that works on it is killed."""
        with self._guard:
            self._abandoned = True
            if self._reader is not None:
                self._reader.kill()

    def begin(self) -> None:
        """Tells who waits that it is being worked on. Doing it twice is harmless."""
        with suppress(InvalidStateError):
            self.begun.set_result(None)

    def given_to(self, reader: ReaderProcess | None) -> bool:
        """Notes who works on it; False if nobody needs to."""
        with self._guard:
            self._reader = reader
            return not self._abandoned


class ReaderPool:
    """Evaluates questions in processes that can be killed.

    Args:
        board: on disk.
        folder: where the readers keep their files; whatever is in it is removed.
        limits: how many readers there may be, and what their results may take.
    """

    def __init__(self, board: Blackboard, folder: Path, limits: LimitSettings) -> None:
        self._board = board
        self._folder = folder
        self._limits = limits
        self._jobs: queue.SimpleQueue[Job | None] = queue.SimpleQueue()
        self._names = count(1)
        self._guard = threading.Lock()
        self._threads: list[threading.Thread] = []
        self._keepers: list[_Keeper] = []
        self._pending = 0
        self._changes = 0
        self._closed = False
        # Left behind by a service that was killed.
        shutil.rmtree(folder, ignore_errors=True)
        self._stop_listening = board.listen(self._on_commits)

    def submit(self, question: Question | Rehearsal, commit: int, now_s: float) -> Job:
        """Has a question answered as soon as a reader is free, at a commit or a later one."""
        job = Job(question, commit, now_s)
        with self._guard:
            self._pending += 1
            self._jobs.put(job)
            if self._pending > len(self._threads):
                self._start_one()
        return job

    def warm_up(self) -> None:
        """Starts a reader if there is none yet, so that the first question finds one."""
        with self._guard:
            if not self._threads:
                self._start_one()

    def prepare_one_more(self) -> None:
        """Starts a reader if all are busy and there may be more."""
        with self._guard:
            if self._pending >= len(self._threads):
                self._start_one()

    def close(self) -> None:
        """Kills the readers and removes their files."""
        self._stop_listening()
        with self._guard:
            self._closed = True
            threads, keepers = list(self._threads), list(self._keepers)
        for _ in threads:
            self._jobs.put(None)
        for keeper in keepers:
            keeper.kill()
        for thread in threads:
            thread.join()
        shutil.rmtree(self._folder, ignore_errors=True)

    def _on_commits(self, commits: Sequence[Commit]) -> None:
        self._changes += sum(len(commit.events) for commit in commits)

    def _start_one(self) -> None:
        if self._closed or len(self._threads) >= self._limits.queries_at_once:
            return
        name = f"reader-{len(self._threads) + 1}"
        thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._threads.append(thread)
        thread.start()

    def _run(self) -> None:
        keeper = _Keeper(self)
        with self._guard:
            self._keepers.append(keeper)
        try:
            while not self._closed:
                keeper.keep_fresh()
                try:
                    job = self._jobs.get(timeout=_LOOK_EVERY_S)
                except queue.Empty:
                    continue
                if job is None:
                    return
                try:
                    keeper.do(job)
                finally:
                    with self._guard:
                        self._pending -= 1
        finally:
            keeper.close()

    def started(self) -> ReaderProcess:
        """A new reader, which has yet to get ready."""
        return ReaderProcess(self._board, self._folder / str(next(self._names)), self._limits)

    @property
    def process_ids(self) -> list[int]:
        """Of the readers that are up, or coming up."""
        with self._guard:
            found = [keeper.process_id for keeper in self._keepers]
        return [one for one in found if one is not None]

    @property
    def changes(self) -> int:
        """How many changes of fluents the board has seen since the pool was made."""
        return self._changes

    @property
    def commit(self) -> int:
        """The board's last commit."""
        return self._board.commit

    @property
    def memory_max_bytes(self) -> int:
        """What a query may take."""
        return self._limits.query_memory_max_bytes


class _Keeper:
    """One reader, and its successors."""

    def __init__(self, pool: ReaderPool) -> None:
        self._pool = pool
        self._reader: ReaderProcess | None = None
        self._seen = 0
        self._last_look: int = -1
        self._looks_since_asked = _ASKED_LOOKS

    @property
    def process_id(self) -> int | None:
        """Of the reader, if there is one."""
        reader = self._reader
        return None if reader is None else reader.process_id

    def keep_fresh(self) -> None:
        """Starts the reader, or brings it up, so that the next question need not wait."""
        changes = self._pool.changes
        behind = changes - self._seen
        try:
            if self._reader is None or behind > _BEHIND_MAX:
                # While writes pour in, a new checkpoint would be old at once.
                if self._reader is None or changes == self._last_look:
                    self._start()
            elif behind and (changes == self._last_look or self._looks_since_asked < _ASKED_LOOKS):
                # While writes pour in and nobody asks, following would only slow them down.
                self._reader.follow(self._pool.commit)
                self._seen = changes
        except ReaderEnded:
            self.close()
        except FluentboardError as problem:
            self.close()
            logger.warning("no query process: %s", problem.message)
        except Exception:
            self.close()
            logger.exception("no query process")
        self._last_look = changes
        self._looks_since_asked += 1

    def do(self, job: Job) -> None:
        """Has a question answered."""
        if not job.future.set_running_or_notify_cancel():
            return
        self._looks_since_asked = 0
        try:
            job.future.set_result(self._answer(job))
        except ReaderEnded:
            self.close()
            job.future.set_exception(self._why(job))
        except BaseException as failure:
            job.future.set_exception(failure)
        finally:
            job.begin()

    def kill(self) -> None:
        """Ends the reader at once, whatever it does. Callable from any thread."""
        reader = self._reader
        if reader is not None:
            reader.kill()

    def close(self) -> None:
        """Ends the reader."""
        if self._reader is not None:
            self._reader.close()
            self._reader = None

    def _answer(self, job: Job) -> Result:
        if job.is_abandoned:
            raise QueryTimeout("nobody waits for the query any more")
        if self._reader is None or self._pool.changes - self._seen > _BEHIND_MAX:
            self._start()
        assert self._reader is not None
        if not job.given_to(self._reader):
            raise QueryTimeout("nobody waits for the query any more")
        job.begin()
        changes = self._pool.changes
        try:
            if isinstance(job.question, Rehearsal):
                result = self._reader.rehearse(job.question, job.commit)
            else:
                result = self._reader.ask(job.question, job.commit, job.now_s)
        finally:
            job.given_to(None)
        self._seen = changes
        return result

    def _start(self) -> None:
        self.close()
        self._seen = self._pool.changes
        self._reader = self._pool.started()
        self._reader.get_ready()

    def _why(self, job: Job) -> FluentboardError:
        if job.is_abandoned:
            return QueryTimeout("the query was stopped")
        limit = self._pool.memory_max_bytes
        return TooLarge(
            f"the query needed more than the {limit:,} bytes of memory that it may take, and was "
            "stopped; narrow it, or raise limits.query_memory_max_bytes",
            limit_bytes=limit,
        )
