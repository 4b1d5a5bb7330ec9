"""Bodies of imports, piece by piece."""

from __future__ import annotations

from collections.abc import AsyncIterator, Callable, Iterable, Iterator
from pathlib import Path

from fluentboard.errors import InvalidInput

Progress = Callable[[int], None]

_BLOCK_BYTES = 64 * 1024


def file_pieces(path: Path) -> Iterator[bytes]:
    """The contents of a file, 64 KiB at a time.

    Raises:
        InvalidInput: it cannot be read.
    """
    try:
        with path.open("rb") as file:
            while block := file.read(_BLOCK_BYTES):
                yield block
    except OSError as failure:
        raise InvalidInput(f"{path}: cannot be read ({failure.strerror or failure})") from failure


def counted(pieces: Iterable[bytes], progress: Progress | None) -> Iterator[bytes]:
    """The pieces; `progress` is told the size of each once it was taken."""
    for piece in pieces:
        yield piece
        if progress is not None:
            progress(len(piece))


async def stream_async(pieces: Iterable[bytes]) -> AsyncIterator[bytes]:
    """The pieces for an asynchronous request."""
    for piece in pieces:
        yield piece
