"""Recognition by size and shape alone: what is there before anything has been trained.

The classes of Section 4.3.1, a few more that stand on every table, and their usual measures. Forks,
knives and spoons look the same to it, as they nearly do to the spin images of the thesis.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fluentboard.model.geometry import FloatArray
from fluentboard_modules.anchoring.observation import Cluster

_SIGMA = 0.28  # of the logarithm of a measure: sorts differ, and views show parts
_UNKNOWN = 0.02  # weight of being something else; the better the best class fits, the less it has


@dataclass(frozen=True, slots=True)
class TypicalSize:
    """Usual measures of a class: long side, short side and height in metres."""

    class_name: str
    long_m: float
    short_m: float
    tall_m: float


TYPICAL_SIZES = (
    TypicalSize("Box", 0.32, 0.22, 0.11),
    TypicalSize("CoffeeJug", 0.20, 0.15, 0.20),
    TypicalSize("Dish", 0.22, 0.21, 0.03),
    TypicalSize("Fork", 0.19, 0.025, 0.015),
    TypicalSize("Knife", 0.22, 0.022, 0.014),
    TypicalSize("Magazine", 0.29, 0.21, 0.015),
    TypicalSize("MilkPot", 0.095, 0.07, 0.095),
    TypicalSize("Mug", 0.105, 0.082, 0.092),
    TypicalSize("Spoon", 0.18, 0.035, 0.017),
    TypicalSize("SugarPot", 0.10, 0.09, 0.075),
    TypicalSize("TableSign", 0.11, 0.06, 0.14),
)
"""From shops' catalogues, rounded; cutlery as a depth camera sees it."""


class GeometricRecogniser:
    """Rates classes by how usual the size of a cluster is for each.

    Confidences sum to less than 1: the rest is for everything that has no class here.

    Args:
        sizes: the classes and their measures.
    """

    def __init__(self, sizes: tuple[TypicalSize, ...] = TYPICAL_SIZES) -> None:
        self._classes = tuple(size.class_name for size in sizes)
        self._measures = np.log([[s.long_m, s.short_m, s.tall_m] for s in sizes])

    @property
    def classes(self) -> tuple[str, ...]:
        """The classes, in alphabetical order."""
        return self._classes

    def recognise(self, cluster: Cluster) -> FloatArray:
        """`(k,)`; confidence of each class.

        What is cut off or hidden may be larger than it looks, so missing size counts half.
        """
        box = cluster.box
        sides = sorted((box.x_size, box.y_size), reverse=True)
        seen = np.log(np.maximum([*sides, box.z_size], 1e-3))
        off = (seen - self._measures) / _SIGMA
        if cluster.is_cut_off or cluster.is_occluded:
            off = np.where(off < 0.0, 0.5 * off, off)
        weights = np.exp(-0.5 * (off**2).sum(axis=1))
        return weights / (weights.sum() + _UNKNOWN)
