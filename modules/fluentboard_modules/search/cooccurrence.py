"""Where things of a class have been seen, and among what: probabilities from the board's memory.

The simplest model that uses context: what stands at a place now votes for the target as often as
the two have been at one place before.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from fluentboard.model.geometry import BoundingBox, FloatArray

_PRIOR = 0.2  # P_i of the thesis's experiments, and what half a memory is worth
_WEIGHT = 1.0
_LEAST, _MOST = 0.02, 0.95


@dataclass(frozen=True, slots=True)
class Sighting:
    """An object at a place, now or earlier.

    Attributes:
        name: of the object.
        classes: its class and those above it.
        position: `(3,)`; metres, map frame.
        is_present: whether it is there now.
    """

    name: str
    classes: frozenset[str]
    position: FloatArray
    is_present: bool


def probabilities_from_memory(
    target_class: str, boxes: Sequence[BoundingBox], sightings: Iterable[Sighting]
) -> list[float]:
    """P_i of each volume: that at least one object of the target class is there.

    For a volume it is the largest of: how often the target has been there among all objects that
    have; and, for each class that is there now, how often the target has been where that class has
    been. Counts are smoothed towards the prior of 0.2 with the weight of one sighting.

    Args:
        target_class: short name.
        boxes: the volumes.
        sightings: of all objects, with their past places.
    """
    ever: list[set[str]] = [set() for _ in boxes]
    now: list[set[str]] = [set() for _ in boxes]
    names: list[set[str]] = [set() for _ in boxes]
    with_target: list[set[str]] = [set() for _ in boxes]
    for sighting in sightings:
        for n, box in enumerate(boxes):
            if not box.contains(sighting.position[None])[0]:
                continue
            names[n].add(sighting.name)
            ever[n] |= sighting.classes
            if target_class in sighting.classes:
                with_target[n].add(sighting.name)
            elif sighting.is_present:
                now[n] |= sighting.classes
    # What is at every place, such as passive objects as such, says nothing.
    filled = [classes for classes in ever if classes]
    everywhere = set.intersection(*filled) if len(filled) > 1 else set[str]()
    found: list[float] = []
    for n in range(len(boxes)):
        votes = [_smoothed(bool(with_target[n]), 1 if names[n] else 0)]
        for class_name in sorted(now[n] - everywhere):
            places = [target_class in classes for classes in ever if class_name in classes]
            votes.append(_smoothed(sum(places), len(places)))
        found.append(min(max(max(votes), _LEAST), _MOST))
    return found


def _smoothed(hits: int, trials: int) -> float:
    return (hits + _WEIGHT * _PRIOR) / (trials + _WEIGHT)
