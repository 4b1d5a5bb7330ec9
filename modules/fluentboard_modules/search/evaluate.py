"""`fluentboard evaluate search`: Table 5.1 and Figure 5.9, with confidence intervals."""

from __future__ import annotations

import json
import statistics
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from fluentboard_modules.progress import FrameProgress
from fluentboard_modules.search.evaluation import (
    Summary,
    Trial,
    export_trial,
    planners_for,
    run_experiment,
    run_trial,
    summarise,
    world_of,
)
from fluentboard_modules.simulation.scene_json import load_scene
from fluentboard_modules.simulation.search_scenes import hidden_pepper_mill

_TITLES = {
    "offline": "one plan, full map",
    "known": "planning again after every look, full map",
    "unknown": "planning again after every look, walls only",
}


def evaluate_search(
    experiments: Sequence[str],
    *,
    scene: Path | None = None,
    trials: int = 20,
    seed: int = 0,
    looks_on_the_way: bool = True,
    export: Path | None = None,
    output: Path | None = None,
) -> dict[str, Any]:
    """Runs the experiments of Section 5.3 and prints their tables.

    Args:
        experiments: any of `offline`, `known`, `unknown`.
        scene: a scene with search volumes; our own room if not given.
        trials: random starts of each.
        seed: of starts and views.
        looks_on_the_way: whether the robot also looks while it drives.
        export: write every offline trial there.
        output: write the numbers there as JSON.

    Returns:
        What `output` gets.
    """
    world = world_of(
        load_scene(scene) if scene else hidden_pepper_mill(0).scene,
        looks_on_the_way=looks_on_the_way,
    )
    console = Console(highlight=False)
    results: dict[str, Any] = {
        "trials": trials,
        "seed": seed,
        "looks_on_the_way": looks_on_the_way,
        "experiments": {},
    }
    everything: list[Trial] = []
    for experiment in experiments:
        planners = planners_for(experiment)
        # Compiles what is timed.
        run_trial(world, "offline", 0, seed + 1_000, planners[:2] + planners[-1:])
        with FrameProgress() as progress:
            progress.begin(_TITLES[experiment], trials)
            done: list[Trial] = []

            def told(trial: Trial, done: list[Trial] = done) -> None:
                done.append(trial)
                progress.advance(f"greedy {sum(trial.expected_s['greedy']):.0f} s")
                if export is not None:
                    export_trial(trial, export)

            run_experiment(world, experiment, trials, seed, planners, told)
        rows = summarise(done, [planner.name for planner in planners])
        results["experiments"][experiment] = [asdict(row) for row in rows]
        if experiment == "offline":
            gaps = [trial.plans["local search"].gap for trial in done]
            results["gap"] = statistics.mean(gaps)
        everything += done
        console.print(_figure_5_9(experiment, rows))
    results["table_5_1"] = {
        "views_s": statistics.mean(t.sampling_s for t in everything),
        "times_s": statistics.mean(t.times_s for t in everything),
        "views_sd_s": _deviation([t.sampling_s for t in everything]),
        "times_sd_s": _deviation([t.times_s for t in everything]),
    }
    console.print(_table_5_1(results["table_5_1"]))
    if output is not None:
        output.write_text(
            json.dumps(results, indent=1, ensure_ascii=False) + "\n", encoding="utf-8"
        )
    return results


def _deviation(values: Sequence[float]) -> float:
    return statistics.stdev(values) if len(values) > 1 else 0.0


def _table(title: str) -> Table:
    return Table(
        title=title,
        title_justify="left",
        box=None,
        pad_edge=False,
        header_style="dim",
        padding=(0, 2, 0, 0),
    )


def _figure_5_9(experiment: str, rows: Sequence[Summary]) -> Table:
    """Greedy, the best setting of the thesis's planner, and ours, in the order of Figure 5.9."""
    table = _table(f"{experiment}: {_TITLES[experiment]}")
    table.add_column("planner")
    for name in ("E[T] moving", "E[T] with planning", "against greedy"):
        table.add_column(name, justify="right")
    bounded = sorted((r for r in rows if r.planner.startswith("b&b")), key=lambda r: r.total_s)
    others = [r for r in rows if not r.planner.startswith("b&b")]
    for row in (others[0], *bounded, *others[1:]):
        table.add_row(
            row.planner,
            f"{row.moving_s:.1f} s",
            f"{row.total_s:.1f} ± {row.interval_s:.1f} s",
            ""
            if row.planner == "greedy"
            else f"{100 * row.against_greedy:+.1f} ± {100 * row.against_interval:.1f} %",
        )
    return table


def _table_5_1(measured: dict[str, float]) -> Table:
    table = _table("Table 5.1: mean run times (one core)")
    table.add_column("step")
    table.add_column("here", justify="right")
    table.add_column("thesis", justify="right")
    for name, key, thesis in (
        ("View sampling (200 views)", "views", "2.4 ± 0.1 s"),
        ("Transition times (all pairs; the thesis: 50 clusters)", "times", "6.4 ± 0.6 s"),
    ):
        table.add_row(name, f"{measured[key + '_s']:.2f} ± {measured[key + '_sd_s']:.2f} s", thesis)
    return table
