"""Plans of the active search against greedy: Figure 5.9 and Table 5.1 of the thesis.

`python -m bench search_plans` runs two rooms of the simulator. For another scene, give
`python -m bench.search_plans FILE --command '...'` the numbers that
`fluentboard evaluate search --scene SCENE --output FILE` wrote: they become
`bench/results/search_plans.json`.
"""

from __future__ import annotations

import argparse
import datetime
import json
import math
import os
import platform
from pathlib import Path
from typing import Any

from bench.measuring import Report
from fluentboard_modules.search.evaluate import TITLES, EvaluationOptions, evaluate_search
from fluentboard_modules.search.evaluation import EXPERIMENTS
from fluentboard_modules.search.figure_of_planners import draw_figure_5_9
from fluentboard_modules.search.summaries import Summary

_RESULTS = Path(__file__).resolve().parent / "results" / "search_plans.json"
_TARGETS = {
    "offline": "at least 15 % below greedy, and below the best branch and bound",
    "known": "at least 15 % below greedy with a map (the thesis: 10 %)",
    "unknown": "at least 7 % below greedy without one (the thesis: 7 %)",
}


def run() -> list[Report]:
    """All three experiments in two rooms of the simulator, five starts each."""
    return reports_of(evaluate_search(EXPERIMENTS, EvaluationOptions(trials=5, whole_grid=False)))


def reports_of(results: dict[str, Any]) -> list[Report]:
    """The reports of an evaluation.

    Args:
        results: what `evaluate_search` returns, or its file holds.
    """
    reports: list[Report] = []
    for name, rows in results["experiments"].items():
        lines = [
            "| planner | starts | E[T] moving | with planning | against greedy | at equal end | "
            "views | gap |",
            "|" + " --- |" * 8,
        ]
        bounded = [row for row in rows if row["planner"].startswith("b&b")]
        best = min(bounded, key=lambda row: row["total_s"], default=None)
        for row in rows:
            if row in bounded and row is not best:
                continue
            label = row["planner"]
            if row is best and len(bounded) > 1:
                label += f" (best of {len(bounded)})"
            is_greedy = label == "greedy"
            cells = [
                label,
                str(row["trials"]),
                f"{row['moving_s']:.1f} s",
                f"{row['total_s']:.1f} ± {row['interval_s']:.1f} s",
                "" if is_greedy else _percent(row["against_greedy"], row["against_interval"]),
                "" if is_greedy else _percent(row["at_equal_end"], row["equal_end_interval"]),
                f"{row['looks']:.1f}",
                f"{row['gap']:.2f}",
            ]
            lines.append(f"| {' | '.join(cells)} |")
        reports.append(
            Report(
                f"Active search, {TITLES[name]}",
                "s",
                {row["planner"]: row["total_s"] for row in rows},
                {},
                _TARGETS[name],
                [
                    f"Scene: {results['scene']}. PR2, P = 0.2 per volume, a threshold of 0.05, the "
                    "same starts, views and transition times for all planners; means with 95 % "
                    "intervals, percentages paired by start, planning in CPU seconds of one busy "
                    "core. At equal end: up to the least probability that a planner had seen when "
                    "it ended."
                ],
                lines,
            )
        )
    return reports


def _summary(row: dict[str, Any]) -> Summary:
    return Summary(**{key: math.inf if value is None else value for key, value in row.items()})


def _percent(value: float, interval: float) -> str:
    return f"{100 * value:+.1f} ± {100 * interval:.1f} %"


def main() -> None:
    """Turns the output of an evaluation into the results of this bench."""
    parser = argparse.ArgumentParser(prog="python -m bench.search_plans", description=__doc__)
    parser.add_argument("file", type=Path, nargs="+", help="outputs of `evaluate search`")
    parser.add_argument("--command", required=True, help="how they were made")
    parser.add_argument("--picture", type=Path, help="draw Figure 5.9 there (PNG)")
    arguments = parser.parse_args()
    results = [json.loads(path.read_text(encoding="utf-8")) for path in arguments.file]
    reports = [report for one in results for report in reports_of(one)]
    if arguments.picture is not None:
        tables = {
            name: [_summary(row) for row in rows]
            for one in results
            for name, rows in one["experiments"].items()
        }
        draw_figure_5_9(tables, arguments.picture)
    kept = {
        "date": datetime.date.today().isoformat(),
        "machine": f"{platform.machine()}, {os.cpu_count()} cores, "
        f"Python {platform.python_version()}",
        "command": arguments.command,
        "reports": [vars(report) for report in reports],
    }
    text = json.dumps(kept, indent=1, ensure_ascii=False) + "\n"
    _RESULTS.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
