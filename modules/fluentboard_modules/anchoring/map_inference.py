"""The most probable classes of all objects together: branch and bound, or ICM (Eq. 4.8)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numba import njit

from fluentboard.model.geometry import FloatArray
from fluentboard_modules.anchoring.crf import Potentials
from fluentboard_modules.anchoring.crf_data import IntArray
from fluentboard_modules.anchoring.node_scores import scores_of_node

MapMethod = Literal["exact", "icm"]

_BOUND_SWEEPS = 12
_ICM_SWEEPS = 100
_EPS = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class MapAssignment:
    """The best joint assignment that was found.

    Attributes:
        labels: `(n,)`; class of each node.
        score: of the assignment.
        is_optimal: whether it is proven that none is better.
        expanded: search nodes that branch and bound looked at.
    """

    labels: IntArray
    score: float
    is_optimal: bool
    expanded: int = 0


def most_probable(
    potentials: Potentials, method: MapMethod = "exact", expanded_max: int = 200_000
) -> MapAssignment:
    """The joint assignment with the highest score.

    The exact method first moves score from the edges to the nodes until the sum of the nodes'
    maxima is a tight bound (block coordinate descent on the dual of the linear relaxation), then
    searches depth first, cutting off what the bound excludes. Parts of the graph that no edge
    joins are solved one by one. ICM starts from the best class of each node alone and changes one
    node at a time, in fixed order, until nothing improves (Section 4.2.3.4).

    Args:
        potentials: of one graph.
        method: `exact`, or `icm` as in the thesis.
        expanded_max: after so many search nodes the best assignment so far is returned, marked as
            not proven: about half a second on a graph of ten objects.
    """
    count, labels = potentials.unary.shape
    if count == 0 or labels == 0:
        return MapAssignment(np.zeros(count, dtype=np.int64), 0.0, True)
    unary = np.array(potentials.unary, dtype=np.float64, order="C")
    edges = np.ascontiguousarray(potentials.edges, dtype=np.int64)
    pairwise = np.array(potentials.pairwise, dtype=np.float64, order="C")
    found = _start(unary)
    _icm(unary, edges, pairwise, found, _ICM_SWEEPS)
    if method == "icm":
        return MapAssignment(found, potentials.score(found), len(edges) == 0)
    # Deviates from Section 4.2.3.4: ICM is only where the search starts.
    expanded = _branch_and_bound(unary, edges, pairwise, found, expanded_max)
    return MapAssignment(found, potentials.score(found), expanded < expanded_max, int(expanded))


# The functions below spell loops out: array expressions take numba many times longer to compile.


@njit(cache=True)
def _largest(row: FloatArray) -> int:
    best = 0
    for c in range(row.shape[0]):
        if row[c] > row[best]:
            best = c
    return best


@njit(cache=True)
def _start(unary: FloatArray) -> IntArray:
    labels = np.zeros(unary.shape[0], dtype=np.int64)
    for i in range(unary.shape[0]):
        labels[i] = _largest(unary[i])
    return labels


@njit(cache=True)
def _icm(
    unary: FloatArray, edges: IntArray, pairwise: FloatArray, labels: IntArray, sweeps: int
) -> None:
    """Improves `labels` in place, one node at a time, until nothing does."""
    count, classes = unary.shape
    local = np.zeros(classes)
    for _ in range(sweeps):
        changed = False
        for i in range(count):
            scores_of_node(unary, edges, pairwise, labels, i, local)
            best = _largest(local)
            if local[best] > local[labels[i]] + _EPS:
                labels[i] = best
                changed = True
        if not changed:
            break


@njit(cache=True)
def _tighten(
    unary: FloatArray, edges: IntArray, pairwise: FloatArray, sweeps: int, known: float
) -> bool:
    """Moves score from edges to nodes in place; the score of every assignment stays the same.

    Returns whether the bound came down to the score of a known assignment: then it is the best.
    """
    classes = unary.shape[1]
    for _ in range(sweeps):
        moved = 0.0
        bound = 0.0
        for k in range(edges.shape[0]):
            i, j = edges[k, 0], edges[k, 1]
            # Everything of both nodes into the edge, and half of what is best back to each.
            for a in range(classes):
                most = -np.inf
                for b in range(classes):
                    pairwise[k, a, b] += unary[i, a] + unary[j, b]
                    most = max(most, pairwise[k, a, b])
                moved = max(moved, abs(0.5 * most - unary[i, a]))
                unary[i, a] = 0.5 * most
            for b in range(classes):
                most = pairwise[k, 0, b]
                for a in range(1, classes):
                    most = max(most, pairwise[k, a, b])
                unary[j, b] = 0.5 * most
            rest = -np.inf
            for a in range(classes):
                for b in range(classes):
                    pairwise[k, a, b] -= unary[i, a] + unary[j, b]
                    rest = max(rest, pairwise[k, a, b])
            bound += rest
        for i in range(unary.shape[0]):
            bound += unary[i, _largest(unary[i])]
        if bound <= known + _EPS:
            return True
        if moved < 1e-3:
            break
    return False


@njit(cache=True)
def _parts(count: int, edges: IntArray) -> IntArray:
    """`(n,)`; the smallest node number of the part of the graph each node belongs to."""
    part = np.arange(count)
    changed = True
    while changed:
        changed = False
        for k in range(edges.shape[0]):
            low = min(part[edges[k, 0]], part[edges[k, 1]])
            for end in range(2):
                if part[edges[k, end]] != low:
                    part[edges[k, end]] = low
                    changed = True
    return part


@njit(cache=True)
def _branch_and_bound(
    unary: FloatArray, edges: IntArray, pairwise: FloatArray, best: IntArray, expanded_max: int
) -> int:
    """Replaces the assignment `best` by the best one; changes the scores in place."""
    count, classes = unary.shape
    known = 0.0
    for i in range(count):
        known += unary[i, best[i]]
    for k in range(edges.shape[0]):
        known += pairwise[k, best[edges[k, 0]], best[edges[k, 1]]]
    if _tighten(unary, edges, pairwise, _BOUND_SWEEPS, known):
        return 0
    other = _start(unary)
    _icm(unary, edges, pairwise, other, _ICM_SWEEPS)
    edge_at = np.full((count, count), -1)
    for k in range(edges.shape[0]):
        edge_at[edges[k, 0], edges[k, 1]] = k
        edge_at[edges[k, 1], edges[k, 0]] = k
    # The surest nodes first: their mistakes are cut off at once.
    margin = np.zeros(count)
    for i in range(count):
        top = _largest(unary[i])
        second = -np.inf
        for c in range(classes):
            if c != top:
                second = max(second, unary[i, c])
        margin[i] = unary[i, top] - second
    part = _parts(count, edges)
    nodes = np.zeros(count, dtype=np.int64)
    expanded = 0
    for root in range(count):
        if part[root] != root:
            continue
        size = 0
        for i in range(count):
            if part[i] == root:
                at = size
                while at > 0 and margin[nodes[at - 1]] < margin[i]:
                    nodes[at] = nodes[at - 1]
                    at -= 1
                nodes[at] = i
                size += 1
        own = nodes[:size]
        known = _score_of(own, best, unary, edges, pairwise, part, root)
        rival = _score_of(own, other, unary, edges, pairwise, part, root)
        if rival > known:
            known = rival
            for i in own:
                best[i] = other[i]
        expanded += _search(
            own, unary, edges, pairwise, edge_at, best, known, expanded_max - expanded
        )
    return expanded


@njit(cache=True)
def _score_of(
    nodes: IntArray,
    labels: IntArray,
    unary: FloatArray,
    edges: IntArray,
    pairwise: FloatArray,
    part: IntArray,
    root: int,
) -> float:
    total = 0.0
    for i in nodes:
        total += unary[i, labels[i]]
    for k in range(edges.shape[0]):
        if part[edges[k, 0]] == root:
            total += pairwise[k, labels[edges[k, 0]], labels[edges[k, 1]]]
    return total


@njit(cache=True)
def _pair(pairwise: FloatArray, edges: IntArray, edge: int, node: int, a: int, b: int) -> float:
    """Score of class a for this node and class b for the node at the other end."""
    return pairwise[edge, a, b] if edges[edge, 0] == node else pairwise[edge, b, a]


@njit(cache=True)
def _search(
    nodes: IntArray,
    unary: FloatArray,
    edges: IntArray,
    pairwise: FloatArray,
    edge_at: IntArray,
    best: IntArray,
    best_score: float,
    expanded_max: int,
) -> int:
    """Depth-first branch and bound over one part of the graph; improves `best` in place.

    `reach[d, k]` is, for each class of the k-th node in order, the most that it can add given the
    first d decisions: its own score, the edges to decided nodes as they are, and the edges to
    earlier undecided nodes at their best.
    """
    count, classes = nodes.shape[0], unary.shape[1]
    reach = np.zeros((count + 1, count, classes))
    optimistic = np.zeros((count, count, classes))
    for k in range(count):
        for b in range(classes):
            reach[0, k, b] = unary[nodes[k], b]
            for d in range(k):
                edge = edge_at[nodes[d], nodes[k]]
                if edge >= 0:
                    most = -np.inf
                    for a in range(classes):
                        most = max(most, _pair(pairwise, edges, edge, nodes[d], a, b))
                    optimistic[d, k, b] = most
                    reach[0, k, b] += most
    decided = np.zeros(count + 1)
    bound = np.zeros((count, classes))
    turn = np.zeros((count, classes), dtype=np.int64)
    position = np.zeros(count, dtype=np.int64)
    choice = np.zeros(count, dtype=np.int64)
    _rank(0, nodes, edges, pairwise, edge_at, optimistic, reach, decided[0], bound, turn)
    expanded = 1
    depth = 0
    while depth >= 0:
        at = position[depth]
        label = turn[depth, at] if at < classes else 0
        if at >= classes or bound[depth, label] <= best_score + _EPS:
            depth -= 1
            continue
        position[depth] += 1
        choice[depth] = label
        decided[depth + 1] = decided[depth] + reach[depth, depth, label]
        if depth + 1 == count:
            if decided[count] > best_score + _EPS:
                best_score = decided[count]
                for k in range(count):
                    best[nodes[k]] = choice[k]
            continue
        if expanded >= expanded_max:
            break
        for k in range(depth + 1, count):
            edge = edge_at[nodes[depth], nodes[k]]
            for b in range(classes):
                reach[depth + 1, k, b] = reach[depth, k, b]
                if edge >= 0:
                    exact = _pair(pairwise, edges, edge, nodes[depth], label, b)
                    reach[depth + 1, k, b] += exact - optimistic[depth, k, b]
        depth += 1
        position[depth] = 0
        _rank(
            depth, nodes, edges, pairwise, edge_at, optimistic, reach, decided[depth], bound, turn
        )
        expanded += 1
    return expanded


@njit(cache=True)
def _rank(
    depth: int,
    nodes: IntArray,
    edges: IntArray,
    pairwise: FloatArray,
    edge_at: IntArray,
    optimistic: FloatArray,
    reach: FloatArray,
    decided: float,
    bound: FloatArray,
    turn: IntArray,
) -> None:
    """Bounds of the classes of the node at this depth, and the order to try them in."""
    count, classes = nodes.shape[0], reach.shape[2]
    for label in range(classes):
        total = decided + reach[depth, depth, label]
        for k in range(depth + 1, count):
            edge = edge_at[nodes[depth], nodes[k]]
            most = -np.inf
            for b in range(classes):
                value = reach[depth, k, b]
                if edge >= 0:
                    exact = _pair(pairwise, edges, edge, nodes[depth], label, b)
                    value += exact - optimistic[depth, k, b]
                most = max(most, value)
            total += most
        bound[depth, label] = total
        at = label
        while at > 0 and bound[depth, turn[depth, at - 1]] < total:
            turn[depth, at] = turn[depth, at - 1]
            at -= 1
        turn[depth, at] = label
