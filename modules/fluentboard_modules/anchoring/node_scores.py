"""Scores of the classes of one node, given those of its neighbours: a step of ICM and of Gibbs."""

from __future__ import annotations

from numba import njit

from fluentboard.model.geometry import FloatArray
from fluentboard_modules.anchoring.crf_data import IntArray


@njit(cache=True)
def scores_of_node(
    unary: FloatArray,
    edges: IntArray,
    pairwise: FloatArray,
    labels: IntArray,
    node: int,
    scores: FloatArray,
) -> None:
    """Writes the scores of a node's classes into `scores`.

    Args:
        unary: `(nodes, classes)`.
        edges: `(edges, 2)`; pairs of nodes.
        pairwise: `(edges, classes, classes)`.
        labels: `(nodes,)`; the classes of all nodes; that of the node itself does not matter.
        node: which one.
        scores: `(classes,)`; written to.
    """
    classes = unary.shape[1]
    for c in range(classes):
        scores[c] = unary[node, c]
    for k in range(edges.shape[0]):
        if edges[k, 0] == node:
            for c in range(classes):
                scores[c] += pairwise[k, c, labels[edges[k, 1]]]
        elif edges[k, 1] == node:
            for c in range(classes):
                scores[c] += pairwise[k, labels[edges[k, 0]], c]
