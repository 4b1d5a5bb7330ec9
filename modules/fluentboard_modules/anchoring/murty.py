"""The k best assignments, by Murty's partitions of the space of assignments."""

from __future__ import annotations

import heapq
import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from fluentboard.model.geometry import FloatArray

_FORBIDDEN = 1e9


@dataclass(frozen=True, slots=True, eq=False)
class RankedAssignment:
    """One of the best assignments.

    Attributes:
        columns: `(n,)`; the column of each row.
        cost: sum of its entries.
    """

    columns: NDArray[np.int64]
    cost: float


def best_assignments(cost: FloatArray, k: int) -> list[RankedAssignment]:
    """The k cheapest assignments of every row to a column of its own, cheapest first.

    Every solution splits what is left into parts that exclude it: the part number r keeps its first
    r pairs and forbids the next one. The best of all parts is the next solution.

    Args:
        cost: `(n, m)` with n <= m; infinite entries are forbidden.
        k: how many at most; there may be fewer.
    """
    costs = np.where(np.isfinite(cost), cost, _FORBIDDEN)
    rows = costs.shape[0]
    if rows == 0:
        return [RankedAssignment(np.zeros(0, dtype=np.int64), 0.0)]
    first = _solve(costs)
    if first is None:
        return []
    tickets = itertools.count()  # solutions of one cost are not compared
    queue = [(first.cost, next(tickets), first, costs, 0)]
    found: list[RankedAssignment] = []
    while queue and len(found) < k:
        _, _, solution, space, fixed = heapq.heappop(queue)
        found.append(solution)
        space = space.copy()
        for row in range(fixed, rows):
            column = solution.columns[row]
            part = space.copy()
            part[row, column] = _FORBIDDEN
            following = _solve(part)
            if following is not None:
                heapq.heappush(queue, (following.cost, next(tickets), following, part, row))
            # From here on the pair is kept: nothing else in its row and column is allowed.
            kept = space[row, column]
            space[row, :] = _FORBIDDEN
            space[:, column] = _FORBIDDEN
            space[row, column] = kept
    return found


def _solve(costs: FloatArray) -> RankedAssignment | None:
    rows, columns = linear_sum_assignment(costs)
    chosen = costs[rows, columns]
    if np.any(chosen >= 0.5 * _FORBIDDEN):
        return None
    return RankedAssignment(columns.astype(np.int64), float(chosen.sum()))
