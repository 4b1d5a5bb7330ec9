"""The conditional random field: scores of classes and of pairs of classes (Eqs. 4.2 to 4.7)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from fluentboard.errors import InvalidInput
from fluentboard.model.geometry import FloatArray
from fluentboard_modules.anchoring.crf_data import IntArray

LocalForm = Literal["logarithm", "product", "none"]
"""How local recognition enters: as evidence (E9), as printed in Eq. 4.7, or not at all."""


@dataclass(frozen=True, slots=True, eq=False)
class Scaling:
    """Features to comparable numbers: standardised and clipped, the bias kept (E10).

    Attributes:
        mean: `(F,)`; 0 for the bias and for features that change sign with the order of a pair.
        deviation: `(F,)`.
        clip: in standard deviations.
    """

    mean: FloatArray
    deviation: FloatArray
    clip: float = 4.0

    @classmethod
    def fit(cls, features: FloatArray, odd: FloatArray | None = None) -> Scaling:
        """The scaling of training features `(n, F)`; unknown (NaN) ones do not count.

        Args:
            features: of all training nodes or edges.
            odd: `(F,)`; which features change their sign with the order of the two objects: they
                are scaled about 0.
        """
        known = np.isfinite(features)
        count = np.maximum(known.sum(axis=0), 1)
        values = np.where(known, features, 0.0)
        mean = values.sum(axis=0) / count
        spread = np.where(known, features - mean, 0.0)
        deviation = np.sqrt((spread**2).sum(axis=0) / count)
        constant = deviation < 1e-9 * np.maximum(np.abs(mean), 1.0)
        centred = np.zeros(features.shape[1], dtype=bool) if odd is None else odd.astype(bool)
        root_mean_square = np.sqrt((values**2).sum(axis=0) / count)
        deviation = np.where(centred, root_mean_square, deviation)
        mean = np.where(constant | centred, 0.0, mean)
        return cls(mean, np.where(constant | (deviation <= 0.0), 1.0, deviation))

    def apply(self, features: FloatArray) -> FloatArray:
        """`(n, F)`; scaled features; unknown ones are 0, the mean of what is usual."""
        scaled = np.clip((features - self.mean) / self.deviation, -self.clip, self.clip)
        return np.where(np.isfinite(scaled), scaled, 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class Potentials:
    """One graph with numbers instead of features: P(Y) is proportional to exp(score) (E8).

    Attributes:
        unary: `(n, L)`; score of each class of each node.
        edges: `(m, 2)`; node numbers.
        pairwise: `(m, L, L)`; score of each pair of classes, first node first.
    """

    unary: FloatArray
    edges: IntArray
    pairwise: FloatArray

    def score(self, labels: IntArray) -> float:
        """Score of a joint assignment `(n,)`: the negative energy of Eq. 4.5."""
        # Deviates from Eq. 4.4: the sum of the factors is a score, not an energy (E8).
        a, b = self.edges[:, 0], self.edges[:, 1]
        nodes = float(self.unary[np.arange(len(labels)), labels].sum())
        return nodes + float(self.pairwise[np.arange(len(a)), labels[a], labels[b]].sum())


@dataclass(frozen=True, slots=True, eq=False)
class Crf:
    """A trained conditional random field.

    Attributes:
        classes: names of the classes.
        node_names: names of the unary features it was trained on.
        edge_names: names of the pairwise features it was trained on.
        node_weights: `(Fn, L)`; omega of Eq. 4.2.
        edge_weights: `(Fe, L, L)`; theta of Eq. 4.3, symmetric for features that do not depend on
            the order of the two objects and antisymmetric for those that change their sign.
        node_scaling: of the unary features.
        edge_scaling: of the pairwise features.
        local_form: how the confidences of local recognition enter.
        local_weight: weight of the logarithm of the confidence.
        confidence_floor: added to the confidence before the logarithm: how much a recogniser can
            be wrong about a class that it excludes.
        trained_on: fingerprint of the training data.
    """

    classes: tuple[str, ...]
    node_names: tuple[str, ...]
    edge_names: tuple[str, ...]
    node_weights: FloatArray
    edge_weights: FloatArray
    node_scaling: Scaling
    edge_scaling: Scaling
    local_form: LocalForm = "logarithm"
    local_weight: float = 1.0
    confidence_floor: float = 0.02
    trained_on: str = ""

    def potentials(
        self,
        x: FloatArray,
        confidence: FloatArray | None,
        edges: IntArray,
        e: FloatArray,
    ) -> Potentials:
        """Scores of one graph.

        Args:
            x: `(n, Fn)`; unary features, not scaled.
            confidence: `(n, L)`; of local recognition; None: it says nothing.
            edges: `(m, 2)`; node numbers.
            e: `(m, Fe)`; pairwise features, not scaled.

        Raises:
            InvalidInput: the features or confidences are not those the model was trained on.
        """
        if x.shape[1] != len(self.node_weights) or e.shape[1] != len(self.edge_weights):
            raise InvalidInput(
                f"graph with {x.shape[1]} unary and {e.shape[1]} pairwise features; the model was "
                f"trained on {len(self.node_weights)} and {len(self.edge_weights)}"
            )
        unary = self.node_scaling.apply(x) @ self.node_weights
        if confidence is not None and self.local_form != "none":
            if confidence.shape != unary.shape:
                raise InvalidInput(
                    f"confidences have shape {confidence.shape}, the model needs {unary.shape}: "
                    f"one per class of {', '.join(self.classes)}"
                )
            if self.local_form == "product":
                unary = unary * confidence
            else:
                unary = unary + self.local_weight * log_confidence(
                    confidence, self.confidence_floor
                )
        scaled = self.edge_scaling.apply(e)
        pairwise = np.tensordot(scaled, self.edge_weights, axes=(1, 0))
        return Potentials(unary, edges, pairwise.reshape(-1, len(self.classes), len(self.classes)))


def log_confidence(confidence: FloatArray, floor: float) -> FloatArray:
    """`(n, L)`; log of normalised confidences with a floor, the evidence of local recognition (E9).

    An object without any confidence counts as one of which every class is as likely.
    """
    # Deviates from Eq. 4.7: a product with the confidence turns round scores below zero.
    total = confidence.sum(axis=1, keepdims=True)
    count = max(confidence.shape[1], 1)
    shares = np.where(total > 0.0, confidence / np.where(total > 0.0, total, 1.0), 1.0 / count)
    return np.log(shares + floor)
