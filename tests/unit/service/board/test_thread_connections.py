"""Connections of threads that come and go."""

from __future__ import annotations

import sqlite3
import threading
from pathlib import Path

import pytest

from fluentboard.board.thread_connections import ThreadConnections


def test_a_thread_keeps_its_connection_and_leaves_none_behind(tmp_path: Path) -> None:
    def connect() -> sqlite3.Connection:
        return sqlite3.connect(tmp_path / "file", check_same_thread=False)

    connections = ThreadConnections(connect)
    seen: list[sqlite3.Connection] = []

    def read_twice() -> None:
        seen.extend([connections.mine(), connections.mine()])

    for _ in range(5):
        thread = threading.Thread(target=read_twice)
        thread.start()
        thread.join()
    assert len({id(one) for one in seen}) == 5
    assert all(first is second for first, second in zip(seen[::2], seen[1::2], strict=True))
    assert len(connections) == 1
    for one in seen[:-2]:
        with pytest.raises(sqlite3.ProgrammingError, match="closed"):
            one.execute("SELECT 1")
    connections.close()
    assert len(connections) == 0
