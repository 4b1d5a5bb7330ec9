"""How far the pose of a verified piece may be off: what pixels bind, and what nobody noticed."""

from __future__ import annotations

import numpy as np

from fluentboard.model.geometry import FloatArray
from fluentboard_modules.mapping.config import CovarianceConfig
from fluentboard_modules.mapping.placement import Looker, Trial
from fluentboard_modules.mapping.refinement import Refined

UNKNOWN_POSE: FloatArray = np.diag([0.25**2, 0.25**2, 0.35**2])
"""Before anything was seen: where ICP begins, metres and radians."""

_PRIOR = np.linalg.inv(UNKNOWN_POSE)
_PLAY_STEPS_M = (0.0125, 0.025, 0.05, 0.1, 0.2, 0.4)  # how far a model is moved to see if it shows


def pose_covariance(
    looker: Looker, best: Trial, refined: Refined, config: CovarianceConfig
) -> FloatArray:
    """`(3, 3)`; of x and y (metres) and yaw (radians) in the map.

    What surfaces bind follows from the noise of all pixels that show them. Along a top no surface
    does, only its outline; and what stands in a shelf may bind it wrongly. So along each axis of
    the model, the deviation is kept between the steps by which it can just and just not be moved
    without a loss: a model that may be anywhere within s to one side has the variance s^2 / 3.

    Args:
        looker: at the model.
        best: where it stands.
        refined: how well the pixels bind it there.
        config: of both parts.
    """
    bound = _bound(refined, looker.config.refinement.independent_share)
    scale = np.ones(3)
    for axis in range(2):
        least, most = _play_m(looker, best, axis, config)
        sigma = float(np.sqrt(bound[axis, axis]))
        scale[axis] = float(np.clip(sigma, least / np.sqrt(3.0), most / np.sqrt(3.0))) / sigma
    floor = np.diag([config.floor_m, config.floor_m, config.floor_rad]) ** 2
    turn = np.eye(3)
    c, s = np.cos(best.standing.yaw_rad), np.sin(best.standing.yaw_rad)
    turn[:2, :2] = (c, -s), (s, c)
    return turn @ (bound * np.outer(scale, scale) + floor) @ turn.T


def _bound(refined: Refined, independent_share: float) -> FloatArray:
    """`(3, 3)`; model frame: the inverse of the pixels' information."""
    share = independent_share / max(refined.misfit, 1.0)
    return np.linalg.inv(refined.information * share + _PRIOR)


def _play_m(
    looker: Looker, best: Trial, axis: int, config: CovarianceConfig
) -> tuple[float, float]:
    """By how much a model can be moved unnoticed, and the least step that is noticed."""
    reference = looker.glance(best.standing)
    least = reference.gain - config.noticed * abs(reference.visibility.close)
    unnoticed = 0.0
    for step in _PLAY_STEPS_M:
        shift = step * np.eye(2)[axis]
        moved = (best.standing.moved(*(side * shift), 0.0) for side in (1.0, -1.0))
        if not any(looker.glance(standing).gain >= least for standing in moved):
            return unnoticed, step
        unnoticed = step
    return unnoticed, np.inf
