"""Compiled shortest ways from many places at once: fast sweeping (Zhao 2005).

The free cells are gone through forwards and backwards until nothing changes; each takes the
cheapest way over the neighbours that were just visited. One row of costs holds sixteen sources, so
what is looked up for a cell serves them all, in vector instructions. In rooms some ten sweeps
settle everything; a maze would need more than a search by buckets, see `route_kernels`.
"""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from fluentboard.model.geometry import FloatArray

LANES = 16
_FIRST_BACKWARD = 4
_OFFSETS = ((0, -1), (-1, -1), (-1, 0), (-1, 1), (0, 1), (1, 1), (1, 0), (1, -1))
"""Rows and columns to the neighbours that a sweep has visited: four forwards, four backwards."""

_jit: Any = numba.njit(cache=True, nogil=True, error_model="numpy")


class SweepGraph:
    """The free cells of a costmap with their neighbours.

    Args:
        price: `(rows, columns)`; of each cell, infinite where the base cannot stand; with a border
            of infinite cells all around.
    """

    def __init__(self, price: FloatArray) -> None:
        rows, columns = np.nonzero(np.isfinite(price))
        self.size = len(rows)
        """How many cells are free."""
        self._number = np.zeros(price.shape, np.int64)  # 0: not free, with costs for ever infinite
        self._number[rows, columns] = np.arange(1, self.size + 1)
        self._neighbours = np.zeros((self.size + 1, len(_OFFSETS)), np.int32)
        self._lengths = np.full((self.size + 1, len(_OFFSETS)), np.inf)
        here = price[rows, columns]
        for k, (down, right) in enumerate(_OFFSETS):
            self._neighbours[1:, k] = self._number[rows + down, columns + right]
            there = price[rows + down, columns + right]
            self._lengths[1:, k] = 0.5 * (here + there) * math.hypot(down, right)

    def costs(
        self, sources: NDArray[np.int64], goals: NDArray[np.int64], sweeps_max: int
    ) -> FloatArray | None:
        """`(n, m)`; costs of the ways from cells `(n,)` to cells `(m,)`, all free.

        Cells are numbers in the flat price array. None if the sweeps did not settle the costs.
        """
        table = np.full((len(sources), len(goals)), np.inf)
        number = self._number.ravel()
        is_settled = _fill_table(
            self._neighbours, self._lengths, number[sources], number[goals], LANES, sweeps_max,
            table,
        )  # fmt: skip
        return table if is_settled else None


@_jit
def _relax(
    costs: Any, neighbours: Any, lengths: Any, cell: int, first: int, lanes: int, best: Any
) -> bool:
    """Takes the cheapest way to a cell over four neighbours; whether it is new for any source."""
    here = np.uint64(cell * lanes)
    p = np.uint64(neighbours[cell, first] * np.int64(lanes))
    q = np.uint64(neighbours[cell, first + 1] * np.int64(lanes))
    r = np.uint64(neighbours[cell, first + 2] * np.int64(lanes))
    s = np.uint64(neighbours[cell, first + 3] * np.int64(lanes))
    to_p, to_q = lengths[cell, first], lengths[cell, first + 1]
    to_r, to_s = lengths[cell, first + 2], lengths[cell, first + 3]
    for n in range(lanes):
        lane = np.uint64(n)
        before = costs[here + lane]
        over_p, over_q = costs[p + lane] + to_p, costs[q + lane] + to_q
        over_r, over_s = costs[r + lane] + to_r, costs[s + lane] + to_s
        over_p = over_p if over_p < over_q else over_q
        over_r = over_r if over_r < over_s else over_s
        over_p = over_p if over_p < over_r else over_r
        best[lane] = over_p if over_p < before else before
    is_new = 0
    for n in range(lanes):
        lane = np.uint64(n)
        is_new |= np.int64(best[lane] != costs[here + lane])
        costs[here + lane] = best[lane]
    return is_new != 0


@_jit
def _fill_table(
    neighbours: Any, lengths: Any, sources: Any, goals: Any, lanes: int, sweeps_max: int, table: Any
) -> bool:
    """Fills the table for `SweepGraph.costs`; whether everything settled."""
    # As an argument, `lanes` is no constant: loops over it are made vector instructions of, and not
    # written out one by one.
    size = neighbours.shape[0]
    costs = np.zeros(size * lanes)
    best = np.zeros(lanes)
    for first in range(0, sources.shape[0], lanes):
        costs[:] = np.inf
        for lane in range(lanes):
            source = sources[min(first + lane, sources.shape[0] - 1)]
            costs[source * lanes + lane] = 0.0
        is_new = True
        sweeps = 0
        while is_new:
            if sweeps >= sweeps_max:
                return False
            is_new = False
            if sweeps % 2 == 0:
                for cell in range(1, size):
                    is_new |= _relax(costs, neighbours, lengths, cell, 0, lanes, best)
            else:
                for cell in range(size - 1, 0, -1):
                    is_new |= _relax(costs, neighbours, lengths, cell, _FIRST_BACKWARD, lanes, best)
            sweeps += 1
            is_new |= sweeps == 1
        for lane in range(min(lanes, sources.shape[0] - first)):
            for n in range(goals.shape[0]):
                table[first + lane, n] = costs[goals[n] * lanes + lane]
    return True
