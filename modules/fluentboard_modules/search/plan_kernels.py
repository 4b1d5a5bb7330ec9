"""Compiled set arithmetic over views for the planners (Eqs. 5.3 to 5.9).

Cells are bits of 64-bit words, and all cells of a word have the same probability, so the gain of a
view, -ln(1 - p(C)), is a weighted count of bits. A state is `(layers, words)`: row m holds the
cells that have been looked at m times; with a perfect detector there is one row, the cells not yet
seen. A view is a range of `ptr` into word numbers `idx` and their bits `bits`.

W is the accumulated gain, so e^-W is the probability that nothing has been found; `need` is the W
at which a plan is complete (Eq. 5.9).
"""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np
from numba import types
from numba.extending import intrinsic

_jit: Any = numba.njit(cache=True, nogil=True, error_model="numpy")
_NOTHING = 1e-12  # gains below are rounding


@intrinsic
def _ones(typing_context: Any, word: Any) -> Any:
    """How many bits of a word are set."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.ctpop(arguments[0])

    return types.uint64(types.uint64), generate


@_jit
def gain_of(view: int, state: Any, ptr: Any, idx: Any, bits: Any, weights: Any) -> float:
    """-ln(1 - p(s|L)): what a view adds to W in a state (Eqs. 5.3 and 5.5)."""
    total = 0.0
    for n in range(ptr[view], ptr[view + 1]):
        w = idx[n]
        for m in range(state.shape[0]):
            seen = bits[n] & state[m, w]
            if seen:
                total += weights[m, w] * numba.int64(_ones(seen))
    return total


@_jit
def look(view: int, state: Any, ptr: Any, idx: Any, bits: Any) -> None:
    """Moves what a view shows to the next layer of the state; out of the last, it is done with."""
    last = state.shape[0] - 1
    for n in range(ptr[view], ptr[view + 1]):
        w = idx[n]
        for m in range(last, -1, -1):
            seen = bits[n] & state[m, w]
            state[m, w] ^= seen
            if m < last:
                state[m + 1, w] |= seen


@_jit
def all_gains(
    state: Any, used: Any, ptr: Any, idx: Any, bits: Any, weights: Any, gains: Any
) -> None:
    """The gain of every view in a state; 0 for those used before."""
    for view in range(gains.shape[0]):
        gains[view] = 0.0 if used[view] else gain_of(view, state, ptr, idx, bits, weights)


@_jit
def finish_greedily(
    plan: Any,
    length: int,
    state: Any,
    used: Any,
    gained: float,
    spent: float,
    need: float,
    times: Any,
    ptr: Any,
    idx: Any,
    bits: Any,
    weights: Any,
    noise: float,
    seed: Any,
) -> Any:
    """Appends the view of the highest utility (Eq. 5.6) until the plan is complete (Eq. 5.9).

    `times` has the start as row 0. With `noise`, utilities are multiplied by a random factor
    between 1 - noise and 1. Returns length, W and E[T]; the plan may end incomplete where no
    reachable view is left.
    """
    views = used.shape[0]
    here = plan[length - 1] + 1 if length > 0 else 0
    while gained <= need:
        best = -1
        best_utility = 0.0
        best_gain = 0.0
        for view in range(views):
            if used[view]:
                continue
            time = times[here, view + 1]
            if not time < np.inf:
                continue
            # Submodularity: what was worth nothing stays worth nothing.
            gain = gain_of(view, state, ptr, idx, bits, weights)
            if gain <= _NOTHING:
                used[view] = True
                continue
            utility = (1.0 - math.exp(-gain)) / time
            if noise > 0.0:
                utility *= 1.0 - noise * uniform(seed)
            if utility > best_utility:
                best, best_utility, best_gain = view, utility, gain
        if best < 0:
            break
        spent += math.exp(-gained) * times[here, best + 1]
        gained += best_gain
        look(best, state, ptr, idx, bits)
        used[best] = True
        plan[length] = best
        length += 1
        here = best + 1
    return length, gained, spent


@_jit
def uniform(seed: Any) -> float:
    """A random number in [0, 1) and the next seed (xorshift64*)."""
    x = seed[0]
    x ^= x >> np.uint64(12)
    x ^= x << np.uint64(25)
    x ^= x >> np.uint64(27)
    seed[0] = x
    return ((x * np.uint64(2685821657736338717)) >> np.uint64(11)) * (1.0 / 9007199254740992.0)


@_jit
def walk(
    plan: Any,
    length: int,
    first: int,
    state: Any,
    gained: float,
    spent: float,
    limit: float,
    need: float,
    times: Any,
    ptr: Any,
    idx: Any,
    bits: Any,
    weights: Any,
) -> Any:
    """Carries a plan out from position `first` on and drops views that show nothing new.

    Returns the new length, W and E[T] (Eq. 5.4); E[T] is infinite once it reaches `limit`.
    """
    here = plan[first - 1] + 1 if first > 0 else 0
    kept = first
    for n in range(first, length):
        if gained > need:
            break
        view = plan[n]
        gain = gain_of(view, state, ptr, idx, bits, weights)
        if gain <= _NOTHING:
            continue
        spent += math.exp(-gained) * times[here, view + 1]
        if not spent < limit:
            return kept, gained, np.inf
        gained += gain
        look(view, state, ptr, idx, bits)
        plan[kept] = view
        kept += 1
        here = view + 1
    return kept, gained, spent


@_jit
def rest_bound(gained: float, need: float, gains: Any, quickest: float) -> float:
    """A lower bound of what completing a plan adds to E[T].

    Gains never grow, so taking them from the largest on, each at the quickest transition, cannot
    be beaten.
    """
    if gained > need:
        return 0.0
    added = 0.0
    for gain in np.sort(gains)[::-1]:
        added += math.exp(-gained) * quickest
        gained += gain
        if gained > need or gain <= 0.0:
            return added
    return added


@_jit
def branch_and_bound(
    start_state: Any,
    need: float,
    times: Any,
    ptr: Any,
    idx: Any,
    bits: Any,
    weights: Any,
    depth_limit: int,
    branch_limit: float,
    prune_dominated: bool,
    node_limit: int,
    best_plan: Any,
    best: Any,
) -> Any:
    """Depth-first branch and bound of Section 5.2.2; below the depth limit plans end greedily.

    `best_plan` and `best` (length, E[T]) hold the best plan so far and are updated. Returns the
    nodes expanded and whether the search came to its end.
    """
    views = ptr.shape[0] - 1
    quickest = np.inf
    for i in range(times.shape[0]):
        for j in range(1, times.shape[0]):
            if i != j:
                quickest = min(quickest, times[i, j])
    depth_max = min(depth_limit, views)
    states = np.zeros((depth_max + 1, start_state.shape[0], start_state.shape[1]), np.uint64)
    states[0] = start_state
    gained = np.zeros(depth_max + 1)
    spent = np.zeros(depth_max + 1)
    order = np.zeros((depth_max + 1, views), np.int64)
    gain_at = np.zeros((depth_max + 1, views))
    choices = np.zeros(depth_max + 1, np.int64)
    chosen = np.zeros(depth_max + 1, np.int64)
    plan = np.zeros(views + 1, np.int64)
    used = np.zeros(views, np.bool_)
    spare_state = np.zeros_like(start_state)
    spare_used = np.zeros(views, np.bool_)
    no_seed = np.ones(1, np.uint64)
    utility = np.zeros(views)
    nodes = 0
    depth = 0
    entering = True
    while depth >= 0:
        here = plan[depth - 1] + 1 if depth > 0 else 0
        if entering:
            entering = False
            chosen[depth] = 0
            choices[depth] = 0
            nodes += 1
            complete = gained[depth] > need
            if not complete:
                all_gains(states[depth], used, ptr, idx, bits, weights, gain_at[depth])
            if complete or depth >= depth_limit:
                spare_state[:] = states[depth]
                spare_used[:] = used
                length, w, e = finish_greedily(
                    plan, depth, spare_state, spare_used, gained[depth], spent[depth], need,
                    times, ptr, idx, bits, weights, 0.0, no_seed,
                )  # fmt: skip
                if w > need and e < best[1]:
                    best[0], best[1] = length, e
                    best_plan[:length] = plan[:length]
            else:
                bound = rest_bound(gained[depth], need, gain_at[depth], quickest)
                if spent[depth] + bound < best[1]:
                    choices[depth] = _branches(
                        gain_at[depth], times[here], branch_limit, prune_dominated, utility,
                        order[depth],
                    )  # fmt: skip
            if nodes >= node_limit:
                return nodes, False
        if chosen[depth] < choices[depth]:
            view = order[depth, chosen[depth]]
            chosen[depth] += 1
            cost = spent[depth] + math.exp(-gained[depth]) * times[here, view + 1]
            if not cost < best[1]:
                continue
            states[depth + 1] = states[depth]
            look(view, states[depth + 1], ptr, idx, bits)
            gained[depth + 1] = gained[depth] + gain_at[depth, view]
            spent[depth + 1] = cost
            plan[depth] = view
            used[view] = True
            depth += 1
            entering = True
        else:
            depth -= 1
            if depth >= 0:
                used[plan[depth]] = False
    return nodes, True


@_jit
def _branches(
    gains: Any, times: Any, branch_limit: float, prune: bool, utility: Any, order: Any
) -> int:
    """The views to branch on, by falling utility (Eqs. 5.6, 5.7 and the branch limit)."""
    views = gains.shape[0]
    for view in range(views):
        reachable = times[view + 1] < np.inf and gains[view] > _NOTHING
        utility[view] = (1.0 - math.exp(-gains[view])) / times[view + 1] if reachable else -1.0
    if prune:
        by_time = np.argsort(times[1:])
        most = 0.0  # the largest gain among strictly quicker views
        n = 0
        while n < views:
            last = n
            tied_most = most
            while last < views and times[by_time[last] + 1] == times[by_time[n] + 1]:
                view = by_time[last]
                if most > gains[view]:
                    utility[view] = -1.0
                tied_most = max(tied_most, gains[view])
                last += 1
            most = tied_most
            n = last
    count = 0
    best = utility.max()
    for view in np.argsort(-utility, kind="mergesort"):
        if utility[view] <= 0.0 or utility[view] * branch_limit < best:
            break
        order[count] = view
        count += 1
    return count
