"""Finds the standing queries whose footprint a statement touches, without asking each (pure)."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Generic, TypeVar

from fluentboard.board.subscriptions.footprint import Shape
from fluentboard.board.vocabulary import Statement

Holder = TypeVar("Holder")


class TouchIndex(Generic[Holder]):
    """Shapes by their constants: looking a statement up costs at most eight hash lookups.

    Holders are kept in dicts rather than sets, so that they are found in the order they came.
    """

    def __init__(self) -> None:
        self._holders: dict[Shape, dict[Holder, None]] = {}
        # How many shapes have constants in which places: lookups that cannot succeed are not made.
        self._masks: dict[tuple[bool, bool, bool], int] = {}

    def __len__(self) -> int:
        return len(self._holders)

    def add(self, holder: Holder, shapes: Iterable[Shape]) -> None:
        """Has statements of these shapes lead to the holder."""
        for shape in shapes:
            holders = self._holders.get(shape)
            if holders is None:
                holders = self._holders[shape] = {}
                mask = _mask(shape)
                self._masks[mask] = self._masks.get(mask, 0) + 1
            holders[holder] = None

    def remove(self, holder: Holder, shapes: Iterable[Shape]) -> None:
        """Undoes `add`."""
        for shape in shapes:
            holders = self._holders.get(shape)
            if holders is None:
                continue
            holders.pop(holder, None)
            if not holders:
                del self._holders[shape]
                mask = _mask(shape)
                self._masks[mask] -= 1
                if not self._masks[mask]:
                    del self._masks[mask]

    def touched(self, statements: Iterable[Statement]) -> dict[Holder, None]:
        """The holders of all shapes that one of the statements has."""
        found: dict[Holder, None] = {}
        if not self._holders:
            return found
        masks = list(self._masks)
        for subject, predicate, target in statements:
            for has_subject, has_predicate, has_target in masks:
                holders = self._holders.get(
                    (
                        subject if has_subject else None,
                        predicate if has_predicate else None,
                        target if has_target else None,
                    )
                )
                if holders:
                    found.update(holders)
        return found


def matches(shape: Shape, statement: Statement) -> bool:
    """The statement has the shape."""
    return all(wanted in (None, term) for wanted, term in zip(shape, statement, strict=True))


def _mask(shape: Shape) -> tuple[bool, bool, bool]:
    subject, predicate, target = shape
    return subject is not None, predicate is not None, target is not None
