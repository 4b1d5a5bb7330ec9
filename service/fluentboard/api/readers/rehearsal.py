"""Rehearsals: updates that are evaluated where they can be stopped, before it is done for good."""

from __future__ import annotations

import pickle
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

from fluentboard.board.update_operations import InsertStatements, Load, Modify, Operation
from fluentboard.board.updates import loads_resolved


@dataclass(frozen=True, slots=True)
class Rehearsal:
    """What a reader evaluates and then forgets.

    Attributes:
        operations: of one request, in order.
        query: asked of what the board would say after them; None for nothing.
    """

    operations: tuple[Operation, ...]
    query: str | None = None

    @classmethod
    def of(cls, operations: Sequence[Operation], query: str | None = None) -> Self:
        """The rehearsal of a request; what it loads from the web is left out."""
        return cls(tuple(loads_resolved(operations, _nothing)), query)

    def packed(self) -> bytes:
        """As it goes to a reader. Service and readers are one program, so pickle will do."""
        return pickle.dumps((self.operations, self.query))

    @classmethod
    def unpacked(cls, packed: bytes) -> Self:
        """What `packed` gave."""
        operations, query = pickle.loads(packed)
        return cls(operations, query)


def needs_rehearsal(operations: Sequence[Operation]) -> bool:
    """A WHERE sees what operations before it did, so evaluating it alone would prove nothing."""
    return any(isinstance(operation, Modify) for operation in operations[1:])


def _nothing(_: Load) -> InsertStatements | None:
    return None
