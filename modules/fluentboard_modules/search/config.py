"""Settings of the active search, each with a unit and where its value comes from."""

from __future__ import annotations

import math
from typing import Literal

from pydantic import Field

from fluentboard_modules.settings import Settings


class SensorModelConfig(Settings):
    """What a reading does to a cell: OctoMap's inverse sensor model and its defaults."""

    hit_probability: float = Field(
        default=0.7, gt=0.5, lt=1.0, description="Of being occupied, where a ray ended."
    )
    miss_probability: float = Field(
        default=0.4, gt=0.0, lt=0.5, description="The same where a ray went through."
    )
    probability_min: float = Field(default=0.1192, gt=0.0, lt=0.5, description="Clamp below.")
    probability_max: float = Field(default=0.971, gt=0.5, lt=1.0, description="Clamp above.")
    fade_margin: float = Field(
        default=0.05,
        gt=0.0,
        lt=0.5,
        description="A fading cell is unknown again when its probability is so near to one half.",
    )

    @property
    def log_odds_updates(self) -> tuple[float, float, float, float]:
        """Log-odds of a hit, of a miss, and the lowest and highest that a cell can have."""
        hit, miss, low, high = (
            math.log(p / (1.0 - p))
            for p in (
                self.hit_probability,
                self.miss_probability,
                self.probability_min,
                self.probability_max,
            )
        )
        return hit, miss, low, high


class BranchAndBoundConfig(Settings):
    """The thesis's planner; the defaults are those of the original software."""

    depth_limit: int | None = Field(
        default=2, ge=0, description="psi: from this depth on plans end greedily; null: no limit."
    )
    branch_limit: float | None = Field(
        default=1.3,
        ge=1.0,
        description="phi: views are tried down to the best utility divided by this; null: all.",
    )
    prune_dominated: bool = Field(
        default=False, description="zeta: skip views that another beats in gain and time (5.7)."
    )
    nodes_max: int = Field(default=200_000, ge=1, description="Search nodes; deterministic.")

    @property
    def is_exact(self) -> bool:
        """Whether the search is exhaustive if it comes to its end."""
        return self.depth_limit is None and self.branch_limit is None and not self.prune_dominated


class PlannerConfig(Settings):
    """The default planner: iterated local search."""

    rounds_max: int = Field(default=60, ge=0, description="Shakes at most.")
    replanning_rounds: int = Field(
        default=0,
        ge=0,
        description="The same where a plan is at hand: the next look will change it again, and "
        "shaking costs more time than it saves.",
    )
    idle_rounds: int = Field(
        default=15, ge=1, description="Shakes without an improvement after which it stops."
    )
    time_limit_s: float = Field(
        default=1.5, gt=0.0, description="Ends it earlier; a plan exists long before."
    )
    seed: int = Field(default=0, ge=0, description="Of the shakes.")


class ViewSamplingConfig(Settings):
    """How views are drawn and what they are taken to reveal."""

    views: int = Field(default=200, ge=1, description="As in Section 5.3.")
    rays: tuple[int, int] = Field(
        default=(80, 60), description="Columns and rows of a view's bundle of rays."
    )
    unknown_occupancy: float = Field(
        default=0.0,
        ge=0.0,
        lt=1.0,
        description="Visibility prior: the probability that an unknown cell is occupied. A ray "
        "ends when it is likelier stopped than not; 0 is the thesis: the unknown is transparent.",
    )
    tries_per_view: int = Field(default=300, ge=1, description="Cells drawn at most, per view.")
    time_limit_s: float = Field(
        default=5.0, gt=0.0, description="Sampling ends then, with the views it has."
    )
    tilt_rad: tuple[float, float] | None = Field(
        default=None, description="Narrower than the robot's own limits; null: those."
    )
    camera_height_m: tuple[float, float] | None = Field(
        default=None, description="Narrower than the robot's own limits; null: those."
    )


class SearchConfig(Settings):
    """A whole search: when it ends, and what it plans with."""

    resolution_m: float = Field(
        default=0.05, gt=0.0, description="Side of a cell; the thesis's map has 5 cm."
    )
    threshold: float = Field(
        default=0.05,
        ge=0.0,
        lt=1.0,
        description="omega: given up when all views together promise less.",
    )
    time_budget_s: float | None = Field(
        default=None, gt=0.0, description="Of the robot, driving and looking; null: no limit."
    )
    recall: float = Field(default=1.0, gt=0.0, le=1.0, description="Of the detector, per look.")
    detector_range_m: float | None = Field(
        default=None,
        gt=0.0,
        description="Farther things are not recognised, so their places count as unseen; null: as "
        "far as the robot's camera.",
    )
    confidence_min: float = Field(
        default=0.0,
        ge=0.0,
        le=1.0,
        description="An object of the class whose class evidence is weaker does not end a search.",
    )
    object_size_m: float = Field(
        default=0.0, ge=0.0, description="Unknown gaps that cannot hold such a cube are given up."
    )
    count_unknown_only: bool = Field(
        default=False, description="N_i of Eq. 5.1 counts the cells unknown at first, not all."
    )
    new_views: int = Field(
        default=40, ge=0, description="Views drawn anew before every plan, as far as there is room."
    )
    misses_max: int = Field(
        default=2,
        ge=1,
        description="A cell that stays unknown in so many looks that should show it is given up.",
    )
    fade_half_life_s: float | None = Field(
        default=None, gt=0.0, description="Knowledge of the map fades with it; null: never."
    )
    sensor: SensorModelConfig = SensorModelConfig()
    sampling: ViewSamplingConfig = ViewSamplingConfig()
    method: Literal["auto", "local-search", "branch-and-bound", "greedy"] = Field(
        default="auto",
        description="Of planning: ours, the thesis's, or one view at a time (Eq. 5.6). By default "
        "greedy for a robot that looks while it drives, else ours: the best that were measured.",
    )
    planner: PlannerConfig = PlannerConfig()
    branch_and_bound: BranchAndBoundConfig = BranchAndBoundConfig()
