"""Compiled shortest ways over a costmap: Dijkstra with buckets.

No edge is shorter than a free cell's cost. With buckets that wide, cells of one bucket cannot
shorten each other's ways, so their order within it does not matter (Dial 1969).
"""

from __future__ import annotations

from typing import Any

import numba
import numpy as np

_jit: Any = numba.njit(cache=True, nogil=True, error_model="numpy")


@_jit
def path_costs_from(
    price: Any, columns: int, source: int, width: float, buckets: int, wanted: Any, left: int,
    cost: Any, queue: Any, filled: Any,
) -> None:  # fmt: skip
    """Fills `cost` with the costs of the cheapest ways from one cell.

    Args:
        price: `(cells,)`; of each cell, infinite where the base cannot stand; flat, with a border
            of infinite cells all around.
        columns: cells per row, border included.
        source: cell number.
        width: of a bucket, at most the least price.
        buckets: how many, more than the longest edge is wide.
        wanted: `(cells,)`; how often each cell is asked for.
        left: how many are asked for in all; the search ends with the last of them; -1: all.
        cost: `(cells,)`; filled with infinity before.
        queue: `(buckets, room)`.
        filled: `(buckets,)`; zeros.
    """
    steps = (1, -1, columns, -columns, columns + 1, columns - 1, 1 - columns, -1 - columns)
    cost[source] = 0.0
    queue[0, 0] = source
    filled[0] = 1
    waiting = 1
    level = 0
    while waiting > 0:
        slot = level % buckets
        if filled[slot] == 0:
            level += 1
            continue
        filled[slot] -= 1
        waiting -= 1
        cell = queue[slot, filled[slot]]
        here = cost[cell]
        if int(here / width) < level:
            continue  # settled before, by a cheaper way
        if int(here / width) > level:
            continue
        if wanted[cell] > 0 and left > 0:
            left -= wanted[cell]
            wanted[cell] = -wanted[cell]
            if left == 0:
                break
        for k in range(8):
            there = cell + steps[k]
            if price[there] == np.inf:
                continue
            edge = 0.5 * (price[cell] + price[there])
            if k > 3:
                edge *= 1.4142135623730951
            new = here + edge
            if new < cost[there]:
                cost[there] = new
                slot = int(new / width) % buckets
                if filled[slot] < queue.shape[1]:
                    queue[slot, filled[slot]] = there
                    filled[slot] += 1
                    waiting += 1
    for slot in range(buckets):
        filled[slot] = 0


@_jit
def path_cost_table(
    price: Any, columns: int, cells: Any, width: float, buckets: int, room: int, table: Any
) -> None:
    """Fills a symmetric `(n, n)` table with the costs of the ways between cells."""
    count = cells.shape[0]
    cost = np.zeros(price.shape[0])
    wanted = np.zeros(price.shape[0], np.int32)
    queue = np.zeros((buckets, room), np.int32)
    filled = np.zeros(buckets, np.int64)
    for i in range(count):
        table[i, i] = 0.0
        left = 0
        for j in range(i + 1, count):
            if wanted[cells[j]] <= 0:
                wanted[cells[j]] = 1
                left += 1
        if left == 0:
            break
        cost[:] = np.inf
        path_costs_from(price, columns, cells[i], width, buckets, wanted, left, cost, queue, filled)
        for j in range(i + 1, count):
            wanted[cells[j]] = 0
            table[i, j] = cost[cells[j]]
            table[j, i] = cost[cells[j]]


@_jit
def path_costs_between(
    price: Any, columns: int, sources: Any, goals: Any, width: float, buckets: int, room: int,
    table: Any,
) -> None:  # fmt: skip
    """Fills an `(n, m)` table with the costs of the ways from each source to each goal."""
    cost = np.zeros(price.shape[0])
    wanted = np.zeros(price.shape[0], np.int32)
    queue = np.zeros((buckets, room), np.int32)
    filled = np.zeros(buckets, np.int64)
    for i in range(sources.shape[0]):
        left = 0
        for j in range(goals.shape[0]):
            if wanted[goals[j]] <= 0:
                wanted[goals[j]] = 1
                left += 1
        cost[:] = np.inf
        path_costs_from(
            price, columns, sources[i], width, buckets, wanted, left, cost, queue, filled
        )
        for j in range(goals.shape[0]):
            wanted[goals[j]] = 0
            table[i, j] = cost[goals[j]]
