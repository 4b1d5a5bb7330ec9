"""Durable subscriptions on a disk that is full for a while."""

from __future__ import annotations

import resource
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

import pytest

from fluentboard.board.subscriptions.durable import (
    DurableSubscription,
    DurableSubscriptions,
    Position,
)
from fluentboard.errors import StorageFailed


@contextmanager
def full_disk() -> Generator[None]:
    """Lets no file grow."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def test_what_a_full_disk_refuses_leaves_no_trace_and_can_be_repeated(tmp_path: Path) -> None:
    durable = DurableSubscriptions(tmp_path / "subscriptions.sqlite")
    durable.add(
        DurableSubscription("mugs", "ASK {}", "bindings", None, None, None, "ann", 1.0, Position(1))
    )
    with full_disk():
        for _ in range(2):
            with pytest.raises(StorageFailed, match="free disk space and repeat"):
                durable.advance("mugs", Position(2))
        assert durable.get("mugs").seen == Position(1)
    durable.advance("mugs", Position(2))
    assert durable.get("mugs").seen == Position(2)
    durable.close()
