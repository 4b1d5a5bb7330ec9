"""Compiled part of the lower bound: prices of cells that make a relaxed coverage small."""

from __future__ import annotations

from typing import Any

import numba
import numpy as np

_jit: Any = numba.njit(cache=True, nogil=True, error_model="numpy")
_PATIENCE = 6  # rounds without progress after which steps get shorter


@_jit
def price_cells(
    ptr: Any,
    members: Any,
    weights: Any,
    costs: Any,
    rate: float,
    reachable: float,
    rounds: int,
    prices: Any,
) -> float:
    """Lowers the dual value of the coverage relaxation by subgradient steps on the prices of cells.

    The value is sum_c sum_m max(0, w_cm - price_c) + sum_v max(0, sum_(c in v) price_c - rate *
    cost_v): what the best fractional choice of views gains, less `rate` times what it costs, is
    never more, whatever the prices are.

    Args:
        ptr: `(v + 1,)`; range of each view in `members`.
        members: numbers of cells.
        weights: `(cells, layers)`; gain of the first, second, ... look at a cell.
        costs: `(v,)`; seconds that each view costs at least.
        rate: gain per second.
        reachable: a value that some choice of views attains; steps aim at it.
        rounds: of steps.
        prices: `(cells,)`; where to begin; becomes the best found.

    Returns:
        The value at `prices`.
    """
    cells, layers = weights.shape
    views = ptr.shape[0] - 1
    tried = prices.copy()
    slope = np.zeros(cells)
    best = np.inf
    length = 1.0
    waited = 0
    for _ in range(rounds + 1):
        value = 0.0
        for c in range(cells):
            slope[c] = 0.0
            for m in range(layers):
                if weights[c, m] > tried[c]:
                    value += weights[c, m] - tried[c]
                    slope[c] -= 1.0
        for v in range(views):
            paid = -rate * costs[v]
            for n in range(ptr[v], ptr[v + 1]):
                paid += tried[members[n]]
            if paid > 0.0:
                value += paid
                for n in range(ptr[v], ptr[v + 1]):
                    slope[members[n]] += 1.0
        if value < best:
            # Progress that is too small to matter lets steps get shorter all the same.
            waited = 0 if value < best - 1e-4 * abs(best) else waited + 1
            best = value
            prices[:] = tried
        else:
            waited += 1
        if waited >= _PATIENCE:
            length *= 0.5
            waited = 0
            tried[:] = prices
            continue
        steep = 0.0
        for c in range(cells):
            low = tried[c] <= 0.0 and slope[c] > 0.0
            high = tried[c] >= weights[c, 0] and slope[c] < 0.0
            if low or high:
                slope[c] = 0.0
            steep += slope[c] * slope[c]
        if steep == 0.0 or value <= reachable:
            break
        step = length * (value - reachable) / steep
        for c in range(cells):
            tried[c] = min(max(tried[c] - step * slope[c], 0.0), weights[c, 0])
    return best
