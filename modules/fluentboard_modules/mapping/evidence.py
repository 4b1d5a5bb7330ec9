"""How likely a CAD model stands where it fits best, by all that the depth images say about it."""

from __future__ import annotations

import math
from dataclasses import dataclass

from fluentboard_modules.mapping.config import EvidenceConfig
from fluentboard_modules.mapping.placement import Looker, Trial
from fluentboard_modules.mapping.stack_kernels import outline_of_views
from fluentboard_modules.mapping.visibility import front_relief_m

_OUTLINE_PRIOR_M = 0.1  # of outline seen to end, and as much that goes on, before any was seen


@dataclass(frozen=True, slots=True)
class Evidence:
    """What speaks for a model at a place.

    Attributes:
        explained: share of what was seen of it that it explains, in [0, 1].
        closeness: the same, each pixel counting less the further off it is.
        outline: share of its outline, as far as anything can be said about it, beyond which one
            sees farther; the rest lies on a surface that goes on. In (0, 1).
        misfit: mean squared residual in variances of the sensor's noise.
        relief: of a front, how far its openings are deeper than its edges, as a share of what
            books leave, in [0, 1]; None if nothing else than a front was recognised.
    """

    explained: float
    closeness: float
    outline: float
    misfit: float
    relief: float | None = None

    def probability(self, config: EvidenceConfig) -> float:
        """How likely the model is there, in [0, 1]; without any relief a front is none."""
        if self.relief == 0.0:
            return 0.0
        odds = config.bodies if self.relief is None else config.fronts
        misfit = min(max(self.misfit, 1.0 / config.misfit_max), config.misfit_max)
        total = (
            odds.intercept
            + odds.explained * self.explained
            + odds.closeness * self.closeness
            + odds.outline * self.outline
            + odds.misfit * math.log(misfit)
            + odds.relief * (self.relief or 0.0)
        )
        return 1.0 / (1.0 + math.exp(-min(max(total, -30.0), 30.0)))


def gather_evidence(
    looker: Looker, trial: Trial, misfit: float, *, is_front: bool = False
) -> Evidence:
    """All that the views say about a model at a place.

    Args:
        looker: at the model.
        trial: the place.
        misfit: how the pixels agree there.
        is_front: whether only a front was recognised; all that is measured may lie in one plane
            then, and whether it is a front shows in its relief.
    """
    model, config = looker.model, looker.config
    T_map_model, stack = trial.standing.transform, looker.views
    ends_m, goes_on_m = outline_of_views(
        model.mesh.vertices,
        model.mesh.triangles,
        model.box_corners,
        T_map_model.matrix,
        stack.depth_m,
        stack.sigma_m,
        stack.cameras,
        stack.sizes,
        stack.T_sensor_map,
        stack.T_map_sensor,
        config.visibility.overrun_reach_m,
        config.visibility.tolerance_m,
        config.visibility.tolerance_sigma,
        config.evidence.outline_m,
        config.visibility.floor_clear_m,
    )
    ends, goes_on = _OUTLINE_PRIOR_M + ends_m, _OUTLINE_PRIOR_M + goes_on_m
    relief: float | None = None
    if is_front:
        relief_m = front_relief_m(model, T_map_model, looker.views, config.visibility)
        relief = min(relief_m / config.evidence.relief_m, 1.0)
    closeness = max(trial.closeness, 0.0)
    return Evidence(trial.score, closeness, ends / (ends + goes_on), misfit, relief)


def rough_evidence(trial: Trial, *, is_front: bool = False) -> Evidence:
    """What is known about a model that hardly anything is like: neither outline nor misfit."""
    closeness = max(trial.closeness, 0.0)
    return Evidence(trial.score, closeness, 0.5, math.inf, 0.0 if is_front else None)
