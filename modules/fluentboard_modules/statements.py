"""What a module wants the board to say: fluents to assert or refine, and endings (pure)."""

from __future__ import annotations

from dataclasses import dataclass

from fluentboard.model.fluent import Fluent
from fluentboard.model.interval import Interval


@dataclass(frozen=True, slots=True)
class Ending:
    """A fluent that ceased to hold some time within an interval."""

    name: str
    finish: Interval


Statement = Fluent | Ending
"""A fluent to assert, or to merge into the one of that name; or an ending."""
