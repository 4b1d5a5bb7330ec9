"""Local recognition by size, learned from labelled boxes: for data sets that have nothing else."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from fluentboard.errors import InvalidInput
from fluentboard.model.geometry import BoundingBox, FloatArray
from fluentboard_modules.anchoring.observation import Cluster

_THINNEST_M = 0.002
_NEAR = 0.15
"""Least deviation of a logarithmic size: makes differ by 15 %."""


@dataclass(frozen=True, slots=True, eq=False)
class SizeRecogniser:
    """Rates classes by how usual the size of the box would be for each.

    Attributes:
        classes: names of the classes.
        mean: `(k, 3)`; of the logarithms of length, width and height.
        deviation: `(k, 3)`; of the same.
    """

    classes: tuple[str, ...]
    mean: FloatArray
    deviation: FloatArray

    @classmethod
    def of_boxes(
        cls, boxes: Sequence[BoundingBox], labels: Sequence[str], classes: Sequence[str]
    ) -> SizeRecogniser:
        """One that learned from labelled boxes.

        A class with few examples borrows the deviation that classes have on the average; one
        without any examples is as likely at every size.

        Raises:
            InvalidInput: there are no boxes.
        """
        if not boxes:
            raise InvalidInput("no boxes to learn sizes from; give labelled objects")
        logs = np.stack([_log_sizes(box) for box in boxes])
        numbers = np.array([list(classes).index(label) for label in labels])
        mean = np.tile(logs.mean(axis=0), (len(classes), 1))
        squares, counts = np.zeros((len(classes), 3)), np.zeros(len(classes))
        for k in range(len(classes)):
            own = logs[numbers == k]
            if len(own):
                mean[k] = own.mean(axis=0)
                squares[k], counts[k] = np.sum((own - mean[k]) ** 2, axis=0), len(own)
        usual = squares.sum(axis=0) / max(counts.sum(), 1.0)
        weight = 5.0  # the average counts like five examples
        variance = (squares + weight * usual) / (counts[:, None] + weight)
        variance[counts == 0] = np.maximum(logs.var(axis=0), usual) * 4.0
        return cls(tuple(classes), mean, np.sqrt(np.maximum(variance, _NEAR**2)))

    def recognise(self, cluster: Cluster) -> FloatArray:
        """`(k,)`; confidence per class; they sum to 1."""
        return self.rate(cluster.box)

    def rate(self, box: BoundingBox) -> FloatArray:
        """`(k,)`; confidence per class of an object with that box."""
        z = (_log_sizes(box) - self.mean) / self.deviation
        # Tails heavier than a Gaussian's: half of an object may be hidden.
        score = -np.sum(np.log1p(z**2 / 4.0) * 2.5 + np.log(self.deviation), axis=1)
        return np.exp(score - logsumexp(score))


def _log_sizes(box: BoundingBox) -> FloatArray:
    long, wide = max(box.x_size, box.y_size), min(box.x_size, box.y_size)
    return np.log(np.maximum([long, wide, box.z_size], _THINNEST_M))
