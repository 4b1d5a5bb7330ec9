"""How far something is believed to be there, by the frames that could have shown it (pure).

Belief is kept as log-odds, to which each frame adds what it says: a frame that shows the thing is
more likely if it is there (`detection_rate`) than if it is not (`false_alarm_rate`), and the other
way round for one that sees through its place. Frames in which it is hidden, or which look
elsewhere, are as likely either way and add nothing: occlusion ends no belief. The log-odds are
clamped, so that after a hundred frames of a chair a few of its empty place suffice.
"""

from __future__ import annotations

import math

from fluentboard_modules.mapping.config import ExistenceConfig


def log_odds(probability: float) -> float:
    """Natural logarithm of p / (1 - p)."""
    return math.log(probability / (1.0 - probability))


def probability(odds: float) -> float:
    """The probability in [0, 1] that log-odds stand for.

    >>> round(probability(log_odds(0.3)), 6)
    0.3
    """
    return 1.0 / (1.0 + math.exp(-odds))


def after_detections(odds: float, count: int, config: ExistenceConfig) -> float:
    """Log-odds after so many more frames that showed it."""
    step = math.log(config.detection_rate / config.false_alarm_rate)
    return min(odds + count * step, log_odds(config.belief_max))


def after_misses(odds: float, count: int, config: ExistenceConfig) -> float:
    """Log-odds after so many more frames that saw through its place."""
    step = math.log((1.0 - config.false_alarm_rate) / (1.0 - config.detection_rate))
    return max(odds - count * step, -log_odds(config.belief_max))


def supported_belief(n_frames: int, config: ExistenceConfig) -> float:
    """Belief in something that so many frames showed and none missed."""
    return probability(after_detections(log_odds(config.prior), n_frames, config))


def combined_belief(earlier: float, present: float, config: ExistenceConfig) -> float:
    """Belief by what an earlier run saw and, independently of it, by what this one has seen."""
    odds = log_odds(earlier) + log_odds(present) - log_odds(config.prior)
    return probability(min(odds, log_odds(config.belief_max)))


def verified_belief(seen: float, agreement: float, config: ExistenceConfig) -> float:
    """Belief by the frames that showed something and by how well its CAD file agrees with them.

    Args:
        seen: belief by the frames alone.
        agreement: probability of the CAD file's verdict, true and false weighed alike.
        config: how far belief goes.
    """
    least = 1.0 - config.belief_max
    odds = log_odds(seen) + log_odds(min(max(agreement, least), config.belief_max))
    return probability(min(odds, log_odds(config.belief_max)))
