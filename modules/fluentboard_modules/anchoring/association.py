"""Which newly seen object is which untracked anchor (Section 4.2.2.2).

The default is one optimal assignment with a column "discovered" of cost 0 for every object, so that
the threshold is part of the optimisation (E6) and every object is reacquired or discovered however
many objects and anchors there are (E5). Nearest neighbour, Algorithm 4.1 as printed, and the k best
assignments are there for comparison.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial import cKDTree

from fluentboard.errors import InvalidInput
from fluentboard.model.geometry import FloatArray
from fluentboard_modules.anchoring.config import AssociationConfig
from fluentboard_modules.anchoring.murty import best_assignments
from fluentboard_modules.anchoring.similarity import Appearance, MismatchModel

_NEVER = 1e6
# The mismatch is a distance in scaled features; a pair on the boundary is as likely as not, and
# one unit away from it about e^-6 times as likely.
_SHARPNESS = 6.0


@dataclass(frozen=True, slots=True)
class Match:
    """What became of one object.

    Attributes:
        anchor: index of its anchor; None if it is a new object.
        cost: mismatch with that anchor; 0 for a new object.
        runner_up: index of the next best candidate, by mismatch; None if there is none in reach.
        runner_up_cost: mismatch with it; None if there is none.
        is_decided: False if the decision should wait for more observations.
        is_left_over: True if Algorithm 4.1 says nothing about the object (E5).
    """

    anchor: int | None
    cost: float
    runner_up: int | None = None
    runner_up_cost: float | None = None
    is_decided: bool = True
    is_left_over: bool = False


def gated_mismatch(
    objects: Sequence[Appearance],
    anchors: Sequence[Appearance],
    model: MismatchModel,
    gate_m: float,
) -> FloatArray:
    """`(n, m)`; mismatch of every pair, infinite outside the gate.

    Args:
        objects: newly seen.
        anchors: untracked.
        model: rates pairs.
        gate_m: largest distance between centres.
    """
    cost = np.full((len(objects), len(anchors)), np.inf)
    if not objects or not anchors:
        return cost
    places = np.array([(a.box.pose.x, a.box.pose.y, a.box.pose.z) for a in anchors])
    tree = cKDTree(places)
    adrift = [j for j, anchor in enumerate(anchors) if anchor.is_adrift]
    for i, thing in enumerate(objects):
        pose = thing.box.pose
        near = sorted({*tree.query_ball_point((pose.x, pose.y, pose.z), gate_m), *adrift})
        if near:
            cost[i, near] = model.mismatch([thing], [anchors[j] for j in near])[0]
    return cost


def assign_objects(cost: FloatArray, config: AssociationConfig) -> list[Match]:
    """What becomes of each object; no anchor is given twice.

    Args:
        cost: `(n, m)`; mismatch, infinite where a pair is impossible.
        config: the method and its numbers.

    Raises:
        InvalidInput: the method is unknown.
    """
    if config.method == "gnn":
        chosen = _with_discovery(cost)
        return [_match(cost, i, j) for i, j in enumerate(chosen)]
    if config.method == "nn":
        return _nearest_neighbour(cost)
    if config.method == "thesis":
        return _as_printed(cost)
    if config.method == "murty":
        return _k_best(cost, config)
    raise InvalidInput(
        f"no association is called {config.method!r}; known are gnn, nn, thesis, murty"
    )


def discovery_matrix(cost: FloatArray) -> FloatArray:
    """`(n, m + n)`; the costs, and one column of cost 0 per object for its discovery."""
    count = cost.shape[0]
    discover = np.where(np.eye(count, dtype=bool), 0.0, np.inf)
    return np.concatenate([cost, discover], axis=1)


def _with_discovery(cost: FloatArray) -> list[int | None]:
    if cost.shape[0] == 0:
        return []
    costs = discovery_matrix(cost)
    _, columns = linear_sum_assignment(np.where(np.isfinite(costs), costs, _NEVER))
    return [int(j) if j < cost.shape[1] else None for j in columns]


def _match(cost: FloatArray, i: int, j: int | None) -> Match:
    row = cost[i]
    order = [int(k) for k in np.argsort(row, kind="stable") if k != j and np.isfinite(row[k])]
    return Match(
        anchor=j,
        cost=0.0 if j is None else float(row[j]),
        runner_up=order[0] if order else None,
        runner_up_cost=float(row[order[0]]) if order else None,
    )


def _nearest_neighbour(cost: FloatArray) -> list[Match]:
    """Every object in turn takes the best anchor that is left; the order decides (Figure 4.5)."""
    left = cost.copy()
    matches: list[Match] = []
    for i in range(cost.shape[0]):
        j = int(np.argmin(left[i])) if cost.shape[1] else -1
        if j >= 0 and left[i, j] < 0.0:
            left[:, j] = np.inf
            matches.append(_match(cost, i, j))
        else:
            matches.append(_match(cost, i, None))
    return matches


def _as_printed(cost: FloatArray) -> list[Match]:
    """Algorithm 4.1: assign first, apply the threshold then; leftover objects are not mentioned."""
    chosen: dict[int, int] = {}
    if cost.size:
        rows, columns = linear_sum_assignment(np.where(np.isfinite(cost), cost, _NEVER))
        chosen = dict(zip(rows.tolist(), columns.tolist(), strict=True))
    matches: list[Match] = []
    for i in range(cost.shape[0]):
        j = chosen.get(i)
        if j is None:
            matches.append(Match(None, 0.0, is_left_over=cost.shape[1] > 0))
        elif cost[i, j] < 0.0:
            matches.append(_match(cost, i, j))
        else:
            matches.append(_match(cost, i, None))
    return matches


def _k_best(cost: FloatArray, config: AssociationConfig) -> list[Match]:
    """The best assignment, decided only where the k best agree."""
    count, anchors = cost.shape
    if count == 0:
        return []
    hypotheses = best_assignments(discovery_matrix(cost), config.hypotheses)
    weights = np.exp([-_SHARPNESS * (h.cost - hypotheses[0].cost) for h in hypotheses])
    weights /= weights.sum()
    matches: list[Match] = []
    for i in range(count):
        shares = np.zeros(anchors + 1)
        for hypothesis, weight in zip(hypotheses, weights, strict=True):
            shares[min(int(hypothesis.columns[i]), anchors)] += weight
        best = int(np.argmax(shares))
        match = _match(cost, i, None if best == anchors else best)
        if shares[best] < config.keep_share:
            match = Match(
                match.anchor, match.cost, match.runner_up, match.runner_up_cost, is_decided=False
            )
        matches.append(match)
    # The likeliest columns of two objects may be one anchor; then the second has to wait.
    taken: set[int] = set()
    for i, match in enumerate(matches):
        if match.anchor is not None and match.anchor in taken:
            matches[i] = Match(
                None, 0.0, match.anchor, float(cost[i, match.anchor]), is_decided=False
            )
        elif match.anchor is not None:
            taken.add(match.anchor)
    return matches
