"""Do two things in a scene occupy the same space?

Every thing is a set of convex solids (`Mesh.solids`); each becomes an upright prism. That is exact
for boxes and turned bodies that stand upright, and on the safe side for everything else.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from fluentboard_modules.simulation.scene import Instance, Scene
from fluentboard_modules.simulation.solids import overlap_depth

TOUCHING_M = 0.001
"""Things may share this much space: a cup sunk 1 mm into a table still stands on it."""


def penetration_m(a: Instance, b: Instance) -> float:
    """How deep two things reach into each other in metres; negative: at least so far apart."""
    deepest = -np.inf
    for p in a.prisms:
        low_p, high_p = p.bounds
        for q in b.prisms:
            low_q, high_q = q.bounds
            room = float((np.minimum(high_p, high_q) - np.maximum(low_p, low_q)).min())
            if room > deepest:
                deepest = max(deepest, overlap_depth(p, q))
    return deepest


def collisions(
    candidate: Instance, others: Iterable[Instance], tolerance_m: float = TOUCHING_M
) -> Iterator[tuple[str, float]]:
    """Names and depths in metres of the things that the candidate reaches into.

    Args:
        candidate: one thing; an instance of the same name among the others is skipped.
        others: the things around it. A `Building` is skipped: its walls are one hollow mesh, and
            the hull around them would be solid.
        tolerance_m: shared depth that still counts as touching; a negative one demands a gap.
    """
    rivals = [o for o in others if o.name != candidate.name and o.cls != "Building"]
    if not rivals or candidate.cls == "Building":
        return
    low, high = candidate.bounds_map
    theirs = np.array([other.bounds_map for other in rivals])
    room = np.minimum(high, theirs[:, 1]) - np.maximum(low, theirs[:, 0])
    for index in np.flatnonzero((room > tolerance_m).all(axis=1)):
        depth = penetration_m(candidate, rivals[index])
        if depth > tolerance_m:
            yield rivals[index].name, depth


def is_free(candidate: Instance, scene: Scene, tolerance_m: float = TOUCHING_M) -> bool:
    """Whether the candidate fits into the scene without reaching into anything."""
    return next(collisions(candidate, scene.instances, tolerance_m), None) is None


def all_collisions(scene: Scene, tolerance_m: float = TOUCHING_M) -> list[tuple[str, str, float]]:
    """Every pair of things that reach into each other, and how deep in metres."""
    found: list[tuple[str, str, float]] = []
    for index, instance in enumerate(scene.instances):
        found += [
            (instance.name, other, depth)
            for other, depth in collisions(instance, scene.instances[:index], tolerance_m)
        ]
    return found
