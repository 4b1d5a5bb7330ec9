"""How probable each class of each object is, given all others: exact, by messages, by sampling."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numba import njit
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from fluentboard.model.geometry import FloatArray
from fluentboard_modules.anchoring.crf import Potentials
from fluentboard_modules.anchoring.crf_data import IntArray
from fluentboard_modules.anchoring.node_scores import scores_of_node

MarginalMethod = Literal["auto", "exact", "messages", "sampling"]

# Joint assignments of one part of a graph that are summed up one by one: 9 classes, 5 objects.
_EXACT_STATES_MAX = 100_000


def class_marginals(
    potentials: Potentials,
    method: MarginalMethod = "auto",
    *,
    rng: np.random.Generator | None = None,
    sweeps: int = 2000,
) -> FloatArray:
    """`(n, L)`; probability of each class of each node; rows sum to 1.

    `exact` sums over all joint assignments of each part of the graph that edges join. `messages`
    is loopy belief propagation, damped; exact on trees. `sampling` is Gibbs sampling with averaged
    conditionals. `auto` is exact where a part has few assignments, messages where they converge,
    and sampling where they do not.

    Args:
        potentials: of one graph.
        method: as above.
        rng: of the sampling; default: the same stream every time.
        sweeps: of the sampling, after a tenth as many to forget the start.
    """
    count, classes = potentials.unary.shape
    result = np.zeros((count, classes))
    if count == 0 or classes == 0:
        return result
    rng = rng if rng is not None else np.random.default_rng(0)
    for nodes, part in _parts(potentials):
        if method == "exact" or (method == "auto" and classes ** len(nodes) <= _EXACT_STATES_MAX):
            result[nodes] = _summed(part)
            continue
        if method != "sampling":
            beliefs, has_converged = _messages(
                np.ascontiguousarray(part.unary), part.edges, part.pairwise, 200, 1e-5
            )
            if has_converged or method == "messages":
                result[nodes] = beliefs
                continue
        start = np.argmax(part.unary, axis=1)
        draws = rng.random((sweeps + sweeps // 10, len(nodes)))
        result[nodes] = _gibbs(
            np.ascontiguousarray(part.unary), part.edges, part.pairwise, start, draws, sweeps
        )
    return result


def _parts(potentials: Potentials) -> list[tuple[IntArray, Potentials]]:
    """The parts of the graph that no edge joins, each with its own numbering."""
    count = len(potentials.unary)
    a, b = potentials.edges[:, 0], potentials.edges[:, 1]
    adjacency = coo_matrix((np.ones(len(a)), (a, b)), shape=(count, count))
    parts, of_node = connected_components(adjacency, directed=False)
    number = np.zeros(count, dtype=np.int64)
    found: list[tuple[IntArray, Potentials]] = []
    for part in range(parts):
        nodes = np.flatnonzero(of_node == part)
        number[nodes] = np.arange(len(nodes))
        own = of_node[a] == part
        found.append(
            (
                nodes.astype(np.int64),
                Potentials(
                    potentials.unary[nodes],
                    np.ascontiguousarray(number[potentials.edges[own]].reshape(-1, 2)),
                    np.ascontiguousarray(potentials.pairwise[own]),
                ),
            )
        )
    return found


def _summed(potentials: Potentials) -> FloatArray:
    """Marginals from the table of all joint assignments."""
    count, classes = potentials.unary.shape
    table = np.zeros((classes,) * count)
    for i in range(count):
        table += potentials.unary[i].reshape([classes if k == i else 1 for k in range(count)])
    for (a, b), scores in zip(potentials.edges, potentials.pairwise, strict=True):
        low, high = min(a, b), max(a, b)
        oriented = scores if a == low else scores.T
        table += oriented.reshape([classes if k in (low, high) else 1 for k in range(count)])
    table = np.exp(table - table.max())
    axes = range(count)
    sums = [table.sum(axis=tuple(k for k in axes if k != i)) for i in axes]
    return np.stack([s / s.sum() for s in sums])


@njit(cache=True)
def _messages(
    unary: FloatArray, edges: IntArray, pairwise: FloatArray, sweeps: int, tolerance: float
) -> tuple[FloatArray, bool]:
    """Sum-product belief propagation in the log domain, and whether it settled."""
    count, classes = unary.shape
    messages = np.zeros((2, edges.shape[0], classes))
    belief = unary.copy()
    joint, fresh = np.zeros(classes), np.zeros(classes)
    has_converged = edges.shape[0] == 0
    for sweep in range(sweeps):
        # Damping grows: most graphs settle at once without, the others need more of it.
        keep = 0.0 if sweep < 20 else (0.5 if sweep < 100 else 0.8)
        change = 0.0
        for k in range(edges.shape[0]):
            for way in range(2):
                sender, receiver = edges[k, way], edges[k, 1 - way]
                # What the sender believes without what this receiver told it, and the edge.
                highest = -np.inf
                for c in range(classes):
                    most = -np.inf
                    for s in range(classes):
                        joint[s] = belief[sender, s] - messages[1 - way, k, s]
                        joint[s] += pairwise[k, s, c] if way == 0 else pairwise[k, c, s]
                        most = max(most, joint[s])
                    total = 0.0
                    for s in range(classes):
                        total += np.exp(joint[s] - most)
                    fresh[c] = most + np.log(total)
                    highest = max(highest, fresh[c])
                for c in range(classes):
                    told = keep * messages[way, k, c] + (1.0 - keep) * (fresh[c] - highest)
                    change = max(change, abs(told - messages[way, k, c]))
                    belief[receiver, c] += told - messages[way, k, c]
                    messages[way, k, c] = told
        if change < tolerance:
            has_converged = True
            break
    for i in range(count):
        _normalise(belief[i])
    return belief, has_converged


@njit(cache=True)
def _normalise(row: FloatArray) -> None:
    """Log scores to probabilities, in place."""
    most = -np.inf
    for c in range(row.shape[0]):
        most = max(most, row[c])
    total = 0.0
    for c in range(row.shape[0]):
        row[c] = np.exp(row[c] - most)
        total += row[c]
    for c in range(row.shape[0]):
        row[c] /= total


@njit(cache=True)
def _gibbs(
    unary: FloatArray,
    edges: IntArray,
    pairwise: FloatArray,
    start: IntArray,
    draws: FloatArray,
    counted: int,
) -> FloatArray:
    """Mean conditional of each node over sweeps in fixed order (less noisy than counting)."""
    count, classes = unary.shape
    labels = start.copy()
    local = np.zeros(classes)
    total = np.zeros((count, classes))
    for sweep in range(draws.shape[0]):
        for i in range(count):
            scores_of_node(unary, edges, pairwise, labels, i, local)
            _normalise(local)
            if sweep >= draws.shape[0] - counted:
                for c in range(classes):
                    total[i, c] += local[c] / counted
            threshold = draws[sweep, i]
            label = 0
            while label < classes - 1 and threshold >= local[label]:
                threshold -= local[label]
                label += 1
            labels[i] = label
    return total
