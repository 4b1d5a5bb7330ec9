"""Evaluation: trials that others can plan anew, results that outlast a stop, honest intervals."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fluentboard.errors import InvalidInput
from fluentboard_modules.search import evaluate
from fluentboard_modules.search.config import PlannerConfig
from fluentboard_modules.search.evaluate import EvaluationOptions, evaluate_search
from fluentboard_modules.search.evaluation import Result, Trial, World, run_trial, world_of
from fluentboard_modules.search.figure_of_planners import draw_figure_5_9
from fluentboard_modules.search.kept_trials import KeptTrial, TrialFolder, export_trial, kept
from fluentboard_modules.search.planners import Greedy, IteratedLocalSearch
from fluentboard_modules.search.planning import PlanningProblem, carry_out
from fluentboard_modules.search.summaries import half_interval, summarise
from fluentboard_modules.simulation.search_scenes import hidden_pepper_mill

PLANNERS = [Greedy(), IteratedLocalSearch(PlannerConfig(rounds_max=2, time_limit_s=600.0))]


@pytest.fixture(scope="module")
def world() -> World:
    return world_of(hidden_pepper_mill(1).scene)


@pytest.fixture(scope="module")
def trial(world: World) -> Trial:
    return run_trial(world, "offline", 3, 0, PLANNERS)


def test_exported_trials_can_be_planned_anew(trial: Trial, tmp_path: Path) -> None:
    export_trial(trial, tmp_path)
    with np.load(tmp_path / "instance-03.npz") as stored:
        times = stored["T"]
        assert times.shape == (len(stored["view_ptr"]),) * 2
        assert np.allclose(times[1:, 1:], times[1:, 1:].T)
        problem = PlanningProblem(
            stored["cell_p"],
            stored["view_ptr"],
            stored["view_cells"],
            times,
            float(stored["omega"]),
        )
    plans = json.loads((tmp_path / "plans-03.json").read_text())
    for plan in plans.values():
        again = carry_out(problem, plan["views"])
        assert again.expected_time_s == pytest.approx(plan["expected_time_s"])
    assert plans["local search"]["expected_time_s"] <= plans["greedy"]["expected_time_s"]
    rows = summarise([kept(trial)], [p.name for p in PLANNERS])
    assert rows[0].against_greedy == pytest.approx(0.0)
    assert half_interval(np.array([1.0, 2.0, 3.0])) == pytest.approx(2.484, abs=1e-3)


def test_a_trial_does_not_depend_on_who_takes_part(world: World, trial: Trial) -> None:
    alone = run_trial(world, "offline", 3, 0, PLANNERS[1:])
    assert alone.views == trial.views
    assert alone.plans["local search"].views == trial.plans["local search"].views


def test_kept_trials_are_read_back_and_others_are_not(trial: Trial, tmp_path: Path) -> None:
    folder = TrialFolder(tmp_path, ["a scene", "0"])
    folder.write("offline", kept(trial))
    assert folder.read("offline", 3) == kept(trial)
    assert folder.read("offline", 4) is None
    assert folder.read("known", 3) is None
    assert TrialFolder(tmp_path, ["another scene", "0"]).read("offline", 3) is None


def test_a_broken_trial_is_named(trial: Trial, tmp_path: Path) -> None:
    folder = TrialFolder(tmp_path, [])
    folder.write("offline", kept(trial))
    (path,) = tmp_path.iterdir()
    path.write_text("{}", encoding="utf-8")
    with pytest.raises(InvalidInput, match="holds no trial; remove it"):
        folder.read("offline", 3)


def test_planners_are_compared_in_the_trials_both_have_done() -> None:
    greedy = Result(100.0, 0.0, 9, 0.5, 0.0, 0.6)
    ours = replace(greedy, moving_s=80.0, planning_s=10.0)
    trials = [
        KeptTrial(0, 0.1, 0.1, {"greedy": greedy, "ours": ours}),
        KeptTrial(1, 0.1, 0.1, {"greedy": replace(greedy, moving_s=200.0)}),
    ]
    rows = summarise(trials, ["greedy", "ours", "nobody"])
    assert [row.trials for row in rows] == [2, 1]
    assert rows[1].total_s == pytest.approx(90.0)
    assert rows[1].against_greedy == pytest.approx(-0.1)


def test_figure_5_9_is_drawn(trial: Trial, tmp_path: Path) -> None:
    rows = summarise([kept(trial), kept(trial)], [p.name for p in PLANNERS])
    draw_figure_5_9({"offline": rows, "known": rows}, tmp_path / "figure.png")
    assert (tmp_path / "figure.png").stat().st_size > 5_000


def test_an_evaluation_goes_on_where_it_stopped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    options = EvaluationOptions(
        trials=1,
        whole_grid=False,
        keep=tmp_path / "kept",
        export=tmp_path / "export",
        output=tmp_path / "numbers.json",
        picture=tmp_path / "figure.png",
    )
    first = evaluate_search(["offline"], options)
    assert json.loads((tmp_path / "numbers.json").read_text()) == first
    assert (tmp_path / "export" / "instance-00.npz").exists()
    assert (tmp_path / "figure.png").exists()
    rows = first["experiments"]["offline"]
    assert [row["planner"] for row in rows] == ["greedy", "b&b ψ=2 φ=1.3 ζ=0", "local search"]
    assert rows[0]["total_s"] > rows[2]["total_s"]
    assert "Table 5.1" in capsys.readouterr().out

    def never(*_: object) -> None:
        raise AssertionError("a trial ran again")

    monkeypatch.setattr(evaluate, "run_trial", never)
    again = evaluate_search(["offline"], replace(options, export=None))
    assert again["experiments"] == first["experiments"]
