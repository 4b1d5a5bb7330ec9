"""Planning problems and plans: views, what they reveal, and how long the way to them is.

The objective is the expected time until the object is found (Eq. 5.4). Plans end as soon as
Eq. 5.9 holds, and only such plans are compared: all stop at (practically) the same probability.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fluentboard.errors import InvalidInput
from fluentboard.model.geometry import FloatArray
from fluentboard_modules.search import plan_kernels as kernels
from fluentboard_modules.search.region import LOOKS_MAX


@dataclass(frozen=True, eq=False)
class PlanningProblem:
    """Which views there are, which cells each reveals, and how long the ways take.

    Attributes:
        cell_p: `(n,)`; p(c_k) of every cell, in [0, 1) (Eq. 5.1).
        view_ptr: `(v + 1,)`; the cells of view i are `view_cells[view_ptr[i]:view_ptr[i + 1]]`.
        view_cells: `(nnz,)`; cell numbers.
        times_s: `(v + 1, v + 1)`; transition times, from row to column, 0 for the start and
            i + 1 for view i; infinite where there is no way.
        omega: the threshold of Section 5.2.2, in [0, 1).
        recall: probability that the object is recognised in a view that shows it.

    Raises:
        InvalidInput: the arrays do not fit together, or a value is out of range.
    """

    cell_p: FloatArray
    view_ptr: NDArray[np.int64]
    view_cells: NDArray[np.int64]
    times_s: FloatArray
    omega: float = 0.05
    recall: float = 1.0

    def __post_init__(self) -> None:
        views = len(self.view_ptr) - 1
        if self.times_s.shape != (views + 1, views + 1):
            raise InvalidInput(
                f"transition times of shape {self.times_s.shape} for {views} views; give "
                f"({views + 1}, {views + 1}) with the start first"
            )
        if not ((self.cell_p >= 0.0) & (self.cell_p < 1.0)).all():
            raise InvalidInput("a cell probability lies outside [0, 1); check the volumes")
        if not (0.0 <= self.omega < 1.0 and 0.0 < self.recall <= 1.0):
            raise InvalidInput(
                f"threshold {self.omega} and recall {self.recall}; give omega in [0, 1) and "
                "recall in (0, 1]"
            )
        if np.isnan(self.times_s).any() or (self.times_s[:, 1:] < 0.0).any():
            raise InvalidInput("a transition time is negative or NaN")
        cells = self.view_cells
        if len(cells) and not (cells.min() >= 0 and cells.max() < len(self.cell_p)):
            raise InvalidInput("a view reveals a cell that does not exist")

    @property
    def view_count(self) -> int:
        """How many views there are."""
        return len(self.view_ptr) - 1

    def cells(self, view: int) -> NDArray[np.int64]:
        """Numbers of the cells that a view reveals."""
        return self.view_cells[self.view_ptr[view] : self.view_ptr[view + 1]]

    @cached_property
    def words(self) -> Words:
        """The same as bit sets, for the compiled planners."""
        return _words(self)

    @cached_property
    def total_probability(self) -> float:
        """p(V(S)): the probability to find the object with all views (Eq. 5.2)."""
        return 1.0 - math.exp(-self.words.reachable)


@dataclass(frozen=True, eq=False)
class Words:
    """A planning problem as bit sets; see `plan_kernels`.

    Attributes:
        start: `(layers, words)`; the state in which nothing has been looked at.
        ptr: `(v + 1,)`; range of each view in `idx` and `bits`.
        idx: word numbers.
        bits: bits of these words.
        weights: `(layers, words)`; gain per cell.
        reachable: W after all views, -ln(1 - p(V(S))).
        need: W at which a plan is complete (Eq. 5.9).
    """

    start: NDArray[np.uint64]
    ptr: NDArray[np.int64]
    idx: NDArray[np.int64]
    bits: NDArray[np.uint64]
    weights: FloatArray
    reachable: float
    need: float

    @property
    def views(self) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.uint64], FloatArray]:
        """What most loops take: ptr, idx, bits and weights."""
        return self.ptr, self.idx, self.bits, self.weights


@dataclass(frozen=True, slots=True)
class Plan:
    """A sequence of views.

    Attributes:
        views: in the order in which they are to be taken.
        expected_time_s: E[T|L] (Eq. 5.4).
        success_probability: p(L) (Eq. 5.8).
        lower_bound_s: no complete plan has a smaller expected time.
        is_complete: whether Eq. 5.9 holds; if not, no reachable views were left.
    """

    views: tuple[int, ...]
    expected_time_s: float
    success_probability: float
    lower_bound_s: float = 0.0
    is_complete: bool = True

    @property
    def gap(self) -> float:
        """By what fraction of its expected time the plan may exceed the best one, in [0, 1]."""
        if self.expected_time_s <= 0.0:
            return 0.0
        return max(0.0, 1.0 - self.lower_bound_s / self.expected_time_s)


def detection_probability(cell_probability: ArrayLike) -> float:
    """Probability that at least one target lies in the cells seen (Eq. 5.3).

    Cells count as independent, so there is nothing to renormalise after an unsuccessful look.

    Args:
        cell_probability: `(n,)`; p(c_k) of every cell in view, each in [0, 1] (Eq. 5.1).

    Returns:
        p(C) in [0, 1]; 0 for an empty view.
    """
    return 1.0 - float(np.prod(1.0 - np.asarray(cell_probability, dtype=np.float64)))


def carry_out(problem: PlanningProblem, views: ArrayLike) -> Plan:
    """What a given sequence of views is worth, as far as it goes before it is complete.

    Views that show nothing new are left out, as no planner would go there.
    """
    words = problem.words
    plan = np.array(views, dtype=np.int64).reshape(-1)
    length, gained, spent = kernels.walk(
        plan, len(plan), 0, words.start.copy(), 0.0, 0.0, np.inf, words.need, problem.times_s,
        *words.views,
    )  # fmt: skip
    return Plan(
        tuple(int(v) for v in plan[:length]),
        float(spent),
        1.0 - math.exp(-gained),
        is_complete=bool(gained > words.need),
    )


def layer_weights(cell_p: FloatArray, recall: float) -> FloatArray:
    """`(layers, n)`; what the first, second, ... look at each cell adds to W.

    One layer for a perfect detector; otherwise looks beyond the fourth count for nothing.

    Args:
        cell_p: `(n,)`; p(c_k).
        recall: probability that the object is recognised in a look that shows it.
    """
    weights = np.zeros((1 if recall == 1.0 else LOOKS_MAX, len(cell_p)))
    missed = np.ones(len(cell_p))  # probability that a cell with a target shows nothing so far
    before = np.zeros(len(cell_p))
    for layer in weights:
        missed = missed * (1.0 - recall)
        after = -np.log1p(-cell_p * (1.0 - missed))
        layer[:] = after - before
        before = after
    return weights


def _words(problem: PlanningProblem) -> Words:
    # Cells of equal probability share words; each group begins a new one.
    values, group = np.unique(problem.cell_p, return_inverse=True)
    order = np.argsort(group, kind="stable")
    sizes = np.bincount(group, minlength=len(values))
    first_word = np.concatenate([[0], np.cumsum((sizes + 63) // 64)])
    within = np.arange(len(order)) - np.repeat(np.cumsum(sizes) - sizes, sizes)
    bit = np.zeros(len(order), np.int64)
    bit[order] = 64 * np.repeat(first_word[:-1], sizes) + within
    count = int(first_word[-1])
    probability = np.repeat(values, np.diff(first_word))
    weights = layer_weights(probability, problem.recall)
    layers = len(weights)
    view = np.repeat(np.arange(problem.view_count), np.diff(problem.view_ptr))
    place = bit[problem.view_cells]
    key, inverse = np.unique(view * max(count, 1) + (place >> 6), return_inverse=True)
    bits = np.zeros(len(key), np.uint64)
    np.bitwise_or.at(bits, inverse, np.uint64(1) << (place & 63).astype(np.uint64))
    ptr = np.searchsorted(key // max(count, 1), np.arange(problem.view_count + 1))
    idx = key % max(count, 1)
    start = np.zeros((layers, count), np.uint64)
    np.bitwise_or.at(start[0], idx, bits)
    # A view that no way leads to counts for nothing.
    reachable = _reached(np.isfinite(problem.times_s))
    state = start.copy()
    total = 0.0
    for number in np.flatnonzero(reachable):
        total += kernels.gain_of(number, state, ptr, idx, bits, weights)
        kernels.look(number, state, ptr, idx, bits)
    need = total + math.log1p(-problem.omega) - 1e-12
    return Words(start, ptr.astype(np.int64), idx, bits, weights, float(total), need)


def _reached(joined: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """`(v,)`; which views a way from the start leads to, directly or by way of others."""
    reached = np.zeros(len(joined), np.bool_)
    reached[0] = True
    while True:
        more = reached | joined[reached].any(axis=0)
        if (more == reached).all():
            return reached[1:]
        reached = more
