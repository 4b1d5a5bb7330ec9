"""How far something is believed to be there, by the frames that could have shown it (pure).

Belief is kept as log-odds, to which each look adds what it says: one that shows the thing is more
likely if it is there than if it is not, and the other way round for one that sees through its
place. Looks in which it is hidden, or which go elsewhere, are as likely either way and add nothing:
occlusion ends no belief. The log-odds are clamped, so that after a hundred frames of a chair a few
of its empty place suffice.

Looks from nearly the same place err alike: a backrest that is overlooked once is overlooked again.
So each view has shares of its own, about which only the looks from there tell: if K looks like this
one have said the same without a break, and the shares a and b (there, not there) of all views are
worth n looks, this one multiplies the odds by (n a + K) / (n b + K). The first look counts in full,
the next from the same place hardly, and one from the other side of the room in full again. K adds
up earlier looks, each by how little the line of sight has changed since. A look that says otherwise
than those before it counts in full: something may have changed.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence

from fluentboard_modules.mapping.config import ExistenceConfig

_LOOKS_KEPT = 24


def log_odds(probability: float) -> float:
    """Natural logarithm of p / (1 - p)."""
    return math.log(probability / (1.0 - probability))


def probability(odds: float) -> float:
    """The probability in [0, 1] that log-odds stand for.

    >>> round(probability(log_odds(0.3)), 6)
    0.3
    """
    return 1.0 / (1.0 + math.exp(-odds))


class ExistenceBelief:
    """Belief that one thing is there, look by look.

    Args:
        config: what a look says.
        odds: log-odds to begin with; by default those of the prior.
    """

    __slots__ = ("_config", "_eyes", "_shown", "odds")

    def __init__(self, config: ExistenceConfig, odds: float | None = None) -> None:
        self._config = config
        self._eyes: deque[tuple[float, float, float]] = deque(maxlen=_LOOKS_KEPT)
        self._shown: bool | None = None
        self.odds = log_odds(config.prior) if odds is None else odds

    @property
    def probability(self) -> float:
        """In [1 - `belief_max`, `belief_max`] after any look."""
        return probability(self.odds)

    def take(self, shows: bool, eye: Sequence[float]) -> None:
        """Takes in a look.

        Args:
            shows: whether it shows the thing; otherwise it sees through its place.
            eye: `(3,)`; from the thing to the sensor, metres, in axes that do not turn.
        """
        config = self._config
        x, y, z = (float(v) for v in eye)
        if shows is not self._shown:
            self._eyes.clear()
            self._shown = shows
        changes = (_change((x, y, z), earlier) for earlier in self._eyes)
        alike = sum(math.exp(-change / config.alike) for change in changes)
        self._eyes.append((x, y, z))
        if shows:
            there, gone = config.shown_if_there, config.shown_if_gone
        else:
            there, gone = config.through_if_there, config.through_if_gone
        n = config.own_looks
        limit = log_odds(config.belief_max)
        odds = self.odds + math.log((n * there + alike) / (n * gone + alike))
        self.odds = min(max(odds, -limit), limit)

    def copy(self) -> ExistenceBelief:
        """The same, for another thing to go on with."""
        other = ExistenceBelief(self._config, self.odds)
        other._eyes.extend(self._eyes)
        other._shown = self._shown
        return other


def _change(a: tuple[float, float, float], b: tuple[float, float, float]) -> float:
    """How far the sensor has moved, as a share of its distance: of small turns, the angle."""
    return math.dist(a, b) / max(min(math.hypot(*a), math.hypot(*b)), 1e-6)


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
