"""Finds the incremental queries that a fluent can matter to, by what they require of it (pure)."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Generic, TypeVar

from fluentboard.board.subscriptions.changes import EventChange
from fluentboard.board.subscriptions.footprint import Shape
from fluentboard.board.subscriptions.touch_index import TouchIndex

Holder = TypeVar("Holder")


class KeyIndex(Generic[Holder]):
    """Like a touch index, but compares with all that a fluent says, changed or not."""

    def __init__(self) -> None:
        self._index: TouchIndex[Holder] = TouchIndex()

    def __len__(self) -> int:
        return len(self._index)

    def add(self, holder: Holder, keys: Iterable[Shape]) -> None:
        """Has fluents with a statement of one of these shapes lead to the holder."""
        self._index.add(holder, keys)

    def remove(self, holder: Holder, keys: Iterable[Shape]) -> None:
        """Undoes `add`."""
        self._index.remove(holder, keys)

    def candidates(self, change: EventChange) -> dict[Holder, None]:
        """The holders that the fluent of an event may match, before it or after."""
        found = self._index.touched(change.after)
        if change.before:
            found.update(self._index.touched(change.before))
        return found
