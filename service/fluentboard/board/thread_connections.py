"""SQLite connections for reading, one per thread that reads."""

from __future__ import annotations

import sqlite3
import threading
from collections.abc import Callable


class ThreadConnections:
    """Opens a connection for each thread that asks, and closes it once that thread has ended.

    Args:
        connect: opens one, which another thread may close.
    """

    def __init__(self, connect: Callable[[], sqlite3.Connection]) -> None:
        self._connect = connect
        self._local = threading.local()
        self._guard = threading.Lock()
        self._open: dict[threading.Thread, sqlite3.Connection] = {}

    def __len__(self) -> int:
        """How many are open; those of ended threads count until the next one is opened."""
        return len(self._open)

    def mine(self) -> sqlite3.Connection:
        """The connection of the calling thread."""
        found: sqlite3.Connection | None = getattr(self._local, "connection", None)
        if found is None:
            found = self._local.connection = self._connect()
            with self._guard:
                for thread in [one for one in self._open if not one.is_alive()]:
                    self._open.pop(thread).close()
                self._open[threading.current_thread()] = found
        return found

    def close(self) -> None:
        """Closes all of them."""
        with self._guard:
            for connection in self._open.values():
                connection.close()
            self._open.clear()
