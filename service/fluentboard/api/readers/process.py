"""A reader as the service sees it: a child process that is asked, and may be killed."""

from __future__ import annotations

import contextlib
import shutil
import subprocess
import sys
from pathlib import Path
from typing import IO, Any

from fluentboard.api.answering import Question, Result
from fluentboard.api.readers.frames import read_frame, write_frame
from fluentboard.api.readers.rehearsal import Rehearsal
from fluentboard.board.blackboard import Blackboard
from fluentboard.config import LimitSettings
from fluentboard.errors import FluentboardError, StorageFailed, error_classes


class ReaderEnded(Exception):
    """The process has ended, by a kill or by itself."""


class ReaderProcess:
    """A process that follows a board. Used by one thread, but for `kill`.

    Args:
        board: whose journal it follows.
        folder: where its checkpoint and its long results go; it is removed with the reader.
        limits: on results and memory.

    Raises:
        StorageFailed: there is no room for a checkpoint, or the process does not start.
    """

    def __init__(self, board: Blackboard, folder: Path, limits: LimitSettings) -> None:
        journal = board.journal_file
        assert journal is not None, "a board in memory cannot be followed"
        self._folder = folder
        try:
            applied = board.checkpoint(folder / "store")
            self._process = subprocess.Popen(
                [sys.executable, "-m", "fluentboard.api.readers.reader"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                # Ctrl-C in a terminal goes to its whole group; the reader ends with the service.
                start_new_session=True,
            )
        except OSError as problem:
            self._clear_away()
            raise StorageFailed(f"a query process cannot be started: {problem}") from None
        except BaseException:
            self._clear_away()
            raise
        self._setup = {
            "journal": str(journal.resolve()),
            "folder": str(folder.resolve()),
            "applied": applied,
            "limits": limits.model_dump(mode="json"),
        }

    def get_ready(self) -> None:
        """Waits until the reader has what the board has.

        Raises:
            StorageFailed: it does not come up.
        """
        try:
            self._exchange(self._setup)
        except ReaderEnded:
            raise StorageFailed(
                "a query process ended as soon as it was started; the log of the service says why"
            ) from None

    @property
    def process_id(self) -> int:
        """Of the child."""
        return self._process.pid

    def follow(self, commit: int) -> None:
        """Has the reader bring its projections up to a commit.

        Raises:
            ReaderEnded: it was killed, or ended by itself.
        """
        self._exchange({"commit": commit})

    def ask(self, question: Question, commit: int, now_s: float) -> Result:
        """The result of a question, at a commit or a later one.

        Args:
            question: the query.
            commit: what was acknowledged when the question came.
            now_s: the time of the board's clock, in seconds.

        Raises:
            FluentboardError: as evaluating it in the service would.
            ReaderEnded: the reader was killed, or ended by itself.
        """
        told = {
            "text": question.text,
            "accept": question.accept,
            "default_graphs": question.default_graphs,
            "named_graphs": question.named_graphs,
            "at": question.at,
            "as_of": question.as_of,
            "certainty": int(question.certainty),
        }
        header, body = self._exchange({"commit": commit, "now_s": now_s, "question": told})
        file: IO[bytes] | None = None
        if header["path"] is not None:
            path = Path(header["path"])
            file = path.open("rb")
            with contextlib.suppress(OSError):  # Windows keeps an open file until it is closed
                path.unlink()
        return Result(
            header["media_type"],
            body if file is None else None,
            file,
            header["size_bytes"],
            header["commit"],
            header["at_s"],
            header["is_exact"],
        )

    def rehearse(self, rehearsal: Rehearsal, commit: int) -> Result:
        """Has an update evaluated, at a commit or a later one; the result is empty.

        Raises:
            FluentboardError: as carrying it out would.
            ReaderEnded: the reader was killed, or ended by itself.
        """
        header, _ = self._exchange({"commit": commit}, rehearsal.packed())
        return Result("", b"", None, 0, header["commit"])

    def kill(self) -> None:
        """Ends the process at once, whatever it does. Callable from any thread."""
        self._process.kill()

    def close(self) -> None:
        """Ends the process and removes its files."""
        self._process.kill()
        for pipe in (self._process.stdin, self._process.stdout):
            with contextlib.suppress(OSError):
                assert pipe is not None
                pipe.close()
        self._process.wait()
        self._clear_away()

    def _clear_away(self) -> None:
        shutil.rmtree(self._folder, ignore_errors=True)

    def _exchange(self, header: dict[str, Any], body: bytes = b"") -> tuple[dict[str, Any], bytes]:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        try:
            write_frame(self._process.stdin, header, body)
            reply, body = read_frame(self._process.stdout)
        except (OSError, EOFError, ValueError) as problem:
            raise ReaderEnded(str(problem)) from None
        if "error" in reply:
            raise _raised(reply)
        return reply, body


def _raised(told: dict[str, Any]) -> FluentboardError:
    """The error that the reader met, as if it had been met here."""
    kind = error_classes().get(told["error"], FluentboardError)
    return kind(told["message"], **told["detail"])
