"""What happened in a search, step by step: for pictures, the board, and evaluation."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from fluentboard.model.geometry import FloatArray
from fluentboard_modules.simulation.robots import View


@dataclass(frozen=True, slots=True)
class Moment:
    """What had been seen by a time.

    Attributes:
        elapsed_s: the robot's time since the search began, without planning.
        planning_s: time spent on planning by then.
        probability: prior probability that the object was in what had been seen.
    """

    elapsed_s: float
    planning_s: float
    probability: float


@dataclass(frozen=True, eq=False)
class SearchStep:
    """One look of a search.

    Attributes:
        view: where the robot looked, or tried to.
        is_reached: whether it got there.
        plan: all views of the plan that began with it.
        expected_time_s: E[T] of the plan.
        success_probability: p(L) of the plan.
        gap: how far the plan may be from the best one.
        candidates: views that the planner chose from.
        gains: `(candidates,)`; probability that each shows the object, for pictures.
        expected_cells: that the view promised.
        revealed_cells: that became known on the way and at the view.
        unknown_cells: of the region that were left.
        remaining_probability: p(V(S)) before the step: with all views that were left.
        path: `(n, 2)`; the way there.
        moment: after the step.
        stamp_s: the robot's clock after the step.
        kept_cells: of those that the view promised, how many became known.
    """

    view: View
    is_reached: bool
    plan: tuple[View, ...]
    expected_time_s: float
    success_probability: float
    gap: float
    candidates: tuple[View, ...]
    gains: FloatArray
    expected_cells: int
    revealed_cells: int
    unknown_cells: int
    remaining_probability: float
    path: FloatArray
    moment: Moment
    stamp_s: float
    kept_cells: int = 0


@dataclass(eq=False)
class SearchRecord:
    """A whole search.

    Attributes:
        start: where the robot was.
        steps: its looks.
        moments: what had been seen when, looks on the way included; the first is the beginning.
        outcome: why it ended, "" while it goes on: `found`, `below-threshold`, `exhausted`,
            `out-of-time` or `cancelled`.
    """

    start: View
    steps: list[SearchStep] = field(default_factory=list)
    moments: list[Moment] = field(default_factory=lambda: [Moment(0.0, 0.0, 0.0)])
    outcome: str = ""

    @property
    def probability(self) -> float:
        """Prior probability that the object is in what has been seen."""
        return self.moments[-1].probability

    def expected_time_s(self, with_planning: bool = True) -> float:
        """The mean duration of the search, over where the object may be (Section 5.3).

        What is not found by the end has searched in vain for all of its duration.

        Args:
            with_planning: count the planning time too.
        """
        total = 0.0
        for before, after in zip(self.moments, self.moments[1:], strict=False):
            spent = after.elapsed_s - before.elapsed_s
            if with_planning:
                spent += after.planning_s - before.planning_s
            total += (1.0 - before.probability) * spent
        return total

    @property
    def duration_s(self) -> float:
        """Time the robot moved and looked."""
        return self.moments[-1].elapsed_s

    @property
    def planning_s(self) -> float:
        """Time spent on planning."""
        last = self.moments[-1].planning_s
        return last if math.isfinite(last) else 0.0
