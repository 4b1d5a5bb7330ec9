"""Interleaved rounds and their ratios: what a noisy machine can still tell.

Every candidate runs once per round, so a slow moment hits all of them; a ratio is formed within
each round, and the median over the rounds is reported.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field


@dataclass
class Report:
    """The outcome of one script.

    Attributes:
        title: the claim, as a heading.
        unit: of the numbers, for one operation.
        medians: per candidate, ours first, the median time of one operation.
        ratios: per peer, the median of (peer's time / our time): above 1 we are faster.
        target: the target of the design, in words, or "".
        notes: what a reader must know to judge the numbers.
        table: lines of a table to show instead of the medians, for results that are no times.
    """

    title: str
    unit: str
    medians: dict[str, float]
    ratios: dict[str, float]
    target: str = ""
    notes: list[str] = field(default_factory=list)
    table: list[str] = field(default_factory=list)

    def markdown(self) -> str:
        """The report as a section of docs/benchmarks.md."""
        lines = [f"## {self.title}", ""]
        if self.target:
            lines += [f"Target: {self.target}.", ""]
        lines += self.table or self._medians()
        lines.append("")
        lines += [f"{note}" for note in self.notes]
        return "\n".join(lines).rstrip() + "\n"

    def _medians(self) -> list[str]:
        heads = ["candidate" if self.ratios else "what", f"median, {self.unit}"]
        if self.ratios:
            heads.append("fluentboard is faster by")
        lines = [f"| {' | '.join(heads)} |", f"|{' --- |' * len(heads)}"]
        for name, value in self.medians.items():
            cells = [name, f"{value:,.4g}"]
            if self.ratios:
                ratio = self.ratios.get(name)
                cells.append("" if ratio is None else f"{ratio:.2f} x")
            lines.append(f"| {' | '.join(cells)} |")
        return lines


def compare(
    title: str,
    candidates: Mapping[str, Callable[[], float | None]],
    *,
    rounds: int,
    operations: int = 1,
    unit: str = "ms",
    target: str = "",
    notes: Sequence[str] = (),
) -> Report:
    """Runs all candidates round by round; the first is ours.

    Args:
        title: the claim.
        candidates: per name a function that does the work once; it may return the seconds that
            count, otherwise its whole run is timed.
        rounds: how many rounds.
        operations: how many operations one run does.
        unit: "ms" or "us" for the reported time of one operation.
        target: the target of the design, in words.
        notes: what a reader must know.
    """
    seconds: dict[str, list[float]] = {name: [] for name in candidates}
    for _ in range(rounds):
        for name, run in candidates.items():
            begin = time.perf_counter()
            spent = run()
            seconds[name].append(time.perf_counter() - begin if spent is None else spent)
    scale = {"ms": 1e3, "us": 1e6, "s": 1.0}[unit] / operations
    ours, *peers = candidates
    return Report(
        title,
        unit,
        {name: statistics.median(times) * scale for name, times in seconds.items()},
        {
            peer: statistics.median(
                p / o for p, o in zip(seconds[peer], seconds[ours], strict=True)
            )
            for peer in peers
        },
        target,
        list(notes),
    )
