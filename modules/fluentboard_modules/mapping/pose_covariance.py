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
# How far a model is moved to see if it shows, and how much of the way each step stands for.
_STEPS_M = (0.0125, 0.025, 0.05, 0.1, 0.2, 0.4)
_FAR_M, _WIDTHS_M = (0.05, 0.1, 0.2, 0.4), (0.035, 0.071, 0.141, 0.217)
_HERE_M = 0.0125


def pose_covariance(
    looker: Looker, best: Trial, refined: Refined, config: CovarianceConfig
) -> FloatArray:
    """`(3, 3)`; of x and y (metres) and yaw (radians) in the map.

    What surfaces bind follows from the noise of all pixels that show them. Along a top no surface
    does, only its outline; and what stands in a shelf may bind it wrongly. So along each axis of
    the model, the deviation is kept between the steps by which it can just and just not be moved
    without a loss: a model that may be anywhere within s to one side has the variance s^2 / 3.
    Places further off that look nearly as good, such as the next table's half of a row, add their
    squared distance by how likely they are.

    Args:
        looker: at the model.
        best: where it stands.
        refined: how well the pixels bind it there.
        config: of all parts.
    """
    bound = _bound(refined, looker.config.refinement.independent_share)
    scale, added = np.ones(3), np.zeros(3)
    for axis in range(2):
        losses = _losses(looker, best, axis)
        least, most = _play_m(losses, config.noticed)
        sigma = float(np.sqrt(bound[axis, axis]))
        scale[axis] = float(np.clip(sigma, least / np.sqrt(3.0), most / np.sqrt(3.0))) / sigma
        added[axis] = _elsewhere_m2(losses, config.doubt)
    floor = np.array([config.floor_m, config.floor_m, config.floor_rad])
    if looker.model.holds_things:
        floor[1] = config.contents_m
    turn = np.eye(3)
    c, s = np.cos(best.standing.yaw_rad), np.sin(best.standing.yaw_rad)
    turn[:2, :2] = (c, -s), (s, c)
    return turn @ (bound * np.outer(scale, scale) + np.diag(added + floor**2)) @ turn.T


def _bound(refined: Refined, independent_share: float) -> FloatArray:
    """`(3, 3)`; model frame: the inverse of the pixels' information."""
    share = independent_share / max(refined.misfit, 1.0)
    return np.linalg.inv(refined.information * share + _PRIOR)


def _losses(looker: Looker, best: Trial, axis: int) -> FloatArray:
    """`(steps, 2)`; share of what speaks for a model that it loses, moved either way."""
    reference = looker.glance(best.standing)
    shift = np.eye(2)[axis]
    gains = [
        [looker.glance(best.standing.moved(*(side * step * shift), 0.0)).gain for side in (1, -1)]
        for step in _STEPS_M
    ]
    return (reference.gain - np.array(gains)) / max(reference.visibility.close, 1e-6)


def _play_m(losses: FloatArray, noticed: float) -> tuple[float, float]:
    """By how much a model can be moved unnoticed, and the least step that is noticed."""
    unnoticed = 0.0
    for step, loss in zip(_STEPS_M, losses.min(axis=1).tolist(), strict=True):
        if loss > noticed:
            return unnoticed, step
        unnoticed = step
    return unnoticed, np.inf


def _elsewhere_m2(losses: FloatArray, doubt: float) -> float:
    """Mean squared distance of the places further off, each as likely as it looks."""
    steps, widths = np.array(_FAR_M), np.array(_WIDTHS_M)
    far = np.maximum(losses[-len(steps) :], 0.0)
    likely = np.exp(-far / doubt).sum(axis=1) * widths
    return float((likely * steps**2).sum() / (_HERE_M + likely.sum()))
