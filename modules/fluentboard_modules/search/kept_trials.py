"""Trials of an evaluation on disk: results, to go on with later, and inputs, for others."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fluentboard.errors import InvalidInput
from fluentboard_modules.search.evaluation import Result, Trial


@dataclass(frozen=True, slots=True)
class KeptTrial:
    """What is left of a trial when it is done.

    Attributes:
        number: of the trial.
        sampling_s: time to draw the views.
        times_s: time for the table of transition times.
        results: per planner.
    """

    number: int
    sampling_s: float
    times_s: float
    results: dict[str, Result]


def _result(found: dict[str, Any]) -> Result:
    moments = tuple((float(a), float(b), float(c)) for a, b, c in found.pop("moments"))
    return Result(**found, moments=moments)


def kept(trial: Trial) -> KeptTrial:
    """A trial without views, maps and records."""
    return KeptTrial(trial.number, trial.sampling_s, trial.times_s, dict(trial.results))


class TrialFolder:
    """A folder with a JSON file per trial, so that an evaluation that was stopped can go on.

    Args:
        folder: made if it does not exist.
        setting: whatever decides the results; trials of other settings have other names.
    """

    def __init__(self, folder: Path, setting: Sequence[str]) -> None:
        self._folder = folder
        self._mark = hashlib.sha256("\n".join(setting).encode()).hexdigest()[:10]

    def read(self, experiment: str, number: int) -> KeptTrial | None:
        """A trial as far as it was done; None if it is not there.

        Raises:
            InvalidInput: the file is not one of ours.
        """
        path = self._path(experiment, number)
        if not path.exists():
            return None
        try:
            found = json.loads(path.read_text(encoding="utf-8"))
            results = {name: _result(result) for name, result in found["results"].items()}
            return KeptTrial(number, found["sampling_s"], found["times_s"], results)
        except (ValueError, KeyError, TypeError) as problem:
            raise InvalidInput(f"{path} holds no trial; remove it") from problem

    def write(self, experiment: str, trial: KeptTrial) -> None:
        """Keeps a trial."""
        self._folder.mkdir(parents=True, exist_ok=True)
        path = self._path(experiment, trial.number)
        unfinished = path.with_suffix(".part")
        text = json.dumps(asdict(trial), indent=1, ensure_ascii=False) + "\n"
        unfinished.write_text(text, encoding="utf-8")
        unfinished.replace(path)

    def _path(self, experiment: str, number: int) -> Path:
        return self._folder / f"{experiment}-{self._mark}-{number:02d}.json"


def export_trial(trial: Trial, folder: Path) -> None:
    """Writes an offline trial, so that any other planner can be run on identical inputs.

    `instance-NN.npz` holds `cell_p` f8[N], `view_ptr` i8[V + 1] and `view_cells` i8[nnz] (the cells
    that each view reveals), `T` f8[V + 1, V + 1] in seconds (0 is the start, infinite is
    unreachable) and `omega` f8; `plans-NN.json` each planner's sequence and E[T].
    """
    problem = trial.problem
    if problem is None:
        return
    folder.mkdir(parents=True, exist_ok=True)
    np.savez_compressed(
        folder / f"instance-{trial.number:02d}.npz",
        cell_p=problem.cell_p.astype(np.float64),
        view_ptr=problem.view_ptr.astype(np.int64),
        view_cells=problem.view_cells.astype(np.int64),
        T=problem.times_s.astype(np.float64),
        omega=np.float64(problem.omega),
    )
    plans: dict[str, Any] = {
        name: {
            "views": list(plan.views),
            "expected_time_s": plan.expected_time_s,
            "planning_s": trial.results[name].planning_s,
            "success_probability": plan.success_probability,
            "lower_bound_s": plan.lower_bound_s,
        }
        for name, plan in trial.plans.items()
    }
    path = folder / f"plans-{trial.number:02d}.json"
    path.write_text(json.dumps(plans, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
