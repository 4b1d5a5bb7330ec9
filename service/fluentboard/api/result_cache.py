"""Result cache: the answer to a query that was asked before, as long as nothing has changed.

Robots and dashboards ask the same questions over and over. A result is kept together with the
commit that it is exact at, and forgotten with the next commit, so what comes from here is never
stale.
"""

from __future__ import annotations

import re
from typing import NamedTuple

_LONGEST_ENTRY_BYTES = 64 * 1024
# Guesses, in bytes, at what an entry costs besides the query and the result.
_ENTRY_OVERHEAD_BYTES = 500

# What may give another answer although nothing on the board has changed.
_VOLATILE = re.compile(r"\b(?:NOW|RAND|UUID|STRUUID|BNODE|SERVICE)\b")
_VOLATILE_PARTS = ("NOW", "RAND", "UUID", "BNODE", "SERVICE")


class Key(NamedTuple):
    """What the answer depends on, besides the board.

    Attributes:
        text: of the query.
        accept: what the client takes.
        default_graphs: of the protocol request.
        named_graphs: of the protocol request.
    """

    text: str
    accept: str | None
    default_graphs: tuple[str, ...]
    named_graphs: tuple[str, ...]


class Cached(NamedTuple):
    """An answer.

    Attributes:
        media_type: of the text.
        text: the serialised result.
    """

    media_type: str
    text: bytes


class ResultCache:
    """Results of one commit. Used by the event loop's thread alone.

    Args:
        size_max_bytes: how much memory it may take; 0 keeps nothing.
    """

    def __init__(self, size_max_bytes: int) -> None:
        self._size_max_bytes = size_max_bytes
        self._entries: dict[Key, Cached] = {}
        self._size_bytes = 0
        self._commit = -1

    def get(self, commit: int, key: Key) -> Cached | None:
        """The answer as of the commit, if it is known."""
        return self._entries.get(key) if commit == self._commit else None

    def put(self, commit: int, key: Key, answer: Cached, *, may_change: bool = True) -> None:
        """Keeps an answer that is exact at the commit, if it may be given again.

        Args:
            commit: the commit.
            key: what was asked.
            answer: to keep.
            may_change: the query may have what gives another answer although nothing changed.
        """
        size = len(answer.text) + 2 * len(key.text) + _ENTRY_OVERHEAD_BYTES
        if len(answer.text) > _LONGEST_ENTRY_BYTES or size > self._size_max_bytes:
            return
        if commit < self._commit or (may_change and _is_volatile(key.text)):
            return
        if commit > self._commit:
            self._forget()
            self._commit = commit
        while self._size_bytes + size > self._size_max_bytes:
            # The oldest first: a dictionary keeps its order.
            oldest = next(iter(self._entries))
            gone = self._entries.pop(oldest)
            self._size_bytes -= len(gone.text) + 2 * len(oldest.text) + _ENTRY_OVERHEAD_BYTES
        if key not in self._entries:
            self._entries[key] = answer
            self._size_bytes += size

    def _forget(self) -> None:
        self._entries = {}
        self._size_bytes = 0


def _is_volatile(text: str) -> bool:
    upper = text.upper()
    # Looking for a part is twenty times faster than the expression, and mostly all that is needed.
    return any(part in upper for part in _VOLATILE_PARTS) and _VOLATILE.search(upper) is not None
