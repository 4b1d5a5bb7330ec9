"""Training a CRF: pseudo-likelihood of labelled graphs, maximised by L-BFGS (Eq. 4.6)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize
from scipy.special import logsumexp
from threadpoolctl import threadpool_limits

from fluentboard.errors import InvalidInput
from fluentboard.model.geometry import FloatArray
from fluentboard_modules.anchoring.crf import Crf, LocalForm, Scaling, log_confidence
from fluentboard_modules.anchoring.crf_data import IntArray, LabelledGraphs
from fluentboard_modules.anchoring.scene_graph import edge_parity


@dataclass(frozen=True, slots=True)
class TrainingConfig:
    """How a CRF is trained.

    Attributes:
        local_form: how the confidences of local recognition enter.
        node_l2: strength of the Gaussian prior on the unary weights, per training node.
        edge_l2: the same for the pairwise weights: there are L times as many of them.
        confidence_floor: added to a confidence before its logarithm.
        iterations_max: of L-BFGS; the original system stopped at 2000.
        gradient_tolerance: largest entry of the gradient per node at which it stops.
    """

    local_form: LocalForm = "logarithm"
    node_l2: float = 1e-3
    edge_l2: float = 1e-2
    confidence_floor: float = 0.02
    iterations_max: int = 300
    gradient_tolerance: float = 1e-4


@dataclass(frozen=True, slots=True)
class Training:
    """A trained model, and how the training went.

    Attributes:
        model: the CRF.
        objective: negative log pseudo-likelihood per node with its penalty, at the end.
        iterations: of L-BFGS.
        has_converged: whether the gradient is as small as was asked for.
    """

    model: Crf
    objective: float
    iterations: int
    has_converged: bool


class PseudoLikelihood:
    """Negative log pseudo-likelihood per node and its gradient, as a function of all weights.

    Each node's class is predicted from its features and from the true classes of its neighbours;
    that needs no partition function. The parameters are, in a row: `(Fn, L)` unary weights,
    `(Fe, L, L)` pairwise weights, and the weight of local recognition.

    Args:
        data: labelled graphs.
        config: the form in which confidences enter, and the priors.
        scaled_x: `(nodes, Fn)`; unary features, scaled.
        scaled_e: `(E, Fe)`; pairwise features, scaled.
        parity: `(Fe,)`; -1 for features that change their sign with the order of the two objects.
    """

    def __init__(
        self,
        data: LabelledGraphs,
        config: TrainingConfig,
        scaled_x: FloatArray,
        scaled_e: FloatArray,
        parity: FloatArray,
    ) -> None:
        self._x, self._y, self._config = scaled_x, data.y, config
        self._parity = parity[:, None, None]
        self._labels = len(data.classes)
        self._shape = (scaled_e.shape[1], self._labels, self._labels)
        self._log_c = log_confidence(data.confidence, config.confidence_floor)
        self._confidence = data.confidence
        # Both directions of every edge: from each node to each neighbour with a known class. An
        # odd feature changes its sign, so one symmetric set of weights serves both.
        first, second = data.edges[:, 0], data.edges[:, 1]
        here = np.concatenate([first, second])
        there = data.y[np.concatenate([second, first])]
        features = np.concatenate([scaled_e, scaled_e * parity])
        self._groups: list[tuple[int, IntArray, FloatArray]] = []
        for label in range(self._labels):
            chosen = np.flatnonzero(there == label)
            # Edges of the same node and neighbouring class add up: one row per node.
            nodes, inverse = np.unique(here[chosen], return_inverse=True)
            summed = np.zeros((len(nodes), features.shape[1]))
            np.add.at(summed, inverse, features[chosen])
            self._groups.append((label, nodes, summed))

    @property
    def size(self) -> int:
        """How many parameters there are."""
        return self._x.shape[1] * self._labels + int(np.prod(self._shape)) + 1

    def unpack(self, parameters: FloatArray) -> tuple[FloatArray, FloatArray, float]:
        """Unary weights, pairwise weights with their symmetry, weight of local recognition."""
        cut = self._x.shape[1] * self._labels
        # Deviates from Eq. 4.3: an edge has no direction, so theta is (anti)symmetric (E10).
        omega = parameters[:cut].reshape(-1, self._labels)
        free = parameters[cut:-1].reshape(self._shape)
        return omega, 0.5 * (free + self._parity * free.transpose(0, 2, 1)), float(parameters[-1])

    def __call__(self, parameters: FloatArray) -> tuple[float, FloatArray]:
        """Objective and gradient at `(size,)` parameters."""
        omega, theta, local = self.unpack(parameters)
        config, nodes = self._config, max(len(self._y), 1)
        linear = self._x @ omega
        scores = linear.copy()
        if config.local_form == "product":
            scores *= self._confidence
        elif config.local_form == "logarithm":
            scores += local * self._log_c
        for label, rows, features in self._groups:
            scores[rows] += features @ theta[:, :, label]
        log_p = scores - logsumexp(scores, axis=1, keepdims=True)
        every = np.arange(len(self._y))
        residual = np.exp(log_p)
        residual[every, self._y] -= 1.0

        to_linear = residual * self._confidence if config.local_form == "product" else residual
        d_omega = self._x.T @ to_linear / nodes + config.node_l2 * omega
        d_theta = np.zeros(self._shape)
        for label, rows, features in self._groups:
            d_theta[:, :, label] = features.T @ residual[rows] / nodes
        d_theta = 0.5 * (d_theta + self._parity * d_theta.transpose(0, 2, 1))
        d_theta = d_theta + config.edge_l2 * theta
        d_local = 0.0
        if config.local_form == "logarithm":
            # The prior says: trust local recognition as it is, as naive Bayes would.
            d_local = float(np.sum(residual * self._log_c)) / nodes
            d_local += config.node_l2 * (local - 1.0)
        objective = -float(log_p[every, self._y].sum()) / nodes
        objective += 0.5 * config.node_l2 * float(np.sum(omega**2))
        objective += 0.5 * config.edge_l2 * float(np.sum(theta**2))
        if config.local_form == "logarithm":
            objective += 0.5 * config.node_l2 * (local - 1.0) ** 2
        return objective, np.concatenate([d_omega.ravel(), d_theta.ravel(), [d_local]])


def train_crf(data: LabelledGraphs, config: TrainingConfig | None = None) -> Training:
    """Trains a CRF on labelled graphs.

    The objective is convex, so the result does not depend on where the search starts.

    Args:
        data: labelled graphs with names of their features.
        config: form, priors and limits.

    Raises:
        InvalidInput: there is no labelled node.
    """
    config = config if config is not None else TrainingConfig()
    if not len(data.y):
        raise InvalidInput("no labelled objects to train a CRF on; give at least one scene")
    parity = edge_parity(data.edge_names or ("",) * data.e.shape[1])
    node_scaling = Scaling.fit(data.x)
    edge_scaling = Scaling.fit(data.e, parity < 0.0)
    objective = PseudoLikelihood(
        data, config, node_scaling.apply(data.x), edge_scaling.apply(data.e), parity
    )
    start = np.zeros(objective.size)
    start[-1] = 1.0
    # Products of small matrices: with more threads BLAS spends its time waiting for them.
    with threadpool_limits(limits=1):
        found = minimize(
            objective,
            start,
            jac=True,
            method="L-BFGS-B",
            options={
                "maxiter": config.iterations_max,
                "gtol": config.gradient_tolerance,
                "ftol": 1e-10,
                "maxcor": 20,
            },
        )
    omega, theta, local = objective.unpack(np.asarray(found.x))
    model = Crf(
        data.classes,
        data.node_names,
        data.edge_names,
        omega,
        theta,
        node_scaling,
        edge_scaling,
        config.local_form,
        local,
        config.confidence_floor,
        data.fingerprint(),
    )
    return Training(model, float(found.fun), int(found.nit), bool(found.success))


def of_the_thesis(config: TrainingConfig | None = None) -> TrainingConfig:
    """Training as in the original system: Eq. 4.7 as printed, no priors, tolerance 0.1."""
    return replace(
        config if config is not None else TrainingConfig(),
        local_form="product",
        node_l2=0.0,
        edge_l2=0.0,
        iterations_max=2000,
    )
