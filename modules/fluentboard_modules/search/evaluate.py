"""`fluentboard evaluate search`: Table 5.1 and Figure 5.9, with confidence intervals."""

from __future__ import annotations

import json
import math
import statistics
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from fluentboard_modules.progress import FrameProgress
from fluentboard_modules.search.evaluation import World, planners_for, run_trial, world_of
from fluentboard_modules.search.figure_of_planners import draw_figure_5_9
from fluentboard_modules.search.kept_trials import KeptTrial, TrialFolder, export_trial, kept
from fluentboard_modules.search.planners import Planner
from fluentboard_modules.search.summaries import Summary, summarise
from fluentboard_modules.simulation.scene_json import load_scene
from fluentboard_modules.simulation.search_scenes import hidden_pepper_mill

TITLES = {
    "offline": "one plan, full map",
    "known": "planning again after every look, full map",
    "unknown": "planning again after every look, walls only",
}


@dataclass(frozen=True, slots=True)
class EvaluationOptions:
    """What to run.

    Attributes:
        scene: a scene with search volumes; our own two rooms if not given.
        trials: random starts of each experiment.
        seed: of starts and views.
        looks_on_the_way: whether the robot also looks while it drives.
        whole_grid: all settings of branch and bound, not only that of the original software.
        export: write every offline trial there.
        keep: keep the results of every trial there, and do not run again what is there.
        output: write the numbers there as JSON.
        picture: draw Figure 5.9 there.
    """

    scene: Path | None = None
    trials: int = 20
    seed: int = 0
    looks_on_the_way: bool = False
    whole_grid: bool = True
    export: Path | None = None
    keep: Path | None = None
    output: Path | None = None
    picture: Path | None = None


def evaluate_search(experiments: Sequence[str], options: EvaluationOptions) -> dict[str, Any]:
    """Runs the experiments of Section 5.3 and prints their tables.

    Args:
        experiments: any of `offline`, `known`, `unknown`.
        options: where, how often, and what to write.

    Returns:
        What `options.output` gets.
    """
    scene = load_scene(options.scene) if options.scene else hidden_pepper_mill(0, rooms=2).scene
    world = world_of(scene, looks_on_the_way=options.looks_on_the_way)
    console = Console(highlight=False)
    tables: dict[str, list[Summary]] = {}
    everything: list[KeptTrial] = []
    for experiment in experiments:
        planners = planners_for(experiment, options.whole_grid)
        with FrameProgress() as progress:
            progress.begin(TITLES[experiment], options.trials)
            done: list[KeptTrial] = []
            for trial in _trials(world, experiment, planners, options):
                done.append(trial)
                progress.advance(f"greedy {trial.results['greedy'].total_s:.0f} s")
        tables[experiment] = summarise(done, [planner.name for planner in planners])
        everything += done
        console.print(_figure_5_9(experiment, tables[experiment]))
    run_times = {
        "views_s": statistics.mean(t.sampling_s for t in everything),
        "views_sd_s": _deviation([t.sampling_s for t in everything]),
        "times_s": statistics.mean(t.times_s for t in everything),
        "times_sd_s": _deviation([t.times_s for t in everything]),
    }
    console.print(_table_5_1(run_times))
    results = {
        "scene": _name_of(options.scene) if options.scene else "two rooms of the simulator",
        "trials": options.trials,
        "seed": options.seed,
        "looks_on_the_way": options.looks_on_the_way,
        "experiments": {name: [_finite(r) for r in rows] for name, rows in tables.items()},
        "table_5_1": run_times,
    }
    if options.output is not None:
        text = json.dumps(results, indent=1, ensure_ascii=False) + "\n"
        options.output.write_text(text, encoding="utf-8")
    if options.picture is not None:
        draw_figure_5_9(tables, options.picture)
    return results


def _name_of(scene: Path) -> str:
    """`kitchen.json`, but the folder of a file that is just called scene.json."""
    return scene.resolve().parent.name if scene.name == "scene.json" else scene.name


def _trials(
    world: World, experiment: str, planners: Sequence[Planner], options: EvaluationOptions
) -> Iterator[KeptTrial]:
    """All trials of an experiment, those from the folder as far as they are there."""
    scene = options.scene.read_text(encoding="utf-8") if options.scene else "two rooms"
    setting = (scene, str(options.seed), str(options.looks_on_the_way), repr(world.config))
    folder = TrialFolder(options.keep, setting) if options.keep else None
    is_warm = False
    for number in range(options.trials):
        before = folder.read(experiment, number) if folder else None
        results = dict(before.results) if before else {}
        missing = [planner for planner in planners if planner.name not in results]
        exports = experiment == "offline" and options.export is not None
        if before is not None and not missing and not exports:
            yield before
            continue
        if not is_warm:
            # Compiles what is timed.
            run_trial(world, "offline", 0, options.seed + 1_000, _one_of_each(planners))
            is_warm = True
        chosen = planners if exports else missing
        trial = run_trial(world, experiment, number, options.seed, chosen)
        if options.export is not None:
            export_trial(trial, options.export)
        results.update(trial.results)
        trial.results = results
        yield kept(trial)
        if folder is not None:
            folder.write(experiment, kept(trial))


def _one_of_each(planners: Sequence[Planner]) -> list[Planner]:
    return list({type(planner): planner for planner in planners}.values())


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
    """Greedy, the settings of the thesis's planner from the best on, and ours."""
    table = _table(f"{experiment}: {TITLES[experiment]}")
    table.add_column("planner", no_wrap=True)
    heads = ["trials", "E[T] moving", "with planning", "against greedy", "looks", "gap"]
    if experiment != "offline":  # where all plans end alike
        heads.insert(4, "at equal end")
    for name in heads:
        table.add_column(name, justify="right")
    bounded = sorted((r for r in rows if r.planner.startswith("b&b")), key=lambda r: r.total_s)
    others = [r for r in rows if not r.planner.startswith("b&b")]
    for row in (others[0], *bounded, *others[1:]):
        compared = [_percent(row.against_greedy, row.against_interval)]
        if experiment != "offline":
            compared.append(_percent(row.at_equal_end, row.equal_end_interval))
        table.add_row(
            row.planner,
            str(row.trials),
            f"{row.moving_s:.1f} s",
            f"{row.total_s:.1f}{_give_or_take(row.interval_s)} s",
            *("" if row.planner == "greedy" else text for text in compared),
            f"{row.looks:.1f}",
            f"{row.gap:.2f}",
        )
    return table


def _percent(value: float, interval: float) -> str:
    return f"{100 * value:+.1f}{_give_or_take(100 * interval)} %"


def _give_or_take(interval: float) -> str:
    return f" ± {interval:.1f}" if math.isfinite(interval) else ""


def _finite(summary: Summary) -> dict[str, Any]:
    """For JSON, which knows no infinity: what one trial does not tell is null."""
    return {
        key: None if isinstance(value, float) and not math.isfinite(value) else value
        for key, value in asdict(summary).items()
    }


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
