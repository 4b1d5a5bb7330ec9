"""Results: where the serialised answer of a query goes, within its limits."""

from __future__ import annotations

import re
import tempfile
import threading
from collections.abc import AsyncIterator
from pathlib import Path
from typing import IO

from pyoxigraph import QueryResultsFormat, RdfFormat

from fluentboard.config import LimitSettings
from fluentboard.errors import StorageFailed, TooLarge

_CHUNK_BYTES = 256 * 1024


class Stopped(Exception):
    """Nobody waits for the result any more, or not for one so long."""


class RowCounter:
    """Counts the rows in a serialised result while it is written.

    Counting in the text costs a fraction of looking at every solution in Python. What is counted
    cannot occur inside a value, where the format escapes a part of it.

    Args:
        form: format of the result.
    """

    def __init__(self, form: QueryResultsFormat | RdfFormat) -> None:
        # In a graph nothing marks a triple; its length is limited in bytes.
        self._mark, self._mark_bytes, self.rows = _MARKS.get(form, (None, 0, 0))
        self._is_csv = form == QueryResultsFormat.CSV
        self._tail: bytes = b""
        self._quoted = False

    def add(self, text: bytes) -> None:
        """Takes the next piece of the result into account."""
        if self._is_csv:
            # Line breaks inside quotes belong to a value; quotes in a value are doubled.
            for position, part in enumerate(text.split(b'"')):
                if position:
                    self._quoted = not self._quoted
                if not self._quoted:
                    self.rows += part.count(b"\n")
            return
        if self._mark is None:
            return
        text = self._tail + text
        self.rows += len(self._mark.findall(text))
        kept = self._mark_bytes - 1
        self._tail = text[-kept:] if kept else b""


# What stands between or before rows, its length, and how many rows there are before the first one.
# In JSON a value may end in }},{ before its closing quote, but a bracket or comma follows that.
_MARKS: dict[QueryResultsFormat | RdfFormat, tuple[re.Pattern[bytes], int, int]] = {
    QueryResultsFormat.JSON: (re.compile(rb'\}\},\{"[^},]'), 6, 1),
    QueryResultsFormat.XML: (re.compile(rb"<result>"), 8, 0),
    QueryResultsFormat.TSV: (re.compile(rb"\n"), 1, -1),
    QueryResultsFormat.CSV: (re.compile(rb"\n"), 1, -1),
}


class ShortSink:
    """A file for Oxigraph to write a short result to.

    Args:
        size_max_bytes: how long it may be.
    """

    __slots__ = ("_left", "_parts")

    def __init__(self, size_max_bytes: int) -> None:
        self._left = size_max_bytes
        self._parts: list[bytes] = []

    def write(self, data: bytes) -> int:
        """Takes the next piece.

        Raises:
            Stopped: the result is longer than that.
        """
        size = len(data)
        self._left -= size
        if self._left < 0:
            raise Stopped
        self._parts.append(data)
        return size

    def flush(self) -> None:
        """Nothing waits to be written."""

    @property
    def text(self) -> bytes:
        """All that was written."""
        return self._parts[0] if len(self._parts) == 1 else b"".join(self._parts)


class ResultSink:
    """A file for Oxigraph to write a result to: memory first, a temporary file when it grows.

    Oxigraph writes in pieces of 8 KB. Each is a chance to stop: when the result is too long, or
    when nobody waits for it any more.

    Args:
        form: format of the result.
        limits: how long it may be, and how much of it is kept in memory.
        stop: once set, nobody waits for the result any more.
        folder: where the file is made, with a name by which another process finds it; None for a
            file without a name.
    """

    def __init__(
        self,
        form: QueryResultsFormat | RdfFormat,
        limits: LimitSettings,
        stop: threading.Event,
        folder: Path | None = None,
    ) -> None:
        self._folder = folder
        self._counter = RowCounter(form)
        self._limits = limits
        self._stop = stop
        self._parts: list[bytes] = []
        self._counted = 0
        self._file: IO[bytes] | None = None
        self.size = 0

    def write(self, data: bytes) -> int:
        """Takes the next piece.

        Raises:
            TooLarge: the result has too many rows or bytes.
            Stopped: nobody waits for it.
        """
        if self._stop.is_set():
            raise Stopped
        self._parts.append(data)
        self.size += len(data)
        # A row takes at least a byte: a result of fewer bytes than rows allowed needs no counting.
        if self.size > self._limits.result_rows_max:
            self._count_rows()
        if self.size > self._limits.result_max_bytes:
            bytes_max = self._limits.result_max_bytes
            raise TooLarge(
                f"the result is longer than {bytes_max:,} bytes; ask for less with LIMIT, or raise "
                "limits.result_max_bytes",
                limit_bytes=bytes_max,
            )
        if self._file is not None or self.size > self._limits.result_memory_max_bytes:
            self._spill()
        return len(data)

    def _spill(self) -> None:
        self._count_rows()
        try:
            if self._file is None:
                self._file = self._opened()
            self._file.writelines(self._parts)
        except OSError as problem:
            raise StorageFailed(
                f"a long result needs a temporary file, which cannot be written: {problem}"
            ) from None
        self._parts = []
        self._counted = 0

    def _opened(self) -> IO[bytes]:
        # Closed by `close`, or when its last chunk is sent.
        if self._folder is None:
            return tempfile.TemporaryFile(prefix="fluentboard-result-")
        return tempfile.NamedTemporaryFile(prefix="result-", dir=self._folder, delete=False)

    def _count_rows(self) -> None:
        for part in self._parts[self._counted :]:
            self._counter.add(part)
        self._counted = len(self._parts)
        rows_max = self._limits.result_rows_max
        if self._counter.rows > rows_max:
            raise TooLarge(
                f"the result has more than {rows_max:,} rows; ask for less with LIMIT, or raise "
                "limits.result_rows_max",
                limit_rows=rows_max,
            )

    def flush(self) -> None:
        """Nothing waits to be written."""

    def close(self) -> None:
        """Lets go of the temporary file, which nobody is to read."""
        if self._file is not None:
            self._file.close()
            if self._folder is not None:
                Path(self._file.name).unlink(missing_ok=True)

    @property
    def text(self) -> bytes | None:
        """The whole result, or None if it is in a file."""
        if self._file is not None:
            return None
        return self._parts[0] if len(self._parts) == 1 else b"".join(self._parts)

    @property
    def file(self) -> IO[bytes] | None:
        """The file that a long result is in; None if the result is in memory."""
        return self._file

    def chunks(self) -> AsyncIterator[bytes]:
        """The pieces of a result that is in a file; closes the file at the end."""
        assert self._file is not None, "a result in memory is read by `text`"
        return file_chunks(self._file)


async def file_chunks(file: IO[bytes]) -> AsyncIterator[bytes]:
    """The pieces of an open file, from its beginning; closes it at the end."""
    file.seek(0)
    try:
        # Fresh in the page cache: reading it here costs less than another thread would.
        while chunk := file.read(_CHUNK_BYTES):
            yield chunk
    finally:
        file.close()
