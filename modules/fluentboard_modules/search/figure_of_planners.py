"""Figure 5.9 anew: the expected time of a search with each planner, moving and with planning."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from fluentboard_modules.search.summaries import Summary

_INK, _PAPER, _FAINT = "#22303c", "#fbfaf7", "#8a95a1"
_COLOURS = {"greedy": "#e9a03b", "b&b": "#1d7f8c", "local search": "#3b1f8f"}
_TITLES = {
    "offline": "one plan,\nfull map",
    "known": "planning again,\nfull map",
    "unknown": "planning again,\nwalls only",
}


def draw_figure_5_9(tables: Mapping[str, Sequence[Summary]], path: Path) -> None:
    """Writes a bar chart: greedy, the best branch and bound, and ours, of each experiment.

    Dark bars are moving and looking, bright ends planning; whiskers are 95 % confidence intervals
    of the mean over random starts, and the percentages pair each planner with greedy.

    Args:
        tables: per experiment the summaries.
        path: of a PNG.
    """
    chosen = [(name, _shown(rows)) for name, rows in tables.items() if rows]
    count = sum(len(rows) for _, rows in chosen)
    figure = Figure(figsize=(8.4, 0.9 + 0.42 * count + 0.3 * len(chosen)), facecolor=_PAPER)
    FigureCanvasAgg(figure)
    height = figure.get_figheight()
    axes = figure.add_axes((0.31, 0.62 / height, 0.62, 1.0 - 0.74 / height))
    axes.set_facecolor(_PAPER)
    y, longest = 0.0, 0.0
    for name, rows in chosen:
        top = y
        for row in rows:
            colour = _colour(row.planner)
            axes.barh(y, row.moving_s, 0.7, color=colour)
            axes.barh(
                y, row.total_s - row.moving_s, 0.7, left=row.moving_s, color=colour, alpha=0.4
            )
            # One start tells no interval.
            interval = row.interval_s if math.isfinite(row.interval_s) else 0.0
            axes.errorbar(row.total_s, y, xerr=interval, color=_INK, capsize=2.5, lw=0.9)
            end = row.total_s + interval
            longest = max(longest, end)
            label = _label(row.planner, tables[name])
            axes.text(-2.0, y, label, ha="right", va="center", color=_INK, fontsize=8.5)
            text = f"{row.total_s:.0f} s"
            if row.planner != "greedy":
                paired = 100 * row.against_interval
                give_or_take = f" ± {paired:.1f}" if math.isfinite(paired) else ""
                text += f"  ({100 * row.against_greedy:+.1f}{give_or_take} %)"
            axes.text(end + 2.0, y, text, va="center", color=_INK, fontsize=8.5)
            y += 1.0
        axes.text(
            -0.47, 0.5 * (top + y - 1.0), _TITLES[name], va="center", color=_INK, fontsize=8.5,
            fontweight="bold", transform=axes.get_yaxis_transform(),
        )  # fmt: skip
        y += 0.6
    axes.set_xlim(0.0, 1.4 * longest)
    axes.set_ylim(y - 1.0, -0.7)
    axes.set_yticks([])
    axes.set_xlabel("expected time until the object is found [s]", color=_INK, fontsize=8.5)
    axes.tick_params(colors=_FAINT, labelsize=8)
    for side in ("top", "right", "left"):
        axes.spines[side].set_visible(False)
    axes.spines["bottom"].set_color(_FAINT)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=150)


def _shown(rows: Sequence[Summary]) -> list[Summary]:
    """Greedy, the best setting of branch and bound, and the others."""
    bounded = [row for row in rows if row.planner.startswith("b&b")]
    best = min(bounded, key=lambda row: row.total_s, default=None)
    return [row for row in rows if row not in bounded or row is best]


def _label(planner: str, rows: Sequence[Summary]) -> str:
    settings = sum(row.planner.startswith("b&b") for row in rows)
    return f"{planner}\n(best of {settings})" if planner[:3] == "b&b" and settings > 1 else planner


def _colour(planner: str) -> str:
    return next((c for name, c in _COLOURS.items() if planner.startswith(name)), _FAINT)
