"""Means over trials with confidence intervals: what Figure 5.9 shows."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fluentboard.model.geometry import FloatArray
from fluentboard_modules.search.kept_trials import KeptTrial


@dataclass(frozen=True, slots=True)
class Summary:
    """A planner's result over all trials.

    Attributes:
        planner: its name.
        trials: how many.
        moving_s: mean E[T] of moving and looking.
        total_s: mean E[T] with planning.
        interval_s: half of the 95 % confidence interval of `total_s`.
        against_greedy: mean of the ratio to greedy's total in the same trial, minus 1.
        against_interval: half of its 95 % confidence interval.
        at_equal_end: the same as `against_greedy`, each trial up to the least probability that a
            planner had seen at its end.
        equal_end_interval: half of its 95 % confidence interval.
        looks: mean number of views taken.
        gap: mean gap of its plans.
    """

    planner: str
    trials: int
    moving_s: float
    total_s: float
    interval_s: float
    against_greedy: float
    against_interval: float
    at_equal_end: float
    equal_end_interval: float
    looks: float
    gap: float


def summarise(trials: Sequence[KeptTrial], planners: Sequence[str]) -> list[Summary]:
    """The mean results of planners, greedy's own included.

    Trials are paired: a planner is compared with greedy in the same trials.
    """
    rows: list[Summary] = []
    for name in planners:
        done = [t for t in trials if name in t.results and "greedy" in t.results]
        if not done:
            continue
        greedy = np.array([t.results["greedy"].total_s for t in done])
        total = np.array([t.results[name].total_s for t in done])
        ratio = total / np.maximum(greedy, 1e-9) - 1.0
        ends = [min(t.results[n].probability for n in planners if n in t.results) for t in done]
        pairs = [
            (t.results[name].total_until_s(p), t.results["greedy"].total_until_s(p))
            for t, p in zip(done, ends, strict=True)
        ]
        equal = np.array([ours / max(theirs, 1e-9) - 1.0 for ours, theirs in pairs])
        rows.append(
            Summary(
                name,
                len(done),
                float(np.mean([t.results[name].moving_s for t in done])),
                float(total.mean()),
                half_interval(total),
                float(ratio.mean()),
                half_interval(ratio),
                float(equal.mean()),
                half_interval(equal),
                float(np.mean([t.results[name].looks for t in done])),
                float(np.mean([t.results[name].gap for t in done])),
            )
        )
    return rows


def half_interval(values: FloatArray) -> float:
    """Half of the 95 % confidence interval of a mean (Student's t); infinite for one value."""
    from scipy.stats import t as student

    if len(values) < 2:
        return math.inf
    quantile = float(student.ppf(0.975, len(values) - 1))
    return quantile * float(values.std(ddof=1)) / math.sqrt(len(values))
