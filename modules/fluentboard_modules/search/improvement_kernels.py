"""Compiled local search over complete plans: what the default planner improves them with."""

from __future__ import annotations

from typing import Any

import numba
import numpy as np

from fluentboard_modules.search.plan_kernels import (
    finish_greedily,
    gain_of,
    look,
    uniform,
    walk,
)

_jit: Any = numba.njit(cache=True, nogil=True, error_model="numpy")


@_jit
def _prefixes(
    plan: Any, length: int, states: Any, gained: Any, spent: Any, first: int,
    times: Any, ptr: Any, idx: Any, bits: Any, weights: Any,
) -> None:  # fmt: skip
    """Fills states, W and E[T] before each position of a plan, from `first` on."""
    for n in range(first, length):
        view = plan[n]
        here = plan[n - 1] + 1 if n > 0 else 0
        states[n + 1] = states[n]
        gain = gain_of(view, states[n], ptr, idx, bits, weights)
        look(view, states[n + 1], ptr, idx, bits)
        spent[n + 1] = spent[n] + np.exp(-gained[n]) * times[here, view + 1]
        gained[n + 1] = gained[n] + gain


@_jit
def _changed(plan: Any, length: int, kind: int, i: int, j: int, view: int, out: Any) -> int:
    """Writes a neighbour of a plan to `out` and returns its length.

    Kinds: 0 insert `view` before i; 1 replace i by `view`; 2 move i to j; 3 reverse i to j;
    4 swap i and j; 5 remove i.
    """
    if kind == 0:
        out[:i] = plan[:i]
        out[i] = view
        out[i + 1 : length + 1] = plan[i:length]
        return length + 1
    out[:length] = plan[:length]
    if kind == 1:
        out[i] = view
    elif kind == 2:
        moved = plan[i]
        if i < j:
            out[i:j] = plan[i + 1 : j + 1]
        else:
            out[j + 1 : i + 1] = plan[j:i]
        out[j] = moved
    elif kind == 3:
        for n in range(i, j + 1):
            out[n] = plan[i + j - n]
    elif kind == 4:
        out[i], out[j] = plan[j], plan[i]
    else:
        out[i : length - 1] = plan[i + 1 : length]
        return length - 1
    return length


@_jit
def improve(
    plan: Any, length: int, need: float, start_state: Any, times: Any,
    ptr: Any, idx: Any, bits: Any, weights: Any, sweeps: int,
) -> Any:  # fmt: skip
    """Local search to a plan that none of its neighbours beats, in at most `sweeps` passes.

    Neighbours differ by an insertion, a replacement, a move, a reversal, a swap, or a removal with
    a greedy end. Returns length, W and E[T]; `plan` is changed in place.
    """
    views = ptr.shape[0] - 1
    room = plan.shape[0]
    states = np.zeros((room + 1, start_state.shape[0], start_state.shape[1]), np.uint64)
    states[0] = start_state
    gained = np.zeros(room + 1)
    spent = np.zeros(room + 1)
    trial = np.zeros(room + 1, np.int64)
    state = np.zeros_like(start_state)
    in_plan = np.zeros(views, np.bool_)
    used = np.zeros(views, np.bool_)
    no_seed = np.ones(1, np.uint64)
    _prefixes(plan, length, states, gained, spent, 0, times, ptr, idx, bits, weights)
    best = spent[length]
    for _ in range(sweeps):
        improved = False
        for kind in (5, 1, 0, 2, 3, 4):
            i = 0
            while i < length + (1 if kind == 0 else 0):
                in_plan[:] = False
                for n in range(length):
                    in_plan[plan[n]] = True
                last = views if kind <= 1 else (length if kind < 5 else 1)
                for choice in range(last):
                    view = choice if kind <= 1 else -1
                    j = choice
                    first = i
                    if kind <= 1:
                        before = plan[i - 1] + 1 if i > 0 else 0
                        if in_plan[view] or length + 1 >= room:
                            continue
                        if spent[i] + np.exp(-gained[i]) * times[before, view + 1] >= best:
                            continue
                        if gain_of(view, states[i], ptr, idx, bits, weights) <= 1e-12:
                            continue
                    elif kind < 5:
                        if j >= length or i >= length:
                            break
                        if j == i or (kind != 2 and j < i):
                            continue
                        first = min(i, j)
                    new = _changed(plan, length, kind, i, j, view, trial)
                    state[:] = states[first]
                    new, w, e = walk(
                        trial, new, first, state, gained[first], spent[first], best, need,
                        times, ptr, idx, bits, weights,
                    )  # fmt: skip
                    if kind == 5 and e < best and w <= need:
                        used[:] = False
                        for n in range(new):
                            used[trial[n]] = True
                        new, w, e = finish_greedily(
                            trial, new, state, used, w, e, need, times, ptr, idx, bits,
                            weights, 0.0, no_seed,
                        )  # fmt: skip
                    if w > need and e < best * (1.0 - 1e-12):
                        for n in range(length):
                            in_plan[plan[n]] = False
                        length = new
                        plan[:length] = trial[:length]
                        for n in range(length):
                            in_plan[plan[n]] = True
                        _prefixes(
                            plan, length, states, gained, spent, first, times, ptr, idx, bits,
                            weights,
                        )  # fmt: skip
                        best = spent[length]
                        improved = True
                        if i >= length:
                            break
                i += 1
        if not improved:
            break
    return length, gained[length], best


@_jit
def shake_and_improve(
    plan: Any, length: int, best: float, need: float, start_state: Any, times: Any,
    ptr: Any, idx: Any, bits: Any, weights: Any, rounds: int, seed: Any,
) -> Any:  # fmt: skip
    """Iterated local search: removes a random stretch of the plan, refills it, improves it.

    Returns length, E[T] and the number of rounds since the last improvement.
    """
    views = ptr.shape[0] - 1
    trial = np.zeros(plan.shape[0], np.int64)
    used = np.zeros(views, np.bool_)
    state = np.zeros_like(start_state)
    idle = 0
    for _ in range(rounds):
        idle += 1
        count = 1 + int(uniform(seed) * min(5, length))
        first = int(uniform(seed) * (length - count + 1))
        trial[:first] = plan[:first]
        trial[first : length - count] = plan[first + count : length]
        state[:] = start_state
        if uniform(seed) < 0.5:
            # Refill where the gap is: the greedy end continues from the stretch's beginning.
            new, w, e = walk(
                trial, first, 0, state, 0.0, 0.0, np.inf, need, times, ptr, idx, bits, weights
            )
        else:
            new, w, e = walk(
                trial, length - count, 0, state, 0.0, 0.0, np.inf, need, times, ptr, idx, bits,
                weights,
            )  # fmt: skip
        used[:] = False
        for n in range(new):
            used[trial[n]] = True
        if uniform(seed) < 0.5:
            for n in range(first, first + count):
                used[plan[n]] = True  # without what was removed, lest it come straight back
        new, w, e = finish_greedily(
            trial, new, state, used, w, e, need, times, ptr, idx, bits, weights, 0.3, seed
        )
        if w <= need or new == 0:
            continue
        new, w, e = improve(trial, new, need, start_state, times, ptr, idx, bits, weights, 20)
        if w > need and e < best * (1.0 - 1e-9):
            plan[:new] = trial[:new]
            length, best, idle = new, e, 0
    return length, best, idle
